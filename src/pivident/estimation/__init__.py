"""Problem, methods and answer: LS, IV, PIV, the literature; control laws, drive gains."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
