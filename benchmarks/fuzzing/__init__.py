"""Fuzzing of every reader: inputs, judge and engine; `benchmarks/fuzz_readers.py` drives them."""
