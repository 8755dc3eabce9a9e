"""The closed loop: controllers, references, its simulation, motions, and what makes instruments."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
