"""Joints of a simulator from logs of positions: MuJoCo, URDF, Isaac Lab.

`fit_simulator` does the work; `SimulatorFit` holds the values with their intervals.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
