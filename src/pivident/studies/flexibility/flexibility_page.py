"""The study of flexible joints as one self-contained HTML page, and its files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from pivident.foundation.document.figure import MEASURED, METHOD_COLOURS, Figure
from pivident.foundation.document.plot import trace
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.plain_values import plain
from pivident.judgement.report.audit.audit_figures import audit_plot
from pivident.judgement.report.builder import page_environment, page_of, write_page
from pivident.studies.flexibility.compliance import Compliance
from pivident.studies.flexibility.flexibility_text import agreement_lines, of_kind, parts_of
from pivident.studies.flexibility.joint_study import JointFlexibility
from pivident.studies.flexibility.resonance import Resonance

#: Points of one trace.
POINTS = 1500


def render_page(found: Sequence[JointFlexibility]) -> str:
    """The page as text."""
    environment = page_environment("pivident.studies.flexibility")
    summary = environment.get_template("flexibility_summary.html")
    template = environment.get_template("flexibility_joint.html")
    names = [f"{one.recording}: {one.joint}" for one in found]
    body = summary.render(
        joints=list(zip(names, found, strict=True)),
        agreement=agreement_lines(found),
        stiffness=_stiffness,
    )
    sections = [("summary", "Results", Markup(body))]
    for number, (name, one) in enumerate(zip(names, found, strict=True), start=1):
        body_of_joint = template.render(parts=parts_of(one), figures=_figures(one))
        sections.append((f"joint-{number}", name, Markup(body_of_joint)))
    return page_of(environment, "Flexible joints", sections)


def _stiffness(one: JointFlexibility) -> str:
    """Stiffness of a joint from the best source available."""
    if one.two_mass is not None:
        known = one.two_mass.measured("stiffness")
    elif one.resonance is not None and one.resonance.stiffness is not None:
        known = one.resonance.stiffness
    elif one.compliance is not None:
        known = one.compliance.stiffness
    else:
        return "not determined"
    return of_kind(str(known), one.sliding)


def _figures(one: JointFlexibility) -> list[Figure]:
    """Figures of the available results."""
    figures = []
    if one.compliance is not None:
        figures.append(deflection_figure(one.compliance, one.sliding))
    if one.resonance is not None and one.resonance.response.size:
        figures.append(response_figure(one.resonance, one.sliding))
    return figures


def deflection_figure(compliance: Compliance, sliding: bool = False) -> Figure:
    """Deflection over the torque through the spring."""
    torque, measured, model = compliance.fitted
    kept = np.arange(0, len(torque), max(1, len(torque) // POINTS))
    points = [
        trace(
            x=torque[kept].astype(np.float32),
            y=(1e3 * values[kept]).astype(np.float32),
            mode="markers",
            name=name,
            marker={"color": colour, "size": 3, "opacity": 0.6},
        )
        for values, name, colour in (
            (measured, "recorded, without transmission error", MEASURED),
            (model, "model", METHOD_COLOURS[0]),
        )
    ]
    quantity = "force" if sliding else "torque"
    plot = audit_plot(
        of_kind("motor less link [mrad]", sliding),
        of_kind(f"{quantity} through the spring [N m]", sliding),
        points,
        legend=True,
    )
    stiffness = of_kind(str(compliance.stiffness), sliding)
    note = f"stiffness {stiffness}; lag and offset of the encoders are not removed"
    if not compliance.explained:
        note = f"{100 * compliance.unexplained:.2g} % of it is unexplained: no stiffness is given"
    return Figure(plot, 320, "Deflection", f"Deflection over {quantity}; {note}", note)


def response_figure(resonance: Resonance, sliding: bool = False) -> Figure:
    """Frequency response from torque to speed, measured and fitted."""
    frequency, measured, fitted = resonance.response
    quantity = "force" if sliding else "torque"
    conclusion = of_kind(resonance.conclusion, sliding)
    traces = [
        trace(
            x=frequency,
            y=measured,
            mode="markers",
            name="measured",
            marker={"color": MEASURED, "size": 3},
        ),
        trace(
            x=frequency,
            y=fitted,
            mode="lines",
            name="fitted",
            line={"color": METHOD_COLOURS[0], "width": 1.4},
        ),
    ]
    plot = audit_plot(
        of_kind(f"speed over {quantity} [rad/s per N m]", sliding),
        "frequency [Hz]",
        traces,
        x={"type": "log"},
        y={"type": "log"},
        legend=True,
    )
    return Figure(
        plot,
        320,
        "Frequency response",
        f"Magnitude from {quantity} to speed; {conclusion}",
        conclusion,
    )


def write_study(found: Sequence[JointFlexibility], folder: str | Path) -> Path:
    """Write ``flexibility.json`` and ``flexibility.html``, both or neither; returns the page."""
    content = {"schema": "pivident-flexibility/1", "joints": plain(list(found))}
    page = render_page(found)
    with atomic_folder(folder) as build:
        write_page(build, "flexibility", page, content)
    return Path(folder) / "flexibility.html"
