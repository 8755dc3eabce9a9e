"""One addition to pivident of each kind, each in a file of its own."""
