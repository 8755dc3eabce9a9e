"""Physical consistency: physically possible standard parameters near an estimate."""
