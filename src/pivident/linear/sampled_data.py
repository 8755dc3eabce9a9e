"""Inputs and output of an estimation, checked once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.errors import DelayTooLong, OrdersNotSupported, UnusableSignal
from pivident.linear.model import Structure
from pivident.linear.noise_free_input import noise_free_inputs
from pivident.linear.simulation import delayed

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
    array = np.asarray(signal, dtype=float)
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
