"""Identification with friction laws whose shape constants are unknown.

The iteration wraps any estimator: the parameters are estimated with the constants of the last pass,
the constants are then estimated from the same equations (same signals, instruments, prefilters,
valid samples and weights), joint by joint, until both converge. The sandwich covariance covers
parameters and constants together, so the interval of a friction level accounts for the uncertainty
of its Stribeck speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify, narrowed
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.methods import method_named
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError, UnknownName
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.numbers import format_significant, plain_table
from pivident.studies.friction_laws.filtered_rows import LastPass, ShapedRows
from pivident.studies.friction_laws.shape_constants import (
    ShapeConstant,
    chosen_names,
    shape_constants,
    with_shapes,
)
from pivident.studies.friction_laws.variable_projection import (
    CHI2,
    STILL,
    Profile,
    Projection,
    SeparableSearch,
)

#: Maximum number of passes of estimate and search.
MAX_PASSES = 8

#: A step smaller than this share of its standard error ends the passes.
SETTLED = 0.1


@dataclass(frozen=True, eq=False)
class IdentifiedShape:
    """One shape constant and its uncertainty."""

    constant: ShapeConstant  # joint, name, unit, bounds and estimate
    std: float  # standard error [unit of the constant]
    low: float  # lower end of the 95 % interval [unit]; the bound if the data set none
    high: float  # upper end, likewise
    profile: Profile  # the least-squares criterion along it
    open_low: bool  # whether the criterion does not rise down to the lower bound
    open_high: bool  # whether it does not rise up to the upper bound

    @property
    def value(self) -> float:
        """The estimate."""
        return self.constant.value

    @property
    def label(self) -> str:
        """Name with its joint, ``stribeck_speed[carriage]``."""
        return self.constant.label

    @property
    def identifiable(self) -> bool:
        """Whether the record bounds it on both sides."""
        return not (self.open_low or self.open_high)

    @property
    def note(self) -> str:
        """A warning if the record does not bound it, else empty."""
        if self.identifiable:
            return ""
        ends = {(True, False): "smaller", (False, True): "larger"}
        side = ends.get((self.open_low, self.open_high), "any other")
        return (
            f"{self.label} is not identifiable from this record: {side} values fit as well, down "
            "or up to its bound. Give it, leave its term out, or record slower and smaller motion."
        )


@dataclass(frozen=True, eq=False)
class ShapedIdentification(Displayed):
    """Parameters and constants of shape, estimated together.

    Attributes:
        identification: the estimate with the constants found; its covariance knows that they are
            estimates.
        problem: the problem with the constants found in the robot's friction laws.
        shapes: the constants.
        covariance: of parameters and constants together, the sandwich, shape
            (parameters + constants,) squared, in their units.
        formula_covariance: the same for white residuals, shape
            (parameters + constants,) squared.
        passes: how often estimate and search were repeated.
        converged: whether both stood still.
    """

    # the estimate with these constants; its covariance includes their uncertainty
    identification: Identification
    problem: Problem  # the problem with the estimated constants in the robot's friction laws
    shapes: tuple[IdentifiedShape, ...]  # the constants
    # sandwich covariance of parameters and constants, (parameters + constants,) squared, in their
    # units
    covariance: np.ndarray
    formula_covariance: np.ndarray  # the same for white residuals
    passes: int  # number of passes of estimate and search
    converged: bool

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about constants that are not identifiable or have not converged."""
        notes = [s.note for s in self.shapes if s.note]
        if not self.converged:
            notes.append(f"The shape constants did not converge in {self.passes} passes.")
        return tuple(notes)

    def shape(self, name: str, joint: str | None = None) -> IdentifiedShape:
        """One constant by its name and, where several joints have it, its joint.

        Raises:
            UnknownName: there is none, or there are several.
        """
        found = [
            s
            for s in self.shapes
            if s.constant.name == name and joint in (None, s.constant.joint_name)
        ]
        if len(found) != 1:
            raise UnknownName(
                f"{len(found)} constants are called {name!r}",
                advice=f"there are {', '.join(s.label for s in self.shapes)}",
            )
        return found[0]

    def table(self) -> str:
        """The constants as a plain table."""
        return plain_table(
            [
                ("constant", "<", [s.label for s in self.shapes]),
                ("value", ".", [format_significant(s.value, 4) for s in self.shapes]),
                ("from", ".", [format_significant(s.low, 3) for s in self.shapes]),
                ("to (95 %)", ".", [format_significant(s.high, 3) for s in self.shapes]),
                ("unit", "<", [s.constant.unit for s in self.shapes]),
            ]
        )

    def __str__(self) -> str:
        return "\n\n".join([str(self.identification), self.table(), *self.notes])


