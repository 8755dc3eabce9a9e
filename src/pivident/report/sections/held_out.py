"""Prediction of motion that was not fitted, and what the error is made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.diagnostics.prediction_statements import JOINT_MISSES
from pivident.report.sections.base import Section
from pivident.validation.held_out.cross_validation import CrossValidation


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
            "split": diagnostics.model_error,
        }
        if compared is not None:
            taken = compared.results[compared.recommended]
            errors = [r.prediction.relative_in_band for _, _, r in judged]
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
                "positions": _positions(judged),
                "advice": compared.simulated_over_rival is not None and compared.advice(),
            }
        return context


def _positions(judged: list[tuple[str, int, CrossValidation]]) -> dict[str, Any] | None:
    """Rms errors of the simulated positions by joint and method; None where nothing was simulated.

    Which loop was simulated follows the method's name where it is not the closed one.
    """
    found = [(label, k, r.simulation) for label, k, r in judged if r.simulation is not None]
    if not found:
        return None
    first = found[0][2]
    return {
        "methods": [(label, k, error.loop) for label, k, error in found],
        "rows": [
            (name, unit, [float(error.position[j]) for _, _, error in found])
            for j, (name, unit) in enumerate(zip(first.joint_names, first.units, strict=True))
        ],
    }
