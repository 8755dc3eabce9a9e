"""Torque error of any parameters from sums over the fitted record, without its signals.

Over the rows in use, with all base parameters β as columns of Φ and W = 1/rms² of each joint,

    G = ΦᵀWΦ,   g = ΦᵀWτ,   t = τᵀWτ,        ‖τ - Φβ‖²_W = t - 2 gᵀβ + βᵀGβ

The sums have the size of the parameters. They tell exactly what another set of parameters, a
consistent one for instance, costs in torque on that record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.regressor import Regressor

if TYPE_CHECKING:
    from pivident.estimation.identification import FittedRecording, Identification

#: Samples that are worked on at a time.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class TorqueSums:
    """Sums over the rows of the fitted record, torques over the rms error of their joint.

    Attributes:
        gram: G, shape (base, base).
        moment: g, shape (base,).
        square: t.
        rows: number of rows, all joints together.
    """

    gram: np.ndarray
    moment: np.ndarray
    square: float
    rows: int

    def squared_error(self, base: np.ndarray) -> float:
        """‖τ - Φβ‖²_W.

        Args:
            base: all base parameters, shape (base,).
        """
        value = self.square - 2.0 * self.moment @ base + base @ self.gram @ base
        return max(float(value), 0.0)

    def relative_error(self, base: np.ndarray) -> float:
        """‖τ - Φβ‖/‖τ‖ over all joints, weighted by joint, 0 to 1 and more.

        Args:
            base: all base parameters, shape (base,).
        """
        return float(np.sqrt(self.squared_error(base) / max(self.square, 1e-300)))

    def to_values(self) -> dict[str, Any]:
        """Plain values for a file; of G the lower triangle by rows."""
        lower = np.tril_indices(self.moment.size)
        return {
            "gram": self.gram[lower].tolist(),
            "moment": self.moment.tolist(),
            "square": self.square,
            "rows": self.rows,
        }

    @classmethod
    def from_values(cls, values: Mapping[str, Any], base: BaseParameters) -> TorqueSums:
        """The sums of :meth:`to_values`.

        Args:
            values: plain values.
            base: base parameters of the robot.

        Raises:
            ValueError: missing entries, sizes that are not those of the robot, numbers that are
                not finite, or a G that is not positive semidefinite.
        """
        size = len(base)
        numbers = {}
        for key, wanted in (
            ("gram", (size * (size + 1) // 2,)),
            ("moment", (size,)),
            ("square", ()),
            ("rows", ()),
        ):
            try:
                numbers[key] = np.asarray(values[key], dtype=float)
            except (KeyError, TypeError, ValueError) as error:
                raise ValueError(f"torque_sums: {key!r} is missing or not a number") from error
            if numbers[key].shape != wanted or not np.isfinite(numbers[key]).all():
                raise ValueError(
                    f"torque_sums: {key!r} has shape {numbers[key].shape} or is not finite; "
                    f"{size} base parameters need {wanted}"
                )
        if min(numbers["square"], numbers["rows"]) < 0.0:
            raise ValueError("torque_sums: square and rows cannot be negative")
        gram = np.zeros((size, size))
        gram[np.tril_indices(size)] = numbers["gram"]
        gram += np.tril(gram, -1).T
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        if np.linalg.eigvalsh(gram / np.outer(scale, scale))[0] < -1e-6:
            raise ValueError("torque_sums: 'gram' is not positive semidefinite")
        return cls(gram, numbers["moment"], float(numbers["square"]), int(numbers["rows"]))


def torque_sums(identification: Identification) -> TorqueSums:
    """Sums over the rows of an identification, all base parameters of its robot.

    Where the estimator worked on filtered rows, the torque is taken as Φθ of these rows plus the
    residual of the fit, so that the estimate has the error that it was reported with.

    Args:
        identification: an estimate with its signals.

    Raises:
        ValueError: it has no signals, as after reading it from a file.
    """
    if not identification.recordings:
        raise ValueError(
            "the identification holds no signals; its sums were made when it was saved "
            "(torque_sums), or identify again"
        )
    base = base_parameters(identification.robot)
    everything = Regressor.build(identification.robot, base.parameters)
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
    """The estimate among all base parameters, zero for those that it leaves out, shape (base,).

    Args:
        identification: the estimate.
        base: base parameters of its robot.

    Raises:
        ValueError: a parameter is no base parameter of the robot.
    """
    theta = np.zeros(len(base))
    theta[estimated_indices(identification, base)] = identification.theta
    return theta


def estimated_indices(identification: Identification, base: BaseParameters) -> np.ndarray:
    """Which base parameters an estimate holds, shape (parameters,).

    Raises:
        ValueError: a parameter is no base parameter of the robot.
    """
    place = {p.name: k for k, p in enumerate(base.parameters)}
    try:
        return np.array([place[p.name] for p in identification.parameters], dtype=np.int64)
    except KeyError as error:
        raise ValueError(
            f"{error.args[0]!r} is no base parameter of robot {identification.robot.name!r}; "
            "identify again with this robot"
        ) from None


def _used(recording: FittedRecording, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """Ones where a row is used, and the residual there, both (joints, samples)."""
    used = recording.used[part].T.astype(float)
    residual = (recording.tau[part] - recording.tau_model[part]).T
    return used, np.where(used > 0.0, residual, 0.0)
