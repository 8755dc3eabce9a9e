"""A physically consistent model from an estimate, which itself is not changed.

    make_consistent(identification)  →  ConsistentModel

finds the physically possible standard parameters nearest to the estimate in the metric of its own
covariance; see `metric`, `constraints`, `priors` and `nearest_consistent`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.inverse_dynamics import InverseDynamics
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identification import Identification, estimated_in_base, torque_sums
from pivident.estimation.solved_equations import TorqueSums
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import (
    ExperimentError,
    NoConsistentModelNear,
    UnknownName,
    require_kind,
)
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.plain_values import plain
from pivident.models.consistency.constraints import (
    Bounds,
    Constraint,
    make_constraints,
    place_of_link,
    plausible_bodies,
    total_at_its_limit,
)
from pivident.models.consistency.link_quantities import link_table
from pivident.models.consistency.metric import (
    NOTABLE_COST,
    cost_notes,
    is_far,
    make_metric,
    probability,
)
from pivident.models.consistency.nearest_consistent import (
    ROOM,
    Active,
    Nearest,
    StandardSpace,
    nearest_consistent,
    standard_space,
)
from pivident.models.consistency.priors import PRIORS
from pivident.models.consistency.profile_intervals import ProfileIntervals, profile_intervals
from pivident.models.consistency.pseudo_inertia import LinkBody, link_body
from pivident.models.consistency.reference import body_links, density_of_estimate, make_reference
from pivident.robot.description import Robot
from pivident.robot.naming import nearest
from pivident.robot.refusals import without_base

#: Diameter of the steel ball that bounds every link from below [m]: about the size of the smallest
#: part built into a joint. It weighs 4 g and has a second moment of 2e-8 kg m².
MIN_BALL = 0.01


@dataclass(frozen=True, eq=False)
class ConsistentModel(Displayed):
    """Physically possible standard parameters near an estimate.

    Attributes:
        free: the unchanged estimate.
        robot: the robot.
        parameters: all standard parameters.
        values: their values, shape (standard,): near the least distance, and near the reference
            where the data say little.
        names: names of the estimated base parameters, as in ``free``.
        theta: these at the consistent point, shape (parameters,).
        was_consistent: whether the estimate itself was consistent; then its torques are kept
            exactly.
        least_distance: from the estimate to the nearest consistent parameters [σ], which may have
            links that are points, lines or plates.
        p_value: probability of at least the least distance if the estimate's errors are those of
            its covariance: χ² with as many degrees of freedom as constraints are active.
        distance: from the estimate to ``values`` [σ], √(least² + ``room``) at most.
        moved: (θ - θ_free)/σ of each estimated parameter, shape (parameters,). One may exceed the
            distance: a parameter left out of the estimate may take over its torque.
        active: active constraints, the most expensive first.
        torque_error_free: relative torque error of the estimate on the fitted record; NaN without
            torque sums.
        torque_error: of the consistent parameters, likewise.
        prior: ``entropic``, ``euclidean`` or ``none``.
        seconds: duration of the search.
        notes: sentences.
        sums: torque sums of the fitted record; None if there were none.
    """

    free: Identification
    robot: Robot
    parameters: tuple[Parameter, ...]
    values: np.ndarray
    names: tuple[str, ...]
    theta: np.ndarray
    was_consistent: bool
    least_distance: float
    p_value: float
    distance: float
    moved: np.ndarray
    active: tuple[Active, ...]
    torque_error_free: float
    torque_error: float
    prior: str
    seconds: float
    notes: tuple[str, ...]
    sums: TorqueSums | None = field(repr=False)
    _base: BaseParameters = field(repr=False)
    _space: StandardSpace = field(repr=False)
    _constraints: tuple[Constraint, ...] = field(repr=False)
    _found: dict[Any, ProfileIntervals] = field(default_factory=dict, repr=False)

    @property
    def method(self) -> str:
        """Name of the stage's estimate, ``PC-IDIM-PIV``."""
        return f"PC-{self.free.method}"

    @property
    def is_far(self) -> bool:
        """Whether the step to it is improbable and costs much torque: no machine is near."""
        return is_far(self.p_value, self.torque_error_free, self.torque_error)

    @property
    def torque_cost(self) -> float:
        """Relative growth of the torque error over that of the estimate."""
        return self.torque_error / self.torque_error_free - 1.0

    @property
    def base_values(self) -> np.ndarray:
        """All base parameters of the robot at the consistent point, shape (base,)."""
        return self._base.values(self.values)

    @cached_property
    def torque(self) -> InverseDynamics:
        """Torque at the consistent point, of one state (joints,) or of samples [N m or N]."""
        return InverseDynamics(self.robot, self.parameters, self.values)

    @property
    def links(self) -> tuple[LinkBody, ...]:
        """All links that are bodies."""
        names = [self.robot.tree.links[i].name for i in body_links(self.robot)]
        return tuple(
            link_body(name, self.values[place])
            for name, place in zip(names, self._space.links, strict=True)
        )

    def link(self, name: str) -> LinkBody:
        """Mass, centre of mass and inertia of a link, by its name or that of its joint.

        Raises:
            RobotDescriptionError: names the nearest link.
        """
        return self.links[place_of_link(self.robot, name)]

    def value(self, name: str) -> float:
        """A standard parameter by its name.

        Raises:
            UnknownName: there is none; names the nearest ones.
        """
        for p, value in zip(self.parameters, self.values, strict=True):
            if p.name == name:
                return float(value)
        names = [p.name for p in self.parameters]
        raise UnknownName(f"no parameter {name!r}", advice=nearest(name, names))

    def predict(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Torque of the consistent model, shape (samples, joints) [N m or N].

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
        """
        return regressor_of(self.robot, self.parameters).torque(q, dq, ddq, self.values)

    def intervals(self, level: float = 0.95, of: str = "estimated") -> ProfileIntervals:
        """Profile intervals over the consistent parameters, see `profile_intervals`.

        If parameters were left out of the estimate, the intervals can be wider than the free ones,
        which assume that those parameters are exactly zero.

        Args:
            level: probability that an interval holds the true value, between 0 and 1.
            of: ``estimated``: the base parameters of ``theta``; ``base``: all base parameters;
                ``standard``: all standard parameters.

        Raises:
            IdentificationError: another level.
            ExperimentError: another ``of``.
        """
        key = (level, of)
        if key not in self._found:
            self._found[key] = self._intervals(level, of)
        return self._found[key]

    def _intervals(self, level: float, of: str) -> ProfileIntervals:
        base, everything = self._base, np.eye(len(self.parameters))
        if of not in ("estimated", "base", "standard"):
            raise ExperimentError(f"intervals of {of!r}: choose estimated, base or standard")
        if of == "standard":
            directions, chosen = everything, self.parameters
            names = tuple(p.name for p in chosen)
        else:
            directions = everything[base.kept]
            directions[:, base.dropped] += base.regrouping
            chosen, names = base.parameters, base.names
            if of == "estimated":
                place = {p.name: k for k, p in enumerate(chosen)}
                own = [place[p.name] for p in self.free.parameters]
                directions, chosen = directions[own], self.free.parameters
                names = self.names
        low, high = profile_intervals(
            self._space, self._constraints, self.least_distance, directions, level
        )
        return ProfileIntervals(
            names, tuple(p.unit for p in chosen), directions @ self.values, low, high, level
        )

    def headline(self) -> str:
        """The result in one or two sentences."""
        text = (
            f"The estimate of {self.free.method} is physically consistent as it is."
            if self.was_consistent
            else f"The estimate of {self.free.method} is not physically consistent; the least "
            f"distance to consistent parameters is {format_significant(self.least_distance)} σ "
            f"(p = {self.p_value:.2g}), that of the model "
            f"{format_significant(self.distance)} σ."
        )
        if np.isfinite(self.torque_error):
            text += (
                f" Torque error on the fitted record: {100 * self.torque_error_free:.3g} % free, "
                f"{100 * self.torque_error:.3g} % consistent."
            )
        return text

    def table(self) -> Table:
        """Links as bodies: mass, centre of mass, principal moments."""
        return link_table(self.links)

    def moved_table(self) -> Table:
        """Estimated base parameters: free, consistent, moved."""
        moved = np.asarray(self.moved, dtype=float)
        columns = {
            "parameter": Column(self.names),
            "free": Column(np.asarray(self.free.theta, dtype=float), digits=3),
            "free_std": Column(np.asarray(self.free.std, dtype=float), shown="files"),
            "value": Column(np.asarray(self.theta, dtype=float), "consistent", digits=3),
            "moved_sigmas": Column(moved, "moved [σ]", cells=[f"{v:+.2f}" for v in moved]),
            "unit": Column(self.free.units),
        }
        return Table("moved", columns, {"moved_sigmas": "(value - free)/free_std"})

    def __str__(self) -> str:
        parts = [self.headline(), self.table().text(), self.moved_table().text()]
        if self.active:
            parts.append("Held back by:\n" + "\n".join(f"  {a}" for a in self.active))
        return "\n\n".join([*parts, *self.notes])

    def to_values(self) -> dict[str, Any]:
        """The result as plain values, ready for JSON."""
        content = {
            "method": self.method,
            "robot": self.robot.name,
            "prior": self.prior,
            "was_consistent": self.was_consistent,
            "least_distance": self.least_distance,
            "p_value": self.p_value,
            "distance": self.distance,
            "torque_error_free": self.torque_error_free,
            "torque_error": self.torque_error,
            "seconds": self.seconds,
            "standard": [
                {"name": p.name, "value": float(v), "unit": p.unit}
                for p, v in zip(self.parameters, self.values, strict=True)
            ],
            "base": [
                {"name": n, "free": float(f), "value": float(v), "moved": float(m), "unit": u}
                for n, f, v, m, u in zip(
                    self.names, self.free.theta, self.theta, self.moved, self.free.units,
                    strict=True,
                )
            ],
            "links": [
                {
                    "name": b.name,
                    "mass": b.mass,
                    "center_of_mass": b.center_of_mass,
                    "inertia": b.inertia,
                }
                for b in self.links
            ],
            "active": self.active,
            "notes": self.notes,
        }  # fmt: skip
        return plain(content)


def make_consistent(
    identification: Identification,
    *,
    prior: str = "entropic",
    bounds: Bounds | None = None,
    margin: float = MIN_BALL,
    reference: Robot | np.ndarray | None = None,
    room: float = ROOM,
    accept_far: bool = False,
) -> ConsistentModel:
    """The physically consistent parameters nearest to an estimate.

    Args:
        identification: an estimate with its covariance; it is not changed. Without signals its
            ``torque_sums`` are needed to compute the change of the torque error.
        prior: rule that selects among equally near points: ``entropic``, ``euclidean`` or
            ``none``.
        bounds: known bounds of masses and centres of mass.
        margin: diameter of a steel ball [m]; mass and second moments of every link about its own
            centre of mass are at least those of the ball; smaller in links that weigh less than ten
            such balls.
        reference: description with the same joints, or standard parameters, shape (standard,),
            that the prior pulls to; None: the robot's nominal ones.
        room: growth of the squared distance [σ²] left to the prior if the estimate is not
            consistent; the nearest point itself has links that are points, lines or plates. It is
            reduced to a tenth or a hundredth where that lowers the torque error clearly.
        accept_far: return the model even if the estimate is too poor.

    Returns:
        The consistent model, including the free estimate.

    Raises:
        NoConsistentModelNear: the step is improbable and costs much torque; the error has the model
            as an attribute.
        ContradictoryBounds: no parameters satisfy the bounds.
        RobotDescriptionError: bounds of a link that does not exist; a measured base.
        ExperimentError: unknown prior, a margin that is not positive, a reference that does not
            fit.
        IdentificationError: a covariance that cannot serve as a metric.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> result = pv.identify(pv.Problem(robot, (recording,), loop), "piv")
        >>> for link in pv.make_consistent(result).links:
        ...     print(f"{link.name}: {link.mass:.2f} kg")
        upper_arm: 4.00 kg
        forearm: 2.50 kg
    """
    kinds = "give what identify returns; a robot's own values are stored_model(robot)"
    require_kind("identification", identification, Identification, kinds)
    without_base(identification.robot, "physical consistency", "use the estimate as it is")
    if prior not in PRIORS:
        raise ExperimentError(
            f"prior is {prior!r}",
            advice=f"{nearest(str(prior), PRIORS)}; choose one of {', '.join(PRIORS)}",
        )
    if not (np.isfinite(margin) and 0.0 < margin < 1.0):
        raise ExperimentError(
            f"margin is {margin!r}",
            advice="it must be the diameter of the smallest body in a link [m], such as 0.01",
        )
    if not (np.isfinite(room) and room > 0.0):
        raise ExperimentError(
            f"room is {room!r}", advice="it must be a positive growth of d² [σ²], such as 1"
        )
    sums = _sums(identification)
    base = base_parameters(identification.robot)
    began = time.perf_counter()
    near = make_reference(
        identification.robot,
        base.standard,
        margin,
        reference,
        density_of_estimate(base, estimated_in_base(identification, base)),
    )
    metric = make_metric(identification, base, sums, near.scales[base.kept])
    constraints = make_constraints(identification.robot, base.standard, near, bounds)
    plausible = plausible_bodies(
        identification.robot, base.standard, near, bounds, identification.is_in_newton_metres
    )
    space = standard_space(identification.robot, metric, near)

    def nearby(left: float) -> Nearest:
        return nearest_consistent(
            space, constraints, near, prior, plausible, left,
            lambda values: _torque_errors(sums, metric.center, base.values(values))[1],
        )  # fmt: skip

    found = nearby(room)
    errors = _torque_errors(sums, metric.center, base.values(found.values))
    for narrower in (0.1, 0.01):
        if found.was_consistent or not errors[1] > (1.0 + NOTABLE_COST) * errors[0]:
            break
        nearer = nearby(narrower * room)
        left = _torque_errors(sums, metric.center, base.values(nearer.values))
        if not errors[1] > (1.0 + NOTABLE_COST) * left[1]:  # bodies degenerate for nothing
            break
        found, errors = nearer, left
    seconds = time.perf_counter() - began
    values, beta = found.values, base.values(found.values)
    p_value = probability(found.least_distance, found.directions, len(base))
    model = ConsistentModel(
        free=identification,
        robot=identification.robot,
        parameters=base.standard,
        values=values,
        names=identification.names,
        theta=beta[metric.estimated],
        was_consistent=found.was_consistent,
        least_distance=found.least_distance,
        p_value=p_value,
        distance=found.distance,
        moved=(beta - metric.center)[metric.estimated] / identification.free_std,
        active=found.active,
        torque_error_free=errors[0],
        torque_error=errors[1],
        prior=prior,
        seconds=seconds,
        notes=(
            *near.notes,
            *metric.notes,
            *cost_notes(errors, p_value),
            *found.notes,
            *total_at_its_limit(plausible, values, near.values),
            *identification.scale_warnings,
        ),
        sums=sums,
        _base=base,
        _space=space,
        _constraints=constraints,
    )
    if model.is_far and not accept_far:
        raise NoConsistentModelNear(
            model.least_distance,
            model.p_value,
            *errors,
            list(dict.fromkeys(a.subject for a in model.active)),
            model,
        )
    return model


def _sums(identification: Identification) -> TorqueSums | None:
    """Torque sums stored in the estimate, or of its signals; None without both."""
    if identification.torque_sums is not None:
        return identification.torque_sums
    return torque_sums(identification) if identification.recordings else None


def _torque_errors(
    sums: TorqueSums | None, free: np.ndarray, consistent: np.ndarray
) -> tuple[float, float]:
    """Relative torque errors of two sets of base parameters; NaN without sums."""
    if sums is None:
        return np.nan, np.nan
    return sums.relative_error(free), sums.relative_error(consistent)
