"""An audit as files: ``audit.json`` and ``audit.html``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pivident.audit.audit import Audit, audits_json
from pivident.files import atomic_folder
from pivident.report.audit.audit_page import render_page
from pivident.report.builder import write_page


def write_audit(audits: Sequence[Audit], folder: str | Path) -> Path:
    """Write ``audit.json`` and ``audit.html``, both or neither.

    Args:
        audits: of one log or several.
        folder: folder to create or to write into.

    Returns:
        The page.

    Raises:
        PividentError: the folder cannot be written.
    """
    page = render_page(audits)
    with atomic_folder(folder) as build:
        write_page(build, "audit", page, audits_json(audits))
    return Path(folder) / "audit.html"
