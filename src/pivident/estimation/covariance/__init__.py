"""Covariances of an estimate."""
