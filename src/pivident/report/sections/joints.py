"""Fit, noise model and smoother of each joint."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section


class JointsSection(Section):
    """One row per joint and method."""

    title = "Fit of each joint"
    anchor = "joints"

    def context(self) -> dict[str, Any]:
        """Joint fits with the unit of their positions."""
        data = self.data
        return {
            "tables": [
                (
                    label,
                    k,
                    [
                        (fit, joint.position_unit)
                        for fit, joint in zip(
                            identification.joints, identification.robot.joints, strict=True
                        )
                    ],
                    identification.relative_error,
                )
                for k, (label, identification) in enumerate(
                    zip(data.labels, data.identifications, strict=True)
                )
            ],
            "several": data.several,
            "fitted": data.fitted,
        }
