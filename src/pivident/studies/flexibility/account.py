"""The study of flexible joints as one self-contained HTML page, and its files.

A joint's flexibility in rows and sentences, for terminal and page.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from markupsafe import Markup

from pivident.foundation.document.plot import MEASURED, METHOD_COLOURS, Figure, trace
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.plain_values import plain
from pivident.judgement.report.audit_account import audit_plot
from pivident.judgement.report.builder import page_environment, page_of, write_page
from pivident.studies.flexibility.compliance import Compliance
from pivident.studies.flexibility.joint_study import JointFlexibility, summary
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
        agreement=list(agreement_lines(found)),
        stiffness=_stiffness,
    )
    joints = [
        (
            f"joint-{number}",
            name,
            Markup(template.render(parts=parts_of(one), figures=list(_figures(one)))),
        )
        for number, (name, one) in enumerate(zip(names, found, strict=True), start=1)
    ]
    sections = [("summary", "Results", Markup(body)), *joints]
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


def _figures(one: JointFlexibility) -> Iterator[Figure]:
    """Figures of the available results."""
    if one.compliance is not None:
        yield deflection_figure(one.compliance, one.sliding)
    if one.resonance is not None and one.resonance.response.size:
        yield response_figure(one.resonance, one.sliding)


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
    note = (
        f"stiffness {stiffness}; lag and offset of the encoders are not removed"
        if compliance.explained
        else f"{100 * compliance.unexplained:.2g} % of it is unexplained: no stiffness is given"
    )
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


#: Units of prismatic joints.
SLIDING = {
    "N m s/rad": "N s/m",
    "N m/rad": "N/m",
    "rad/s per N m": "m/s per N",
    "kg m²": "kg",
    "N m": "N",
    "rad": "m",
}


@dataclass(frozen=True)
class Part:
    """Results of one method for a joint."""

    heading: str  # the method
    rows: tuple[tuple[str, str], ...]  # names and values with unit and interval
    sentences: tuple[str, ...]  # reservations


def parts_of(found: JointFlexibility) -> list[Part]:
    """The results by method."""
    parts = []
    if found.compliance is not None:
        rows = [
            *(_estimated_rows(found.compliance) if found.compliance.explained else []),
            *_recorded_rows(found.compliance),
        ]
        parts.append(("both encoders, slow motion", rows, found.compliance.notes))
    if found.two_mass is not None:
        two = found.two_mass
        rows = [(_words(name), str(two.measured(name))) for name in two.names]
        rows.append(("antiresonance", str(two.antiresonance)))
        parts.append(("both encoders, two masses", rows, two.notes))
    if found.resonance is not None:
        values = {
            _words(name): getattr(found.resonance, name)
            for name in ("resonance", "motor_inertia", "load_inertia", "damping")
        }
        rows = [(name, str(value)) for name, value in values.items() if value is not None]
        parts.append(("motor encoder alone", rows, (found.resonance.conclusion,)))
    if found.rigid is not None:
        parts.append((f"rigid model: {found.rigid.severity}", [], found.rigid.sentences))
    if found.notes:
        parts.append(("not determined", [], found.notes))

    def with_units(text: str) -> str:
        return of_kind(text, found.sliding)

    return [
        Part(
            heading,
            tuple((name, with_units(value)) for name, value in rows),
            tuple(with_units(sentence) for sentence in sentences),
        )
        for heading, rows, sentences in parts
    ]


def flexibility_lines(found: JointFlexibility) -> list[str]:
    """The results in lines of text."""
    lines = [f"{found.recording}, {found.joint}"]
    for part in parts_of(found):
        lines += [
            f"  {part.heading}",
            *(f"    {name:<22} {value}" for name, value in part.rows),
            *(f"    {sentence}" for sentence in part.sentences),
        ]
    return lines


def of_kind(text: str, sliding: bool) -> str:
    """A text with the units of a sliding joint, if it is one."""
    if sliding:
        for turning, other in SLIDING.items():
            text = text.replace(turning, other)
    return text


def _words(name: str) -> str:
    """A parameter name in words."""
    return name.replace("_", " ").replace("coulomb", "Coulomb")


def _estimated_rows(c: Compliance) -> list[tuple[str, str]]:
    """Estimated terms of the deflection."""
    rows: list[tuple[str, object]] = [
        ("stiffness", c.stiffness),
        ("motor friction", c.friction),
        ("hysteresis, width", c.hysteresis.times(1e3, "mrad")),
        (
            "backlash",
            "torque keeps its sign" if c.backlash is None else c.backlash.times(1e3, "mrad"),
        ),
        ("damping and delay", c.damping),
        ("link encoder later by", c.encoder_lag.times(1e3, "ms")),
        ("zeros differ by", c.offset.times(1e3, "mrad")),
    ]
    rows += [
        (f"error, order {line.order:.4g}", line.amplitude.times(1e3, "mrad"))
        for line in c.lines
        if line.amplitude.clear
    ]
    low, high = (1e3 * end for end in c.deflection)
    rows.append(("deflection by torque", f"{low:.3g} to {high:.3g} mrad"))
    if math.isfinite(c.stiffness_change) and c.motor_inertia:
        rows.append(
            (
                "10 % more motor",
                f"inertia than {c.motor_inertia:.4g} kg m²: stiffness {c.stiffness_change:+.2g} %",
            )
        )
    return [(label, str(value)) for label, value in rows]


def _recorded_rows(c: Compliance) -> list[tuple[str, str]]:
    """Recorded difference of the encoders, and its unexplained part."""
    low, high = (1e3 * end for end in c.recorded)
    return [
        ("recorded difference", f"{low:.3g} to {high:.3g} mrad"),
        ("unexplained", f"{1e3 * c.residual:.2g} mrad rms ({100 * c.unexplained:.2g} %)"),
    ]


def agreement_lines(found: Sequence[JointFlexibility]) -> Iterator[str]:
    """Agreement of recordings on the stiffness of a joint, one line for each joint."""
    for joint, values in summary(found).items():
        if len(values) < 2:
            continue
        low, high = max(v.low for v in values), min(v.high for v in values)
        listed = "; ".join(map(str, values))
        word = "agree" if low <= high else "do not agree"
        yield f"{joint}: the recordings {word} on the stiffness: {listed}"
