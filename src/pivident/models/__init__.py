"""Models with a value for every parameter, from the files of results."""
