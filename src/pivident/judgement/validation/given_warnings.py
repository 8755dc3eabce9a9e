"""Warnings of Python: an estimate or a fold is not what was asked for.

What a result finds about data, noise or machine stands in its ``warnings`` and is nothing to warn
of. As elsewhere in statistics, a warning says that an iteration did not end, that parameters were
left out, that something else took the place of what was asked for, or that a fold failed. Its text
has no numbers of the record, so that a thousand runs in one line of a program print it once.
"""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import ParamSpec

from pivident.dynamics.separation import KIND
from pivident.estimation.identification import Identification
from pivident.foundation.errors import (
    ConvergenceWarning,
    EstimateWarning,
    FallbackWarning,
    RankWarning,
)

#: Files whose frames are not the user's: those of pivident, and of the context around `identify`.
_OWN = (str(Path(__file__).parents[2]), contextlib.__file__)

#: Topic and kind of the findings that are warned of: category, and what was done.
CAUSES: dict[tuple[str, str], tuple[type[EstimateWarning], str]] = {
    ("iteration", "not converged"): (ConvergenceWarning, "did not converge"),
    ("motion", KIND): (
        RankWarning,
        "left out parameters that the motion does not separate from others",
    ),
    ("simulation", "undetermined"): (
        RankWarning,
        "held parameters at their start that the record does not determine",
    ),
    ("loop", "not simulated"): (
        FallbackWarning,
        "took instruments from the record, since the loop could not be simulated",
    ),
    ("noise model", "replaced"): (
        FallbackWarning,
        "took a simpler noise model than it was asked for",
    ),
}

Arguments = ParamSpec("Arguments")


def warn(text: str, category: type[EstimateWarning]) -> None:
    """Give a warning at the line of the user's program from which pivident was called.

    Args:
        text: what happened.
        category: its kind.
    """
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OWN):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)


def warn_of(found: Identification) -> None:
    """Warn of each cause that a result names, once.

    Args:
        found: the result.
    """
    named = {(w.topic, w.kind): None for w in found.warnings}
    for category, what in (CAUSES[cause] for cause in named if cause in CAUSES):
        warn(f"{found.method} {what}; the result's `warnings` say more", category)


def warned(identify: Callable[Arguments, Identification]) -> Callable[Arguments, Identification]:
    """The same estimator, which warns of what its result names.

    Args:
        identify: an estimator.
    """

    @wraps(identify)
    def warning(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Identification:
        found = identify(*args, **kwargs)
        warn_of(found)
        return found

    return warning