def identify_shapes(
    problem: Problem,
    method: Method | str = "piv",
    names: Mapping[str, Sequence[str]] | Sequence[str] | None = None,
    *,
    grid: bool = True,
    profiles: bool = True,
    progress: Callable[[str], None] | None = None,
) -> ShapedIdentification:
    """Estimate a problem's parameters and the shape constants of its friction laws.

    Args:
        problem: the identification problem; the search starts at the constants of its laws.
        method: a method or its name.
        names: constants by joint name, ``{"carriage": ["stribeck_speed"]}``; a list: those of
            every joint that has them; None: all that are free. ``gamma`` is the slope of the
            smoothed signs.
        grid: whether the start is searched over the whole range of each constant.
        profiles: whether the criterion along each constant is kept, which shows whether the record
            bounds it.
        progress: called with one line at each stage.

    Returns:
        The constants with their standard errors, the problem with them, and its estimate.

    Raises:
        ExperimentError: an unknown joint or constant, or nothing to identify.
        IdentificationError: the method fails, or has no equations for constants (DIDIM).
    """
    say = progress or (lambda line: None)
    method = method_named(method)
    if method.fits_simulation:
        raise IdentificationError(
            f"{method.label} fits shape constants itself: name them in free, such as free = "
            "('gamma',), and call identify"
        )
    if not method.handles.shape_constants:
        raise IdentificationError(
            f"{method.label} has no equations for shape constants, which need the measured motion",
            advice="identify them with 'ls' or 'piv', and use their values with it",
        )
    names_of = chosen_names(problem.robot, names)
    constants: dict[int, list[ShapeConstant]] = {}
    found, state = None, None
    converged = False
    for number in range(1, MAX_PASSES + 1):
        wide = grid and number == 1
        # a prefilter made for the residual of wrong constants removes the information about them
        used = LeastSquares(signals=method.signals) if wide else method
        found = identify(problem, used)
        problem = narrowed(problem, found)
        state = _State(problem, used, found)
        if not constants:
            motions = [r.kinematics for r in state.equations.records]
            constants = {
                j: shape_constants(problem.robot, j, own, motions) for j, own in names_of.items()
            }
        searched = {j: state.search(own, wide) for j, own in constants.items()}
        moved = max(_moved(constants[j], s) for j, (_, s) in searched.items())
        say(f"pass {number}: shape constants change by {moved:.2g} of their smallest steps")
        if moved <= 1.0 and number > 1:
            converged = found.converged and all(s.converged for _, s in searched.values())
            break
        if number == MAX_PASSES:
            break
        constants |= {j: list(own.rows.values(s.coordinates)) for j, (own, s) in searched.items()}
        shaped = with_shapes(problem.robot, [c for own in constants.values() for c in own])
        start = dict(zip(problem.names, state.theta, strict=True))
        problem = replace(problem, robot=shaped, initial=dict(problem.initial) | start)
    assert found is not None and state is not None
    return _answer(problem, found, state, constants, number, converged, profiles)


class _State:
    """The equations of the last estimate, and the sums of all joints."""

    def __init__(self, problem: Problem, method: Method, found: Identification) -> None:
        self.problem, self.theta = problem, found.theta
        self.last = LastPass.of(problem, method, found)
        self.equations = self.last.equations
        self.sums = self.last.sums()

    def search(
        self, constants: Sequence[ShapeConstant], grid: bool
    ) -> tuple[SeparableSearch, Projection]:
        """The constants of one joint, with the sums of the other joints fixed."""
        own = self.searcher(constants)
        u = np.array([c.coordinate(c.value) for c in constants])
        found = own.search(u, self.equations.has_instruments, grid)
        self.sums[constants[0].joint] = own.rows.sums(found.coordinates)
        self.theta = found.theta
        return own, found

    def searcher(self, constants: Sequence[ShapeConstant]) -> SeparableSearch:
        """The search for one joint's constants."""
        j, eq = constants[0].joint, self.equations
        rows = ShapedRows(self.last, self.problem.robot, constants)
        joints = [i for i in range(len(self.sums)) if i != j]
        others = [self.sums[i] for i in joints]
        return SeparableSearch(rows, others, joints, eq.variance, eq.size, eq.weight_power)


