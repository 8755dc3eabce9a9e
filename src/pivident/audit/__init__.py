"""The audit of a log: what is wrong with it, before anything is identified from it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
