"""The experiment file: what was logged, on which machine, and what is to be estimated."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
