"""Held-out errors of a result in few numbers, as they are stored with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pivident.errors import IdentificationError
from pivident.validation.held_out.cross_validation import CrossValidation


@dataclass(frozen=True)
class HeldOutErrors:
    """Torque errors below ``band`` on motion that was not fitted."""

    method: str  # name of the method
    where: str  # what was held out, in words
    band: float  # highest frequency of the motion [Hz]
    total: float  # over all joints [%]
    fitted: float  # on the fitted motion [%]
    joints: Mapping[str, float]  # of each joint [%]
    rms: Mapping[str, float]  # rms error of each joint [N m or N]
    units: Mapping[str, str]  # its unit

    @classmethod
    def of(cls, judged: CrossValidation) -> HeldOutErrors:
        """Those of a cross-validation."""
        error = judged.prediction

        def by_joint(values: Any) -> dict[str, Any]:
            return dict(zip(error.joint_names, np.asarray(values).tolist(), strict=True))

        return cls(
            judged.method,
            judged.where,
            error.band,
            error.total_in_band,
            judged.training.total_in_band,
            by_joint(error.relative_in_band),
            by_joint(error.rms_in_band),
            by_joint(error.units),
        )

    @property
    def worst(self) -> str:
        """The joint with the largest error."""
        return max(self.joints, key=self.joints.__getitem__)

    def to_values(self) -> dict[str, Any]:
        """Plain values for a file."""
        return asdict(self)

    @classmethod
    def from_values(cls, values: Any) -> HeldOutErrors:
        """The errors of :meth:`to_values`.

        Raises:
            IdentificationError: they are not errors.
        """
        try:
            joints, rms = (
                {str(n): float(x) for n, x in values[k].items()} for k in ("joints", "rms")
            )
            band, total, fitted = (float(values[k]) for k in ("band", "total", "fitted"))
            units = {str(n): str(unit) for n, unit in values["units"].items()}
            method, where = str(values["method"]), str(values["where"])
            return cls(method, where, band, total, fitted, joints, rms, units)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise IdentificationError(f"held-out errors cannot be read ({error!r})") from None
