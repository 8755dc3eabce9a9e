"""Which combinations of a link's parameters its joint can feel: the rules of Gautier and Khalil.

The torques depend on a link's parameters through kinetic and potential energy alone. Carry all
parameters of the links behind a link to it, at any fixed position of their joints. The torque of
joint i then depends on the ten sums of link i only through what changes with q_i, and on its own
inertia and coupling:

    sᵀ A(a) X(q_i) v      for every twist v that the links before can have
    T(v, q_i) - T(v, 0)   what the kinetic energy with this twist gains when q_i changes
    U(g, q_i) - U(g, 0)   likewise the potential energy, for every direction of gravity

with s the joint's screw, A(a) the spatial inertia. Everything else acts as if the link were part
of its parent and is carried to it. Expanded in functions of q_i these are, for a revolute joint,

    zz                                always
    xx - yy, xy                       if an axis before is not parallel to this one
    xz, yz, mx, my                    in pairs: from the twists (ω, v) across the axis,
                                      ωx xz + ωy yz + vy mx - vx my and the same turned by 90°;
                                      mx, my wherever gravity has a component across the axis

and never xx + yy, mz and m. For a prismatic joint they are m always and, with ω the speeds of
turning of the links before, h × ω: nothing where ω is along the slide, two of three first moments
h where it has one other direction, all three where it has all directions.

References: Gautier and Khalil, IEEE Trans. Robotics and Automation 6 (1990); Khalil and Bennis,
Int. J. Robotics Research 14 (1995), for trees; Khalil and Dombre, Modeling, Identification and
Control of Robots (2002), chapter 9.

Torques of a joint alone, as functions of its motion that are independent of each other.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.grouping.geometry import (
    NamedFrame,
    Names,
    Quantity,
    as_quantity,
    numbers,
    quantities,
)
from pivident.dynamics.grouping.rows import (
    ONE,
    ROUNDING,
    Reach,
    Row,
    reduced,
    row_space,
    summed,
    times,
)
from pivident.dynamics.parameters import Parameter
from pivident.robot.description import INERTIAL, Coupling, JointKind, Robot
from pivident.robot.friction_column import Functions, SignFunction
from pivident.robot.friction_term import FrictionTerm

_ON_THE_AXIS = "lies on the axis: it acts as part of the link before"
_NEVER_ACROSS = "the link never turns about a direction across its axis"
_DIFFERENCE = "only xx - yy is felt here; equal xx and yy act as part of the link before"
_NOT_ACCELERATED = "neither motion nor gravity accelerates the link across its axis"
_CROSSING = "all axes before cross this axis in one point: felt only as inertia about it"
_SLIDES = "does not change with the slide: it acts as part of the link before"
_NEVER_ACROSS_SLIDE = "the link never turns about a direction across its slide"
_ONE_DIRECTION = "moments along the one direction that the link turns about are not felt here"


def reasons_by_stem(kind: JointKind, turns_across: bool, crossing: bool) -> dict[str, str]:
    """The rule that keeps a parameter from heading a group, by stem.

    ``crossing``: all axes before cross this one in one point, and gravity does not act on its first
    moments.
    """
    if kind == "prismatic":
        words = dict.fromkeys(INERTIAL[:6], _SLIDES)
        along = _ONE_DIRECTION if turns_across else _NEVER_ACROSS_SLIDE
        words |= dict.fromkeys(("mx", "my", "mz"), along)
        return words | {"ia": "moves like m: only their sum is felt"}
    words = dict.fromkeys(INERTIAL[:6], _NEVER_ACROSS)
    if turns_across:
        words["yy"] = _DIFFERENCE
    words |= dict.fromkeys(("mx", "my"), _CROSSING if crossing else _NOT_ACCELERATED)
    words |= dict.fromkeys(("mz", "m"), _ON_THE_AXIS)
    return words | {"ia": "turns like zz: only their sum is felt"}


@dataclass(frozen=True)
class LocalGroups:
    """What one joint feels of its own parameters, by their index among the standard parameters."""

    kept: tuple[int, ...]  # heads of groups
    shares: dict[int, Row]  # of the others: what the joint feels of each in each of its own heads
    reasons: dict[int, str]  # of the others: the rule in words


def friction_functions(term: FrictionTerm) -> Functions:
    """The column of a term as a sum of independent functions.

    ``1`` is the function of an offset, ``cos`` and ``sin`` of order 1 are those of a weight.
    """
    functions = term.column.functions
    if functions is None:
        return {("own", term.stem): 1.0}
    _, code, (gamma, *_) = term.encoded()
    return {
        (name, 1.0)
        if name in ("cos", "sin") and abs(constants[0] - 1.0) < ROUNDING
        else key: factor
        for key, factor in functions(_sign(code, gamma), *term.values).items()
        for name, *constants in (key,)
    }


def coupling_functions(robot: Robot, stem: str, coupling: Coupling) -> Functions:
    """The columns ``fvm`` and ``fcm`` of a coupling likewise.

    They act on two joints at once and are independent of all others, unless the ratio is 0: then
    ``fvm`` has no effect and ``fcm`` is the Coulomb friction of the motor's own joint.
    """
    if coupling.ratio == 0.0:
        return {} if stem == "fvm" else {_sign(*coupling_sign(robot, coupling.motor)): 1.0}
    if stem == "fvm":  # the same for both directions
        return {("dq dq", *sorted((coupling.motor, coupling.joint))): coupling.ratio}
    return {("s s", coupling.motor, coupling.joint, coupling.ratio): 1.0}


def _sign(code: int, gamma: float) -> tuple:
    """The (smoothed) sign as a function; a hard sign has no slope."""
    return ("s", code) if code == SignFunction.SIGN else ("s", code, gamma)


@dataclass(eq=False)
class JointRules:
    """The rules for joint i; a coupling's inertia belongs to the later joint.

    ``reach`` is that of the links before, seen from the joint at q = 0, ``gravity`` (3,) in the
    link's frame with all joints at 0; ``coupled`` are the joints whose speeds ``reach`` has.
    """

    robot: Robot
    i: int
    own: dict[int, Parameter]
    reach: Reach
    gravity: np.ndarray
    frames: list[NamedFrame]
    coupled: list[int]
    names: Names

    def __post_init__(self) -> None:
        self.of = {p.stem: k for k, p in self.own.items() if p.is_inertial or p.stem == "ia"}
        self.omega, self.v = self.reach.twists[:, :3], self.reach.twists[:, 3:6]
        self.turns_across = _any(self.omega[:, :2])
        #: z of the point where all axes before cross this one, None where it has no effect
        self.crossing: Quantity | None = None
        self.functions = self._joint_functions()

    def groups(self) -> LocalGroups:
        """What the joint feels of its own parameters."""
        revolute = self.robot.joints[self.i].kind == "revolute"
        rows = self.revolute_rows() if revolute else self.prismatic_rows()
        own = self.own
        heads = reduced(rows, sorted(own, key=lambda k: (_rank(self.robot, own[k]), k)))
        shares = {
            k: {head: row[k] for head, row in heads.items() if k in row}
            for k in own
            if k not in heads
        }
        return LocalGroups(tuple(sorted(heads)), shares, self.reasons(shares))

    def row(self, **entries: Quantity | float) -> Row:
        """A row from the stems of the link's own parameters, those that the model has."""
        made = {self.of[stem]: as_quantity(x) for stem, x in entries.items() if stem in self.of}
        return {k: x for k, x in made.items() if x.value != 0.0}

    def revolute_rows(self) -> list[Row]:
        """What a revolute joint feels."""
        reaction, rows = self._reactions(self.omega[:, 2])
        rows.append(self.row(zz=1.0, ia=1.0))
        if reaction is not None:
            rows.append(self.row(zz=1.0) | reaction)
        if self.turns_across:
            rows += [self.row(xx=1.0, yy=-1.0), self.row(xy=1.0)]
        rows += self._pairs()
        # Potential energy: torque (gx my - gy mx) cos q + (gx mx + gy my) sin q.
        across = self.reach.gravities[:, [0, 1, 3]]
        cosine = self.functions.pop(("cos", 1.0), {})
        sine = self.functions.pop(("sin", 1.0), {})
        if _any(across[:, :2]) and len(row_space(across)) == 1 and (cosine or sine):
            rows += self._moments_with_functions(cosine, sine)
        else:
            if _any(across[:, :2]):
                rows += [self.row(mx=1.0), self.row(my=1.0)]
            rows += [cosine, sine]
        return rows + list(self.functions.values())

    def prismatic_rows(self) -> list[Row]:
        """What a prismatic joint feels."""
        if self.turns_across:
            rows = [self.row(m=1.0), *self._moments_across_turning()]
        else:
            reaction, rows = self._reactions(self.v[:, 2])
            if reaction is not None:
                rows.append(self.row(m=1.0) | reaction)
        rows.append(self.row(m=1.0, ia=1.0))
        # Potential energy: force -gz m, constant like an offset.
        along = self.reach.gravities[:, [2, 3]]
        offset = self.functions.pop(("1",), {})
        if len(row_space(along)) == 1 and offset:
            rows.append(self.row(m=-self.gravity[2]) | offset)
        else:
            rows += [self.row(m=1.0)] if _any(along[:, 0]) else []
            rows.append(offset)
        return rows + list(self.functions.values())

    def _reactions(self, amounts: np.ndarray) -> tuple[Row | None, list[Row]]:
        """Reaction of the joint to motion of the joints before it, with couplings' inertias.

        ``amounts`` is the motion that the joint reacts to in each reachable twist. The speeds of
        the coupled joints belong to the same twists as the link's own motion, so combinations of
        the two are felt: the couplings' inertias felt with the joint's reaction to one unit of
        that motion, None where it is not reachable; and rows of couplings alone.
        """
        own = -1  # the column of the motion itself
        rows: list[Row] = [{own: Quantity.number(x)} if x else {} for x in amounts]
        alone: list[Row] = []
        couplings = {k: p.coupling for k, p in self.own.items() if p.stem == "iam" and p.coupling}
        for k, coupling in couplings.items():
            partner = coupling.joint if coupling.motor == self.i else coupling.motor
            if partner in self.robot.ancestors(self.i):
                speeds = self.reach.twists[:, 6 + self.coupled.index(partner)]
                for row, x in zip(rows, coupling.ratio * speeds, strict=True):
                    row |= {k: Quantity.number(x)} if x else {}
            elif coupling.ratio:  # on another branch: its speed is independent of this link
                alone.append({k: Quantity.number(coupling.ratio)})
        found = reduced(rows, [own, *couplings])
        reaction = found.pop(own, None)
        if reaction is not None:
            reaction = {k: x for k, x in reaction.items() if k != own}
        return reaction, alone + list(found.values())

    def _pairs(self) -> list[Row]:
        """Rows of xz yz mx my that come from kinetic energy."""
        x, y = self.omega[:, 0], self.omega[:, 1]
        vx, vy = self.v[:, 0], self.v[:, 1]
        pairs = np.vstack(
            [np.array([x, y, vy, -vx]).T, np.array([-y, x, vx, vy]).T]  # the same turned by 90°
        )
        size = len(row_space(pairs))
        inertia, moment = _any(pairs[:, :2]), _any(pairs[:, 2:])
        # A speed along the axis together with turning across it accelerates mx and my as well.
        if size == 4 or (inertia and _any(self.v[:, 2])):
            return [self.row(**{stem: 1.0}) for stem in ("xz", "yz", "mx", "my")]
        if size == 0:
            return []
        if not (inertia and moment):
            return [self.row(**{s: 1.0}) for s in (("xz", "yz") if inertia else ("mx", "my"))]
        self.crossing = self._height_of_crossing()
        return [self.row(xz=1.0, mx=self.crossing), self.row(yz=1.0, my=self.crossing)]

    def _height_of_crossing(self) -> Quantity:
        """The z where the axes before cross this one: vy = z ωx, -vx = z ωy."""
        omega, v = self._twist_of_turning()
        if abs(omega[0].value) >= abs(omega[1].value):
            return self._short_ratio("c", v[1], omega[0])
        return self._short_ratio("c", -v[0], omega[1])

    def _short_ratio(self, stem: str, above: Quantity, below: Quantity) -> Quantity:
        """A quotient, by name where it is not simple."""
        quotient = above / below
        sums = len(below.polynomial.terms) > 1
        return self.names.length(stem, quotient.value) if sums else self.names.short(stem, quotient)

    def _twist_of_turning(self) -> tuple[np.ndarray, np.ndarray]:
        """Twist (ω, v) of the nearest joint before that turns about an axis not parallel."""
        path: list[int] = []
        for ancestor in self.robot.ancestors(self.i):
            if ancestor != self.i and self.robot.joints[ancestor].kind == "revolute":
                omega, v = quantities([0.0, 0.0, 1.0]), quantities(np.zeros(3))
                for j in reversed(path):
                    frame = self.frames[j]
                    v = frame.rotation.T @ (v + _cross(omega, frame.translation))
                    omega = frame.rotation.T @ omega
                if _any(numbers(omega[:2])):
                    return omega, v
            path.append(ancestor)
        raise AssertionError(f"no axis before joint {self.i} turns it across its own axis")

    def _moments_across_turning(self) -> list[Row]:
        """First moments in h × ω, with the couplings' inertias.

        With all directions of ω all of them are felt in kinetic energy. With one direction a that
        shows (ax² + ay²) mz - az (ax mx + ay my), and the reaction of the joint to turning is
        ax my - ay mx. Solved for the moments, these are the rows below.
        """
        if len(row_space(self.omega)) > 1:
            rows = [self.row(**{stem: 1.0}) for stem in ("mx", "my", "mz")]
            return rows + self._reactions(np.zeros(len(self.omega)))[1]
        x, y, z = (
            self.names.short(f"a{axis}", q) if abs(q.value) > ROUNDING else Quantity.number(0.0)
            for axis, q in zip("xyz", self._twist_of_turning()[0], strict=True)
        )
        across = x * x + y * y
        reaction, rows = self._reactions(self.omega[:, :2] @ [x.value, y.value] / across.value)
        reaction = reaction or {}
        if z.value:
            rows += [
                self.row(mx=1.0, mz=-x / z) | times(reaction, -y / across),
                self.row(my=1.0, mz=-y / z) | times(reaction, x / across),
            ]
        elif y.value:
            rows += [self.row(mx=1.0, my=-x / y) | times(reaction, -(ONE / y)), self.row(mz=1.0)]
        else:
            rows += [self.row(my=1.0) | times(reaction, ONE / x), self.row(mz=1.0)]
        return rows

    def _moments_with_functions(self, cosine: Row, sine: Row) -> list[Row]:
        """First moments with joint torques like a weight, where gravity has one direction (gx, gy).

        The joint feels gx my - gy mx + (cosine) and gx mx + gy my + (sine), solved for mx and my.
        """
        x, y = (
            self.names.short(f"g{axis}", q) if abs(q.value) > ROUNDING else Quantity.number(0.0)
            for axis, q in zip("xy", self.gravity[:2], strict=True)
        )
        square = x * x + y * y
        mx = summed(times(cosine, -y / square), times(sine, x / square))
        my = summed(times(cosine, x / square), times(sine, y / square))
        return [self.row(mx=1.0) | mx, self.row(my=1.0) | my]

    def _joint_functions(self) -> dict[tuple, Row]:
        """Friction and other joint torques as functions of the joint's motion, by function."""
        found: dict[tuple, Row] = defaultdict(dict)
        for k, p in self.own.items():
            if p.friction is not None:
                parts = friction_functions(p.friction)
            elif p.coupling is not None and p.stem != "iam":
                parts = coupling_functions(self.robot, p.stem, p.coupling)
            else:
                continue
            for function, factor in parts.items():
                if abs(factor) > ROUNDING:
                    found[function][k] = Quantity.number(factor)
        return dict(found)

    def reasons(self, shares: dict[int, Row]) -> dict[int, str]:
        """Why parameters head no group, in words."""
        kind = self.robot.joints[self.i].kind
        words = reasons_by_stem(kind, self.turns_across, self.crossing is not None)
        out = {}
        for k, share in shares.items():
            heads = " and ".join(self.own[head].name for head in share)
            other = (
                f"its torque is indistinguishable from that of {heads}"
                if heads
                else "has no torque"
            )
            out[k] = words.get(self.own[k].stem, other)
        return out


def _rank(robot: Robot, p: Parameter) -> int:
    """Class of preference: 0 is kept first; the order of the numeric base parameters."""
    if p.friction is not None and p.friction.depends_on_position:
        return 2
    if p.stem == "ia":
        return 1
    last = ("yy", "mz", "m") if robot.joints[p.joint].kind == "revolute" else INERTIAL[:6]
    return int(p.is_inertial and p.stem in last)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product of quantities."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _any(array: np.ndarray) -> bool:
    return bool((np.abs(array) > ROUNDING).any())
