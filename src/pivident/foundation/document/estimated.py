"""What every estimate answers by the names that statistics packages have.

They mean what statsmodels means by them, with these differences: ``params``, ``bse``, ``tvalues``
and ``pvalues`` are numbers by name (of which `pandas.Series` and `numpy.asarray` make series and
arrays), ``conf_int`` takes the level and not its complement, and all of them rest on one
covariance, that of ``cov_params()``, and on the normal distribution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pivident.foundation.distributions import normal
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import UnknownName, UnusableValue, require_kind
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.sentences import nearest

#: Tests of linear hypotheses: a name, coefficients by name, several of both, or rows of them.
Hypotheses = str | Mapping[str, float] | Sequence[str | Mapping[str, float]] | ArrayLike


def half_width(level: float) -> float:
    """Half width z = Φ⁻¹((1 + level)/2) of an interval, in standard errors.

    Args:
        level: probability that the interval holds the true value, at least 0.5 and below 1.

    Raises:
        UnusableValue: another level; below 0.5 its complement was meant.
    """
    require_kind("level", level, Real, "0.95 is usual")
    if not 0.5 <= level < 1.0:
        meant = f"{1.0 - level:g}" if 0.0 < level < 0.5 else "0.95"
        raise UnusableValue(
            f"level must be between 0.5 and 1, not {level}",
            advice=f"it is the probability that an interval holds the true value, such as {meant}",
        )
    return float(normal.ppf(0.5 * (1.0 + level)))


class ByName(dict[str, float]):
    """Numbers by the names of parameters, in their order; ``numpy.asarray`` gives the numbers."""

    def __missing__(self, name: str) -> float:
        raise UnknownName(f"no parameter {name!r}", advice=nearest(str(name), self))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(list(self.values()), dtype=dtype or float)


@dataclass(frozen=True, eq=False)
class LinearTests(Displayed):
    """Tests of H₀: R θ = r, one for each row of R.

    Attributes:
        labels: the left sides, ``fv1 - 2 fv2``.
        value: the right sides r, shape (tests,).
        effect: R θ, shape (tests,).
        sd: standard errors of R θ, shape (tests,).
    """

    labels: tuple[str, ...]
    value: np.ndarray
    effect: np.ndarray
    sd: np.ndarray

    @property
    def tvalue(self) -> np.ndarray:
        """(R θ - r)/σ, shape (tests,)."""
        return _ratio(self.effect - self.value, self.sd)

    @property
    def pvalue(self) -> np.ndarray:
        """Probability of one as large if the hypothesis is true, of both sides, shape (tests,)."""
        return 2.0 * np.asarray(normal.sf(np.abs(self.tvalue)))

    def conf_int(self, level: float = 0.95) -> np.ndarray:
        """Confidence intervals of R θ, shape (tests, 2).

        Args:
            level: probability that an interval holds the true value.
        """
        half = half_width(level) * self.sd
        return np.column_stack([self.effect - half, self.effect + half])

    def table(self) -> Table:
        """One row for each hypothesis."""
        columns: dict[str, Column | list[str]] = {
            "hypothesis": [f"{a} = {b:g}" for a, b in zip(self.labels, self.value, strict=True)],
            "effect": Column(self.effect, spread=half_width(0.95) * self.sd),
            "t": Column(self.tvalue, digits=3),
            "p": Column(self.pvalue, digits=2),
        }
        return Table("tests", columns, {"p": "of both sides, by the normal distribution"})

    def __repr__(self) -> str:
        return f"<LinearTests of {len(self.labels)}: smallest p = {self.pvalue.min():.2g}>"

    def __str__(self) -> str:
        return self.table().text()


class Estimated:
    """Estimates θ with names and a covariance.

    Attributes:
        names: names of the parameters.
        theta: estimates, shape (parameters,).
    """

    names: tuple[str, ...]
    theta: np.ndarray

    def cov_params(self) -> np.ndarray:
        """Covariance that all standard errors come from, shape (parameters, parameters)."""
        raise NotImplementedError

    @property
    def nobs(self) -> int:
        """Number of equations that the estimate was made of."""
        raise NotImplementedError

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter, empty where there is none."""
        return ("",) * len(self.names)

    @property
    def bound_sides(self) -> tuple[str, ...]:
        """Bound that holds each estimate, ``low`` or ``high``; empty where none does."""
        return ("",) * len(self.names)

    @property
    def std(self) -> np.ndarray:
        """Standard errors, shape (parameters,)."""
        return np.sqrt(np.diag(self.cov_params()))

    @property
    def params(self) -> ByName:
        """Estimates by the names of their parameters, in the order of ``names``."""
        return self._by_name(self.theta)

    @property
    def bse(self) -> ByName:
        """Standard errors by name, those of every interval."""
        return self._by_name(self.std)

    @property
    def tvalues(self) -> ByName:
        """Estimates over their standard errors, by name."""
        return self._by_name(_ratio(self.theta, self.std))

    @property
    def pvalues(self) -> ByName:
        """Probability of an estimate as far from zero if the parameter is zero, by name."""
        return self._by_name(2.0 * np.asarray(normal.sf(np.abs(_ratio(self.theta, self.std)))))

    @property
    def df_resid(self) -> int:
        """Equations less parameters."""
        return self.nobs - len(self.names)

    def conf_int(self, level: float = 0.95) -> np.ndarray:
        """Confidence intervals θ ± z σ with z = Φ⁻¹((1 + level)/2) of the normal distribution.

        They rest on ``std``, as all intervals that are shown, which are those of z = 2 (a level of
        0.9545), and hold for a model without systematic error. As with statsmodels
        the lower bound stands in the first column. Where a bound of the parameter itself holds the
        estimate, the interval ends there: it has the other side only.

        Args:
            level: probability that an interval holds the true value, at least 0.5 and below 1.

        Returns:
            Lower and upper bounds in ``units``, shape (parameters, 2).

        Raises:
            UnusableValue: another level.
        """
        half = half_width(level) * self.std
        ends = np.column_stack([self.theta - half, self.theta + half])
        for k, side in enumerate(self.bound_sides):
            if side:
                ends[k, 0 if side == "low" else 1] = self.theta[k]
        return ends

    def t_test(self, hypotheses: Hypotheses, value: ArrayLike = 0.0) -> LinearTests:
        """Tests of linear hypotheses R θ = r, each by itself.

        Args:
            hypotheses: the rows of R: the name of a parameter, coefficients by name such as
                ``{"fv1": 1, "fv2": -1}``, a list of these, or an array, shape (parameters,) or
                (tests, parameters).
            value: r, one for all or shape (tests,).

        Returns:
            Effects R θ with their standard errors, t and p values and intervals.

        Raises:
            UnknownName: a name that is no parameter.
            UnusableValue: an array of another shape.
        """
        rows = self._rows(hypotheses)
        sides = np.broadcast_to(np.asarray(value, dtype=float), (len(rows),))
        variance = np.einsum("ij,jk,ik->i", rows, self.cov_params(), rows)
        labels = tuple(_sum_in_words(row, self.names) for row in rows)
        return LinearTests(labels, sides, rows @ self.theta, np.sqrt(np.maximum(variance, 0.0)))

    def parameter_table(self) -> Table:
        """Name, value ± 2σ and unit of each parameter."""
        columns: dict[str, Any] = {
            "parameter": list(self.names),
            "value": Column(self.theta, spread=2.0 * self.std, spread_title="± 2σ"),
        }
        if any(self.units):
            columns["unit"] = list(self.units)
        return Table("parameters", columns)

    def _by_name(self, values: np.ndarray) -> ByName:
        return ByName(zip(self.names, values.tolist(), strict=True))

    def _rows(self, hypotheses: Any) -> np.ndarray:
        """R, shape (tests, parameters)."""
        if isinstance(hypotheses, str | Mapping):
            hypotheses = [hypotheses]
        if all(isinstance(row, str | Mapping) for row in hypotheses):
            rows = np.zeros((len(hypotheses), len(self.names)))
            place = ByName(zip(self.names, range(len(self.names)), strict=True))
            for own, hypothesis in zip(rows, hypotheses, strict=True):
                terms = {hypothesis: 1.0} if isinstance(hypothesis, str) else hypothesis
                for name, coefficient in terms.items():
                    own[int(place[name])] = coefficient
            return rows
        rows = np.atleast_2d(np.asarray(hypotheses, dtype=float))
        if rows.ndim != 2 or rows.shape[1] != len(self.names):
            raise UnusableValue(
                f"the hypotheses have shape {np.shape(hypotheses)}",
                advice=f"give coefficients of {len(self.names)} parameters in each row, or names",
            )
        return rows


def _ratio(values: np.ndarray, std: np.ndarray) -> np.ndarray:
    """values/std, ±∞ where only std is zero, NaN where both are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(values) / np.asarray(std)


def _sum_in_words(row: np.ndarray, names: Sequence[str]) -> str:
    """``fv1 - 2 fv2`` for a row of coefficients."""
    text = ""
    for coefficient, name in zip(row, names, strict=True):
        if coefficient:
            size = "" if abs(coefficient) == 1.0 else f"{abs(coefficient):g} "
            sign = "-" if coefficient < 0 else "+"
            text += f" {sign} {size}{name}" if text else f"{'-' * (sign == '-')}{size}{name}"
    return text or "0"
