"""Several identifications side by side: which parameters differ, by how much, and how surely."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
