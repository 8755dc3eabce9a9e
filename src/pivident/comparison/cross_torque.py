"""How well the parameters of one result predict the torque of the record of another.

The sums G, g, t of a result over its own record (`pivident.estimation.solved_equations`) give the
error of any parameters on that record,

    ‖τ - Φβ‖/‖τ‖ = √((t - 2 gᵀβ + βᵀGβ)/t),      ‖Φ(β_b - β_a)‖/‖τ‖ = √((β_b - β_a)ᵀG(β_b - β_a)/t)

over all joints, each weighted by its own rms error. No signal is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.comparison.entry import Entry


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


def cross_torques(entries: Sequence[Entry]) -> tuple[CrossTorque, ...]:
    """One for each result that holds the sums or the signals of its record."""
    found = []
    for k, entry in enumerate(entries):
        identification = entry.identification
        if identification is None:
            continue
        sums = identification.torque_sums
        if sums is None and identification.recordings:
            from pivident.estimation.torque_sums import torque_sums

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
        found.append(CrossTorque(k, error, apart))
    return tuple(found)


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
