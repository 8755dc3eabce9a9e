"""Recognition: which column is which channel, which is the clock, and in which units."""
