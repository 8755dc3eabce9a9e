"""Which instruments a record allows, and which of them to take.

Best first: those that share nothing with the noise of the record (the loop simulated with its law,
the reference through the identified response, another repetition), then those that share some of
it. Among equals the order is that of `KINDS`, unless the instruments follow too little of the
motion. Whether they are strong enough, and whether others contradict them, is tested on the
equations that were solved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pivident.estimation.method import InstrumentalMethod
from pivident.estimation.problem import Problem
from pivident.foundation.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.text.numbers import percent
from pivident.loop.instruments.given_motion import (
    GOOD,
    USEFUL,
    GivenMotions,
    InstrumentsAbsent,
    InstrumentsUsed,
)
from pivident.loop.instruments.kinds import KINDS
from pivident.loop.motion.motion import Kinematics, SimulatedMotion


class InstrumentSource(Protocol):
    """Whatever makes the motions of the instruments."""

    def simulate_or_halve(
        self, previous: np.ndarray | None, theta: np.ndarray
    ) -> tuple[list[SimulatedMotion], np.ndarray, int]:
        """Motions for θ or a point before it, that point, and the halvings on the way."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """The instruments of one identification."""

    source: InstrumentSource
    used: InstrumentsUsed
    kinematics: list[Kinematics]  # measured motions that go with them


def choose(
    problem: Problem,
    method: InstrumentalMethod,
    kinematics: list[Kinematics],
    differences: bool,
) -> Chosen:
    """The instruments that a method asks for, or with ``auto`` the best that the record allows.

    ``differences``: whether speeds of the simulated loop are differences of its positions.

    Raises:
        IdentificationError: the record does not allow them.
        ExperimentError: the simulated loop is asked for and there is none.
    """
    wanted = method.instruments
    floating = problem.robot.base_motion == "measured"
    if wanted == "auto" and problem.loop is not None and floating:
        return without_loop(kinematics, "A floating base is not simulated.", floating)
    if wanted == "loop" or (wanted == "auto" and problem.loop is not None):
        from pivident.estimation.auxiliary_model import AuxiliaryModel

        given = kinematics if differences else None
        auxiliary = AuxiliaryModel(problem, differences, given, torque=False)
        return Chosen(auxiliary, InstrumentsUsed("loop"), kinematics)
    if wanted == "auto":
        return without_loop(kinematics, problem.without_loop, floating)
    kind = KINDS[wanted]
    if floating and kind.floating:
        kind.absent(kind.floating)
    assert kind.make is not None, "the loop was chosen above"
    return _chosen(kind.make(kinematics), kinematics)


def without_loop(kinematics: list[Kinematics], reason: str, floating: bool = False) -> Chosen:
    """The best instruments besides those of the simulated loop.

    ``reason``: why there is no simulated loop, a sentence, or empty; ``floating``: whether the base
    floats, which rules some kinds out.
    """
    motions: list[GivenMotions] = []
    missing = {k.title: k.floating for k in KINDS.values() if floating and k.floating}
    for kind in KINDS.values():
        if kind.title in missing or kind.make is None:
            continue
        try:
            motions.append(kind.make(kinematics))
        except InstrumentsAbsent as error:
            missing[kind.title] = error.reason
        except IdentificationError as error:
            missing[kind.title] = str(error)
    motions.sort(key=_rank)
    return _chosen(motions[0], kinematics, motions[1:], missing, reason)


def may_do_without(problem: Problem, method: InstrumentalMethod) -> bool:
    """Whether other instruments may replace the loop.

    Its law is not what the user says it is, or a joint has no torque that its parameters would be
    known from.
    """
    loop = problem.loop
    return method.instruments == "auto" and (
        loop is None or loop.found or loop.reference == "smoothed" or bool(problem.silent_joints)
    )


def instead_of_loop(error: SimulationDiverged | MassMatrixNotPositiveDefinite) -> str:
    """Why the simulated loop made no instruments."""
    return f"The simulated loop cannot make the instruments: {error}."


def _rank(given: GivenMotions) -> tuple[bool, bool, bool, int]:
    """What is best comes first: exogenous, following the motion, without noise, as in `KINDS`."""
    weakest = float(given.agreement.min())
    return (
        not given.exogenous or weakest < USEFUL,
        weakest < GOOD,
        bool(given.shares_noise),
        list(KINDS).index(given.kind.name),
    )


def _chosen(
    given: GivenMotions,
    kinematics: list[Kinematics],
    others: Sequence[GivenMotions] = (),
    missing: Mapping[str, str] | None = None,
    reason: str = "",
) -> Chosen:
    """The motions with an account of those that were not taken."""
    weights = [(o.kind.title, _why_not(o)) for o in others] + list((missing or {}).items())
    further = next((o for o in others if o.exogenous and o.agreement.min() > USEFUL), None)
    used = InstrumentsUsed(
        given.kind.name,
        given.found,
        tuple(float(a) for a in given.agreement),
        given.shares_noise,
        tuple(weights),
        reason,
        () if further is None else tuple(further.motions),
        "" if further is None else further.kind.title,
    )
    return Chosen(given, used, given.regressors or kinematics)


def _why_not(other: GivenMotions) -> str:
    """What speaks for or against instruments that were not taken."""
    text = f"follow at least {percent(100 * other.agreement.min())} of each acceleration"
    if other.shares_noise:
        return f"{text}; {other.shares_noise}"
    return text if other.kind.exogenous else f"{text}; share noise with the record"
