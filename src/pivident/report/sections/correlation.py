"""Which parameters the record cannot distinguish."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from pivident.report.correlation_figure import correlation_figure
from pivident.report.sections.base import Section
from pivident.validation.parameter_correlation import (
    STRONG_CORRELATION,
    ParameterCorrelation,
    parameter_correlation,
)


class CorrelationSection(Section):
    """One map per method."""

    title = "Correlations of the parameters"
    anchor = "correlations"

    @cached_property
    def correlations(self) -> tuple[ParameterCorrelation | None, ...]:
        """Of each result, None where its standard errors are not known."""
        return tuple(parameter_correlation(i) for i in self.data.identifications)

    @property
    def applies(self) -> bool:
        """Only where standard errors are known."""
        return any(own is not None for own in self.correlations)

    def context(self) -> dict[str, Any]:
        """One gallery per method."""
        return {
            "galleries": [
                self.gallery(k, correlation_figure(own))
                for k, own in enumerate(self.correlations)
                if own is not None
            ],
            "several": self.data.several,
            "strong": STRONG_CORRELATION,
        }
