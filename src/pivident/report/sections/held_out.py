"""Prediction of motion that was not fitted, and what the error is made of."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section


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
        return {"compared": compared, "judged": judged, "split": diagnostics.model_error}
