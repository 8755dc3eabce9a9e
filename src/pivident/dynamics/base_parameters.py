"""Base parameters: the smallest set that the torques determine, in the Khalil–Gautier grouping.

The columns of Φ are linearly dependent. Walking through them in a fixed order of preference, a
column that is not a combination of those before it is kept; the others are regrouped into the
kept ones (Gautier 1991, by orthogonal projection instead of symbolic rules). With Φ_d = Φ_k K,

    Φ θ = Φ_k (θ_k + K θ_d)          base parameter = kept parameter + regrouped ones

The order of preference reproduces the rules of Khalil and Gautier: everything before ``yy mz m``
of revolute links, the inertia of prismatic links and the rotor inertias ``ia``; within each class
links from the base outwards, so that groups gather on the link nearest to the base. Ripple,
springs and struts come last: where one of them is indistinguishable from gravity (a ripple of
order one, the weight of a pendulum), it is added to the first moments, which head the group.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.common_work import once
from pivident.foundation.errors import ExperimentError, UnknownName, UnusableValue
from pivident.foundation.text.display import Displayed
from pivident.robot.description import Robot
from pivident.robot.naming import nearest

#: Relative length of a column's remainder below which it depends on the columns before it.
DEPENDENCE = 1e-9


@dataclass(frozen=True, eq=False)
class BaseParameters(Displayed):
    """The base parameters of a robot.

    Attributes:
        robot: the robot.
        standard: all standard parameters, in order.
        kept: indices of the standard parameters that head a group, ascending.
        dropped: indices of the others that act on the torques.
        regrouping: K, contribution of each dropped parameter, shape (kept, dropped).
        without_effect: indices of parameters that no torque depends on.
    """

    robot: Robot
    standard: tuple[Parameter, ...]
    kept: np.ndarray
    dropped: np.ndarray
    regrouping: np.ndarray
    without_effect: np.ndarray

    def __len__(self) -> int:
        return self.kept.size

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The standard parameters that head the groups: their columns are the base columns."""
        return tuple(self.standard[i] for i in self.kept)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names, with an ``r`` (regrouped) where others were added: ``zz1r``, ``my6``."""
        return tuple(
            regrouped_name(p) if self.regrouping[k].any() else p.name
            for k, p in enumerate(self.parameters)
        )

    @cached_property
    def expressions(self) -> tuple[str, ...]:
        """Each group written out: ``zz1 + ia1 + yy2 + 0.07 mz3 + …``."""
        return tuple(self._expression(k) for k in range(len(self)))

    def values(self, standard: np.ndarray) -> np.ndarray:
        """Base parameters of given standard ones, θ_k + K θ_d.

        Args:
            standard: standard parameters, shape (standard,).

        Raises:
            UnusableValue: another number of them.
        """
        standard = np.asarray(standard, dtype=float)
        if standard.shape != (len(self.standard),):
            raise UnusableValue(
                f"the standard parameters have shape {standard.shape}",
                advice=f"{(len(self.standard),)} is needed, in the order of `standard`",
            )
        return standard[self.kept] + self.regrouping @ standard[self.dropped]

    def standard_from_base(self, base: np.ndarray) -> np.ndarray:
        """Standard parameters with the same torques: groups on their heads, zeros elsewhere.

        Args:
            base: base parameters, shape (base,).

        Returns:
            Standard parameters, shape (standard,). They are not physical link by link.
        """
        standard = np.zeros(len(self.standard))
        standard[self.kept] = base
        return standard

    def index(self, name: str) -> int:
        """Position of a base parameter by its name, with or without the trailing ``r``.

        Raises:
            UnknownName: there is none; names the nearest ones.
        """
        for k, (own, p) in enumerate(zip(self.names, self.parameters, strict=True)):
            if name.lower() in (own.lower(), p.name.lower()):
                return k
        heads = [p.name for p in self.parameters]
        raise UnknownName(
            f"no base parameter {name!r}", advice=nearest(name.lower().removesuffix("r"), heads)
        )

    def _expression(self, k: int) -> str:
        text = self.parameters[k].name
        for i, coefficient in zip(self.dropped, self.regrouping[k], strict=True):
            if coefficient == 0.0:
                continue
            sign = "-" if coefficient < 0 else "+"
            size = abs(coefficient)
            factor = "" if size == 1.0 else f"{size:.6g} "
            text += f" {sign} {factor}{self.standard[i].name}"
        return text


def regrouped_name(p: Parameter) -> str:
    """``zz1r``, or ``zzr[elbow]`` on a tree."""
    return p.name.replace("[", "r[") if "[" in p.name else f"{p.name}r"


def base_parameters(robot: Robot) -> BaseParameters:
    """Base parameters of a robot, deterministic (the random states have a fixed seed).

    Args:
        robot: the robot.

    Returns:
        Its base parameters.

    Example:
        >>> base = pv.base_parameters(pv.load_robot("planar_2r"))
        >>> for name, group in zip(base.names[:3], base.expressions[:3]):
        ...     print(name, "=", group)
        zz1r = zz1 + ia1 + 0.16 m2
        mx1r = mx1 + 0.4 m2
        my1 = my1
    """
    return once(("base parameters", robot), lambda: _base_parameters(robot))


def _base_parameters(robot: Robot) -> BaseParameters:
    """The same, computed."""
    standard = standard_parameters(robot)
    phi = _probe(robot, standard)
    length = np.linalg.norm(phi, axis=0)
    active = length > 1e-12 * length.max()
    order = [i for i in preference(robot, standard) if active[i]]
    chosen, basis = independent_columns(phi / np.where(active, length, 1.0), order)
    kept, dropped = sorted(chosen), sorted(set(order) - set(chosen))
    # Φ_k = Q R with Q the basis, so K = R⁻¹ Qᵀ Φ_d
    regrouping = np.linalg.solve(basis.T @ phi[:, chosen], basis.T @ phi[:, dropped])
    regrouping = regrouping[np.argsort(chosen)]
    return BaseParameters(
        robot,
        standard,
        np.array(kept, dtype=np.int64),
        np.array(dropped, dtype=np.int64),
        _cleaned(regrouping),
        np.flatnonzero(~active),
    )


def _probe(robot: Robot, standard: tuple[Parameter, ...]) -> np.ndarray:
    """Φ at random states, stacked: more than twice as many rows as columns.

    Friction that no combination of other columns can reproduce enters as a random column: random
    states would not show a Stribeck curve of low speed, nor a state that remembers a path.
    """
    samples = max(40, 3 * len(standard) // robot.size)
    rng = np.random.default_rng(19910501)
    if robot.constraints is not None:
        return _closed_probe(robot, standard, samples, rng)
    q, dq, ddq = rng.uniform(-np.pi, np.pi, (3, samples, robot.size))
    if robot.base_motion == "held":
        for x in (q, dq, ddq):
            x[:, : robot.base_joints] = 0.0
    phi = Regressor.build(robot, standard).matrix(q, dq, ddq)
    for k, p in enumerate(standard):
        if p.friction is not None and p.friction.is_independent:
            phi[:, p.joint, k] = rng.uniform(-1.0, 1.0, samples)
    return phi.reshape(-1, len(standard))


def _closed_probe(
    robot: Robot, standard: tuple[Parameter, ...], samples: int, rng: np.random.Generator
) -> np.ndarray:
    """The same of a closed mechanism, at postures in which its loops close."""
    from pivident.dynamics.closed_chains.closed_regressor import ClosedRegressor

    regressor = ClosedRegressor.of(robot, standard)
    q = regressor.chains.random_postures(rng, samples)
    dq, ddq = rng.uniform(-np.pi, np.pi, (2, samples, robot.size))
    phi = np.concatenate(
        [regressor.matrix(*(x[None] for x in one)) for one in zip(q, dq, ddq, strict=True)]
    )
    independent = [k for k, p in enumerate(standard) if p.friction and p.friction.is_independent]
    if independent:
        gain = np.stack([regressor.chains.start(x).gain for x in q])
        for k in independent:
            phi[:, :, k] = gain[:, standard[k].joint] * rng.uniform(-1.0, 1.0, (len(q), 1))
    return phi.reshape(-1, len(standard))


def preference(robot: Robot, standard: tuple[Parameter, ...]) -> list[int]:
    """Indices of the standard parameters, those to be kept first.

    Args:
        robot: the robot.
        standard: its standard parameters, in order.
    """
    joints = robot.tree.joints

    def rank(p: Parameter) -> int:
        if p.friction is not None and p.friction.depends_on_position:
            return 2
        if p.stem == "ia":
            return 1
        if not p.is_inertial:
            return 0
        if joints[p.joint].kind == "prismatic":
            return int(p.stem not in ("mx", "my", "mz", "m"))
        return int(p.stem in ("yy", "mz", "m"))

    return sorted(range(len(standard)), key=lambda i: (rank(standard[i]), i))


def independent_columns(
    phi: np.ndarray, order: list[int], least: float | np.ndarray = DEPENDENCE
) -> tuple[list[int], np.ndarray]:
    """Columns that are not combinations of those before them in ``order``, and a basis of them.

    Gram–Schmidt with a second pass (twice is enough), so that a remainder of rounding errors
    stays at rounding level and is not mistaken for an independent direction.

    Args:
        phi: columns of length one, shape (rows, columns).
        order: indices of the columns that may be kept.
        least: length of a column's remainder up to which it depends on those before it, one or
            one for each column.

    Returns:
        Indices of those that are kept, in the order of ``order``, and an orthonormal basis, shape
        (rows, kept).
    """
    basis = np.empty((phi.shape[0], len(order)))
    kept: list[int] = []
    least = np.broadcast_to(least, phi.shape[1])
    for i in order:
        remainder = phi[:, i].copy()
        for _ in range(2):
            span = basis[:, : len(kept)]
            remainder -= span @ (span.T @ remainder)
        size = np.linalg.norm(remainder)
        if size > least[i]:
            basis[:, len(kept)] = remainder / size
            kept.append(i)
    return kept, basis[:, : len(kept)]


def _cleaned(regrouping: np.ndarray) -> np.ndarray:
    """Elements within rounding of zero or of an integer are set to it."""
    cleaned = np.where(np.abs(regrouping) < 1e-9, 0.0, regrouping)
    nearest = np.round(cleaned)
    return np.where(np.abs(cleaned - nearest) < 1e-9, nearest, cleaned)


def parameter_index(base: BaseParameters, name: str) -> int:
    """Index of a base parameter by its name.

    Args:
        base: the base parameters.
        name: with or without the trailing ``r``.

    Raises:
        ExperimentError: names the nearest ones that there are.
    """
    try:
        return base.index(name)
    except UnknownName as error:
        raise ExperimentError(error.fact, advice=error.advice) from None
