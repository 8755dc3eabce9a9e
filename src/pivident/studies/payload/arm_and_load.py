"""The unknowns of the loaded record, arm, friction and load, and what is known of them before.

    θ_empty = M₁ x,      θ_loaded = M₂ x,      x = (θ, ΔF, ξ)

θ are the base parameters of the arm, known from the record without load to θ̂₁ ± P₁; ΔF is the
change of the friction under load (Khalil, Gautier and Lemoine 2007 assume zero); ξ are coordinates
of the ten parameters of the load, π = V ξ, in the directions that affect the torques of this arm.
The load adds B π to the base parameters of the arm, with the regrouping of Khalil and Gautier, so
M₂ = [1, F, B V].

The known arm enters as (θ - θ̂₁)ᵀ P₁⁻¹ (θ - θ̂₁). This gives the estimate from both records at once,
because the normal equations of the first record contain all its information about θ. An arm that
was identified long before can be used as well, and the loaded record need not excite all of θ.

Known parts of a load: its mass from a scale, its shape from a drawing.

Each known number is one linear equation in the ten inertial parameters. With m₀, c₀ and I₀ known,

    m = m₀ ± σ,      h - c₀ m = 0 ± σ_c m,      J - 2 S(c₀, h) + m S(c₀, c₀) = I₀ ± σ_I.

The last one is J = I + S(h, h)/m to first order in δ = h/m - c₀. The true centre of mass is not c₀,
but c₀ + δ with δ = 0 ± σ_c, and the inertia is known about the true one; the remainder m S(δ, δ),
with a root mean square of √8 m σ_c² for moments and m σ_c² for products, is added to σ_I. If the
mass is unknown, σ_c is multiplied by the mass of an estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.estimation.drives.known_payload import Payload, check_body
from pivident.estimation.identification import Identification
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.robot.frames import Pose
from pivident.robot.inertia import elements, steiner
from pivident.studies.payload.load_estimate import NATURAL, seen_from

#: Weak priors that keep undetermined directions finite: a load is below a thousand natural sizes
#: (a tonne; 100 m kg), friction under load changes by less than ten times its size.
WEAK_LOAD, WEAK_FRICTION = 1e3, 10.0
#: Relative length below which the torques of an arm do not depend on a direction of π.
NO_TORQUE = 1e-9
#: Smallest eigenvalue of a correlation matrix, over its largest, above rounding errors.
SINGULAR = 1e-14
#: Standard deviation assigned to an exact number, as a share of its natural size.
EXACT = 1e-6
#: Mass [kg] assumed for an unknown one before there is an estimate: a known centre of mass is then
#: weak, and the torques determine the mass.
BEFORE_AN_ESTIMATE = 1e3
#: Root mean square of the elements xx xy xz yy yz zz of S(δ, δ) for δ of unit variance.
SECOND_ORDER = np.sqrt([8.0, 1.0, 1.0, 8.0, 1.0, 8.0])


@dataclass(frozen=True, eq=False)
class KnownParts(Displayed):
    """Known numbers of a load in one frame; None: to be estimated.

    Attributes:
        mass: m [kg].
        mass_std: its standard deviation [kg]; zero: exact.
        center_of_mass: c [m], shape (3,).
        center_of_mass_std: of each coordinate [m].
        inertia: xx xy xz yy yz zz about the centre of mass [kg m²], shape (6,).
        inertia_std: of each element [kg m²].
    """

    mass: float | None = None
    mass_std: float = 0.0
    center_of_mass: Sequence[float] | None = None
    center_of_mass_std: float = 0.0
    inertia: Sequence[float] | None = None
    inertia_std: float = 0.0

    def __post_init__(self) -> None:
        check_body("load", self.mass, self.center_of_mass, self.inertia)
        for key in ("mass", "center_of_mass", "inertia"):
            std = getattr(self, f"{key}_std")
            if not (np.isfinite(std) and std >= 0):
                raise ExperimentError(
                    f"{key}_std of the load is {std}", advice="it cannot be negative"
                )
            if std > 0 and getattr(self, key) is None:
                raise ExperimentError(
                    f"{key}_std of the load is given without {key}", advice="add it"
                )

    @property
    def needs_mass(self) -> bool:
        """Whether the standard deviations of the equations depend on an unknown mass."""
        return self.mass is None and self.center_of_mass is not None

    def equations(
        self, estimated_mass: float = BEFORE_AN_ESTIMATE
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """H π = y ± σ.

        Args:
            estimated_mass: root mean square of the mass [kg] if it is unknown.

        Returns:
            H, shape (equations, 10); y and σ, shape (equations,).
        """
        rows, right, std = [np.zeros((0, 10))], [np.zeros(0)], [np.zeros(0)]
        size = estimated_mass
        if self.mass is not None:
            size = float(np.hypot(self.mass, self.mass_std))
            rows.append(np.eye(10)[9:])
            right.append(np.array([self.mass]))
            std.append(np.array([max(self.mass_std, EXACT * self.mass)]))
        if self.center_of_mass is not None:
            centre = np.asarray(self.center_of_mass, dtype=float)
            first_moments = np.eye(10)[6:9]
            first_moments[:, 9] = -centre
            rows.append(first_moments)
            right.append(np.zeros(3))
            std.append(np.full(3, size * max(self.center_of_mass_std, EXACT * 0.1)))
            if self.inertia is not None:
                about_centre = np.eye(10)[:6]
                for k in range(3):
                    about_centre[:, 6 + k] = -2.0 * elements(steiner(centre, np.eye(3)[k]))
                about_centre[:, 9] = elements(steiner(centre, centre))
                rows.append(about_centre)
                right.append(np.asarray(self.inertia, dtype=float))
                left_out = SECOND_ORDER * size * self.center_of_mass_std**2
                std.append(np.hypot(max(self.inertia_std, EXACT * 0.01), left_out))
        return np.vstack(rows), np.concatenate(right), np.concatenate(std)


@dataclass(frozen=True, eq=False)
class ArmAndLoad:
    """The unknowns of a loaded record, and the prior knowledge about them."""

    problem: Problem  # robot, loaded recordings and loop, with all parameters that θ_loaded needs
    selected: np.ndarray  # indices of the arm's parameters in those of the problem, shape (arm,)
    friction: np.ndarray  # indices of the arm's parameters whose change under load is estimated
    basis: np.ndarray  # V, shape (10, r)
    # directions of π that neither torques nor known parts determine, shape (10, 10 - r)
    structural: np.ndarray
    loaded_map: np.ndarray  # M₂, shape (parameters of the problem, unknowns)
    # information of arm, known parts and weak priors, shape (unknowns, unknowns)
    information: np.ndarray
    right: np.ndarray  # information times the known values, shape (unknowns,)
    arm_theta: np.ndarray  # θ̂₁, shape (arm,)
    arm_information: np.ndarray  # P₁⁻¹ as the normal equations have it, shape (arm, arm)
    arm_covariance: np.ndarray  # covariance of θ̂₁ as reported, shape (arm, arm)
    known: KnownParts  # known parts of the load
    known_rows: np.ndarray  # H V of its equations, shape (equations, r)
    weak_load: np.ndarray  # information of the weak prior of ξ, shape (r, r)

    @property
    def arm_part(self) -> slice:
        """Indices of θ in x."""
        return slice(0, self.arm_theta.size)

    @property
    def friction_part(self) -> slice:
        """Indices of ΔF in x."""
        return slice(self.arm_theta.size, self.arm_theta.size + self.friction.size)

    @property
    def load_part(self) -> slice:
        """Indices of ξ in x."""
        return slice(self.arm_theta.size + self.friction.size, self.loaded_map.shape[1])

    @property
    def empty_theta(self) -> np.ndarray:
        """The arm without load, in the parameters of the problem."""
        theta = np.zeros(self.loaded_map.shape[0])
        theta[self.selected] = self.arm_theta
        return theta

    def mass_size(self, x: np.ndarray, covariance: np.ndarray) -> float:
        """Root mean square of the load's mass by an estimate and its covariance [kg]."""
        own, row = self.load_part, self.basis[9]
        return float(np.sqrt((row @ x[own]) ** 2 + row @ covariance[own, own] @ row))

    def at_mass(self, mass: float) -> ArmAndLoad:
        """The same with the standard errors of the known parts for a mass of this size [kg]."""
        own = self.load_part
        _, values, std = self.known.equations(mass)
        information, right = self.information.copy(), self.right.copy()
        weighted = self.known_rows / std[:, None]
        information[own, own] = weighted.T @ weighted + self.weak_load
        right[own] = weighted.T @ (values / std)
        return replace(self, information=information, right=right)


