"""The gravity model in a control law: its columns, and whether a joint's law has one.

A law that compensates gravity adds g_j(x) = Σ_k G_jk(x) θ_k, with x the measured position or the
reference, and G the columns of mx, my, mz and m of the observation matrix at rest. It is linear in
θ, the parameters as the *controller* knows them, which need not be the robot's.

Physics makes the torque of every arm follow its gravity, whatever the law. So a law of unknown
structure would be given a gravity model along with other columns that look like the dynamics. The
model is taken in only where each of its columns earns its place as every extra term does, where it
is what was missing (it takes most of what the law without leaves, and is well determined against
a residual that is not white), and where the law is then complete: feedback of the right sign, and
hardly anything unexplained.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.control_law.law_equations import (
    ALWAYS,
    F_PROBABILITY,
    ROUNDING,
    WORTHWHILE,
    Channel,
    Column,
    Equations,
    best_equations,
)
from pivident.foundation.distributions import fisher
from pivident.loop.simulation.gravity_compensation import MASS_STEMS, GravityModel
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops

#: Where a law evaluates its gravity model.
Place = Literal["gravity", "gravity_reference"]
PLACES: tuple[Place, ...] = ("gravity", "gravity_reference")

#: The same in words.
PLACE_TEXTS: dict[Place, str] = {
    "gravity": "measured position",
    "gravity_reference": "reference",
}

#: Share of the output (rms) that a law with a gravity model may leave unexplained.
COMPLETE = 0.1

#: Share of the residual's sum of squares that a gravity model takes at least, and standard errors
#: that the best known of its parameters has at least: 2σ are then a fifth of it.
MOST = 0.8
MIN_RATIO = 10.0

#: Postures that show which columns are independent, and the length of a remainder that is not.
POSTURES = 60
DEPENDENT = 1e-9

#: Samples whose columns are formed at a time.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class JointGravity:
    """The gravity model in the law of one joint."""

    place: Place  # ``gravity``: at the measured position; ``gravity_reference``: at the reference
    parameters: tuple[Parameter, ...]  # heads of the groups of parameters in use
    values: np.ndarray  # as the controller knows them, shape (parameters,) [kg m or kg]
    std: np.ndarray  # their robust standard errors
    statistic: float  # F of all of them together
    taken: float  # share of the residual's sum of squares that they take

    def to_values(self) -> dict[str, Any]:
        """The model as plain values, for the file of a result."""
        return {
            "at": "q" if self.place == "gravity" else "q_ref",
            "parameters": [p.name for p in self.parameters],
            "values": self.values,
            "std": self.std,
            "units": [p.unit for p in self.parameters],
            "f_test": self.statistic,
        }

    @property
    def is_significant(self) -> bool:
        """Whether it is significant, even if what the law leaves is no white noise."""
        return bool(np.any(np.abs(self.values) > MIN_RATIO * self.std))


#: What there is for a robot with closed loops.
KNOWN_LAW = (
    "give the law and its gains, or identify it without gravity, identify_controller(recordings) "
    "without robot"
)


@dataclass(frozen=True, eq=False)
class GravityColumns:
    """What the gravity model of one joint's law can be made of."""

    regressor: Regressor  # columns of all parameters that gravity acts on
    joint: int  # index of the joint
    chosen: tuple[
        int, ...
    ]  # columns that its torque distinguishes; none where it carries no weight

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the columns."""
        return tuple(self.regressor.parameters[k] for k in self.chosen)

    def at(self, q: np.ndarray) -> np.ndarray:
        """The columns in postures q, shape (samples, joints) [rad or m].

        Result: torque per parameter, shape (samples, parameters).
        """
        out = np.empty((len(q), len(self.chosen)))
        for first in range(0, len(q), BLOCK):
            part = q[first : first + BLOCK]
            out[first : first + BLOCK] = _at_rest(self.regressor, part)[:, self.joint][
                :, self.chosen
            ]
        return out


@dataclass(frozen=True, eq=False)
class GravityFit:
    """A law with a gravity model."""

    place: Place  # where the model is evaluated
    channels: list[Channel]  # the joint's signals with the columns of the model
    equations: Equations  # for the best differentiator
    columns: tuple[Column, ...]  # terms, and numbers of the model's columns
    tests: dict[str, float]  # F statistics of the extra terms
    statistic: float  # F of the model
    taken: float  # share of the residual's sum of squares that it takes


def gravity_columns(robot: Robot) -> list[GravityColumns]:
    """What gravity models of the laws of all joints can be made of.

    Raises:
        RobotDescriptionError: a robot with closed loops.
    """
    without_loops(robot, "the search for gravity in a control law", KNOWN_LAW)
    heads = tuple(p for p in base_parameters(robot).parameters if p.stem in MASS_STEMS)
    regressor = regressor_of(robot, heads)
    postures = np.random.default_rng(19991231).uniform(-np.pi, np.pi, (POSTURES, robot.size))
    probe = _at_rest(regressor, postures)
    return [
        GravityColumns(regressor, j, tuple(_independent(probe[:, j]))) for j in range(robot.size)
    ]


def _at_rest(regressor: Regressor, q: np.ndarray) -> np.ndarray:
    """Observation matrix of postures, shape (samples, joints, parameters)."""
    still = np.zeros_like(q)
    return regressor.matrix(q, still, still)


def _independent(probe: np.ndarray) -> Iterator[int]:
    """Columns that are not combinations of those before them."""
    basis = np.zeros((len(probe), 0))
    for k in range(probe.shape[1]):
        rest = probe[:, k] - basis @ (basis.T @ probe[:, k])
        rest -= basis @ (basis.T @ rest)
        size = np.linalg.norm(rest)
        if size > DEPENDENT * len(probe):
            basis = np.column_stack([basis, rest / size])
            yield k


def best_gravity(
    channels: Sequence[Channel],
    recordings: Sequence[Recording],
    columns: GravityColumns,
    plain: tuple[Equations, tuple[Column, ...]],
) -> GravityFit | None:
    """The best law with a gravity model, or None where none earns its place."""
    equations, terms = plain
    rss = equations.fit(terms)[1]
    if not columns.parameters or rss <= ROUNDING * equations.total:
        return None
    found = []
    for place in PLACES:
        postures = [r.q if place == "gravity" else r.q_ref for r in recordings]
        own = [
            replace(c, gravity=columns.at(q))
            for c, q in zip(channels, postures, strict=True)
            if q is not None
        ]
        found.append(_fit_at(place, own, plain))
    sound = [own for own in found if own is not None and _believable(own)]
    return min(sound, key=lambda own: own.equations.fit(own.columns)[1], default=None)


def _fit_at(
    place: Place,
    channels: list[Channel],
    plain: tuple[Equations, tuple[Column, ...]],
) -> GravityFit | None:
    """The best law with the model at one place; None where it takes too little."""
    model = tuple(range(channels[0].gravity.shape[1]))
    rss = plain[0].fit(plain[1])[1]
    first = Equations.build(channels, plain[0].time, plain[0].averaged)
    if rss - first.fit((*plain[1], *model))[1] <= WORTHWHILE * rss:  # before any search
        return None
    equations, chosen, tests = best_equations(channels, (*ALWAYS, *model))
    chosen = _without_idle(equations, chosen)
    count = sum(isinstance(c, int) for c in chosen)
    left = equations.fit(chosen)[1]
    taken = 1.0 - left / rss
    if not count or taken < MOST:
        return None
    freedom = equations.rows - len(chosen)
    statistic = (rss - left) / count / max(left / freedom, 1e-300)
    if statistic < _least_statistic(count, freedom):
        return None
    return GravityFit(place, channels, equations, chosen, tests, statistic, taken)


def _without_idle(equations: Equations, chosen: tuple[Column, ...]) -> tuple[Column, ...]:
    """Leave out columns of the model, one after the other, that the fit does without."""
    rss = equations.fit(chosen)[1]
    while True:
        rests = {
            c: equations.fit([other for other in chosen if other != c])[1]
            for c in chosen
            if isinstance(c, int)
        }
        if not rests:
            return chosen
        idle = min(rests, key=lambda c: rests[c])
        lost, freedom = rests[idle] - rss, equations.rows - len(chosen)
        needed = lost > WORTHWHILE * rss and lost > ROUNDING * equations.total
        if needed and lost / max(rss / freedom, 1e-300) >= _least_statistic(1, freedom):
            return chosen
        chosen = tuple(c for c in chosen if c != idle)
        rss = rests[idle]


def _least_statistic(count: int, freedom: int) -> float:
    return float(fisher.ppf(F_PROBABILITY, count, freedom))


def _believable(found: GravityFit) -> bool:
    """Whether the law is complete with its gravity model."""
    gains, rss = found.equations.fit(found.columns)
    feedback = [gains[found.columns.index(term)] for term in ALWAYS]
    return min(feedback) >= 0.0 and rss <= COMPLETE**2 * found.equations.total


def gravity_models(
    robot: Robot, found: Sequence[JointGravity | None], drive_gain: np.ndarray
) -> dict[Place, GravityModel]:
    """The gravity models of all joints together, for each place where there are some.

    ``found``: the model of each joint, None where its law has none; ``drive_gain``: joint torque
    per controller output, shape (joints,).
    """
    n = robot.size
    masses = {place: np.zeros((n, n, len(MASS_STEMS))) for place in PLACES}
    for j, own in enumerate(found):
        if own is None:
            continue
        for p, value in zip(own.parameters, own.values, strict=True):
            masses[own.place][j, p.joint, MASS_STEMS.index(p.stem)] = value / drive_gain[j]
    return {place: GravityModel(robot, m) for place, m in masses.items() if m.any()}


def gravity_notes(names: Sequence[str], found: Sequence[JointGravity | None]) -> Iterator[str]:
    """Which joints' laws compensate gravity, a sentence for each place where they do.

    ``found``: the model of each joint, None where its law has none.
    """
    for place in PLACES:
        joints = [n for n, own in zip(names, found, strict=True) if own and own.place == place]
        if joints:
            yield (
                f"The control law of {', '.join(joints)} compensates gravity at the "
                f"{PLACE_TEXTS[place]}, with a model of its own that was found beside its gains."
            )
