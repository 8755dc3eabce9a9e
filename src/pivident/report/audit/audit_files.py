"""An audit as files: ``audit.json`` and ``audit.html``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pivident.audit.audit import SCHEMA, Audit
from pivident.files import atomic_folder
from pivident.report.audit.audit_page import render_page
from pivident.report.builder import write_page
from pivident.text.finding import worst
from pivident.version import __version__


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
    content = {
        "schema": SCHEMA,
        "pivident": __version__,
        "severity": worst(f for audit in audits for f in audit.findings),
        "audits": [audit.as_json() for audit in audits],
    }
    page = render_page(audits)
    with atomic_folder(folder) as build:
        write_page(build, "audit", page, content)
    return Path(folder) / "audit.html"
