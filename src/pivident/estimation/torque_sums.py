"""Torque error of any parameters from sums over the fitted record, without its signals.

Over the rows in use, with all base parameters β as columns of Φ and W = 1/rms² of each joint,

    G = ΦᵀWΦ,   g = ΦᵀWτ,   t = τᵀWτ,        ‖τ - Φβ‖²_W = t - 2 gᵀβ + βᵀGβ

The sums have the size of the parameters. From them follows exactly what another
set of parameters, a consistent one for instance, costs in torque on that record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters


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
