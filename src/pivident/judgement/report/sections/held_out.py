"""Prediction of motion that was not fitted, and what the error is made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.judgement.diagnostics.prediction_statements import JOINT_MISSES
from pivident.judgement.report.sections.base import Section


class HeldOutSection(Section):
    """Errors of each method on held-out blocks, joint by joint; noise and model error apart."""

    title = "Motion that was not fitted"
    anchor = "held-out"

    @property
    def applies(self) -> bool:
        """Only where something was held out, or a motion repeats."""
        diagnostics = self.data.diagnostics
        return diagnostics.out_of_sample is not None or diagnostics.model_error is not None

    def context(self) -> dict[str, Any]:
        """The comparison, and the split of the recommended method's residual."""
        diagnostics = self.data.diagnostics
        names = list(diagnostics.identifications)
        compared = diagnostics.out_of_sample
        judged = [] if compared is None else [
            (self.data.labels[names.index(name)], names.index(name), result)
            for name, result in compared.results.items()
        ]  # fmt: skip
        context: dict[str, Any] = {
            "compared": compared,
            "judged": judged,
            "methods": {label: k for label, k, _ in judged},
            "split": diagnostics.model_error,
        }
        if compared is not None:
            taken = compared.results[compared.recommended]
            errors = [r.prediction.relative_in_band for _, _, r in judged]
            loops = [r.simulation.loop for _, _, r in judged if r.simulation is not None]
            worst = int(np.argmax(taken.prediction.relative_in_band))
            context |= {
                "blocks": taken.kind == "folds",
                "motion": taken.motion,
                "joints": list(
                    zip(taken.prediction.joint_names, np.transpose(errors), strict=True)
                ),
                "worst": taken.prediction.joint_names[worst],
                "worst_error": float(taken.prediction.relative_in_band[worst]),
                "missed_above": JOINT_MISSES,
                "positions": compared.position_table(),
                "open_loop": "open" in loops,
                "advice": compared.simulated_over_rival is not None and compared.advice(),
            }
        return context
