"""Tables of every file format, one way to read them."""
