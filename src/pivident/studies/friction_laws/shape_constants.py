"""Shape constants to identify: their coordinate and bounds.

A Stribeck speed or a presliding distance may be wrong by orders of magnitude, so positive constants
are searched and bounded in their logarithm u = ln s; angles, excesses and orders are not
transformed. The bounds are those of the law, narrowed to the range covered by the record: a
Stribeck speed above the fastest motion acts as Coulomb friction, one far below the slowest has no
effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.loop.motion.motion import Kinematics
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_column import Shape, unit_on_joint
from pivident.robot.naming import nearest

#: Slope of all smoothed signs of a law; not among its shapes, but identifiable like one.
GAMMA = "gamma"

#: Starting points along each constant.
GRID = 11

#: Share of the samples that must be slower than three times an identifiable Stribeck speed.
SLOWEST_SHARE = 2e-3


@dataclass(frozen=True)
class ShapeConstant:
    """One constant of one joint's friction law."""

    joint: int  # index of the joint
    joint_name: str  # its name
    name: str  # as the law has it, ``stribeck_speed``, or ``gamma``
    value: float  # start of the search, or its result
    unit: str  # of the value, ``rad/s``; ``1`` without one
    low: float  # smallest value that the record can distinguish
    high: float  # largest one
    logarithmic: bool  # whether the coordinate is ln s

    @property
    def label(self) -> str:
        """Name with its joint, ``stribeck_speed[carriage]``."""
        return f"{self.name}[{self.joint_name}]"

    def coordinate(self, value: float) -> float:
        """The u of a value s."""
        return math.log(value) if self.logarithmic else value

    def at(self, coordinate: float) -> float:
        """The value s of a u, inside the bounds."""
        value = math.exp(min(coordinate, 700.0)) if self.logarithmic else coordinate
        return min(max(value, self.low), self.high)

    def slope(self, value: float) -> float:
        """Derivative ds/du at a value."""
        return value if self.logarithmic else 1.0

    @property
    def span(self) -> float:
        """Distance of the bounds in the coordinate u."""
        return self.coordinate(self.high) - self.coordinate(self.low)

    def is_bound(self, value: float) -> bool:
        """Whether a value is at one of the bounds, to 1 % of a positive constant."""
        u, near = self.coordinate(value), 0.01 if self.logarithmic else 0.001 * self.span
        ends = (self.coordinate(self.low), self.coordinate(self.high))
        return min(abs(u - end) for end in ends) <= near

    def grid(self) -> np.ndarray:
        """Values from which the search may start, shape (points,)."""
        if self.logarithmic:
            return np.geomspace(self.low, self.high, GRID)
        if self.low == 0.0:  # an excess: small values are likely, zero would hide its speed
            return self.high * np.linspace(0.0, 1.0, GRID)[1:] ** 3
        return np.linspace(self.low, self.high, GRID)


def chosen_names(
    robot: Robot, names: Mapping[str, Sequence[str]] | Sequence[str] | None
) -> dict[int, tuple[str, ...]]:
    """Constants to identify, by joint.

    ``names`` by joint name; a list: those of each joint that has them; None: all free ones.
    """
    chosen: dict[int, tuple[str, ...]] = {}
    if isinstance(names, Mapping):
        for named, wanted in names.items():
            j = robot.joint_index(named)
            known = _known(robot.joints[j].friction)
            for name in wanted:
                if name not in known:
                    raise ExperimentError(
                        f"friction of joint {named!r}, {robot.joints[j].friction}, has no "
                        f"constant {name!r}",
                        advice=nearest(name, known) if known else "it has none at all",
                    )
            chosen[j] = tuple(dict.fromkeys(wanted))
    else:
        for j, joint in enumerate(robot.joints):
            free = [s.name for s in joint.friction.shapes if s.free]
            known = _known(joint.friction)
            chosen[j] = tuple(free if names is None else [n for n in names if n in known])
        unknown = set(names or ()) - {n for own in chosen.values() for n in own}
        if unknown:
            raise ExperimentError(f"no joint's friction has a constant {sorted(unknown)[0]!r}")
    chosen = {j: own for j, own in sorted(chosen.items()) if own}
    if not chosen:
        raise ExperimentError(
            "no friction law has a free shape constant",
            advice="give a joint such a law (Stribeck, power, presliding), or name the constants",
        )
    return chosen