def _moved(constants: Sequence[ShapeConstant], found: Projection) -> float:
    """Change of the constants in units of the smallest step that matters."""
    u = np.array([c.coordinate(c.value) for c in constants])
    scale = np.array([1.0 if c.logarithmic else 0.1 * c.span for c in constants])
    spread = np.where(np.isfinite(found.std), found.std, 10.0)
    smallest = np.maximum(SETTLED * spread, STILL * scale)
    return float(np.max(np.abs(found.coordinates - u) / smallest))


def _answer(
    problem: Problem,
    found: Identification,
    state: _State,
    constants: Mapping[int, Sequence[ShapeConstant]],
    passes: int,
    converged: bool,
    profiles: bool,
) -> ShapedIdentification:
    """Joint covariance, and intervals of the constants."""
    eq, theta = state.equations, found.theta
    state.sums = state.last.sums()
    searchers = {j: state.searcher(own) for j, own in constants.items()}
    joint_sums = list(state.sums)
    listed: list[ShapeConstant] = []
    for j, own in constants.items():
        u = np.array([c.coordinate(c.value) for c in own])
        joint_sums[j] = searchers[j].rows.windowed_sums(u, theta, len(listed))
        listed += list(own)
    unknowns = np.r_[theta, np.zeros(len(listed))]
    try:
        robust = sandwich(joint_sums, unknowns, eq.variance, eq.weight_power)
    except np.linalg.LinAlgError as error:
        values = ", ".join(f"{c.label} = {c.value:.3g}" for c in listed)
        raise IdentificationError(
            f"with {values} one of these constants has no effect, so its interval cannot be "
            "computed",
            advice="fix its value, or leave its term out of the law",
        ) from error
    formula = _formula(joint_sums, eq.variance, unknowns.size)
    slopes = np.r_[np.ones(theta.size), [c.slope(c.value) for c in listed]]
    covariance, formula = (x * np.outer(slopes, slopes) for x in (robust, formula))
    shapes: list[IdentifiedShape] = []
    for j, own in constants.items():
        u = np.array([c.coordinate(c.value) for c in own])
        for i, c in enumerate(own):
            k = theta.size + len(shapes)
            spread = float(np.sqrt(robust[k, k]))
            excess = covariance[k, k] / max(formula[k, k], 1e-300)
            profile = searchers[j].profile(u, i) if profiles else Profile(np.empty(0), np.empty(0))
            shapes.append(_shape(c, spread, max(excess, 1.0), profile))
    n = theta.size
    return ShapedIdentification(
        replace(
            found,
            covariance=covariance[:n, :n],
            robust_covariance=covariance[:n, :n],
            formula_covariance=formula[:n, :n],
            warnings=(
                *found.warnings,
                *(Finding("warning", "shape", "searched", s.note) for s in shapes if s.note),
            ),
        ),
        problem,
        tuple(shapes),
        covariance,
        formula,
        passes,
        converged,
    )


def _shape(c: ShapeConstant, spread: float, excess: float, profile: Profile) -> IdentifiedShape:
    """Interval of one constant: u ± 2σ, or to the bound where the criterion does not rise."""
    u = c.coordinate(c.value)
    rises = profile.increase > CHI2 * excess
    below, above = profile.values < c.value, profile.values > c.value
    open_low = bool(profile.values.size and not (rises & below).any())
    open_high = bool(profile.values.size and not (rises & above).any())
    return IdentifiedShape(
        c,
        spread * c.slope(c.value),
        c.low if open_low else c.at(u - 2.0 * min(spread, 1e3)),
        c.high if open_high else c.at(u + 2.0 * min(spread, 1e3)),
        profile,
        open_low,
        open_high,
    )


def _formula(sums: Sequence[JointSums], variance: np.ndarray, size: int) -> np.ndarray:
    """(Σ_j Z̃ᵀZ̃/λ_j)⁻¹ over parameters and constants."""
    zz = np.zeros((size, size))
    for joint, lam in zip(sums, variance, strict=True):
        zz[np.ix_(joint.columns, joint.columns)] += joint.zz / lam
    scale = np.sqrt(np.diag(zz))
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.linalg.pinv(zz / np.outer(scale, scale), rcond=1e-14, hermitian=True) / np.outer(
        scale, scale
    )
