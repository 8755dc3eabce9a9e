"""Linear models from sampled data: continuous and discrete time, with noise models.

Useful without a robot. Continuous time: `srivc`, `rivc`; discrete time: `arx`, `sriv`, `riv`;
noise alone: `ar`, `arma`; orders: `select_orders`. All return a `LinearEstimate` (noise
models a `Noise`), whose polynomials have the highest power first. Names are imported when
they are first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pivident.linear.arx import arx
    from pivident.linear.conversion import from_control, from_scipy
    from pivident.linear.estimate import LinearEstimate, Noise
    from pivident.linear.order_selection import select_orders
    from pivident.linear.riv import riv
    from pivident.linear.rivc import rivc
    from pivident.linear.sriv import sriv
    from pivident.linear.srivc import srivc
    from pivident.signals.arma import ar, arma, select_arma

#: Where each name of the front door lives.
_HOME = {
    "LinearEstimate": "pivident.linear.estimate",
    "Noise": "pivident.linear.estimate",
    "ar": "pivident.signals.arma",
    "arma": "pivident.signals.arma",
    "arx": "pivident.linear.arx",
    "from_control": "pivident.linear.conversion",
    "from_scipy": "pivident.linear.conversion",
    "riv": "pivident.linear.riv",
    "rivc": "pivident.linear.rivc",
    "select_arma": "pivident.signals.arma",
    "select_orders": "pivident.linear.order_selection",
    "sriv": "pivident.linear.sriv",
    "srivc": "pivident.linear.srivc",
}

__all__ = [
    "LinearEstimate",
    "Noise",
    "ar",
    "arma",
    "arx",
    "from_control",
    "from_scipy",
    "riv",
    "rivc",
    "select_arma",
    "select_orders",
    "sriv",
    "srivc",
]


def __getattr__(name: str) -> Any:
    """A public name, imported from its module at first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'pivident.linear' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})


class _FrontDoor(ModuleType):
    """A package in which ``arx`` stays the function when its module ``arx`` is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _FrontDoor
