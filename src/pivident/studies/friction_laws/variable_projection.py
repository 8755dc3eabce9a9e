"""Shape constants of one joint by variable projection (Golub and Pereyra 1973).

For given constants s the parameters follow linearly, so only s is searched. With least squares
it is the minimum of the concentrated criterion

    C(s) = min over θ of Σ_j ‖τ_j - Φ_j(s) θ‖²/λ_j

With instruments there is no criterion to minimise: (θ, s) solve the moment equations

    Σ_j Z̃_jᵀ (τ_j - Φ_j(s) θ)/λ_j = 0,    Z̃ = (Z(s), ∂Z/∂u θ) of the simulated motion

and the minimum of C on the same equations is only the start of their Newton iteration. Both take
the same step: the solution (θ, δu) of the equations linearised around s. C may have several minima,
so the search starts from the best point of a grid along each constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from pivident.estimation.normal_equations import JointSums
from pivident.studies.friction_laws.filtered_rows import ShapedRows

#: The search ends where a step is smaller than this share of a standard error …
SETTLED = 0.02

#: … or than this in u: 0.01 % of a positive constant.
STILL = 1e-4

#: Largest step in u: a factor of e, or a tenth of the bounds' distance of other constants.
MAX_STEP = 1.0

#: Maximum number of iterations.
MAX_STEPS = 40

#: Number of points of a coarse grid over several constants from which the search starts.
STARTS = 3

#: χ² of one degree of freedom at 95 %.
CHI2 = 3.841

_RCOND = 1e-13


@dataclass(frozen=True, eq=False)
class Profile:
    """The criterion along one constant, the others and θ at their best for each value."""

    values: np.ndarray  # of the constant, ascending, shape (points,)
    increase: np.ndarray  # C(s) - C(ŝ), in variances of the residual, likewise


@dataclass(frozen=True, eq=False)
class Projection:
    """Constants of one joint at the solution."""

    coordinates: np.ndarray  # u of each constant, shape (constants,)
    theta: np.ndarray  # all parameters at these constants, shape (parameters,)
    step: np.ndarray  # the last step δu, shape (constants,)
    std: np.ndarray  # standard errors of u by the formula for white residuals, likewise
    steps: int  # number of steps
    converged: bool


class SeparableSearch:
    """Search for one joint's constants with the equations of the other joints fixed.

    ``others`` are the normal equations of the joints numbered ``joints``, ``variance`` is λ of all
    joints, ``size`` the number of parameters; for ``weight_power`` see ``solve``.
    """

    def __init__(
        self,
        rows: ShapedRows,
        others: Sequence[JointSums],
        joints: Sequence[int],
        variance: np.ndarray,
        size: int,
        weight_power: float = 1.0,
    ) -> None:
        self.rows, self.size, self.power = rows, size, weight_power
        self.lam = float(variance[rows.joint])
        self._rest = _Weighted.zeros(size + len(rows.constants))
        for sums, j in zip(others, joints, strict=True):
            self._rest.add(sums, float(variance[j]), weight_power)

    def search(self, u: np.ndarray, instruments: bool, grid: bool) -> Projection:
        """The constants that solve the equations, from u.

        ``instruments``: the moment equations decide, not the criterion. ``grid``: search the
        minimum of the criterion from the best point of grids.
        """
        if grid:
            # instruments simulated with constants that may be far off would mislead: not yet
            ends = [self.minimise(start) for start in [u, self.start(u), *self._spread(u)]]
            return min(ends, key=lambda end: self.criterion(end.coordinates))
        return self.solve_moments(u) if instruments else self.minimise(u)

    def _spread(self, u: np.ndarray) -> list[np.ndarray]:
        """Best points of a coarse grid over all constants, if there are several constants."""
        if u.size == 1:
            return []
        lines = [[c.coordinate(float(v)) for v in c.grid()[1::2]] for c in self.rows.constants]
        return sorted([np.array(point) for point in product(*lines)], key=self.criterion)[:STARTS]

    def criterion(self, u: np.ndarray) -> float:
        """C at coordinates u, θ being the least-squares solution."""
        total = self._rest.plus(self.rows.sums(u), self.lam, self.power)
        return float(total.tt - least_norm_solution(total.ff, total.ft) @ total.ft)

    def start(self, u: np.ndarray) -> np.ndarray:
        """Best point of the grids, constant by constant, twice if there are several constants."""
        best, lowest = u.copy(), self.criterion(u)
        for _ in range(1 if u.size == 1 else 2):
            before = lowest
            for i, constant in enumerate(self.rows.constants):
                for value in constant.grid():
                    trial = best.copy()
                    trial[i] = constant.coordinate(float(value))
                    if (found := self.criterion(trial)) < lowest:
                        best, lowest = trial, found
            if lowest == before:
                break
        return best

    def minimise(self, u: np.ndarray, free: Sequence[int] | None = None) -> Projection:
        """Gauss–Newton steps down the concentrated criterion from u, ``free`` constants moving."""
        lowest = self.criterion(u)
        for k in range(MAX_STEPS):
            theta, step, std = self._linearised(u, False, free)
            if self._still(step, std):
                return Projection(u, theta, step, std, k, True)
            for halving in range(12):
                trial = self._inside(u + self._limited(step) * 0.5**halving)
                found = self.criterion(trial)
                if found < lowest:
                    break
            else:  # nothing lower along the step: a corner, a bound, or rounding errors
                return Projection(u, theta, step, std, k, True)
            gained = lowest - found
            u, lowest = trial, found
            if gained < 1e-6:
                return Projection(u, theta, step, std, k + 1, True)
        return Projection(u, theta, step, std, MAX_STEPS, False)

    def solve_moments(self, u: np.ndarray) -> Projection:
        """Newton steps on the moment equations from u; each at most a factor of e."""
        shrink = 1.0
        previous: np.ndarray | None = None
        for k in range(MAX_STEPS):
            theta, step, std = self._linearised(u, True, None)
            if self._still(step, std):
                return Projection(u, theta, step, std, k, True)
            if previous is not None and float(step @ previous) < 0.0:
                shrink = max(0.5 * shrink, 1.0 / 64.0)  # oscillating steps: shorten them
            trial = self._inside(u + shrink * self._limited(step))
            if np.array_equal(trial, u):  # at a bound that it would cross
                return Projection(u, theta, step, std, k, True)
            previous, u = step, trial
        return Projection(u, theta, step, std, MAX_STEPS, False)

    def profile(self, u: np.ndarray, i: int) -> Profile:
        """Increase of C along constant i, from the minimum in both directions."""
        constant, lowest = self.rows.constants[i], self.criterion(u)
        grid = np.array([constant.coordinate(float(v)) for v in constant.grid()])
        others = [k for k in range(u.size) if k != i]
        points = {float(u[i]): 0.0}
        for side in (grid[grid > u[i]], grid[grid < u[i]][::-1]):
            trial = u.copy()
            for value in side:
                trial = trial.copy()
                trial[i] = value
                if others:
                    trial = self.minimise(trial, others).coordinates
                points[float(value)] = self.criterion(trial) - lowest
        order = sorted(points)
        return Profile(
            np.array([constant.at(x) for x in order]), np.array([points[x] for x in order])
        )

    def _linearised(
        self, u: np.ndarray, instruments: bool, free: Sequence[int] | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """θ at u, the step δu, and standard errors of u."""
        plain = self._rest.plus(self.rows.sums(u), self.lam, self.power)
        n = self.size
        gram, right = (plain.zf, plain.zt) if instruments else (plain.ff, plain.ft)
        theta = least_norm_solution(gram[:n, :n], right[:n])
        full = self._rest.plus(self.rows.sums(u, theta), self.lam, self.power)
        gram, right = (full.zf, full.zt) if instruments else (full.ff, full.ft)
        active = np.r_[:n, n + np.array(range(u.size) if free is None else list(free), int)]
        solution = np.zeros(n + u.size)
        solution[active] = least_norm_solution(gram[np.ix_(active, active)], right[active])
        spread = _standard_errors(full.zz if instruments else full.ff)[n:]
        return theta, solution[n:], spread

    def _still(self, step: np.ndarray, std: np.ndarray) -> bool:
        return bool(np.all(np.abs(step) < np.maximum(SETTLED * std, STILL * self._scales())))

    def _scales(self) -> np.ndarray:
        """Size of a large step of each constant."""
        return np.array([MAX_STEP if c.logarithmic else 0.1 * c.span for c in self.rows.constants])

    def _limited(self, step: np.ndarray) -> np.ndarray:
        """The step, scaled down as a whole where one constant would move too far."""
        return step / max(1.0, float(np.max(np.abs(step) / self._scales())))

    def _inside(self, u: np.ndarray) -> np.ndarray:
        return np.array(
            [c.coordinate(c.at(float(x))) for c, x in zip(self.rows.constants, u, strict=True)]
        )


@dataclass(eq=False)
class _Weighted:
    """Normal equations of several joints with their weights."""

    zf: np.ndarray
    zz: np.ndarray
    ff: np.ndarray
    zt: np.ndarray
    ft: np.ndarray
    tt: float = 0.0

    @classmethod
    def zeros(cls, size: int) -> _Weighted:
        zf, zz, ff = np.zeros((3, size, size))
        zt, ft = np.zeros((2, size))
        return cls(zf, zz, ff, zt, ft)

    def add(self, sums: JointSums, lam: float, power: float) -> None:
        grid, own = np.ix_(sums.columns, sums.columns), sums.columns
        self.zf[grid] += sums.zf / lam**power
        self.zz[grid] += sums.zz / lam
        self.ff[grid] += sums.ff / lam
        self.zt[own] += sums.zt / lam**power
        self.ft[own] += sums.ft / lam
        self.tt += sums.tt / lam

    def plus(self, sums: JointSums, lam: float, power: float) -> _Weighted:
        total = _Weighted(
            self.zf.copy(), self.zz.copy(), self.ff.copy(), self.zt.copy(), self.ft.copy(), self.tt
        )
        total.add(sums, lam, power)
        return total


def least_norm_solution(gram: np.ndarray, right: np.ndarray, rcond: float = _RCOND) -> np.ndarray:
    """Solution of normal equations; zero in directions without information."""
    scale = np.sqrt(np.abs(np.diag(gram)))
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=rcond)[0] / scale


def _standard_errors(gram: np.ndarray) -> np.ndarray:
    """Roots of the diagonal of the inverse; infinite for unknowns without information."""
    scale = np.sqrt(np.abs(np.diag(gram)))
    empty = scale <= 0.0
    scale = np.where(empty, 1.0, scale)
    inverse = np.linalg.pinv(gram / np.outer(scale, scale), rcond=_RCOND, hermitian=True)
    return np.where(empty, np.inf, np.sqrt(np.maximum(np.diag(inverse), 0.0)) / scale)
