"""The control law of a record: identified, or reconstructed together with its reference."""
