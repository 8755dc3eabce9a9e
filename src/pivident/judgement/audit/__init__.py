"""The audit of a log: what is wrong with it, before anything is identified from it."""
