"""Functions and maps as tables, and the whole study as JSON.

The friction of a record as files: page, JSON, and curves as tables.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from pivident.foundation.extras import require
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.finding import serious
from pivident.foundation.text.plain_values import plain
from pivident.foundation.version import __version__
from pivident.judgement.report.builder import page_environment, page_of, write_page
from pivident.studies.friction.effects import headline
from pivident.studies.friction.friction_figures import gain_figure, joint_figures, ripple_figures
from pivident.studies.friction.friction_study import FrictionStudy, JointFriction

if TYPE_CHECKING:
    import polars as pl

    from pivident.studies.friction.ripple_lines import Ripple


#: Number of the layout of ``friction.json``.
SCHEMA = 1

#: State of each function and its unit: p position unit, t torque unit.
STATES = {
    "positive": ("speed", "{p}/s"),
    "negative": ("speed", "{p}/s"),
    "position": ("position", "{p}"),
    "load": ("load", "{t}"),
    "time": ("time", "s"),
}


def curves_table(study: FrictionStudy) -> pl.DataFrame:
    """All functions and maps, one row per point.

    Columns: joint, kind (``function`` or ``map``), name, state_name, state, state_unit, value,
    lower, upper (2σ), torque_unit, passes, effective (both of a map; independent samples of a
    function).
    """
    pl = require("polars", extra="tables", purpose="the table of friction curves")
    return pl.concat([frame for joint in study.joints for frame in _joint_frames(joint)])


def as_json(study: FrictionStudy) -> dict[str, Any]:
    """The study as plain values; numbers that are not finite become null."""
    content = {
        "schema": SCHEMA,
        "pivident": __version__,
        "robot": study.robot,
        "method": study.method,
        "recordings": study.recordings,
        "left_out": study.left_out,
        "joints": [_joint_json(joint) for joint in study.joints],
        "ripple": None if study.ripple is None else _ripple_json(study.ripple),
    }
    return plain(content)


def _ripple_json(ripple: Ripple) -> list[dict[str, Any]]:
    """Ripple lines, joint by joint."""
    return [
        {
            "joint": joint.name,
            "unit": joint.unit,
            "lines": [
                {
                    "order": line.order,
                    "order_std": line.order_std,
                    "over": line.angle.name,
                    "amplitude": line.amplitude,
                    "interval": list(line.interval),
                    "phase_rad": line.phase,
                    "sentence": str(line),
                }
                for line in joint.lines
            ],
            "notes": list(joint.notes),
        }
        for joint in ripple.joints
    ]


def _joint_json(joint: JointFriction) -> dict[str, Any]:
    fit, held_out = joint.fit, joint.held_out
    return {
        "joint": joint.name,
        "torque_unit": joint.torque.torque_unit,
        "position_unit": joint.torque.position_unit,
        "samples_in_motion": int(joint.torque.moving.sum()),
        "correlation_s": fit.correlation / joint.torque.rate,
        "independent_samples": fit.effective,
        "converged": fit.converged,
        "residual_std": fit.noise_std,
        "rigid_std": joint.torque.load_std,
        "held_out": {
            "band_hz": held_out.band,
            "constant_rms": held_out.constant.rms,
            "speed_rms": held_out.speed.rms,
            "full_rms": held_out.full.rms,
            "without_rms": {name: e.rms for name, e in held_out.by_term.items()},
        },
        "functions": [
            {
                "name": p.name,
                "over": STATES[p.name][0],
                "nvr": p.nvr,
                "straight": p.is_straight,
                "state": p.state,
                "value": p.value,
                "std": p.std,
            }
            for p in fit.parameters
        ],
        "findings": [
            {
                "kind": f.kind,
                "severity": f.severity,
                "message": f.message,
                "value": f.evidence["value"].value,
                "two_sigma": f.evidence["two_sigma"].value,
                "unit": f.evidence["value"].unit,
                "clear": bool(f.clear),
                "terms": f.terms,
            }
            for f in joint.findings
        ],
    }


def _joint_frames(joint: JointFriction) -> list[pl.DataFrame]:
    pl = require("polars", extra="tables", purpose="the table of friction curves")
    torque = joint.torque
    frames = []
    for p in joint.fit.parameters:
        over, unit = STATES[p.name]
        frames.append(
            {
                "kind": "function",
                "name": p.name,
                "state_name": over,
                "state_unit": unit.format(p=torque.position_unit, t=torque.torque_unit),
                "state": p.state,
                "value": p.value,
                "lower": p.value - 2.0 * p.std,
                "upper": p.value + 2.0 * p.std,
                "passes": np.full(p.state.size, np.nan),
                "effective": p.density,
            }
        )
    frames += [
        {
            "kind": "map",
            "name": name,
            "state_name": found.state,
            "state_unit": found.unit,
            "state": found.centre,
            "value": found.value,
            "lower": found.lower,
            "upper": found.upper,
            "passes": found.passes.astype(float),
            "effective": found.effective,
        }
        for name, found in joint.maps.items()
    ]
    numbers = ("state", "value", "lower", "upper", "passes", "effective")
    return [
        pl.DataFrame(
            {
                "joint": torque.name,
                **{k: v for k, v in frame.items() if k not in numbers},
                "torque_unit": torque.torque_unit,
                **{k: pl.Series(frame[k], dtype=pl.Float64) for k in numbers},
            }
        ).with_columns(pl.col(pl.Float64).fill_nan(None))
        for frame in frames
    ]


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
    environment.filters["serious"] = serious
    summary = environment.get_template("friction_summary.html").render(
        study=study, gain=gain_figure(study.joints)
    )
    sections = [("summary", "What was seen", Markup(summary))]
    template = environment.get_template("friction_joint.html")
    sections += [
        (
            f"joint-{n}",
            joint.name,
            Markup(template.render(joint=joint, figures=joint_figures(joint))),
        )
        for n, joint in enumerate(study.joints, start=1)
    ]
    if study.ripple is not None:
        drawn = {j.name: ripple_figures(j) for j in study.ripple.joints}
        body = environment.get_template("friction_ripple.html").render(
            ripple=study.ripple, figures=drawn
        )
        sections.append(("ripple", "Ripple over position", Markup(body)))
    return page_of(environment, title or f"{study.robot}: friction", sections)
