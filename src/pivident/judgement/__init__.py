"""Whether to believe a result: the log, residuals, held-out motion, model error, verdict."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
