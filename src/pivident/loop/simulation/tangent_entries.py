"""Which numbers of a simulated loop change along directions, and how much.

Tables of the model and the sampled law are arrays of numbers. A direction changes a few of them,
and the tangents carry the sum of what these do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pivident.dynamics.forward import Model, make_model
from pivident.dynamics.friction_table import FrictionTable
from pivident.foundation.scratch import working_array
from pivident.loop.simulation.controllers import TAPS, SampledLaw
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.friction_tangent import LINEAR, PAIR, PATH, TERM
from pivident.loop.simulation.loop_tangent import (
    LAW_SLOPES,
    NO_REFERENCE,
    OF_FEEDBACK,
    OF_INTEGRAL_GAIN,
    OF_INTEGRAND,
    OF_POLE,
)
from pivident.robot.description import INERTIAL

#: Relative step of the central differences of constants that enter the tables and the law
#: nonlinearly …
SHAPE_DIFFERENCE = 1e-5

#: … and of gains, which enter linearly.
GAIN_DIFFERENCE = 0.5

#: Model parameters in the unit vectors that the tables are made for: friction of the load has to
#: stay below one.
_UNIT = 0.5


def law_slope(
    loop: ParametrisedLoop, direction: Direction, q_ref: np.ndarray, dq_ref: np.ndarray | None
) -> SampledLaw:
    """Derivative of the sampled law along one of its attributes, by central differences.

    Gains enter linearly, so that differences of any step are exact; times do not.
    """
    rate, value = float(loop.signals.rate), float(abs(loop.law_value(direction.name)).max())
    if "time" in direction.name:
        step = SHAPE_DIFFERENCE * (value + 1.0 / rate)
    else:
        step = GAIN_DIFFERENCE * (value or 1.0)
    ahead, behind = (
        loop.moved(direction, sign * step).controller.law(rate, q_ref, dq_ref)
        for sign in (1.0, -1.0)
    )
    return SampledLaw(*(_slope(a, b, 2.0 * step) for a, b in zip(ahead, behind, strict=True)))


def _slope(ahead: np.ndarray, behind: np.ndarray, width: float) -> np.ndarray:
    """A central difference; references are long, and often the same array in both laws."""
    if ahead is behind:
        return np.broadcast_to(0.0, ahead.shape)
    difference = ahead - behind
    difference /= width
    return difference


class LawEntries:
    """Slopes of the sampled law along directions, entry by entry.

    What changes a law's reference is as long as the record and kept only where there is such.
    """

    def __init__(self, samples: int, count: int) -> None:
        self._index: list[tuple[int, int, int, int]] = []
        self._slope = np.zeros((count, LAW_SLOPES))
        self._reference = working_array((2 * count, samples))
        self._references = 0

    def add(self, joint: int, d: int, what: SampledLaw | int) -> None:
        """One joint's slopes: of its law, or of one in a column of ``law_slope``."""
        slope = self._slope[len(self._index)]
        places = [NO_REFERENCE, NO_REFERENCE]
        if isinstance(what, SampledLaw):
            slope[OF_FEEDBACK : OF_FEEDBACK + TAPS] = what.feedback[joint]
            slope[OF_POLE : OF_POLE + TAPS] = what.pole[joint]
            slope[OF_INTEGRAND : OF_INTEGRAND + TAPS] = what.integrand[joint]
            slope[OF_INTEGRAL_GAIN] = what.integral_gain[joint]
            for k, own in enumerate((what.reference, what.integrand_reference)):
                if own[:, joint].any():
                    places[k] = self._references
                    self._reference[self._references] = own[:, joint]
                    self._references += 1
        else:
            slope[what] = 1.0
        self._index.append((joint, d, places[0], places[1]))

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """``law_index``, ``law_slope`` and ``law_reference``."""
        index = np.array(self._index, dtype=np.int64).reshape(-1, 4)
        return index, self._slope, self._reference[: self._references]


class ModelEntries:
    """Which numbers of the model's tables change along directions, and how much.

    The tables are linear in the parameters, so those of a unit vector are the slopes; constants of
    shape are found by central differences of the tables.
    """

    def __init__(self, loop: ParametrisedLoop, directions: Sequence[Direction]) -> None:
        self.inertial: list[tuple[int, int, int]] = []
        self.rotor: list[tuple[tuple[int, int, int], float]] = []
        self.friction: list[tuple[tuple[int, int, int, int, int], float]] = []
        #: Friction of the passive joints of a mechanism with closed loops, counted in its tree.
        self.passive: list[tuple[tuple[int, int, int, int, int], float]] = []
        names = [p.name for p in loop.parameters]
        nothing = make_model(loop.robot, loop.parameters, np.zeros(len(names)))
        for d, direction in enumerate(directions):
            if direction.kind == "parameter":
                k = names.index(direction.name)
                p = loop.parameters[k]
                if p.is_inertial:
                    self.inertial.append((p.joint, INERTIAL.index(p.stem), d))
                    continue
                unit = np.zeros(len(names))
                unit[k] = _UNIT
                ahead = make_model(loop.robot, loop.parameters, unit)
                self._add(nothing, ahead, _UNIT, d)
            elif direction.kind == "shape":
                step = SHAPE_DIFFERENCE * (abs(loop.value(direction)) or 1.0)
                behind, ahead = (loop.moved(direction, sign * step).model for sign in (-1.0, 1.0))
                self._add(behind, ahead, 2.0 * step, d)
            elif direction.kind == "torque_offset":
                self.friction.append(((direction.joint, LINEAR, direction.joint, 1, d), 1.0))

    def _add(self, behind: Model, ahead: Model, width: float, d: int) -> None:
        change = (ahead.rotor - behind.rotor) / width
        self.rotor += [
            ((i, j, d), float(change[i, j])) for i, j in np.argwhere(np.tril(change)).tolist()
        ]
        self.friction += _friction_entries(behind.friction, ahead.friction, width, d)
        if behind.closed is not None and ahead.closed is not None:
            before, after = behind.closed.friction, ahead.closed.friction
            self.passive += _friction_entries(before, after, width, d)


def _friction_entries(
    behind: FrictionTable, ahead: FrictionTable, width: float, d: int
) -> Iterator[tuple[tuple[int, int, int, int, int], float]]:
    """Constants of friction that differ between two tables, and their slopes along a direction."""
    tables = (
        (LINEAR, behind.linear, ahead.linear),
        (TERM, behind.term_value, ahead.term_value),
        (PAIR, behind.pair_value, ahead.pair_value),
        (PATH, behind.path_value, ahead.path_value),
    )
    for table, before, after in tables:
        change = (after - before) / width
        yield from [
            ((row, table, row, column, d), float(change[row, column]))
            for row, column in np.argwhere(change).tolist()
        ]
