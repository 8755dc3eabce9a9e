"""Logs: files of any logger as columns and channels, before anybody judges them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
