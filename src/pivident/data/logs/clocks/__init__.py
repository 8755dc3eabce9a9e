"""Clocks of logs: their stamps, gaps in them, and channels brought onto one clock."""
