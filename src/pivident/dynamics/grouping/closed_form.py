"""Base parameters in closed form: every group as an expression in the robot's geometry.

From the last links to the base, the parameters that a joint does not feel are carried to the link
before by the parallel-axis rule (the λ of Khalil and Dombre). For a revolute joint of a general
robot these are xx + yy, mz and m:

    xx_i - yy_i,  zz_i, mx_i … stay         yy_i (with xx_i), mz_i, m_i  →  link before

so that with a modified DH table, for example, mz_i adds d sin α to xy and -sin α to my of the link
before. What each joint feels follows from rules about axes and gravity (``rules``), without random
states or a decomposition of the observation matrix. `dynamics.base_parameters` finds the same
groups as numbers from the matrix; each is a test of the other.

A base parameter: a group of standard parameters of which only the sum is felt.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pivident.dynamics.base_parameters import (
    BaseParameters,
    base_parameters,
    regrouped_name,
)
from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import ONE, ZERO, Add, Expression
from pivident.dynamics.grouping.geometry import (
    GEOMETRY_TOLERANCE,
    Geometry,
    NamedFrame,
    Names,
    Quantity,
    named_frame,
    named_gravity,
    numbers,
)
from pivident.dynamics.grouping.polynomial import Polynomial
from pivident.dynamics.grouping.rows import ONE as WHOLE, Reach, Row
from pivident.dynamics.grouping.rules import JointRules, LocalGroups
from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.foundation.common_work import once
from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.identifiers import latex_name
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.inertia import moved
from pivident.robot.refusals import without_loops

if TYPE_CHECKING:
    import sympy

#: Coefficients smaller than this are zero, as in ``dynamics.base_parameters``.
ZERO_BELOW = 1e-9


@dataclass(frozen=True)
class Member:
    """A standard parameter in a group, with its factor."""

    parameter: Parameter
    polynomial: Polynomial  # the factor in the names of the geometry, in normal form
    value: float  # the factor as a number

    @cached_property
    def coefficient(self) -> Expression:
        """Its factor as an expression."""
        return self.polynomial.expression()


@dataclass(frozen=True)
class Group:
    """A base parameter: its head, with factor 1, plus the standard parameters regrouped into it."""

    name: str  # ``zz1r``
    head: Parameter
    members: tuple[Member, ...]

    @property
    def expression(self) -> Expression:
        """The group as an expression in standard parameters and geometry."""
        total: Expression = symbol(self.head.name)
        for members in self._collected():
            common: Expression = ZERO
            for member in members:
                common = common + symbol(member.parameter.name)
            total = total + members[0].coefficient * common
        return total

    def __str__(self) -> str:
        """``zz1r = zz1 + ia1 + yy2 + … + (d3² + r3²)·(m3 + m4 + m5 + m6)``."""
        text = f"{self.name} = {self.head.name}"
        for members in self._collected():
            polynomial = members[0].polynomial
            sign, factor = "+", str(polynomial)
            if factor.startswith("-"):
                sign, factor = "-", str(-polynomial)
            names = [member.parameter.name for member in members]
            if factor == "1":
                text += "".join(f" {sign} {name}" for name in names)
                continue
            factor = f"({factor})" if len(polynomial.written_terms()) > 1 else factor
            total = f"({' + '.join(names)})" if len(names) > 1 else names[0]
            text += f" {sign} {factor}·{total}"
        return text

    def to_latex(self) -> str:
        """One line of an ``align`` environment, without line break."""
        text = f"{latex_name(self.name)} &= {latex_name(self.head.name)}"
        for members in self._collected():
            sign, factor = "+", members[0].coefficient
            if factor.to_latex().startswith("-"):
                sign, factor = "-", -factor
            names = [latex_name(member.parameter.name) for member in members]
            if factor is ONE:
                text += "".join(f" {sign} {name}" for name in names)
                continue
            written = factor.to_latex()
            written = rf"\left({written}\right)" if isinstance(factor, Add) else written
            total = rf"\left({' + '.join(names)}\right)" if len(names) > 1 else names[0]
            text += rf" {sign} {written} \, {total}"
        return text

    def to_sympy(self) -> sympy.Expr:
        """The group for SymPy."""
        return self.expression.to_sympy()

    def _collected(self) -> list[list[Member]]:
        """Members with the same factor together, in the order of the first of each."""
        found: dict[frozenset, list[Member]] = {}
        for member in self.members:
            found.setdefault(frozenset(member.polynomial.terms.items()), []).append(member)
        return list(found.values())


@dataclass(frozen=True, eq=False)
class ClosedFormBaseParameters:
    """The base parameters of a robot by rule, in the order of the standard parameters."""

    robot: Robot
    standard: tuple[Parameter, ...]
    groups: tuple[Group, ...]
    without_effect: tuple[Parameter, ...]  # parameters that no torque depends on
    reasons: dict[str, str]  # why a parameter heads no group
    constants: dict[str, float]  # of the geometry, by name [m, rad, m/s²]

    def __len__(self) -> int:
        return len(self.groups)

    def __str__(self) -> str:
        """Groups line by line, then what has no effect and why."""
        lines = [str(group) for group in self.groups]
        by_reason: dict[str, list[str]] = {}
        for p in self.without_effect:
            by_reason.setdefault(self.reasons[p.name], []).append(p.name)
        if by_reason:
            lines += ["", "Without effect on any torque:"]
            lines += [f"{', '.join(names)}: {reason}" for reason, names in by_reason.items()]
        if self.constants:
            values = ", ".join(f"{k} = {x:.6g}" for k, x in self.constants.items())
            lines += ["", f"Constants (m, rad, m/s²): {values}"]
        return "\n".join(lines)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters: ``zz1r``, ``my6``."""
        return tuple(group.name for group in self.groups)

    @property
    def expressions(self) -> dict[str, Expression]:
        """Each base parameter as an expression in standard parameters and geometry, by name."""
        return {group.name: group.expression for group in self.groups}

    def values(self, standard: np.ndarray) -> np.ndarray:
        """Base parameters of given standard ones, by evaluating the expressions."""
        named: Mapping[str, float] = self.constants | {
            p.name: float(x) for p, x in zip(self.standard, standard, strict=True)
        }
        return np.array([group.expression.evaluate(named) for group in self.groups], dtype=float)

    def numeric(self) -> BaseParameters:
        """The same as a matrix of numbers, as used by the estimators."""
        index = {p.name: k for k, p in enumerate(self.standard)}
        kept = [index[group.head.name] for group in self.groups]
        nothing = [index[p.name] for p in self.without_effect]
        dropped = sorted(set(range(len(self.standard))) - set(kept) - set(nothing))
        place = {k: column for column, k in enumerate(dropped)}
        regrouping = np.zeros((len(kept), len(dropped)))
        for row, group in enumerate(self.groups):
            for member in group.members:
                regrouping[row, place[index[member.parameter.name]]] = member.value
        return BaseParameters(
            self.robot,
            self.standard,
            np.array(kept, dtype=np.int64),
            np.array(dropped, dtype=np.int64),
            regrouping,
            np.array(nothing, dtype=np.int64),
        )

    def to_sympy(self) -> dict[str, sympy.Expr]:
        """Groups for SymPy, by name."""
        return {group.name: group.to_sympy() for group in self.groups}

    def to_latex(self) -> str:
        r"""Groups as ``align*`` of the package amsmath."""
        body = " \\\\\n".join(group.to_latex() for group in self.groups)
        return f"\\begin{{align*}}\n{body}\n\\end{{align*}}\n"


