"""Physical consistency: standard parameters that a real machine can have, near an estimate."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
