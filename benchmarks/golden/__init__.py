"""Parts of golden_results.py: cases, logs, and how numbers are read and compared."""
