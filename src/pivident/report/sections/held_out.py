"""Prediction of motion that was not fitted, and what the error is made of."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section


class HeldOutSection(Section):
    """Errors of each method on held-out blocks, joint by joint; noise and model error apart."""

    title = "Motion that was not fitted"
    anchor = "held-out"
    template = "held_out.html"

    @property
    def applies(self) -> bool:
        """Only where something was held out, or a motion repeats."""
        examination = self.material.examination
        return examination.out_of_sample is not None or examination.model_error is not None

    def context(self) -> dict[str, Any]:
        """The comparison, and the split of the recommended method's residual."""
        examination = self.material.examination
        names = list(examination.identifications)
        compared = examination.out_of_sample
        judged = [] if compared is None else [
            (self.material.labels[names.index(name)], names.index(name), result)
            for name, result in compared.results.items()
        ]  # fmt: skip
        return {"compared": compared, "judged": judged, "split": examination.model_error}
