"""What every room stands on: text, files, errors, kernels, options, registry, documents."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
