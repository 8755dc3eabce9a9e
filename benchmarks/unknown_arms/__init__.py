"""Logs of robots that pivident has never seen, and what a new user gets from them."""
