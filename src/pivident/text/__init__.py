"""Text: numbers, names and tables as they are printed, TOML and JSON."""
