"""Errors of a state-dependent model on held-out motion, and the gain of each of its terms.

The record is cut into blocks of time. Each block is predicted from the others, with a correlation
length left out on both sides, and the errors are compared below the motion's highest frequency:
above it there is noise that no law explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pivident.signals.bandpass import butterworth
from pivident.studies.friction.back_fitting import StateDependence
from pivident.studies.friction.friction_torque import FrictionTorque
from pivident.studies.friction.state_dependent import StateDependentFit, contributions_without

#: Blocks that are left out in turn.
BLOCKS = 10


@dataclass(frozen=True, eq=False)
class HeldOutError:
    """Errors on held-out motion, block by block."""

    squares: np.ndarray  # mean square of the error in each block [torque_unit²], shape (blocks,)
    samples: np.ndarray  # samples of each block, likewise

    @property
    def rms(self) -> float:
        """Over all blocks [torque_unit]."""
        return float(np.sqrt(np.average(self.squares, weights=self.samples)))

    def gain(self, other: HeldOutError) -> tuple[float, float]:
        """Reduction of the error against another on the same blocks, and its standard error [%]."""
        own, base, n = self.squares, other.squares, self.samples
        every = np.arange(len(own))

        def of(kept: np.ndarray) -> float:
            ratio = (own[kept] @ n[kept]) / max(float(base[kept] @ n[kept]), 1e-300)
            return 100.0 * (1.0 - float(np.sqrt(ratio)))

        without = np.array([of(every[every != k]) for k in every])
        spread = np.sqrt((len(every) - 1) * np.mean((without - without.mean()) ** 2))
        return of(every), float(spread)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors of the models of one joint on held-out motion."""

    band: float  # below which they are compared [Hz]
    constant: HeldOutError  # viscous, Coulomb friction and offset as constants
    speed: HeldOutError  # functions of speed alone
    by_term: dict[str, HeldOutError]  # all functions but one, by the name of the one left out
    full: HeldOutError  # all functions


def held_out_error(
    friction: FrictionTorque, terms: Sequence[StateDependence], fit: StateDependentFit
) -> HeldOutError:
    """Error of a model on blocks that were left out, smoothness and correlation from ``fit``."""
    return _by_block(
        friction,
        fit.correlation,
        lambda used: contributions_without(friction.tau, terms, fit, used, friction.record),
    )


def constant_law_error(friction: FrictionTorque, correlation: float) -> HeldOutError:
    """Error of fv dq + fc sign(dq) + off, fitted without the block and D samples on both sides."""
    columns = np.column_stack([friction.dq, friction.direction, np.ones(friction.dq.size)])

    def model(used: np.ndarray) -> np.ndarray:
        return columns @ np.linalg.lstsq(columns[used], friction.tau[used], rcond=None)[0]

    return _by_block(friction, correlation, model)


def _by_block(
    friction: FrictionTorque, correlation: float, model: Callable[[np.ndarray], np.ndarray]
) -> HeldOutError:
    """Error on each block of a model that is fitted without it, and D samples on both sides."""
    gap, error = int(np.ceil(correlation)), np.zeros(friction.tau.size)
    borders = np.linspace(0, error.size, BLOCKS + 1).astype(int)
    blocks = [slice(a, b) for a, b in pairwise(borders.tolist())]
    for block in blocks:
        used = friction.moving.copy()
        used[max(block.start - gap, 0) : block.stop + gap] = False
        error[block] = (friction.tau - model(used))[block]
    low = np.zeros(error.size)
    for k in np.unique(friction.record):
        own = friction.record == k
        moving = np.where(friction.moving, error, 0.0)[own]
        low[own] = butterworth(moving, friction.rate, friction.band)
    parts = [low[block][friction.moving[block]] ** 2 for block in blocks]
    parts = [part for part in parts if part.size]
    return HeldOutError(
        np.array([part.mean() for part in parts]), np.array([float(part.size) for part in parts])
    )
