"""Text: numbers, names, findings and tables as they are printed, TOML and JSON."""
