"""Filters along the record: extended, unscented, central-difference and particle, and recursions.

`KalmanFilter`, `RecursiveLeastSquares` and `RecursiveInstruments` also run online.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
