"""Joints of a simulator from logs of positions: MuJoCo, URDF, Isaac Lab.

`fit_simulator` does the work; `SimulatorFit` holds the values with their intervals.
"""