def shape_constants(
    robot: Robot,
    joint: int,
    names: Iterable[str],
    motions: Sequence[Kinematics],
    used: Sequence[np.ndarray] | None = None,
) -> list[ShapeConstant]:
    """The constants of one joint with the bounds that its motion allows.

    ``used``: samples of each motion that are fitted; None: all. Between them a joint reverses
    unseen, and a shorter presliding distance than it travels there has no effect.
    """
    law, kind = robot.joints[joint].friction, robot.joints[joint].kind
    q = [k.q[joint, k.start : k.stop] for k in motions]
    unseen = 0.0 if used is None else _unseen_path(joint, motions, used)
    if used is None:
        used = [np.arange(k.start, k.stop) for k in motions]
    dq = np.abs(np.concatenate([k.dq[joint, own] for k, own in zip(motions, used, strict=True)]))
    travel = max(float(np.ptp(x)) for x in q)
    step = float(np.median(np.abs(np.concatenate([np.diff(x) for x in q])))) or 1e-12
    fastest = float(dq.max())
    slowest = max(float(np.quantile(dq, SLOWEST_SHARE)) / 3.0, 1e-4 * fastest)
    made = []
    for name in names:
        if name == GAMMA:
            value = law.slopes[0]
            bounds, unit, log = (
                (1.0 / fastest, 10.0 / slowest),
                unit_on_joint("1/speed", kind),
                True,
            )
        else:
            shape = next(s for s in law.shapes if s.name == name)
            value, unit = shape.value, unit_on_joint(shape.unit, kind)
            bounds = _bounds_from_motion(shape, travel, max(0.05 * step, unseen), slowest, fastest)
            log = shape.low > 0.0 and shape.unit not in ("angle", "1/position")
        low, high = min(bounds), max(bounds)
        made.append(
            ShapeConstant(
                joint,
                robot.joint_names[joint],
                name,
                float(np.clip(value, low, high)),
                unit,
                low,
                high,
                log,
            )
        )
    return made


def with_shapes(robot: Robot, constants: Iterable[ShapeConstant]) -> Robot:
    """The same robot with these values in its friction laws."""
    joints = list(robot.joints)
    for c in constants:
        law = joints[c.joint].friction.with_shapes({c.name: c.value})
        joints[c.joint] = joints[c.joint].with_friction(law)
    return replace(robot, joints=tuple(joints))


def _known(law: FrictionLaw) -> list[str]:
    return [s.name for s in law.shapes] + [GAMMA] * bool(law.slopes)


def _bounds_from_motion(
    shape: Shape, travel: float, shortest: float, slowest: float, fastest: float
) -> tuple[float, float]:
    """Bounds of a constant: those of its law, narrowed to the range of the motion."""
    low, high = {
        "speed": (slowest, 2.0 * fastest),
        "position": (min(shortest, 0.5 * travel), travel),
        "1/speed": (1.0 / fastest, 10.0 / slowest),
        # adjacent orders differ by one period over the whole travel
        "1/position": (shape.value - 4.0 * np.pi / travel, shape.value + 4.0 * np.pi / travel),
        "angle": (shape.value - np.pi, shape.value + np.pi),
        "1": (shape.low, shape.high),
    }[shape.unit]
    return max(low, shape.low), min(high, shape.high)


def _unseen_path(joint: int, motions: Sequence[Kinematics], used: Sequence[np.ndarray]) -> float:
    """Median path of a joint between fitted samples that do not follow each other [rad or m]."""
    paths: list[float] = []
    for k, own in zip(motions, used, strict=True):
        path = np.cumsum(np.abs(np.diff(k.q[joint], prepend=k.q[joint, 0])))
        apart = np.diff(own) > 1.5 * np.median(np.diff(own))
        paths += np.diff(path[own])[apart].tolist()
    return float(np.median(paths)) if paths else 0.0


#: Evaluations of the search for each constant, after the grid.
EVALUATIONS = 25

#: The criterion at values of the constants.
Criterion = Callable[[Sequence[float]], float]


def search_constants(
    law: FrictionLaw,
    constants: Sequence[ShapeConstant],
    evaluate: Callable[[FrictionLaw], float],
) -> None:
    """The best point of grids along each constant, then Nelder and Mead's simplex from there.

    Args:
        law: the law with any constants.
        constants: which are searched, with their bounds.
        evaluate: the criterion of a law with constants; it is called with each point.
    """

    def criterion(values: Sequence[float]) -> float:
        return evaluate(
            law.with_shapes({c.name: v for c, v in zip(constants, values, strict=True)})
        )

    _descend(constants, _grid(constants, criterion), criterion)


def _grid(constants: Sequence[ShapeConstant], criterion: Criterion) -> list[float]:
    """The best point of the grids, constant by constant."""
    best = [c.value for c in constants]
    lowest = np.inf
    for _ in range(1 if len(constants) == 1 else 2):
        for i, c in enumerate(constants):
            for value in c.grid():
                trial = [*best]
                trial[i] = float(value)
                found = criterion(trial)
                if found < lowest:
                    best, lowest = trial, found
    return best


def _descend(
    constants: Sequence[ShapeConstant], start: Sequence[float], criterion: Criterion
) -> None:
    """Nelder and Mead's simplex from the best point of the grids."""
    from scipy.optimize import minimize

    u = np.array([c.coordinate(v) for c, v in zip(constants, start, strict=True)])
    steps = np.array([0.5 * c.span / (len(c.grid()) - 1) for c in constants])
    inward = np.where(u + steps > [c.coordinate(c.high) for c in constants], -1.0, 1.0)
    simplex = np.vstack([u, u + np.diag(inward * steps)])
    minimize(
        lambda x: criterion([c.at(float(v)) for c, v in zip(constants, x, strict=True)]),
        u,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": EVALUATIONS * len(constants),
            "xatol": 1e-3,
            "fatol": 1e-3,
        },
    )
