"""Results side by side: their parameters, marked differences, and torques of each other's records.

How well the parameters of one result predict the torque of the record of another.

The sums G, g, t of a result over its own record (`pivident.estimation.solved_equations`) give the
error of any parameters on that record,

    ‖τ - Φβ‖/‖τ‖ = √((t - 2 gᵀβ + βᵀGβ)/t),      ‖Φ(β_b - β_a)‖/‖τ‖ = √((β_b - β_a)ᵀG(β_b - β_a)/t)

over all joints, each weighted by its own rms error. No signal is needed.

The difference of two estimates with its interval, and which of many differences are significant.

With the lower and upper halves l and u of the two intervals (2σ each where they are symmetric),

    θ_b - θ_a   from  -c(l_b, u_a)  to  +c(u_b, l_a),     c(x, y) = √(x² + y²)   or   x + y

The first c is for independent errors (Zou and Donner 2008 for intervals that are not symmetric).
Estimates from the same record share its noise, and how much of it depends on both methods: their
correlation is not known. The second c holds for any correlation, by Cauchy's inequality:
√(σ_a² + σ_b² - 2 ρ σ_a σ_b) ≤ σ_a + σ_b.

Of 200 parameters that do not differ, ten differ "significantly" at 5 %. Holm (1979) orders the
probabilities p_(1) ≤ … ≤ p_(m) and takes

    p̃_(k) = max_{i ≤ k} min(1, (m - i + 1) p_(i))

The probability of one false finding or more among all p̃ ≤ α is then at most α, however the tests
depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import torque_sums
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.sentences import plural
from pivident.studies.comparison.entry import Entry
from pivident.studies.comparison.friction_curves import JointFriction


@dataclass(frozen=True)
class Estimate:
    """One parameter of one result."""

    value: float
    low: float  # lower end of its interval (2σ), NaN without one
    high: float  # upper end, likewise
    #: parameters of that result that it is a sum of, where it is not one of them
    from_groups: tuple[str, ...] = ()

    @property
    def spread(self) -> float:
        """Half the length of the interval, 2σ; NaN without one."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class Difference(Displayed):
    """An estimate less the first one.

    Attributes:
        value: θ_b - θ_a.
        low: lower end of its interval (2σ), NaN without one.
        high: upper end, likewise.
        z: difference over its standard error on the side of zero, NaN without an interval.
        p_value: two-sided probability of a larger |z| where there is no difference.
        p_adjusted: after Holm, among all differences of the comparison.
        relative: 100 (θ_b - θ_a)/|θ_a| [%], infinite where only θ_a is zero.
    """

    value: float
    low: float
    high: float
    z: float
    p_value: float
    p_adjusted: float
    relative: float

    @property
    def spread(self) -> float:
        """Half the length of the interval, 2σ; NaN without one."""
        return 0.5 * (self.high - self.low)


def share_a_record(a: Entry, b: Entry) -> bool:
    """Whether two results may come from the same record.

    They do if a file has the same hash; and they may where one does not say what it came from.
    """
    return not a.inputs or not b.inputs or bool(set(a.inputs.values()) & set(b.inputs.values()))


def difference(a: Estimate, b: Estimate, *, independent: bool) -> Difference:
    """The second estimate less the first."""
    value = b.value - a.value
    below = _combined(b.value - b.low, a.high - a.value, independent)
    above = _combined(b.high - b.value, a.value - a.low, independent)
    z = _ratio(2.0 * value, below if value > 0.0 else above)
    return Difference(
        value=value,
        low=value - below,
        high=value + above,
        z=z,
        p_value=math.erfc(abs(z) / math.sqrt(2.0)) if not math.isnan(z) else math.nan,
        p_adjusted=math.nan,
        relative=100.0 * _ratio(value, abs(a.value)),
    )


def _combined(x: float, y: float, independent: bool) -> float:
    return math.hypot(x, y) if independent else x + y


def _ratio(difference: float, scale: float) -> float:
    """Their quotient; infinite where only the scale is zero."""
    if scale == 0.0:
        return math.copysign(math.inf, difference) if difference else 0.0
    return difference / scale


