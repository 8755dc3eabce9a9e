"""Ratios of the joints' gains by what their torques have in common.

A mass on the forearm acts on shoulder and elbow. Where each joint's torque has a gain of its own,

    c_j = ν_j Φ_j θ + e_j,        ν_j = s_j exp(-ℓ_j),

the record determines the ratios of the gains as far as joints share parameters, and no mass of a
description is needed (`pivident.estimation.drives.gain_equations`). One scale remains free: that
of gains that are known, or else the mean of the logarithms is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.drives.gain_equations import (
    GainEquations,
    covariance,
    homogeneous_start,
    least_squares,
)
from pivident.estimation.normal_equations import JointSums
from pivident.judgement.audit.inverse_model import InverseModel

#: Standard deviation of the logarithm of a gain that is held at what is known of it.
HELD = 1e-3


@dataclass(frozen=True, eq=False)
class GainRatios:
    """Gains against those that are known, or against each other.

    Attributes:
        gains: N m (or N) per unit of the log, of the sign that was given, shape (joints,).
        connected: joints whose gain, or whose ratio to others, the record determines, likewise.
    """

    gains: np.ndarray
    connected: np.ndarray


def gain_ratios(sums: Sequence[JointSums], signs: np.ndarray, known: np.ndarray) -> GainRatios:
    """The gains that let all joints share one set of parameters.

    Args:
        sums: of each joint, with Z = Φ and those of stretches of time.
        signs: of the gains, shape (joints,).
        known: sizes of gains that are known, NaN elsewhere, likewise.
    """
    joints, size = len(sums), 1 + max(int(own.columns.max(initial=0)) for own in sums)
    given = np.isfinite(known)
    from pivident.estimation.drives.log_units import gain_groups

    equations = GainEquations(
        [sums],
        [np.eye(size)],
        [np.zeros(size)],
        signs,
        np.array([[max(own.own_variance(), 1e-12 * own.tt) for own in sums]]),
        np.log(np.where(given, known, 1.0)),
        np.where(given, HELD, np.inf),
    )
    start = homogeneous_start(equations)
    start += np.mean((equations.centre - start)[given] if given.any() else -start)
    ell, x = least_squares(equations, np.where(given, equations.centre, start))
    try:
        groups = gain_groups(covariance(equations, ell, x)[:joints, :joints])
    except np.linalg.LinAlgError:  # all that is known of one lies within one stretch of time
        return GainRatios(signs * np.exp(equations.centre), np.zeros(joints, bool))
    chosen = max(groups, key=lambda group: (group.anchored, len(group.motors)))
    ties = chosen.anchored or len(chosen.motors) > 1
    connected = np.isin(np.arange(joints), chosen.motors) & ties
    if ties and not given.any():
        ell = ell - ell[connected].mean()
    return GainRatios(signs * np.exp(np.where(connected, ell, equations.centre)), connected)


def sums_of(model: InverseModel) -> list[JointSums]:
    """Sums of all joints' rows, and of each stretch of time."""
    tau, stretches, made = model.tau(), np.unique(model.block), []
    for j, own in enumerate(model.own):
        counting = [model.moving[:, j] & (model.block == k) for k in stretches]
        parts = [(model.columns[j][rows], tau[rows, j]) for rows in counting]
        grams = np.array([phi.T @ phi for phi, _ in parts])
        rights = np.array([phi.T @ y for phi, y in parts])
        square = sum(float(y @ y) for _, y in parts)
        name, rows = model.robot.joint_names[j], sum(len(y) for _, y in parts)
        made.append(joint_sums(name, own, grams, rights, square, rows))
    return made


def joint_sums(
    name: str, columns: np.ndarray, grams: np.ndarray, rights: np.ndarray, square: float, rows: int
) -> JointSums:
    """Sums with Z = Φ from those of stretches, shapes (stretches, k, k) and (stretches, k)."""
    gram, right = grams.sum(axis=0), rights.sum(axis=0)
    return JointSums(name, columns, gram, gram, gram, right, right, grams, rights, square, rows)
