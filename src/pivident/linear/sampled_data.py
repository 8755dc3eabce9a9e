"""Inputs and output of an estimation, checked once.

Inputs of a closed loop are made free of the noise that the loop feeds back.

In a loop the input u = S r - C S ξ carries the output's noise ξ, and instruments computed from it
are correlated with ξ. The first stage of the two-stage method (Van den Hof and Schrama, 1993)
keeps the part that the external signals r explain,

    û = Σ_k c_k L_k(z) r,     L_k(z) = √(1 - a²)/(z - a) ((1 - a z)/(z - a))^(k-1)

on Laguerre functions and a direct term: linear in c, always stable, and the orders are nested,
so that one Cholesky factorisation gives the BIC of all of them. The pole a is searched on a grid.
Estimates are consistent for any û that depends on r alone; a good û makes them precise.

Noise-free output of a linear model.

In continuous time the inputs are known at the samples and, by their hold, between them, so that

    x(t_k) = Σ_i B_i(p)/A_i(p) u_i(t_k - delay_i)

has an exact discretisation: x is an output of the chain (C2). In discrete time the model itself is
the recursion. Both start from rest, with zero inputs before the record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from pivident.foundation.compiled import compiled
from pivident.foundation.errors import DelayTooLong, OrdersNotSupported, UnusableSignal
from pivident.linear.model import Hold, LinearModel, Structure
from pivident.linear.state_variable_filter import combined, filtered_derivatives

#: Minimum number of samples per parameter; with fewer no standard error is meaningful.
_SAMPLES_PER_PARAMETER = 3


@dataclass(frozen=True, eq=False)
class SampledData:
    """Signals of one record, inputs already shifted by their delays."""

    u: np.ndarray  # inputs, (inputs, samples)
    clean: np.ndarray  # inputs free of the output's noise, for instruments; u itself in open loop
    y: np.ndarray  # output, (samples,)
    dt: float  # [s]

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.y.size * self.dt

    def of_input(self, which: int, y: np.ndarray) -> SampledData:
        """One input with the part of the output that it explains."""
        rows = slice(which, which + 1)
        return SampledData(self.u[rows], self.clean[rows], y, self.dt)


def columns_of(name: str, signal: np.ndarray) -> np.ndarray:
    """A signal as (samples, columns)."""
    try:
        array = np.asarray(signal, dtype=float)
    except (TypeError, ValueError) as error:
        advice = "give real numbers, shape (samples,)"
        raise UnusableSignal(name, f"is no array of numbers ({error})", advice) from None
    columns = array[:, None] if array.ndim == 1 else array
    if columns.ndim != 2 or columns.size == 0:
        raise UnusableSignal(
            name, f"has shape {array.shape}", "give (samples,) or (samples, columns)"
        )
    return columns


def sampled_data(
    u: np.ndarray,
    y: np.ndarray,
    dt: float,
    structure: Structure,
    external: np.ndarray | None = None,
) -> SampledData:
    """Check the signals and shift the inputs by their delays."""
    if not (math.isfinite(dt) and dt > 0):
        raise UnusableSignal("dt", f"is {dt!r}", "give the sampling period in seconds")
    columns = columns_of("u", u)
    output = columns_of("y", y)
    if output.shape[1] != 1:
        raise UnusableSignal("y", f"has {output.shape[1]} columns", "estimate one output at a time")
    references = columns_of("external", u if external is None else external)
    for name, signal in (("y", output), ("external", references)):
        if len(signal) != len(columns):
            raise UnusableSignal(
                name,
                f"has {len(signal)} samples, but u has {len(columns)}",
                "trim both to the same samples; time is the first axis",
            )
    for name, signal in (("u", columns), ("y", output), ("external", references)):
        _check_values(name, signal)
    samples = len(columns)
    longest = max(structure.delays)
    if longest >= samples - 1:
        raise DelayTooLong(longest, samples)
    if samples - longest < _SAMPLES_PER_PARAMETER * structure.parameters:
        raise OrdersNotSupported(
            structure.parameters,
            f"{samples} samples less a delay of {longest} leave {samples - longest}, and at least "
            f"{_SAMPLES_PER_PARAMETER * structure.parameters} are needed",
        )
    noise_free = columns if external is None else noise_free_inputs(columns, references)
    shifted, clean = (
        np.stack([delayed(c, d) for c, d in zip(signals.T, structure.delays, strict=True)])
        for signals in (columns, noise_free)
    )
    return SampledData(shifted, clean, np.ascontiguousarray(output[:, 0]), float(dt))


def _check_values(name: str, signal: np.ndarray) -> None:
    """Refuse NaN and constant columns."""
    for i, column in enumerate(signal.T):
        label = name if signal.shape[1] == 1 else f"{name}{i + 1}"
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise UnusableSignal(
                label,
                f"has {bad.size} sample(s) that are NaN or infinite, the first at {bad[0]}",
                "cut the record there or repair the log",
            )
        if np.ptp(column) == 0:
            raise UnusableSignal(
                label,
                f"is {column[0]:.6g} at every sample",
                "take a record in which it moves (one that begins before the step), check its "
                "column, or leave it out",
            )


#: Maximum number of Laguerre functions for each external signal.
_FUNCTIONS = 24

#: Poles tried: time constants of the loop, logarithmically spaced [samples].
_TIME_CONSTANTS = np.geomspace(2.0, 1000.0, 12)

#: Regularisation of linearly dependent functions, relative to their energy.
_RIDGE = 1e-10

#: Samples per block of a sum.
_STRETCH = 512


def noise_free_inputs(u: np.ndarray, external: np.ndarray) -> np.ndarray:
    """û (samples, inputs) from u (samples, inputs) and r (samples, signals)."""
    samples, inputs = u.shape
    best = np.full(inputs, np.inf)
    found = np.zeros_like(u)
    energy = np.sum(u**2, axis=0)
    for constant in _TIME_CONSTANTS[_TIME_CONSTANTS <= samples / 4]:
        basis = _laguerre(external, np.exp(-1.0 / constant), min(_FUNCTIONS, samples // 20))
        functions = len(basis)
        moments = _moments(np.concatenate([basis, u.T]))
        gram = moments[:functions, :functions]
        gram[np.diag_indices(functions)] *= 1.0 + _RIDGE
        factor = np.linalg.cholesky(gram)
        scores = np.linalg.solve(factor, moments[:functions, functions:])
        left = np.maximum(energy - np.cumsum(scores**2, axis=0), 1e-14 * energy)
        size = np.arange(1, functions + 1)[:, None]
        bic = samples * np.log(left / samples) + np.log(samples) * size
        for i, order in enumerate(np.argmin(bic, axis=0)):
            if bic[order, i] < best[i]:
                best[i] = bic[order, i]
                kept = slice(0, int(order) + 1)
                weights = np.linalg.solve(factor[kept, kept].T, scores[kept, i])
                found[:, i] = combined(weights, basis[kept])
    return found


def _laguerre(external: np.ndarray, a: float, functions: int) -> np.ndarray:
    """Rows r, L_1 r, L_2 r, … of all external signals, by order."""
    rows = [external.T]
    state = lfilter([0.0, np.sqrt(1 - a * a)], [1.0, -a], external.T)
    for _ in range(functions):
        rows.append(state)
        state = lfilter([-a, 1.0], [1.0, -a], state)
    return np.concatenate(rows)


@compiled(fastmath={"contract", "reassoc"})
def _moments(rows):
    """Σ_k v_ik v_jk of all pairs of rows, in stretches that stay in the cache."""
    size, samples = rows.shape
    out = np.zeros((size, size))
    for start in range(0, samples, _STRETCH):
        stop = min(start + _STRETCH, samples)
        for i in range(size):
            for j in range(i + 1):
                total = 0.0
                for k in range(start, stop):
                    total += rows[i, k] * rows[j, k]
                out[i, j] += total
    for i in range(size):
        for j in range(i):
            out[j, i] = out[i, j]
    return out


def simulate(model: LinearModel, u: np.ndarray) -> np.ndarray:
    """Noise-free output from rest, shape (samples,).

    Args:
        model: the model.
        u: inputs, shape (samples,) or (samples, inputs), at the model's sampling period.

    Raises:
        UnusableSignal: the inputs are not as many as the model's.
    """
    columns = np.asarray(u, dtype=float)
    columns = columns[:, None] if columns.ndim == 1 else columns
    inputs = len(model.numerators)
    if columns.ndim != 2 or columns.shape[1] != inputs:
        raise UnusableSignal(
            "u", f"has shape {np.shape(u)}", f"give (samples, {inputs}), one column for each input"
        )
    x = np.zeros(len(columns))
    terms = zip(model.numerators, model.denominators, model.delays, columns.T, strict=True)
    for b, a, delay, column in terms:
        shifted = delayed(column, delay)
        if model.continuous:
            x += continuous_response(b, a, shifted, model.dt, model.hold)
        else:
            x += lfilter(b, a, shifted)
    return x


def continuous_response(
    numerator: np.ndarray, denominator: np.ndarray, u: np.ndarray, dt: float, hold: Hold
) -> np.ndarray:
    """B(p)/A(p) u at the samples, from rest, shape (samples,)."""
    rows = filtered_derivatives(u, denominator, dt, hold)[-len(numerator) :]
    return combined(np.asarray(numerator, dtype=float), rows)


def delayed(u: np.ndarray, delay: int) -> np.ndarray:
    """The signal shifted by whole samples, zero before its beginning, shape of ``u``."""
    return np.r_[np.zeros(min(delay, u.size)), u[: max(u.size - delay, 0)]]
