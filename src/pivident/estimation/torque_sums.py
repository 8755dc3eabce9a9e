"""Sums of the fitted record of an identification, and its estimate among all base parameters."""

from __future__ import annotations

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.errors import UnusableValue
from pivident.estimation.equation_record import FittedRecording
from pivident.estimation.identification import Identification
from pivident.estimation.solved_equations import TorqueSums

#: Samples that are worked on at a time.
BLOCK = 4096


def torque_sums(identification: Identification) -> TorqueSums:
    """Sums over the rows of an identification, all base parameters of its robot.

    Where the estimator worked on filtered rows, the torque is taken as Φθ of these rows plus the
    residual of the fit, so that the estimate has the error that it was reported with.
    """
    if not identification.recordings:
        raise UnusableValue(
            "the identification holds no signals",
            advice="its sums were made when it was saved (torque_sums), or identify again",
        )
    base = base_parameters(identification.robot)
    everything = regressor_of(identification.robot, base.parameters)
    theta = estimated_in_base(identification, base)
    weights = 1.0 / np.array([max(j.rms_error, 1e-150) ** 2 for j in identification.joints])
    size = len(base)
    gram, moment, square, rows = np.zeros((size, size)), np.zeros(size), 0.0, 0
    for recording in identification.recordings:
        inner = everything.inner(recording.q.T, recording.dq.T, recording.ddq.T, theta)
        for start in range(0, recording.t.size, BLOCK):
            part = slice(start, min(start + BLOCK, recording.t.size))
            used, residual = _used(recording, part)
            q, dq, ddq = (x[part].T for x in (recording.q, recording.dq, recording.ddq))
            packed = everything.packed(q, dq, ddq, inner=inner[:, part])
            for j in range(identification.robot.size):
                columns = everything.columns_of(j)
                phi = packed[everything.offsets[j] : everything.offsets[j + 1]] * used[j]
                tau = theta[columns] @ phi + residual[j]
                gram[np.ix_(columns, columns)] += weights[j] * (phi @ phi.T)
                moment[columns] += weights[j] * (phi @ tau)
                square += float(weights[j] * (tau @ tau))
                rows += int(np.count_nonzero(used[j]))
    return TorqueSums(gram, moment, square, rows)


def estimated_in_base(identification: Identification, base: BaseParameters) -> np.ndarray:
    """The estimate among all base parameters, zero for those that it leaves out, shape (base,)."""
    theta = np.zeros(len(base))
    theta[estimated_indices(identification, base)] = identification.theta
    return theta


def estimated_indices(identification: Identification, base: BaseParameters) -> np.ndarray:
    """Which base parameters an estimate holds, shape (parameters,)."""
    place = {p.name: k for k, p in enumerate(base.parameters)}
    try:
        return np.array([place[p.name] for p in identification.parameters], dtype=np.int64)
    except KeyError as error:
        raise UnusableValue(
            f"{error.args[0]!r} is not a base parameter of robot {identification.robot.name!r}",
            advice="identify again with this robot",
        ) from None


def _used(recording: FittedRecording, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """Ones where a row is used, and the residual there, both (joints, samples)."""
    used = recording.used[part].T.astype(float)
    residual = (recording.tau[part] - recording.tau_model[part]).T
    return used, np.where(used > 0.0, residual, 0.0)
