"""An audit as files: ``audit.json``, and one HTML page in the look of the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from markupsafe import Markup

from pivident.foundation.document.figure import Figure
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.finding import Finding, counted, gravest_first, serious
from pivident.judgement.audit.audit import Audit, audits_json
from pivident.judgement.report.audit import audit_figures as figures
from pivident.judgement.report.builder import page_environment, page_of, write_page


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


def render_page(audits: Sequence[Audit]) -> str:
    """The page as text."""
    environment = page_environment("pivident.judgement.report.audit")
    template = environment.get_template("audit.html")
    summary = environment.get_template("audit_summary.html")
    sections = []
    for number, audit in enumerate(audits, start=1):
        tag = f"-{number}" if len(audits) > 1 else ""
        name = f"{audit.log.name}: " if len(audits) > 1 else ""
        grave = serious(audit.findings)
        body = summary.render(audit=audit, serious=grave, counted=counted(audit.findings))
        sections.append((f"summary{tag}", f"{name}What was found", Markup(body)))
        for topic in audit.topics:
            check, heading = topic.name, topic.heading
            drawn = _figures(audit, check)
            found = gravest_first(audit.of(check))
            if found or drawn:
                body = template.render(
                    findings=found,
                    figures=drawn,
                    position=position,
                    placed=any(position(finding) for finding in found),
                )
                sections.append((f"{check}{tag}", f"{name}{heading}", Markup(body)))
    # What was found in a single log heads the page, before the list of contents.
    title = f"Audit of {', '.join(audit.log.name for audit in audits)}"
    return page_of(environment, title, sections, headed=len(audits) == 1)


def position(finding: Finding) -> str:
    """Where in the log a finding begins."""
    if finding.sample is None:
        return ""
    time = "" if finding.time is None else f", t = {finding.time:.6g} s"
    return f"sample {finding.sample}{time}"


def _figures(audit: Audit, check: str) -> list[Figure]:
    """The drawings that belong to a check."""
    drawers: dict[str, Callable[[], Sequence[Figure | None]]] = {
        "timing": lambda: [figures.interval_figure(audit), figures.clock_figure(audit)],
        "quantisation": lambda: [figures.grid_figure(audit), *figures.steps_figures(audit)],
        "order": lambda: [figures.order_figure(audit)],
        "delay": lambda: [figures.shift_figure(audit)],
        "power": lambda: figures.torque_speed_figures(audit),
        "excitation": lambda: figures.excitation_figures(audit),
    }
    drawn = drawers[check]() if check in drawers else []
    return [figure for figure in drawn if figure is not None]
