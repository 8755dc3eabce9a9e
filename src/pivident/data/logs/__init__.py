"""Logs: files of any logger as columns and channels, before anybody judges them."""