def holm(p: np.ndarray) -> np.ndarray:
    """Adjusted probabilities, same shape; NaN where there is no test."""
    p = np.asarray(p, dtype=float)
    adjusted = np.full(p.shape, np.nan)
    tested = np.flatnonzero(np.isfinite(p))
    order = tested[np.argsort(p[tested], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted


@dataclass(frozen=True)
class ComparedParameter(Displayed):
    """One quantity in all results.

    Attributes:
        name: base parameter, as the first result that estimates it calls it.
        unit: its unit.
        expression: its group written out.
        estimates: what each result says about it, None where it says nothing.
        differences: of each result from the first, None for the first itself and where one of both
            says nothing.
    """

    name: str
    unit: str
    expression: str
    estimates: tuple[Estimate | None, ...]
    differences: tuple[Difference | None, ...]

    @property
    def shared(self) -> bool:
        """Whether all results have it."""
        return all(estimate is not None for estimate in self.estimates)


@dataclass(frozen=True, eq=False)
class CrossTorque:
    """Torques of all results on the record of one of them."""

    record: int  # index of the result whose record it is
    #: relative error of each result's parameters on it, shape (results,); NaN where they do not
    #: determine all of its base parameters
    error: np.ndarray
    #: difference of each result's torque from that of the record's own, over the measured torque,
    #: likewise
    apart: np.ndarray


def cross_torques(entries: Sequence[Entry]) -> Iterator[CrossTorque]:
    """One for each result that holds the sums or the signals of its record."""
    for k, entry in enumerate(entries):
        identification = entry.identification
        if identification is None:
            continue
        sums = identification.torque_sums
        if sums is None and identification.recordings:
            sums = torque_sums(identification)
        if sums is None or sums.square <= 0.0 or sums.moment.size != len(entry.groups.names):
            continue
        own = entry.all_values
        error, apart = np.full((2, len(entries)), math.nan)
        for j, other in enumerate(entries):
            theirs = _in_groups_of(entry, other)
            if theirs is None:
                continue
            step = theirs - own
            error[j] = sums.relative_error(theirs)
            apart[j] = math.sqrt(max(float(step @ sums.gram @ step), 0.0) / sums.square)
        yield CrossTorque(k, error, apart)


def _in_groups_of(entry: Entry, other: Entry) -> np.ndarray | None:
    """The other result's values of all base parameters of one, shape (base,).

    Parameters that the other one has left out are zero in its torque.
    """
    values = np.empty(len(entry.groups.names))
    for k, row in enumerate(entry.groups.rows):
        c = other.groups.coefficients(row)
        if c is None:
            return None
        values[k] = c @ other.all_values
    return values


@dataclass(frozen=True, eq=False)
class ComparedResults(Displayed):
    """Several results side by side, with the fields of `Comparison`."""

    entries: tuple[Entry, ...]
    parameters: tuple[ComparedParameter, ...]
    alpha: float
    same_record: tuple[bool, ...]
    one_machine: bool
    torques: tuple[CrossTorque, ...]
    friction: tuple[JointFriction, ...]
    notes: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the results."""
        return tuple(entry.label for entry in self.entries)

    @property
    def tests(self) -> int:
        """Number of differences that were tested."""
        return sum(
            d is not None and not math.isnan(d.p_value)
            for p in self.parameters
            for d in p.differences
        )

    def is_marked(self, found: Difference | None) -> bool:
        """Whether a difference is significant, among all that were tested."""
        return found is not None and found.p_adjusted <= self.alpha

    def marked(self, entry: int) -> tuple[str, ...]:
        """Names of the parameters of a result that differ significantly from the first's."""
        return tuple(p.name for p in self.parameters if self.is_marked(p.differences[entry]))

    def __repr__(self) -> str:
        marked = sum(len(self.marked(k)) for k in range(len(self.entries)))
        return (
            f"<Comparison of {', '.join(self.labels)}: {len(self.parameters)} parameters, "
            f"{plural(marked, 'significant difference')}>"
        )
