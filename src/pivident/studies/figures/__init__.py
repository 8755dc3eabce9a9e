"""Figures for papers, one call each: matplotlib figures of one or two columns' width.

Every function returns a `matplotlib.figure.Figure` that no window and no global state knows of, so
it works on a machine without a screen. Lines differ by dash and by lightness as well as by colour.

Example:
    >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    >>> made = pv.simulate(robot, loop, duration=5.0, encoder=1e-5)
    >>> result = pv.identify(pv.Problem(robot, (made.recording,), loop), "piv")
    >>> figure = pv.figures.figure_of_intervals(result, ["fv1", "fc1"], truth=made.truth)
    >>> [path.name for path in pv.figures.save_figure(figure, "friction.pdf")]
    ['friction.pdf']
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
