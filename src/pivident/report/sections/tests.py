"""All tests on residuals and instruments, with their numbers and in words."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section


class TestsSection(Section):
    """One table of residual tests for each method; sentences about its instruments."""

    __test__ = False  # not a test class, whatever its name looks like

    title = "Tests"
    anchor = "tests"

    def context(self) -> dict[str, Any]:
        """Tests by method."""
        diagnostics = self.data.diagnostics
        entries = []
        for k, name in enumerate(diagnostics.identifications):
            entries.append(
                (
                    self.data.labels[k],
                    k,
                    self.opened(k),
                    diagnostics.residuals[name],
                    diagnostics.instruments.get(name),
                )
            )
        return {"entries": entries, "fitted": self.data.fitted}
