"""The method whose options a file of results holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from pivident.errors import PividentError
from pivident.estimation.methods import (
    Adaline,
    Algebraic,
    Bandpass,
    CentralDifferenceKalman,
    CorrelatedJoints,
    ExtendedKalman,
    FrequencyDomain,
    Hopfield,
    InstrumentalVariables,
    LeastSquares,
    Method,
    OutputError,
    Particles,
    PrefilteredIV,
    PriorRegression,
    RandomWalk,
    Ridge,
    RobustRegression,
    SetMembership,
    TotalLeastSquares,
    UnscentedKalman,
)
from pivident.estimation.noise_options import Arma, AutoRegressive, Repetition

_METHODS = (
    LeastSquares,
    InstrumentalVariables,
    PrefilteredIV,
    OutputError,
    TotalLeastSquares,
    RobustRegression,
    Ridge,
    PriorRegression,
    CorrelatedJoints,
    SetMembership,
    FrequencyDomain,
    Adaline,
    Hopfield,
    ExtendedKalman,
    UnscentedKalman,
    CentralDifferenceKalman,
    Particles,
)
_PARTS = {
    "signals": (Bandpass, Algebraic, RandomWalk),
    "noise": (AutoRegressive, Repetition, Arma),
}


def method_of_options(options: Mapping[str, Any]) -> Method | None:
    """The method whose options these are; None: of no method of this version."""
    values = {key: value for key, value in options.items() if key != "mask"}
    try:
        for key, kinds in _PARTS.items():
            if key in values:
                values[key] = _made(kinds, values[key])
        return _made(_METHODS, values)
    except (TypeError, ValueError, AttributeError, PividentError):
        return None


def _made(kinds: tuple[type, ...], values: Mapping[str, Any]) -> Any:
    """The class that has just these fields, with lists as the tuples that they were.

    Files from before there was a choice of instruments do not name them.
    """
    for kind in kinds:
        names = {f.name for f in fields(kind)}
        if set(values) in (names, names - {"instruments"}):
            return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
    raise ValueError(f"no method has the options {', '.join(values)}")
