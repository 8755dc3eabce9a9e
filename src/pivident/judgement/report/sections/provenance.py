"""Where the results come from, and the files that the page carries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pivident.judgement.report.sections.base import Section


class ProvenanceSection(Section):
    """Options of each method side by side, sources, versions."""

    title = "Options and provenance"
    anchor = "provenance"

    def context(self) -> dict[str, Any]:
        """Flat options by name, recordings, sources and versions."""
        identifications = self.data.identifications
        options = [dict(_flat(i.options)) for i in identifications]
        names = dict.fromkeys(name for entry in options for name in entry)
        return {
            "labels": self.data.labels,
            "options": {name: [entry.get(name, "–") for entry in options] for name in names},
            "recordings": [(name, text) for name, text in self._accounts().items() if text],
            "sources": {
                name: digest for i in identifications for name, digest in i.sources.items()
            },
            "versions": list(dict.fromkeys(i.version or "unknown" for i in identifications)),
        }

    def _accounts(self) -> dict[str, tuple[str, ...]]:
        """How each recording was logged and what was done to its samples."""
        recordings = (r for i in self.data.identifications for r in i.recordings)
        return {recording.name: recording.account for recording in recordings}


def _flat(options: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Nested options as ``signals.order``: text."""
    for key, value in options.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, (tuple, list)):
            yield f"{prefix}{key}", ", ".join(map(str, value)) or "–"
        else:
            yield f"{prefix}{key}", str(value)


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
