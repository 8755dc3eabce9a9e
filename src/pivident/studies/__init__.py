"""A question in each folder: friction, prediction, comparison, payload, exciting motion, fleets."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