def arm_and_load(
    arm: Identification,
    problem: Problem,
    link: int,
    known: KnownParts,
    frame: Pose,
    friction_under_load: bool,
) -> ArmAndLoad:
    """Separate known from unknown parameters of the loaded arm.

    ``frame``: frame of the known parts in that of the link. ``friction_under_load``: friction may
    be different with the load.
    """
    names = [p.name for p in problem.regressor.parameters]
    selected = np.array([names.index(p.name) for p in arm.parameters])
    columns = load_columns(problem.base, link)[list(problem.selection)]
    rows = known.equations()[0] @ seen_from(frame)
    basis, structural = _determined_directions(columns, rows)
    movable = [
        k for k, p in enumerate(arm.parameters) if friction_under_load and not p.carries_load
    ]
    friction = np.array(movable, dtype=int)
    size = len(names)
    loaded_map = np.hstack(
        [np.eye(size)[:, selected], np.eye(size)[:, selected[friction]], columns @ basis]
    )
    arm_information = _information(arm)
    n, f = selected.size, friction.size
    information = np.zeros((loaded_map.shape[1],) * 2)
    right = np.zeros(loaded_map.shape[1])
    information[:n, :n] = arm_information
    right[:n] = arm_information @ arm.theta
    weak = WEAK_FRICTION * _friction_sizes(arm)[friction]
    information[n : n + f, n : n + f] = np.diag(weak**-2)
    in_natural_sizes = basis / NATURAL[:, None] / WEAK_LOAD
    return ArmAndLoad(
        problem, selected, friction, basis, structural, loaded_map, information, right,
        arm.theta, arm_information, _reported(arm),
        known, rows @ basis, in_natural_sizes.T @ in_natural_sizes,
    ).at_mass(BEFORE_AN_ESTIMATE)  # fmt: skip


