"""Speeds and sizes of pivident, with the peers run beside it."""
