"""The numbers of the page as files, which it carries inside itself."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section


class DownloadsSection(Section):
    """Parameters of every method as CSV, JSON and LaTeX; signals of the one to take as CSV."""

    title = "Downloads"
    anchor = "downloads"

    def context(self) -> dict[str, Any]:
        """Files by method."""
        data = self.data
        return {
            "files": data.downloads,
            "methods": [
                (label, k, [file for file in data.downloads if file.method == k])
                for k, label in enumerate(data.labels)
            ],
        }