def closed_form_base_parameters(
    robot: Robot, geometry: Geometry = "names", tolerance: float = GEOMETRY_TOLERANCE
) -> ClosedFormBaseParameters:
    """Base parameters of a robot by the rules of Gautier and Khalil.

    ``geometry`` "names" writes lengths and angles as symbols (``d3``, ``alpha2``), "numbers" as
    their values. Elements of rotation matrices within ``tolerance`` of 0 or ±1, and positions
    within it of 0 [m], count as exact: 1e-3 makes axes perpendicular that are within a milliradian
    of it (angles rounded in a file are exact already, see `pivident.robot.frames`).

    Raises:
        RobotDescriptionError: a geometry or tolerance that there is not; a robot with closed loops.
    """
    without_loops(robot, "the closed form of base parameters", "base_parameters finds them")
    if geometry not in ("names", "numbers"):
        raise RobotDescriptionError(f"geometry is 'names' or 'numbers', not {geometry!r}")
    if not 0.0 < tolerance < 0.1:
        raise RobotDescriptionError(
            f"geometry tolerance {tolerance}: give a small number between 1e-12 and 0.1, "
            f"such as {GEOMETRY_TOLERANCE:g}"
        )
    standard = standard_parameters(robot)
    frames = [
        named_frame(joint, robot.label(i), geometry, tolerance)
        for i, joint in enumerate(robot.joints)
    ]
    gravity, constants = named_gravity(robot.gravity, geometry, tolerance)
    names = [Names(robot.label(i), geometry, tolerance) for i in range(robot.size)]
    local = list(_all_local_groups(robot, standard, frames, gravity, names))
    shares = _carried_to_heads(robot, standard, frames, local)
    kept = sorted(k for groups in local for k in groups.kept)
    members: dict[int, list[Member]] = {head: [] for head in kept}
    nothing = []
    for k, row in enumerate(shares):
        if row.keys() == {k}:
            continue
        felt = {head: x for head, x in row.items() if abs(x.value) > ZERO_BELOW}
        if not felt:
            nothing.append(k)
        for head, x in felt.items():
            members[head].append(Member(standard[k], x.polynomial, _cleaned(x.value)))
    groups = tuple(_group(standard[head], members[head]) for head in kept)
    for frame, own in zip(frames, names, strict=True):
        constants |= frame.constants | own.constants
    used = {name for group in groups for m in group.members for name in m.polynomial.names}
    return ClosedFormBaseParameters(
        robot,
        standard,
        groups,
        tuple(standard[k] for k in nothing),
        {standard[k].name: text for link in local for k, text in link.reasons.items()},
        {name: x for name, x in constants.items() if name in used},
    )


