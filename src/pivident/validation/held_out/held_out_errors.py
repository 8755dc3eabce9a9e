"""Held-out errors of a result in few numbers, as they are stored with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
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
    loop: str = ""  # closed or open: what was simulated; empty where nothing was
    positions: Mapping[str, float] = field(default_factory=dict)  # rms error [position unit]
    position_units: Mapping[str, str] = field(default_factory=dict)  # rad or m

    @classmethod
    def of(cls, judged: CrossValidation) -> HeldOutErrors:
        """Those of a cross-validation."""
        error, simulation = judged.prediction, judged.simulation

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
            "" if simulation is None else simulation.loop,
            {} if simulation is None else by_joint(simulation.position),
            {} if simulation is None else by_joint(simulation.units),
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
            loop = str(values.get("loop", ""))
            positions = {str(n): float(x) for n, x in values.get("positions", {}).items()}
            own = {str(n): str(unit) for n, unit in values.get("position_units", {}).items()}
            return cls(method, where, band, total, fitted, joints, rms, units, loop, positions, own)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise IdentificationError(f"held-out errors cannot be read ({error!r})") from None
