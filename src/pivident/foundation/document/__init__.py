"""Results as documents: sentences, tables of named columns, curves, findings, values."""
