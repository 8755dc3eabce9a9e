"""Many records: simulated studies, fleets over time."""
