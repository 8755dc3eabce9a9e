"""Which instruments a record allows, and which of them to take.

Best first: those that share nothing with the noise of the record (the loop simulated with its law,
the reference through the identified response, another repetition), then those that share some of
it. Among equals the order is that of `KINDS`, unless the instruments follow too little of the
motion. Whether they are strong enough, and whether others contradict them, is tested on the
equations that were solved.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pivident.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.method import InstrumentalMethod
from pivident.estimation.problem import Problem
from pivident.instruments.given_motion import (
    EXOGENOUS,
    GOOD,
    KINDS,
    TITLES,
    USEFUL,
    GivenMotions,
    InstrumentsUsed,
    Kind,
    not_there,
)
from pivident.instruments.interleaved_halves import interleaved_instruments
from pivident.instruments.reference_response import response_instruments
from pivident.instruments.repeated_motion import repetition_instruments
from pivident.instruments.second_sensor import sensor_instruments
from pivident.instruments.virtual_loop import virtual_instruments
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion
from pivident.text.numbers import percent

#: How the motions of each kind are made.
MAKERS: dict[Kind, Callable[[Sequence[Kinematics]], GivenMotions]] = {
    "response": response_instruments,
    "repetition": repetition_instruments,
    "sensor": sensor_instruments,
    "virtual": virtual_instruments,
    "halves": interleaved_instruments,
}


#: Instruments that a floating base rules out, and why.
UNLED: Mapping[Kind, str] = {
    "response": "a floating base has no reference that it follows",
    "virtual": "a floating base has no motors that a law could command",
}


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
        return without_loop(kinematics, "A floating base is not simulated.", UNLED)
    if wanted == "loop" or (wanted == "auto" and problem.loop is not None):
        given = kinematics if differences else None
        auxiliary = AuxiliaryModel(problem, differences, given, torque=False)
        return Chosen(auxiliary, InstrumentsUsed("loop"), kinematics)
    if wanted == "auto":
        return without_loop(kinematics, problem.without_loop, UNLED if floating else {})
    if floating and wanted in UNLED:
        not_there(wanted, UNLED[wanted])
    return _chosen(MAKERS[wanted](kinematics), kinematics)


def without_loop(
    kinematics: list[Kinematics], reason: str, excluded: Mapping[Kind, str] | None = None
) -> Chosen:
    """The best instruments besides those of the simulated loop.

    ``reason``: why there is no simulated loop, a sentence, or empty; ``excluded``: kinds that are
    not looked for, and why.
    """
    made, missing = [], dict(excluded or {})
    for kind, make in MAKERS.items():
        if kind in missing:
            continue
        try:
            made.append(make(kinematics))
        except IdentificationError as error:
            missing[kind] = str(error).partition(": ")[2] or str(error)
    made.sort(key=_rank)
    return _chosen(made[0], kinematics, made[1:], missing, reason)


def may_do_without(problem: Problem, method: InstrumentalMethod) -> bool:
    """Whether other instruments may replace the loop: its law is not what the user says it is."""
    loop = problem.loop
    return method.instruments == "auto" and (
        loop is None or loop.found or loop.reference == "smoothed"
    )


def instead_of_loop(error: SimulationDiverged | MassMatrixNotPositiveDefinite) -> str:
    """Why the simulated loop made no instruments."""
    return f"The simulated loop cannot make the instruments: {error}."


def _rank(given: GivenMotions) -> tuple[bool, bool, int]:
    """What is best comes first: exogenous, following the motion, and the order of `KINDS`."""
    weakest = float(given.agreement.min())
    return not given.exogenous or weakest < USEFUL, weakest < GOOD, KINDS.index(given.kind)


def _chosen(
    given: GivenMotions,
    kinematics: list[Kinematics],
    others: Sequence[GivenMotions] = (),
    missing: dict[Kind, str] | None = None,
    reason: str = "",
) -> Chosen:
    """The motions with an account of those that were not taken."""
    weights = [(o.kind, _why_not(o)) for o in others] + list((missing or {}).items())
    further = next((o for o in others if o.exogenous and o.agreement.min() > USEFUL), None)
    used = InstrumentsUsed(
        given.kind,
        given.found,
        tuple(float(a) for a in given.agreement),
        given.shares_noise,
        tuple((TITLES[kind], why) for kind, why in weights),
        reason,
        () if further is None else tuple(further.motions),
        "" if further is None else TITLES[further.kind],
    )
    return Chosen(given, used, given.regressors or kinematics)


def _why_not(other: GivenMotions) -> str:
    """What speaks for or against instruments that were not taken."""
    text = f"follow at least {percent(100 * other.agreement.min())} of each acceleration"
    if other.shares_noise:
        return f"{text}; {other.shares_noise}"
    return text if other.kind in EXOGENOUS else f"{text}; share noise with the record"
