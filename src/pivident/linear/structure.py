"""Orders of a continuous-time model: which parameters there are and in which order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.linear.model import Hold

#: Poles on the imaginary axis are moved this far to the left, relative to their modulus.
_MARGIN = 1e-6


@dataclass(frozen=True)
class Structure:
    """Orders, delays and hold of y = Σ_i B_i/A_i u_i(t - delay_i).

    θ holds the denominators without their ones, then the numerators, highest power first.
    """

    numerator_orders: tuple[int, ...]
    denominator_orders: tuple[int, ...]  # a single one when the denominator is common
    delays: tuple[int, ...]  # [samples]
    hold: Hold

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.numerator_orders)

    @property
    def common(self) -> bool:
        """Whether one denominator serves all inputs."""
        return len(self.denominator_orders) == 1

    @property
    def parameters(self) -> int:
        """Length of θ."""
        return sum(self.denominator_orders) + sum(m + 1 for m in self.numerator_orders)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of θ: a1 …, b0 …; with several inputs b0_u1 …, and a1_u1 … if not common."""

        def suffix(which: int, several: bool) -> str:
            return f"_u{which + 1}" if several else ""

        denominators = (
            f"a{k}{suffix(i, not self.common)}"
            for i, n in enumerate(self.denominator_orders)
            for k in range(1, n + 1)
        )
        numerators = (
            f"b{k}{suffix(i, self.inputs > 1)}"
            for i, m in enumerate(self.numerator_orders)
            for k in range(m + 1)
        )
        return (*denominators, *numerators)

    def split(self, theta: np.ndarray) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
        """Monic denominators (one, if common) and numerators of θ."""
        sizes = [*self.denominator_orders, *(m + 1 for m in self.numerator_orders)]
        parts = np.split(np.asarray(theta, dtype=float), np.cumsum(sizes)[:-1])
        count = len(self.denominator_orders)
        return tuple(np.r_[1.0, a] for a in parts[:count]), tuple(parts[count:])

    def per_input(self, denominators: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
        """The denominator of every input, also where they share one."""
        return tuple(denominators) * self.inputs if self.common else tuple(denominators)

    def of_input(self, which: int) -> Structure:
        """Structure of one input alone."""
        denominator = self.denominator_orders[0 if self.common else which]
        return Structure(
            (self.numerator_orders[which],), (denominator,), (self.delays[which],), self.hold
        )

    def joined(
        self, denominators: Sequence[np.ndarray], numerators: Sequence[np.ndarray]
    ) -> np.ndarray:
        """θ of monic denominators and numerators."""
        return np.concatenate([*(a[1:] for a in denominators), *numerators])

    def stabilised(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ with unstable poles reflected at the imaginary axis (C1), and those poles."""
        denominators, numerators = self.split(theta)
        moved, unstable = [], []
        for a in denominators:
            poles = np.roots(a)
            wrong = poles.real >= 0
            if wrong.any():
                unstable.append(poles[wrong])
                real = np.maximum(poles.real, _MARGIN * np.maximum(np.abs(poles), 1e-300))
                a = np.poly(np.where(wrong, -real + 1j * poles.imag, poles)).real
            moved.append(a)
        found = np.concatenate(unstable) if unstable else np.zeros(0, dtype=complex)
        return self.joined(moved, numerators), found


def structure_of(
    inputs: int,
    numerator_order: int | Sequence[int],
    denominator_order: int | Sequence[int],
    delay: int | Sequence[int],
    hold: Hold,
    common: bool,
) -> Structure:
    """Structure from the arguments of the estimators."""
    if hold not in ("zoh", "foh"):
        raise IdentificationError(f"hold is {hold!r}", advice="expected 'zoh' or 'foh'")
    common = common or inputs == 1
    numerators = _each("numerator_order", numerator_order, inputs, 0)
    denominators = _each("denominator_order", denominator_order, 1 if common else inputs, 1)
    structure = Structure(numerators, denominators, _each("delay", delay, inputs, 0), hold)
    for i, m in enumerate(numerators):
        n = denominators[0 if common else i]
        if m > n:
            raise IdentificationError(
                f"the numerator of input {i + 1} has degree {m}, above its denominator's {n}: the "
                "derivatives of sampled signals are not defined",
                advice="raise denominator_order, or lower numerator_order",
            )
    return structure


def _each(name: str, value: int | Sequence[int], count: int, least: int) -> tuple[int, ...]:
    """One integer for each of ``count``, from one for all or a sequence."""
    given = np.atleast_1d(np.asarray(value))
    values = np.repeat(given, count) if given.size == 1 else given
    if values.shape != (count,) or not np.issubdtype(values.dtype, np.integer):
        raise IdentificationError(
            f"{name} is {value!r}",
            advice=f"expected one integer, or {count} (one for each "
            f"input{')' if name != 'denominator_order' else ', with common=False)'}",
        )
    if values.min() < least:
        raise IdentificationError(f"{name} is {value!r}", advice=f"expected at least {least}")
    return tuple(int(v) for v in values)
