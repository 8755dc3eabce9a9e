"""Identification of the dynamic parameters of robots from closed-loop records.

One verb, ``identify(problem, method)``. A `Problem` holds what is given (robot, recordings,
control loop), a method how to estimate (`LeastSquares`, `InstrumentalVariables`,
`PrefilteredIV`), and an `Identification` the answer with everything needed to judge it. Each
room has a front of its own (``pivident.robot``, ``pivident.studies`` …); modules behind the fronts
are private. Names are imported when they are first used.
"""

import lazy_loader

from pivident.app.notebook import presentation
from pivident.foundation.text import display

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

display.presentation = presentation
