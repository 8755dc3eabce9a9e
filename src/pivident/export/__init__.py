"""A model in the formats of other programs: URDF, MJCF, SDF, C, NumPy, JSON, LaTeX."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
