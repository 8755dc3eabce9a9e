"""Logged torque per torque of the robot's description, joint by joint.

A rotor of unknown inertia adds to what the links need to be accelerated; it is estimated beside the
factor where the description has none:

    τ_j = a (g_j(q) + (M(q) ddq + c(q, dq))_j) + b ddq_j + friction
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.data.logs.log import Log
from pivident.judgement.audit.blocked_fit import blocked_fit, jackknife, orthonormal
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.judgement.audit.scale import ALIKE, OWN, Scale, check_scale, share_apart

#: Relative standard error above which a factor is not used, and distance from the typical one.
BLUNT, FAR = 0.3, 5.0

#: Standard errors from zero that a reversed sign must have.
CLEAR = 4.0


def description_factors(log: Log, model: InverseModel, signs_right: Sequence[int] = ()) -> Scale:
    """Logged torque per torque of the description, and its standard error, by joint.

    ``signs_right``: joints whose friction shows that their sign is right. Where the description
    says otherwise, or its torque has another shape, its body is wrong: no sign follows from it.
    """
    robot = model.robot
    scale = check_scale(log, model)
    factors, standard_errors = scale.factors.copy(), scale.standard_errors.copy()
    for j in np.flatnonzero(robot.rotor_inertia == 0.0):
        if model.usable(int(j)):
            factors[j], standard_errors[j] = _beside_a_rotor(model, int(j))
    factors[~(standard_errors < BLUNT * np.abs(factors))] = np.nan
    factors[(factors < 0) & ~(standard_errors * CLEAR < np.abs(factors))] = np.nan
    unlike = ~(np.abs(scale.likeness) >= ALIKE)
    unlike[list(signs_right)] = True
    factors[(factors < 0) & unlike] = np.nan
    if np.isfinite(factors).any():
        for kind in ("revolute", "prismatic"):  # a factor far from all others is a wrong one
            own = np.array([joint.kind == kind for joint in robot.joints])
            if np.isfinite(factors[own]).sum() > 1:
                typical = np.nanmedian(np.abs(factors[own]))
                off = np.abs(np.log(np.abs(factors) / typical)) > np.log(FAR)
                factors[own & off] = np.nan
    return replace(scale, factors=factors, standard_errors=standard_errors)


def _beside_a_rotor(model: InverseModel, j: int) -> tuple[float, float]:
    """Factor of one joint with the inertia of its rotor as a further unknown."""
    rows = model.moving[:, j]
    described = (model.gravity + model.inertial)[rows, j]
    parameters = model.base.parameters
    friction = [
        k
        for k, index in enumerate(model.own[j])
        if parameters[index].friction is not None or parameters[index].coupling is not None
    ]
    size = float(np.linalg.norm(described))
    acceleration = model.ddq[rows, j]
    if size == 0.0 or not acceleration.any():
        return np.nan, np.nan
    others = np.column_stack([model.columns[j][rows][:, friction], acceleration])
    others = orthonormal(others / np.maximum(np.linalg.norm(others, axis=0), 1e-300))[0]
    if share_apart(described, others) < OWN:  # a vertical slide: weight and mass, offset and rotor
        return np.nan, np.nan
    fit = blocked_fit(
        np.column_stack([described / size, others]), model.tau()[rows, j], model.block[rows]
    )
    return float(fit.estimate[0]) / size, float(jackknife(fit.replicates[:, :1])[0]) / size
