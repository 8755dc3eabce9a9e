"""The friction of a record as files: page, JSON, and curves as tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from pivident.foundation.files import atomic_folder
from pivident.judgement.report.builder import page_environment, page_of, write_page
from pivident.studies.friction.curves import as_json, curves_table
from pivident.studies.friction.friction_figures import gain_figure, joint_figures, ripple_figures
from pivident.studies.friction.friction_findings import FrictionFinding, headline
from pivident.studies.friction.friction_study import FrictionStudy


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


def render_page(study: FrictionStudy, title: str | None = None) -> str:
    """The page as text."""
    environment = page_environment("pivident.studies.friction")
    environment.globals["headline"] = headline
    environment.filters["clear"] = _clear
    summary = environment.get_template("friction_summary.html").render(
        study=study, gain=gain_figure(study.joints)
    )
    sections = [("summary", "What was seen", Markup(summary))]
    template = environment.get_template("friction_joint.html")
    for number, joint in enumerate(study.joints, start=1):
        body = template.render(joint=joint, figures=joint_figures(joint))
        sections.append((f"joint-{number}", joint.name, Markup(body)))
    if study.ripple is not None:
        drawn = {j.name: ripple_figures(j) for j in study.ripple.joints}
        body = environment.get_template("friction_ripple.html").render(
            ripple=study.ripple, figures=drawn
        )
        sections.append(("ripple", "Ripple over position", Markup(body)))
    return page_of(environment, title or f"{study.robot}: friction", sections)


def _clear(findings: Sequence[FrictionFinding]) -> bool:
    """Whether anything stands out beyond viscous and Coulomb friction."""
    return any(f.severity == "warning" for f in findings)
