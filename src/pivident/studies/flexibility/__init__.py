"""Flexible joints: compliance, two-mass models, resonances, and their effect on rigid models.

With encoders on both sides of the gear: `identify_compliance` (slow motion: stiffness, hysteresis,
transmission error) and `identify_two_mass` (both inertias, stiffness, damping). With the motor's
encoder alone: `find_resonance`. Effect of compliance on a rigid model: `joint_study`.
"""
