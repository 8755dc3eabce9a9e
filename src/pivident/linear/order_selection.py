"""Orders and delay of a linear model: all candidates estimated and ranked.

Young's criterion (C5) adds the relative variance of the parameters to the fit. It is very negative
for a model that explains the output with well-determined parameters, and rises sharply as soon as
a pole and a zero cancel. It does not detect a model that is too small, whose few parameters are
very well determined; so it only chooses among the models whose R_T² is within half a percent of
the best one.

A candidate is rejected where it could not be estimated, did not converge, or has a pole beyond the
Nyquist frequency that the record does not determine; its row states the reason. By the hold of the
input a pole can be determined that has died away before the next sample.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypedDict, Unpack

import numpy as np

from pivident.foundation.errors import DelayTooLong, IdentificationError, UnusableSignal
from pivident.linear.estimate import LinearEstimate
from pivident.linear.model import Hold, poles_with_std
from pivident.linear.sriv import riv, sriv
from pivident.linear.srivc import POOR, rivc, srivc

OrderCriterion = Literal["yic", "aic", "bic", "r2"]
Method = Literal["srivc", "rivc", "sriv", "riv"]
Orders = int | tuple[int, ...]

#: Estimators by name.
_ESTIMATORS: dict[str, Callable[..., LinearEstimate]] = {
    "srivc": srivc,
    "rivc": rivc,
    "sriv": sriv,
    "riv": riv,
}


class EstimatorOptions(TypedDict, total=False):
    """What `select_orders` hands on to the estimator of its method, where it is given."""

    external: np.ndarray | None
    tolerance: float
    max_iterations: int
    noise_order: tuple[int, int] | None  # of rivc and riv
    hold: Hold  # of srivc and rivc, as the next three
    svf_pole: float | None
    common: bool
    offset: bool | None
    mask: np.ndarray | None  # of sriv and riv, as the next
    fixed_poles: Sequence[complex]


#: Standard error of a pole over its size, from which on the record does not determine it.
UNDETERMINED = 0.25

#: Share of the unexplained variance below which a rejected model is named as the better one.
FAR_LESS = 0.1

#: Models within this distance of the best R_T² explain the output equally well.
R2_BAND = 0.005


@dataclass(frozen=True, eq=False)
class OrderCandidate:
    """One row of the table; orders are degrees, the delay is in samples."""

    numerator_order: Orders
    denominator_order: Orders
    delay: Orders
    estimate: LinearEstimate | None  # None: it could not be estimated
    rejected: str  # why it cannot be chosen; empty: it can

    @property
    def converged(self) -> bool:
        """Whether the estimation converged."""
        return self.estimate is not None and self.estimate.converged

    def score(self, criterion: OrderCriterion) -> float:
        """Value of a criterion, infinite without a model; smaller is better, except for R_T²."""
        if self.estimate is None:
            return -np.inf if criterion == "r2" else np.inf
        return float(getattr(self.estimate.fit, criterion))


@dataclass(frozen=True, eq=False)
class OrderTable:
    """All candidates, best first by the criterion; prints as a table."""

    rows: tuple[OrderCandidate, ...]
    criterion: OrderCriterion

    @property
    def best(self) -> LinearEstimate:
        """The chosen model."""
        first = self.rows[0]
        if first.rejected or first.estimate is None:
            raise IdentificationError(
                f"all {len(self.rows)} candidates were rejected, the first because "
                f"{first.rejected}",
                advice="offer lower orders or other delays",
            )
        return first.estimate

    def __str__(self) -> str:
        head = f"{'num':>6s} {'den':>6s} {'delay':>6s} {'R_T²':>9s} {'YIC':>8s} "
        lines = [head + f"{'AIC':>11s} {'BIC':>11s}  remarks (ranked by {self.criterion.upper()})"]
        for row in self.rows:
            scores = (
                f"{row.score('r2'):9.5f} {row.score('yic'):8.2f} "
                f"{row.score('aic'):11.1f} {row.score('bic'):11.1f}"
                if row.estimate is not None
                else f"{'–':>9s} {'–':>8s} {'–':>11s} {'–':>11s}"
            )
            orders = (row.numerator_order, row.denominator_order, row.delay)
            named = " ".join(f"{_short(order):>6s}" for order in orders)
            lines.append(f"{named} {scores}  {row.rejected}".rstrip())
        return "\n".join([*lines, *self._better()])

    def _better(self) -> list[str]:
        """What is said where a rejected candidate explains far more than the chosen one."""
        chosen, best = self.rows[0], max(self.rows, key=lambda row: row.score("r2"))
        left = 1.0 - chosen.score("r2")
        if chosen.rejected or not best.rejected or 1.0 - best.score("r2") > FAR_LESS * left:
            return []
        orders = f"{_short(best.numerator_order)} and {_short(best.denominator_order)}"
        return [
            f"A rejected model of orders {orders} leaves {1.0 - best.score('r2'):.2g} of the "
            f"output's variance, the first one {left:.2g}: {best.rejected}."
        ]


def select_orders(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    numerator_orders: Iterable[Orders],
    denominator_orders: Iterable[Orders],
    delays: Iterable[Orders] = (0,),
    *,
    method: Method = "srivc",
    criterion: OrderCriterion = "yic",
    **options: Unpack[EstimatorOptions],
) -> OrderTable:
    """Estimate every combination of orders and delay, and rank them.

    Combinations whose numerator is of higher degree than the denominator are left out.

    Args:
        u: inputs, shape (samples,) or (samples, inputs).
        y: output, shape (samples,).
        dt: sampling period [s].
        numerator_orders: degrees of the numerator; a tuple gives one degree for each input.
        denominator_orders: degrees of the denominator, likewise.
        delays: delays in samples, likewise.
        method: ``srivc`` or ``rivc`` in continuous time, ``sriv`` or ``riv`` in discrete time.
        criterion: ``yic`` (among the models within half a percent of the best R_T²), ``aic``,
            ``bic`` or ``r2``.
        options: those of the estimator by name, see there: ``external``, ``tolerance`` and
            ``max_iterations``; ``noise_order`` (rivc, riv); ``hold``, ``svf_pole``, ``common`` and
            ``offset`` (srivc, rivc); ``mask`` and ``fixed_poles`` (sriv, riv).

    Returns:
        The candidates, the best first.

    Raises:
        UnusableSignal: signals from which nothing can be estimated.
        IdentificationError: no combination, an unknown method or an unknown criterion.
    """
    if criterion not in ("yic", "aic", "bic", "r2"):
        raise IdentificationError(
            f"criterion {criterion!r} for orders", advice="expected yic, aic, bic or r2"
        )
    if method not in _ESTIMATORS:
        raise IdentificationError(f"method {method!r}", advice="expected srivc, rivc, sriv or riv")
    estimator = _ESTIMATORS[method]
    combinations = [
        (m, n, delay)
        for m, n, delay in itertools.product(numerator_orders, denominator_orders, delays)
        if _proper(m, n)
    ]
    if not combinations:
        raise IdentificationError(
            "no combination of orders is left: every numerator has a higher degree than every "
            "denominator",
            advice="raise denominator_orders",
        )
    # whether a poor model lacks an offset is asked of the chosen one alone
    asks = method in ("srivc", "rivc") and not options.get("offset", False)
    quick: EstimatorOptions = {**options, "offset": None} if asks else options
    rows = [_candidate(estimator, u, y, dt, *orders, quick) for orders in combinations]
    first, *others = _ranked(rows, criterion)
    if asks and not first.rejected and first.score("r2") < POOR:
        orders = first.numerator_order, first.denominator_order, first.delay
        first = _candidate(estimator, u, y, dt, *orders, options)
    return OrderTable((first, *others), criterion)


def _candidate(
    estimator: Callable[..., LinearEstimate],
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    m: Orders,
    n: Orders,
    delay: Orders,
    options: EstimatorOptions,
) -> OrderCandidate:
    """One row; errors of the signals themselves are raised, not tabulated."""
    try:
        estimate = estimator(u, y, dt, m, n, delay=delay, **options)
    except (UnusableSignal, DelayTooLong):
        raise
    except IdentificationError as error:
        return OrderCandidate(m, n, delay, None, error.fact)
    return OrderCandidate(m, n, delay, estimate, _objection(estimate))


def _objection(estimate: LinearEstimate) -> str:
    """Why an estimate cannot be chosen."""
    if not estimate.converged:
        return "did not converge"
    if not np.isfinite(estimate.fit.yic):
        return "covariance without full rank"
    nyquist = np.pi / estimate.dt if estimate.continuous else np.inf
    for which in range(len(estimate.numerators)):
        for pole, std in poles_with_std(estimate, which):
            if abs(pole) > nyquist and std > UNDETERMINED * abs(pole):
                return f"pole at {abs(pole):.4g} rad/s, beyond the Nyquist frequency {nyquist:.4g}"
    return ""


def _ranked(rows: Sequence[OrderCandidate], criterion: OrderCriterion) -> list[OrderCandidate]:
    """Best first: eligible models, then those with a lower R_T², then the rejected."""
    best = max((row.score("r2") for row in rows if not row.rejected), default=-np.inf)

    def key(row: OrderCandidate) -> tuple[int, float]:
        score = row.score(criterion)
        explains_less = criterion == "yic" and row.score("r2") < best - R2_BAND
        return (2 if row.rejected else int(explains_less), -score if criterion == "r2" else score)

    return sorted(rows, key=key)


def _proper(m: Orders, n: Orders) -> bool:
    """Whether no numerator has a higher degree than its denominator."""
    numerators, denominators = np.atleast_1d(m), np.atleast_1d(n)
    if denominators.size not in (1, numerators.size) and numerators.size != 1:
        return True  # refused by the estimator, with its own message
    return bool(np.all(numerators <= denominators))


def _short(order: Orders) -> str:
    return ",".join(str(value) for value in np.atleast_1d(order))
