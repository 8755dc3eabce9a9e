"""What somebody knows of the parameters: values, bounds, priors and equations, by their names.

A `Problem` takes them as arguments, a result keeps them, and `Restrictions` are what they mean for
the normal equations.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Any

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, parameter_index
from pivident.estimation.restrictions import Restrictions
from pivident.foundation.errors import ExperimentError, concerning
from pivident.foundation.text.numbers import format_exact
from pivident.foundation.text.plain_values import Limits, Null, Sized
from pivident.foundation.text.sentences import listed

#: Least and largest value.
Bounds = tuple[Annotated[float, Null(-inf)], Annotated[float, Null(inf)]]


@dataclass(frozen=True, eq=False)
class Prior:
    """Some parameters as they are expected: normal with a mean and a covariance.

    Attributes:
        names: names of the parameters.
        mean: their expected values, shape (names,).
        covariance: of these, shape (names, names).
    """

    names: Annotated[tuple[str, ...], Sized("names")]
    mean: Annotated[np.ndarray, Sized("names")]
    covariance: Annotated[np.ndarray, Sized("names", "names")]

    @property
    def std(self) -> np.ndarray:
        """Standard deviations, shape (names,)."""
        return np.sqrt(np.diag(self.covariance))

    def checked(self) -> Prior:
        """The same in arrays.

        Returns:
            The prior.

        Raises:
            ExperimentError: other shapes, values that are not finite, or a covariance that is not
                positive definite.
        """
        names = (self.names,) if isinstance(self.names, str) else tuple(self.names)
        mean, covariance = np.atleast_1d(np.asarray(self.mean, float)), np.asarray(self.covariance)
        size = len(names)
        if mean.shape != (size,) or covariance.shape != (size, size) or not size:
            raise ExperimentError(
                f"a prior of {size} parameters has a mean of shape {mean.shape} and a covariance "
                f"of shape {covariance.shape}",
                advice=f"give {(size,)} and {(size, size)}",
            )
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0)).astype(float)
        good = np.isfinite(mean).all() and np.isfinite(covariance).all() and (std > 0.0).all()
        if good:
            correlations = covariance / np.outer(std, std)
            symmetric = np.allclose(correlations, correlations.T, rtol=0.0, atol=1e-9)
            good = symmetric and np.linalg.eigvalsh(correlations)[0] > 1e-12
        if not good:
            raise ExperimentError(
                f"the prior of {listed(names)} has a covariance that is not positive definite, or "
                "values that are not finite",
                advice="give standard deviations above zero, and correlations between -1 and 1",
            )
        return Prior(names, mean, covariance.astype(float))


@dataclass(frozen=True)
class Equality:
    """A linear equation between parameters: Σ coefficient · parameter = value.

    Attributes:
        coefficients: factors by parameter name.
        value: what the products sum up to.
    """

    coefficients: dict[str, float]
    value: float = 0.0

    def __str__(self) -> str:
        terms = (f"{format_exact(x)} {name}" for name, x in self.coefficients.items())
        return f"{' + '.join(terms)} = {format_exact(self.value)}".replace("+ -", "- ")


#: A prior as people give it: an expected value with its standard deviation by name, or `Prior`s.
Priors = Mapping[str, tuple[float, float]] | Sequence[Prior] | Prior
#: Equations: `Equality`s, or coefficients by name with their value.
Equalities = Sequence[Equality | tuple[Mapping[str, float], float]]


@dataclass(frozen=True, eq=False)
class KnownParameters:
    """What is known of some parameters.

    Attributes:
        fixed: values by name.
        bounds: least and largest values by name, infinite for none.
        priors: expected values with their covariances.
        constraints: linear equations.
    """

    fixed: dict[str, float] = field(default_factory=dict)
    bounds: dict[str, Bounds] = field(default_factory=dict)
    priors: tuple[Prior, ...] = ()
    constraints: Annotated[tuple[Equality, ...], Limits(max_length=10_000)] = ()

    @classmethod
    def of(
        cls,
        base: BaseParameters,
        fixed: Mapping[str, float],
        bounds: Mapping[str, Any],
        priors: Priors,
        constraints: Equalities,
    ) -> KnownParameters:
        """The same with the names of a robot's base parameters, checked one by one.

        Args:
            base: the robot's base parameters.
            fixed: values by name.
            bounds: least and largest value by name, None for none.
            priors: expected value and standard deviation by name, or sets of them, each a `Prior`.
            constraints: equations, or coefficients by name with their value.

        Returns:
            What is known.

        Raises:
            ExperimentError: an unknown name, a value that is none, or a fixed one beyond its
                bounds.
        """
        with concerning("fixed"):
            values = _by_name(base, fixed, _number)
        with concerning("bounds"):
            limits = _by_name(base, bounds, _bounds)
        with concerning("priors"):
            expected = tuple(_priors(base, priors))
        with concerning("constraints"):
            equations = tuple(_equality(base, each) for each in _sequence(constraints))
        for name in values.keys() & limits.keys():
            low, high = limits[name]
            if not low <= values[name] <= high:
                raise ExperimentError(
                    f"{name} is fixed at {values[name]:g}, beyond its bounds {low:g} and {high:g}",
                    advice="correct one of the two",
                ).about("fixed")
        return cls(values, limits, expected, equations)

    def __bool__(self) -> bool:
        return bool(self.fixed or self.bounds or self.priors or self.constraints)

    @property
    def names(self) -> set[str]:
        """All parameters that something is known of."""
        said = (*(p.names for p in self.priors), *(e.coefficients for e in self.constraints))
        return {*self.fixed, *self.bounds, *(name for each in said for name in each)}

    def restrictions(self, names: Sequence[str]) -> Restrictions:
        """What it means for the normal equations of these parameters.

        Args:
            names: names of the parameters that are solved for, all of `names` among them.

        Raises:
            ExperimentError: values, equations and bounds contradict or repeat one another, or
                leave nothing to be estimated.
        """
        place = {name: k for k, name in enumerate(names)}
        size = len(place)
        rows = [({name: 1.0}, value) for name, value in self.fixed.items()]
        rows += [(each.coefficients, each.value) for each in self.constraints]
        matrix, right = np.zeros((len(rows), size)), np.array([value for _, value in rows])
        for row, (coefficients, _) in zip(matrix, rows, strict=True):
            row[[place[name] for name in coefficients]] = list(coefficients.values())
        low, high = np.full(size, -inf), np.full(size, inf)
        for name, own in self.bounds.items():
            low[place[name]], high[place[name]] = own
        information, moment = np.zeros((size, size)), np.zeros(size)
        for prior in self.priors:
            k = np.array([place[name] for name in prior.names])
            scale = np.outer(prior.std, prior.std)
            inverse = np.linalg.inv(prior.covariance / scale) / scale
            information[np.ix_(k, k)] += inverse
            moment[k] += inverse @ prior.mean
        mean = np.linalg.lstsq(information, moment, rcond=1e-14)[0] if self.priors else moment
        made = Restrictions(tuple(names), matrix, right.reshape(-1), low, high, mean, information)
        if not made.freedom.free.size:
            raise ExperimentError(
                "everything is fixed, so nothing is left to be estimated",
                advice="leave a parameter free",
            ).about("fixed")
        if made.is_bounded and len(matrix):
            _check_possible(made)
        return made

    def without(self, names: Iterable[str]) -> KnownParameters:
        """The same without what is known of single parameters, which are left out of the model.

        Args:
            names: their names.
        """
        gone = set(names)
        return KnownParameters(
            {k: x for k, x in self.fixed.items() if k not in gone},
            {k: x for k, x in self.bounds.items() if k not in gone},
            tuple(p for p in self.priors if not gone.intersection(p.names)),
            tuple(e for e in self.constraints if not gone.intersection(e.coefficients)),
        )

    def sentences(self) -> list[str]:
        """What was known, for people who read the result."""
        said = []
        if self.bounds:
            limits = (
                f"{name} {f'≥ {format_exact(low)}' if low > -inf else ''}"
                f"{' and ' if -inf < low and high < inf else ''}"
                f"{f'≤ {format_exact(high)}' if high < inf else ''}"
                for name, (low, high) in self.bounds.items()
            )
            said.append(f"Bounds: {listed(list(limits))}.")
        if self.priors:
            means = (
                f"{name} = {format_exact(float(mean))} ± {format_exact(2.0 * float(std))}"
                for p in self.priors
                for name, mean, std in zip(p.names, p.mean, p.std, strict=True)
            )
            said.append(f"Expected beforehand (2σ): {listed(list(means))}.")
        if self.constraints:
            said.append(f"Constraints: {'; '.join(map(str, self.constraints))}.")
        return said


def _by_name(base: BaseParameters, given: Mapping[str, Any], read: Any) -> dict[str, Any]:
    """Values by the names of base parameters, each once."""
    if not isinstance(given, Mapping):
        raise ExperimentError(f"{given!r} is no table of values by parameter name")
    found: dict[str, Any] = {}
    for name, value in given.items():
        own = base.names[parameter_index(base, name)]
        if own in found:
            raise ExperimentError(f"parameter {own!r} is given twice", advice="keep one of the two")
        found[own] = read(own, value)
    return found


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise ExperimentError(f"{name} is {value!r}", advice="give a finite number")
    return number


def _bounds(name: str, value: Any) -> tuple[float, float]:
    try:
        low, high = value
        pair = -inf if low is None else float(low), inf if high is None else float(high)
    except (TypeError, ValueError):
        pair = np.nan, np.nan
    if not pair[0] < pair[1]:
        raise ExperimentError(
            f"the bounds of {name} are {value!r}",
            advice="give the least and the largest value, None for none, as in (0, None)",
        )
    return pair


def _priors(base: BaseParameters, given: Priors) -> Iterator[Prior]:
    if isinstance(given, Mapping):
        found = []
        for name, value in given.items():
            try:
                mean, std = value
            except (TypeError, ValueError):
                raise ExperimentError(
                    f"the prior of {name} is {value!r}",
                    advice="give the expected value and its standard deviation",
                ) from None
            if not _number(name, std) > 0.0:
                raise ExperimentError(
                    f"the standard deviation of {name} is {std!r}, so its covariance is not "
                    "positive definite",
                    advice="give one above zero; what is certain is fixed",
                )
            size = np.array([[_number(name, std) ** 2]])
            found.append(Prior((name,), np.array([_number(name, mean)]), size))
        given = found
    for prior in [given] if isinstance(given, Prior) else _sequence(given):
        if not isinstance(prior, Prior):
            raise ExperimentError(f"{prior!r} is no prior", advice="give Prior(names, mean, …)")
        prior = prior.checked()
        names = tuple(base.names[parameter_index(base, name)] for name in prior.names)
        if len(set(names)) < len(names):
            raise ExperimentError(f"a prior names {listed(names)}", advice="name each one once")
        yield Prior(names, prior.mean, prior.covariance)


def _equality(base: BaseParameters, given: Any) -> Equality:
    if not isinstance(given, Equality):
        try:
            coefficients, value = given
            given = Equality(dict(coefficients), value)
        except (TypeError, ValueError):
            raise ExperimentError(
                f"the constraint {given!r} is none",
                advice='give coefficients by name and a value, as in ({"zz1r": 1, "ia1": -2}, 0)',
            ) from None
    coefficients = _by_name(base, given.coefficients, _number)
    value = _number("a constraint", given.value)
    if not any(coefficients.values()):
        raise ExperimentError("a constraint has no coefficient other than zero")
    return Equality({name: x for name, x in coefficients.items() if x}, value)


def _sequence(given: Any) -> Sequence[Any]:
    if isinstance(given, (str, Mapping)) or not isinstance(given, Iterable):
        raise ExperimentError(f"{given!r} is no list")
    return tuple(given)


def _check_possible(known: Restrictions) -> None:
    """Refuse equalities that no values within the bounds meet."""
    from scipy.optimize import linprog

    bounds = list(zip(known.low, known.high, strict=True))
    found = linprog(np.zeros(len(bounds)), A_eq=known.matrix, b_eq=known.right, bounds=bounds)
    if found.status == 2:
        raise ExperimentError(
            "no values within the bounds meet the constraints",
            advice="correct or leave out one of them",
        ).about("constraints")
