"""Six recorded logs as plain tables, faults planted in them, and what a verdict makes of these."""
