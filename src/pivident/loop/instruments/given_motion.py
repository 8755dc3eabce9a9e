"""Instruments whose motion does not depend on the parameters, and what is known of them.

An instrument has to move with the regressors (relevance) and share nothing with the residual
(exogeneity). The simulated loop is one way to such a motion. It needs a law; these do not:

    response     the recorded reference through the identified response of the loop
    repetition   the same motion, run at another time
    sensor       another sensor of the same motion
    virtual      a virtual computed-torque loop around the smoothed motion
    halves       every other sample: regressors from one half, instruments from the other
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NoReturn

import numpy as np

from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.numbers import percent
from pivident.foundation.text.plain_values import Known
from pivident.loop.motion.motion import Kinematics, SimulatedMotion

#: Share of a joint's acceleration that instruments must follow to be of use, and to be good.
USEFUL, GOOD = 0.1, 0.9


class InstrumentsAbsent(IdentificationError):
    """Instruments that a record does not have.

    Attributes:
        reason: why, half a sentence.
    """

    def __init__(self, title: str, reason: str) -> None:
        self.reason = reason
        super().__init__(f"no instruments from {title}: {reason}")


@dataclass(frozen=True)
class InstrumentKind:
    """A way to instruments.

    Attributes:
        name: what a file calls it.
        title: what they are made of.
        cures: noise that is not in them.
        leaves: what may be.
        exogenous: whether they do not share the noise of the record.
        floating: why a floating base rules them out; empty: it does not.
        make: makes the motions from those of all recordings; None: the simulated loop.

    Raises:
        InstrumentsAbsent: by ``make``, where the record does not allow them.
    """

    name: str
    title: str
    cures: str
    leaves: str
    exogenous: bool = False
    floating: str = ""
    make: Callable[[Sequence[Kinematics]], GivenMotions] | None = None

    def absent(self, reason: str) -> NoReturn:
        """Refuse instruments that a record does not have."""
        raise InstrumentsAbsent(self.title, reason)


#: The simulated closed loop.
LOOP = InstrumentKind(
    "loop",
    "the simulated closed loop",
    "noise and disturbances that the feedback brings into the motion",
    "errors of law, reference and model",
    exogenous=True,
)


@dataclass(frozen=True, eq=False)
class GivenMotions:
    """Motions of all recordings that are instruments for any parameters.

    Attributes:
        kind: how they were made.
        motions: one for each recording.
        found: what was found on the way, sentences with figures.
        agreement: share of each joint's acceleration that they follow, shape (joints,).
        shares_noise: why they share noise with the record, a half sentence; empty: nothing was
            found that says so.
        regressors: measured motions in place of the usual ones, where the kind asks for them.
    """

    kind: InstrumentKind
    motions: list[SimulatedMotion]
    found: tuple[str, ...]
    agreement: np.ndarray
    shares_noise: str = ""
    regressors: list[Kinematics] | None = None

    def __post_init__(self) -> None:
        made = [replace(motion, from_record=True) for motion in self.motions]
        object.__setattr__(self, "motions", made)

    def simulate_or_halve(
        self, previous: np.ndarray | None, theta: np.ndarray
    ) -> tuple[list[SimulatedMotion], np.ndarray, int]:
        """The motions, whatever the parameters."""
        return self.motions, theta, 0

    @property
    def exogenous(self) -> bool:
        """Whether nothing is known by which they would share noise with the record."""
        return self.kind.exogenous and not self.shares_noise


@dataclass(frozen=True)
class InstrumentsUsed:
    """Which instruments a result has, and which others the log would have had.

    Attributes:
        kind: the kind.
        found: what was found when they were made, sentences.
        agreement: share of each joint's acceleration that they follow, 0 to 1; empty for those of
            the simulated loop.
        shares_noise: why they share noise with the record, a half sentence, or empty.
        others: other kinds that were looked at, best first, each with what speaks for or against.
        instead_of: why the simulated loop could not be used, a sentence; empty: it was not asked.
    """

    kind: str
    found: tuple[str, ...] = ()
    agreement: tuple[Known, ...] = ()
    shares_noise: str = ""
    others: tuple[tuple[str, str], ...] = ()
    instead_of: str = ""
    #: Motions of the next best kind, for the test whether it contradicts these; not stored.
    further: tuple[SimulatedMotion, ...] = field(default=(), repr=False, compare=False)
    further_kind: str = field(default="", repr=False, compare=False)


def agreement(kinematics: Sequence[Kinematics], motions: Sequence[SimulatedMotion]) -> np.ndarray:
    """Squared correlation of the accelerations of measured motion and instruments, (joints,)."""
    products = np.zeros((3, len(kinematics[0].q)))
    for kin, motion in zip(kinematics, motions, strict=True):
        used = np.zeros(kin.q.shape[1], bool)
        used[kin.start : kin.stop] = True
        if motion.valid is not None:
            used &= motion.valid
        x, y = kin.ddq[:, used], motion.ddq[:, used]
        if not used.any():
            continue
        x, y = x - x.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)
        products += np.sum(x * y, axis=1), np.sum(x**2, axis=1), np.sum(y**2, axis=1)
    cross, xx, yy = products
    same = cross > 0.0  # a motion of the wrong sign is another motion
    return np.where(same, cross**2 / np.maximum(xx * yy, 1e-300), 0.0)


def with_valid(motion: SimulatedMotion, valid: np.ndarray) -> SimulatedMotion:
    """The motion with the samples at which it may be used, shape (samples,)."""
    return replace(motion, valid=None if valid.all() else valid)


def correlated(said: str, names: Sequence[str], shares: np.ndarray, bound: float) -> str:
    """A sentence with the joints whose noise is correlated beyond a bound; empty if none is."""
    own = [
        f"{name!r} ({percent(100 * share)})"
        for name, share in zip(names, shares, strict=True)
        if share > bound
    ]
    return f"{said}: {', '.join(own)}" if own else ""
