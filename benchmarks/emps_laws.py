"""Friction laws of the EMPS carriage that `benchmarks.emps_leaderboard` chooses from.

They are the changes that ``pivident laws`` tries on a joint (`pivident.studies.friction_laws`):
another slope of the sign, Stribeck friction, a power of the speed, two viscous slopes, presliding
with a state. An offset beside Coulomb friction is a Coulomb level for each direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.open_loop_model import OpenLoopModel

from pivident.data.recording.public_records import EMPS
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_viscous,
    coulomb,
    dahl,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.gallery import load_robot

#: Slope of the sign tanh(γ v) [s/m]: at 99 % of the Coulomb level a carriage at rest creeps
#: 0.07 mm/s, at half of it 0.01 mm/s.
STEEP = 4e4

#: Lead of the screw, and a wave as long as the motion [m].
LEAD, STROKE = 2.5e-3, 0.25

#: Distances after which Maxwell elements slip: thousandths to tenths of the stroke [m].
SLIPS = (2.5e-4, 2.5e-3, 2.5e-2)

#: The authors' least-squares values (kg, N s/m, N, N).
PUBLISHED = {"m1": 95.1089, "fv1": 203.5034, "fc1": 20.3935, "off1": -3.1648}

#: Where the search of constants starts [s/m, m/s, -, m, -].
START = {
    "gamma": 2000.0, "stribeck_speed": 0.01, "viscous_exponent": 0.5, "presliding_distance": 5e-6,
    "stribeck_excess": 0.1,
}  # fmt: skip


#: Factor by which a constant may leave where its search starts.
SPAN = 8.0


@dataclass(frozen=True)
class Candidate:
    """A friction law with its drive.

    Attributes:
        title: for the tables.
        terms: of the law.
        constants: of the law or the drive that are sought beside the parameters.
    """

    title: str
    terms: tuple[FrictionTerm, ...]
    constants: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What is sought: the mass, a parameter for each term, constants."""
        return ("m1", *(f"{term.stem}1" for term in self.terms), *self.constants)

    def model(self, start: dict[str, float] | None = None) -> OpenLoopModel:
        """The law with given values, others as published."""
        robot = load_robot("emps").with_friction(FrictionLaw(self.terms))
        known = PUBLISHED | START | (start or {})
        values = {name: known.get(name, 0.0) for name in self.names}
        return OpenLoopModel(robot, float(EMPS["units"]["tau"]["gain"]), values)

    def fitted(self, record: Recording, horizon: str = "record") -> Identification:
        """`oloe` of a record; the search starts at IDIM-LS of the law."""
        robot = load_robot("emps").with_friction(FrictionLaw(self.terms))
        problem = Problem(robot, (record,), initial=self._linear_start(record))
        sought = {name: START[name] for name in self.constants if name in START}
        method = replace(
            METHODS["oloe"], horizon=horizon, free=self.constants, start="initial",
            undetermined="hold",
            bounds={f"{name}1": (value / SPAN, value * SPAN) for name, value in sought.items()},
        )  # fmt: skip
        return identify(problem, method)

    def _linear_start(self, record: Recording) -> dict[str, float]:
        """IDIM-LS of the law, its constants where their search starts.

        Terms with a state count as Coulomb friction, which Maxwell elements share equally.
        """
        plain = [term for term in self.terms if not term.has_memory]
        slips = [term.stem for term in self.terms if term.has_memory]
        law = FrictionLaw((*plain, SIGN) if slips else tuple(plain))
        robot = load_robot("emps").with_friction(law)
        values = dict(identify(Problem(robot, (record,)), "ls").params)
        level = values.pop("fc1") if slips else 0.0
        return values | {f"{stem}1": level / len(slips) for stem in slips}

    def model_of(self, found: Identification) -> OpenLoopModel:
        """The model of an estimate."""
        values = {"m1" if name == "m1r" else name: float(v) for name, v in found.params.items()}
        own = () if found.simulation is None else found.simulation.loop_parameters
        return self.model(values | {p.name.removesuffix("1"): p.value for p in own})


SIGN = coulomb("tanh", STEEP)
TWO_SLOPES = (*asymmetric_viscous(), SIGN, offset())


def laws() -> list[Candidate]:
    """Friction laws of speed and path."""
    bare = (*asymmetric_viscous(), offset())
    excess = stribeck(START["stribeck_speed"], smoothing="tanh", gamma=STEEP)
    power = power_viscous(START["viscous_exponent"], smoothing="tanh", gamma=STEEP)
    distance = START["presliding_distance"]
    bristle = lugre(distance, START["stribeck_excess"], START["stribeck_speed"], damped=False)
    gentle = tuple(replace(t, gamma=START["gamma"]) if t.has_sign else t for t in TWO_SLOPES)
    return [
        Candidate("viscous, Coulomb, offset", (viscous(), SIGN, offset())),
        Candidate("viscous, Coulomb, offset, Stribeck", (viscous(), SIGN, offset(), excess),
                  ("stribeck_speed",)),
        Candidate("power of the speed, Coulomb, offset", (power, SIGN, offset()),
                  ("viscous_exponent",)),
        Candidate("two slopes, Coulomb, offset", TWO_SLOPES),
        Candidate("two slopes, free slope of the sign", gentle, ("gamma",)),
        Candidate("two slopes, Stribeck", (*TWO_SLOPES, excess), ("stribeck_speed",)),
        Candidate("two slopes, power of the speed", (*TWO_SLOPES, power), ("viscous_exponent",)),
        Candidate("two slopes, Dahl", (*bare, dahl(distance)), ("presliding_distance",)),
        Candidate("two slopes, LuGre", (*bare, *bristle),
                  ("presliding_distance", "stribeck_excess", "stribeck_speed")),
        Candidate("two slopes, Maxwell slip", (*bare, *maxwell_slip(SLIPS))),
    ]  # fmt: skip


def extensions(chosen: Candidate) -> list[Candidate]:
    """What may be added to a law, one at a time.

    Constants without a name in ``constants`` are known from drawings or are grids: a constant
    that is merely tried has to be sought, so that the record can fail to determine it.
    """

    def more(title: str, *terms: FrictionTerm) -> Candidate:
        return replace(chosen, title=f"+ {title}", terms=(*chosen.terms, *terms))

    return [
        replace(chosen, title="+ delay of the drive", constants=(*chosen.constants, "delay")),
        more("ripple of the screw, 2.5 mm", *ripple(2.0 * np.pi / LEAD, "a")),
        more("wave of the position, 250 mm", *ripple(2.0 * np.pi / STROKE, "b")),
        more("spring", spring()),
    ]
