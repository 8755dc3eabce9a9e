"""The load that a robot carries, from a record without and one with the load.

`identify_payload` does the work; `LoadEstimate` holds mass, centre of mass and inertia with their
intervals.
"""
