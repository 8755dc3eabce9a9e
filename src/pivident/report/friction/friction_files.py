"""The friction of a record as files: page, JSON, and curves as tables."""

from __future__ import annotations

from pathlib import Path

from pivident.files import atomic_folder
from pivident.friction.curves import as_json, curves_table
from pivident.friction.friction_study import FrictionStudy
from pivident.report.builder import write_page
from pivident.report.friction.friction_page import render_page


def write_friction(study: FrictionStudy, folder: str | Path, title: str | None = None) -> Path:
    """Write ``friction.html``, ``friction.json``, ``curves.csv`` and ``curves.parquet``.

    All of them or none.

    Args:
        study: the friction of a record.
        folder: folder to create or to write into.
        title: title of the page.

    Returns:
        The page.

    Raises:
        PividentError: the folder cannot be written.
    """
    page = render_page(study, title)
    table = curves_table(study)
    content = as_json(study)
    with atomic_folder(folder) as build:
        write_page(build, "friction", page, content)
        table.write_csv(build / "curves.csv", float_precision=None)
        table.write_parquet(build / "curves.parquet")
    return Path(folder) / "friction.html"
