"""Errors that the record would not show, although they change the estimate; gains that it checks.

A cause whose size has the standard error σ_δ is named for certain from about (t + 2) σ_δ on, with t
the quantile at which the tests of all causes name one. An error of the description as they commonly
are may be smaller than that, and still change the parameters by

    G δ,    G = -(Zᵀ Φ)⁻¹ Zᵀ D

more than their intervals are wide. Nothing in the data can tell: the description has to be right.
G is that of the motion's band, as all of the tests are. Where the estimate also knows a parameter
from higher frequencies, it is changed less, by about as much as its standard error is smaller: the
change is told in standard errors of the band.

Some errors no record shows at all: a gain of all torques is a gain of all parameters, the pitch of
a screw and the clock scale them, where gravity does not check them. They are as large as whoever
describes the robot makes them; what one per cent or one millimetre would change is told.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.distributions import student
from pivident.foundation.text.display import Displayed
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.motion_errors import PLAY
from pivident.judgement.model_errors.score_tests import LEVEL, Score, ScoreTests

#: Errors as they commonly are, by kind and unit: those of a drawing that is not that of the very
#: machine, of its assembly, of its zero positions, a play of one to two minutes of arc, and a cycle
#: of the bus that the log comes by; of gears, gains and clocks one per cent.
COMMON: Mapping[tuple[str, str], float] = {
    ("geometry", "mm"): 1.0,
    ("geometry", "°"): 0.1,
    ("zero position", "mm"): 1.0,
    ("zero position", "°"): 0.1,
    **{("backlash", unit): size for unit, size in PLAY.items()},
    ("delay", "ms"): 1.0,
    ("gear ratio", "%"): 1.0,
    ("torque gain", "%"): 1.0,
    ("clock", "%"): 1.0,
}

#: Error of a torque's gain that the record has to rule out for the gain to count as checked [%]: a
#: little less than the least that an audit warns of, 1/1.3.
GAIN = 20.0

#: Standard errors beyond the quantile from which on a cause is named for certain (98 %).
CERTAIN = 2.0


@dataclass(frozen=True, eq=False)
class UncheckedCause(Displayed):
    """An error that the record would not show.

    Attributes:
        cause: what would be wrong.
        size: how large, in the unit of the cause.
        shown_from: size from which on the record shows it, in the same unit; infinite where it
            would not be believed, look like something else, or like other parameters.
        shift: largest change of a parameter by the error, in standard errors.
        parameter: the one that changes so much.
        relative: its change [%].
    """

    cause: Cause
    size: float
    shown_from: float
    shift: float
    parameter: str
    relative: float


def unchecked_causes(
    tests: ScoreTests,
    scores: Mapping[int, Score],
    named: Sequence[int],
    found: Identification,
    least: float,
) -> tuple[UncheckedCause, ...]:
    """Errors as they commonly are that the tests would not name, the gravest first.

    Args:
        tests: tests of an estimate.
        scores: those of the causes that are not named, by number; parameters hide the others.
        named: numbers of the causes that are named.
        found: the estimate.
        least: change of a parameter from which on an error counts, in standard errors.
    """
    needed = _standard_errors(tests)
    own = tests.columns([])
    std = found.free_std
    with suppress(np.linalg.LinAlgError):  # all that is known of one lies within one window
        of_band = tests.covariance(own, tests.fit(own).theta)
        std = np.maximum(std, np.sqrt(np.diag(of_band)))
    hidden = []
    for number, cause in enumerate(tests.causes):
        size = COMMON.get((cause.kind, cause.unit), 0.0)
        if cause.count > 1 or not size or number in named:
            continue
        score = scores.get(number)
        shown_from = np.inf if score is None else needed * float(score.std[0])
        if shown_from > size:
            shown_from = shown_from if shown_from < cause.largest else np.inf
            hidden.append((number, cause, size, shown_from))
    columns = [int(tests.first[number]) for number, *_ in hidden]
    made = []
    for (_, cause, size, shown_from), by_one in zip(
        hidden, tests.sensitivity(np.r_[own, np.array(columns, int)]).T, strict=True
    ):
        change = size * np.abs(by_one)
        k = int(np.argmax(change / std))
        shift = float(change[k] / std[k])
        relative = 100.0 * float(change[k] / max(abs(found.theta[k]), 1e-300))
        if shift > least:
            made.append(UncheckedCause(cause, size, shown_from, shift, found.names[k], relative))
    # equal effects, as of pitch and clock on a single slide, stay in the order of the causes
    return tuple(sorted(made, key=lambda one: -float(f"{one.shift:.6g}")))


def checked_gains(tests: ScoreTests, scores: Iterable[Score]) -> tuple[str, ...]:
    """Joints whose torque no factor separates from those of the others: they move the same bodies.

    Args:
        tests: tests of an estimate.
        scores: those of the causes that are not named.
    """
    needed = _standard_errors(tests)
    return tuple(
        score.cause.subject
        for score in scores
        if score.cause.kind == "torque gain"
        and score.std[0] > 0.0  # else the parameters take it up
        and abs(float(score.size[0])) + needed * float(score.std[0]) < GAIN
    )


def timely(scores: Iterable[Score]) -> dict[str, float]:
    """Joints whose torque is seen to be neither late nor early, with what is ruled out [ms].

    That is |δ| + 3 σ_δ of a delay δ of the joint's own that is within two standard errors of none.

    Args:
        scores: those of the causes that are not named.
    """
    return {
        score.cause.subject: abs(float(score.size[0])) + 3.0 * float(score.std[0])
        for score in scores
        if score.cause.kind == "delay" and abs(float(score.size[0])) < 2.0 * float(score.std[0])
    }


def _standard_errors(tests: ScoreTests) -> float:
    """How many of its standard errors a cause has to be large to be named for certain."""
    return float(student.isf(0.5 * LEVEL / tests.tried, tests.freedom)) + CERTAIN
