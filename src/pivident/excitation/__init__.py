"""The motion that answers the question: excitation within a robot's limits.

`design_motion` finds the motion whose record determines the parameters best, and says before the
robot moves how large their standard errors will be.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