def quick_base_parameters(robot: Robot) -> BaseParameters:
    """Base parameters by the closed form, or by the search where closed loops leave no other way.

    The form takes a tenth of the time of the search on robots of many joints.
    """
    if robot.constraints is not None:
        return base_parameters(robot)
    return once(
        ("base parameters in closed form", robot),
        lambda: closed_form_base_parameters(robot, "numbers").numeric(),
    )


def _all_local_groups(
    robot: Robot,
    standard: tuple[Parameter, ...],
    frames: list[NamedFrame],
    gravity: np.ndarray,
    names: list[Names],
) -> Iterator[LocalGroups]:
    """The rules joint by joint, from the base outwards."""
    couplings = [c for c in robot.couplings if c.inertia]
    coupled = sorted({j for c in couplings for j in (c.motor, c.joint)})
    own: list[dict[int, Parameter]] = [{} for _ in robot.joints]
    for k, p in enumerate(standard):
        inertia = p.stem == "iam" and p.coupling is not None
        own[max(p.coupling.motor, p.coupling.joint) if inertia else p.joint][k] = p  # type: ignore[union-attr]
    base = Reach.of_base(numbers(gravity), len(coupled))
    behind: list[Reach] = []
    directions: list[np.ndarray] = []
    for i, joint in enumerate(robot.joints):
        before = base if joint.parent < 0 else behind[joint.parent]
        frame = frames[i]
        reach = before.seen_from(numbers(frame.rotation), numbers(frame.translation))
        above = gravity if joint.parent < 0 else directions[joint.parent]
        directions.append(frame.rotation.T @ above)
        rules = JointRules(robot, i, own[i], reach, directions[i], frames, coupled, names[i])
        yield rules.groups()
        behind.append(reach.moved_by(joint.kind, coupled.index(i) if i in coupled else None))


def _carried_to_heads(
    robot: Robot,
    standard: tuple[Parameter, ...],
    frames: list[NamedFrame],
    local: list[LocalGroups],
) -> list[Row]:
    """For each standard parameter, how much of it is in each group.

    Parameter k of link i is its share in the link's own heads h, plus what the rest,
    e_k - Σ share e_h, which joint i does not feel, adds to the parameters of the link before.
    """
    first = {p.joint: k for k, p in reversed(list(enumerate(standard))) if p.is_inertial}
    rows: list[Row] = [{} for _ in standard]
    for i, groups in enumerate(local):  # the rows of the link before are complete
        parent = robot.joints[i].parent
        for k in groups.kept:
            rows[k] = {k: WHOLE}
        for k, share in groups.shares.items():
            rows[k] = dict(share)
            rest = [(k, WHOLE), *((head, -x) for head, x in share.items())]
            rest = [(h, x) for h, x in rest if standard[h].is_inertial]
            if parent < 0 or not rest:
                continue
            for place, amount in enumerate(_carried(rest, first[i], frames[i])):
                if not amount.is_zero:
                    _accumulate(rows[k], rows[first[parent] + place], amount)
    return rows


def _carried(rest: Iterable[tuple[int, Quantity]], first: int, frame: NamedFrame) -> np.ndarray:
    """Ten parameters of the link before that a combination of a link's parameters adds to."""
    ten = np.array([Quantity.number(0.0)] * len(INERTIAL))
    for k, x in rest:
        ten[k - first] = x
    return moved(ten, frame.carrying_rotation, frame.carrying_translation)


def _accumulate(row: Row, other: Row, amount: Quantity) -> None:
    """Add an amount of the other row."""
    for head, x in other.items():
        product = amount * x
        row[head] = row[head] + product if head in row else product


def _group(head: Parameter, members: list[Member]) -> Group:
    return Group(regrouped_name(head) if members else head.name, head, tuple(members))


def _cleaned(value: float) -> float:
    """A number within rounding of an integer is set to it."""
    return float(round(value)) if abs(value - round(value)) < ZERO_BELOW else value
