"""The control law of a record: identified, and references reconstructed."""