def load_columns(base: BaseParameters, link: int) -> np.ndarray:
    """B: change of all base parameters per parameter of the load, shape (base, 10)."""
    return Payload(mass=1.0, link=link).base_columns(base)


def widened(arm: Identification, base: BaseParameters, link: int) -> tuple[str, ...]:
    """Names of the parameters that a loaded record needs: the arm's, and those a load changes."""
    touched = np.abs(load_columns(base, link)).sum(axis=1) > 0
    estimated = {p.name for p in arm.parameters}
    return tuple(p.name for k, p in enumerate(base.parameters) if touched[k] or p.name in estimated)


def reduced(sums: Sequence[JointSums], unknowns: ArmAndLoad) -> list[JointSums]:
    """Normal equations in x, from those in θ_loaded = M₂ x."""
    every = np.arange(unknowns.loaded_map.shape[1])
    made = []
    for own in sums:
        M = unknowns.loaded_map[own.columns]
        made.append(
            JointSums(
                own.name,
                every,
                M.T @ own.zf @ M,
                M.T @ own.zz @ M,
                M.T @ own.ff @ M,
                M.T @ own.zt,
                M.T @ own.ft,
                M.T @ own.window_zf @ M,
                own.window_zt @ M,
                own.tt,
                own.rows,
            )
        )
    return made


def _determined_directions(columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of π determined by torques or known parts, and the rest, in natural sizes."""
    stack = np.vstack([columns * NATURAL, rows * NATURAL])
    length = np.linalg.norm(stack, axis=1, keepdims=True)
    _, values, right = np.linalg.svd(stack / np.where(length > 0, length, 1.0))
    rank = int(np.sum(values > NO_TORQUE * max(values[0], 1e-300)))
    return right[:rank].T * NATURAL[:, None], right[rank:].T * NATURAL[:, None]


def _reported(arm: Identification) -> np.ndarray:
    """Covariance for residuals of any colour, if the arm has one."""
    robust = arm.robust_covariance
    return robust if np.isfinite(robust).all() else arm.covariance


def _friction_sizes(arm: Identification) -> np.ndarray:
    """Size of each friction parameter, at least a tenth of the largest one of its kind."""
    size = np.abs(arm.theta) + arm.std
    stems = [p.stem for p in arm.parameters]
    largest = {s: max(v for v, t in zip(size, stems, strict=True) if t == s) for s in stems}
    return np.array([max(v, 0.1 * largest[s], 1e-9) for v, s in zip(size, stems, strict=True)])


def _information(arm: Identification) -> np.ndarray:
    """Inverse of the covariance of parameters that differ by orders of magnitude."""
    scale = np.sqrt(np.maximum(np.diag(arm.formula_covariance), 0.0))
    exact = [name for name, one in zip(arm.names, scale, strict=True) if not 0.0 < one < np.inf]
    if exact:
        raise IdentificationError(
            f"the arm without load has no standard error of {', '.join(exact[:4])}",
            advice="identify it again, or give its record together with the one with the load",
        )
    correlation = arm.formula_covariance / np.outer(scale, scale)
    variances, directions = np.linalg.eigh(0.5 * (correlation + correlation.T))
    if not variances[0] > SINGULAR * variances[-1]:
        share = np.abs(directions[:, 0])
        together = [arm.names[k] for k in np.argsort(-share)[:4] if share[k] > 0.1]
        raise IdentificationError(
            "the covariance of the arm without load is singular: it gives a combination of "
            f"{', '.join(together)} a standard error of zero, which no record can. Identify the "
            "arm again, or give its record together with the one with the load"
        )
    inverse = np.linalg.inv(correlation) / np.outer(scale, scale)
    return 0.5 * (inverse + inverse.T)
