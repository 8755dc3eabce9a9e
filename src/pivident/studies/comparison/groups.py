"""Base parameters as sums of standard ones, so that those of two descriptions can be compared.

A base parameter is a row g of coefficients on the standard parameters, θ_g = Σ g_k θ_k: one on the
parameter that heads the group, K on those that were regrouped with it. A quantity t of one robot is
known to an estimate of another description of the same machine exactly if t = Σ c_i g_i over the
groups that it estimates. Every group has a head that no other group holds, so c_i is the
coefficient of t on the head of g_i, and it only remains to check that the sum is t.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.grouping.closed_form import quick_base_parameters
from pivident.dynamics.parameters import Parameter
from pivident.robot.description import Robot

#: A standard parameter whatever it is called: joint, kind, and function of friction or coupling.
Key = tuple[int, str, str]

#: Coefficients that differ by less, relative to the largest, are the same.
SAME = 1e-7

#: Frames that differ by less are the same [1 and m].
SAME_FRAME = 1e-9


@dataclass(frozen=True, eq=False)
class Groups:
    """The base parameters of a robot."""

    names: tuple[str, ...]  # of the base parameters
    units: tuple[str, ...]  # of the base parameters
    expressions: tuple[str, ...]  # groups written out
    heads: tuple[Key, ...]  # the standard parameter that heads each group
    rows: tuple[Mapping[Key, float], ...]  # coefficients of each group by standard parameter

    def coefficients(self, target: Mapping[Key, float]) -> np.ndarray | None:
        """The c of t = Σ c_i g_i, shape (base,); None where there are none."""
        c = np.array([target.get(head, 0.0) for head in self.heads])
        left = dict(target)
        for k in np.flatnonzero(c):
            for key, value in self.rows[k].items():
                left[key] = left.get(key, 0.0) - c[k] * value
        size = max(map(abs, target.values()), default=1.0)
        return c if all(abs(value) <= SAME * size for value in left.values()) else None


def base_of(robot: Robot, names: tuple[str, ...]) -> BaseParameters:
    """The base parameters of a robot that have these names.

    They come from the closed form, which is quicker; geometry at the edge of a tolerance can make
    the numerical search differ from it, and then that is meant.
    """
    base = quick_base_parameters(robot)
    return base if set(base.names).issuperset(names) else base_parameters(robot)


def groups_of(base: BaseParameters) -> Groups:
    """All base parameters of a robot by their coefficients."""
    keys = [key_of(p) for p in base.standard]
    rows = []
    for k, head in enumerate(base.kept):
        row = {keys[head]: 1.0}
        row |= {
            keys[i]: float(coefficient)
            for i, coefficient in zip(base.dropped, base.regrouping[k], strict=True)
            if coefficient != 0.0
        }
        rows.append(row)
    return Groups(
        base.names,
        tuple(p.unit for p in base.parameters),
        base.expressions,
        tuple(keys[head] for head in base.kept),
        tuple(rows),
    )


def key_of(parameter: Parameter) -> Key:
    """What a standard parameter is, apart from its name.

    Two frictions with the same symbol are the same quantity where they multiply the same kind of
    function; a slope or a Stribeck speed that is chosen otherwise does not make another one.
    """
    function = "" if parameter.friction is None else parameter.friction.column.name
    if parameter.coupling is not None:
        function = f"of joint {parameter.coupling.joint}"
    return parameter.joint, parameter.stem, function


def _difference_of_loops(a: Robot, b: Robot) -> str:
    """How what closes the loops of two robots differs; empty where nothing does."""
    if a.constraints is None or b.constraints is None:
        return "" if a.constraints is b.constraints else "loops are closed in one only"
    if len(a.constraints.closures) != len(b.constraints.closures):
        return "other loops are closed"
    for one, other in zip(a.constraints.closures, b.constraints.closures, strict=True):
        frames = zip(one.frames, other.frames, strict=True)
        apart = max(
            float(np.abs(np.c_[f.rotation - g.rotation, f.translation - g.translation]).max())
            for f, g in frames
        )
        if one.links != other.links or one.kind != other.kind or apart > SAME_FRAME:
            return f"the loop {one.name} closes elsewhere"
    linear = [
        [(tuple(one.ratios), one.offset) for one in r.constraints.linear]
        for r in (a, b)
        if r.constraints
    ]
    return "" if linear[0] == linear[1] else "joints move in other proportions"


def difference_of_geometry(a: Robot, b: Robot) -> str:
    """How the kinematics of two robots differ, in a few words; empty where nothing does.

    Gravity, nominal values, limits and friction laws may differ.
    """
    if a.size != b.size:
        return f"{a.size} and {b.size} joints"
    if a.tree.size != b.tree.size:
        return f"{a.tree.size} and {b.tree.size} joints, passive ones included"
    if a.places != b.places:
        return "other joints are passive"
    if difference := _difference_of_loops(a, b):
        return difference
    a, b = a.tree, b.tree
    for one, other in zip(a.joints, b.joints, strict=True):
        if one.kind != other.kind:
            return f"joint {one.name} is {one.kind} in one and {other.kind} in the other"
        if one.parent != other.parent:
            return f"joint {one.name} hangs on another link"
        apart = max(
            float(np.abs(one.rotation - other.rotation).max()),
            float(np.abs(one.translation - other.translation).max()),
        )
        if apart > SAME_FRAME:
            return f"the frame of joint {one.name} lies elsewhere"
    couplings = [[(c.motor, c.joint, c.ratio) for c in robot.couplings] for robot in (a, b)]
    return "" if couplings[0] == couplings[1] else "motors are coupled differently"
