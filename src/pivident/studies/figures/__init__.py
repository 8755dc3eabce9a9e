"""Figures for papers, one call each: matplotlib figures of one or two columns' width.

Every function returns a `matplotlib.figure.Figure` that no window and no global state knows of, so
it works on a machine without a screen. Lines differ by dash and by lightness as well as by colour.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
