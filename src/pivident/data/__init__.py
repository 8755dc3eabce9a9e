"""Logs of any logger, and recordings of them: measured signals in SI units on the joint side."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
