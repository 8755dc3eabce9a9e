"""The study of flexible joints as one HTML page that needs nothing else."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from pivident import __version__
from pivident.audit.figures import empty_plot
from pivident.flexibility.compliance import Compliance
from pivident.flexibility.joint_study import JointFlexibility, agreement_lines, flexibility_lines
from pivident.flexibility.resonance import Resonance
from pivident.report.builder import page_environment
from pivident.report.figures import MEASURED, METHOD_COLOURS, Figure

#: Characters of a line.
WIDTH = 96

#: Points of one trace.
POINTS = 1500


def render_page(found: Sequence[JointFlexibility]) -> str:
    """The page as text.

    Args:
        found: joints of recordings.
    """
    environment = page_environment()
    body = environment.from_string(
        '{% from "macros.html" import figure %}<pre>{{ text }}</pre>'
        '<div class="figures">{% for one in figures %}{{ figure(one) }}{% endfor %}</div>'
    )
    sections = []
    agreement = agreement_lines(found)
    if agreement:
        text = Markup(body.render(text=_wrapped(agreement), figures=[]))
        sections.append(("agreement", "Recordings compared", text))
    for number, one in enumerate(found, start=1):
        drawn = _figures(one)
        text = Markup(body.render(text=_wrapped(flexibility_lines(one)[1:]), figures=drawn))
        sections.append((f"joint-{number}", f"{one.recording}: {one.joint}", text))
    return environment.get_template("page.html").render(
        title="Flexible joints",
        sections=sections,
        version=__version__,
    )


def _wrapped(lines: Sequence[str]) -> str:
    """Lines of a report, broken where a page is narrower, with what follows indented further."""
    broken: list[str] = []
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()))
        broken += textwrap.wrap(
            line, WIDTH, initial_indent="", subsequent_indent=f"{indent}    ", drop_whitespace=False
        ) or [""]
    return "\n".join(part.rstrip() for part in broken)


def _figures(one: JointFlexibility) -> list[Figure]:
    """What there is to draw."""
    figures = []
    if one.compliance is not None:
        figures.append(deflection_figure(one.compliance))
    if one.resonance is not None and one.resonance.response.size:
        figures.append(response_figure(one.resonance))
    return figures


def deflection_figure(compliance: Compliance) -> Figure:
    """Deflection over the torque through the spring.

    Args:
        compliance: of one joint.
    """
    torque, measured, model = compliance.fitted
    kept = np.arange(0, len(torque), max(1, len(torque) // POINTS))
    plot = empty_plot("motor less link [mrad]")
    for values, name, colour in (
        (measured, "recorded, without transmission error", MEASURED),
        (model, "model", METHOD_COLOURS[0]),
    ):
        plot.add_scatter(
            x=torque[kept].astype(np.float32),
            y=(1e3 * values[kept]).astype(np.float32),
            mode="markers",
            name=name,
            marker={"color": colour, "size": 3, "opacity": 0.6},
        )
    plot.update_xaxes(title_text="torque through the spring [N m]")
    _with_legend(plot)
    note = f"stiffness {compliance.stiffness}; the encoders' lag and offset are still in it"
    return Figure(plot, 320, "Deflection", f"Deflection over torque; {note}", note)


def response_figure(resonance: Resonance) -> Figure:
    """Frequency response from torque to speed, measured and fitted.

    Args:
        resonance: of one joint.
    """
    frequency, measured, fitted = resonance.response
    plot = empty_plot("speed over torque [rad/s per N m]")
    plot.add_scatter(
        x=frequency,
        y=measured,
        mode="markers",
        name="measured",
        marker={"color": MEASURED, "size": 3},
    )
    plot.add_scatter(
        x=frequency,
        y=fitted,
        mode="lines",
        name="fitted",
        line={"color": METHOD_COLOURS[0], "width": 1.4},
    )
    plot.update_xaxes(title_text="frequency [Hz]", type="log")
    plot.update_yaxes(type="log", exponentformat="power")
    _with_legend(plot)
    return Figure(
        plot,
        320,
        "Frequency response",
        f"Magnitude from torque to speed; {resonance.conclusion}",
        resonance.conclusion,
    )


def _with_legend(plot: go.Figure) -> None:
    plot.update_layout(showlegend=True, legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})
