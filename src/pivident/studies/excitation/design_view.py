"""A design as one HTML page that needs nothing else, with a moving picture of the robot."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.foundation.text.numbers import format_exact, format_significant
from pivident.foundation.text.plain_values import plain, strict_json
from pivident.judgement.report.builder import PAGE_SCRIPTS, page_environment, page_of
from pivident.judgement.report.downloads import Download
from pivident.judgement.report.motion import RATE, motion_values
from pivident.judgement.report.sections.parameters import correlation_figure
from pivident.judgement.validation.parameter_correlation import STRONG_CORRELATION
from pivident.studies.collision.bodies import Obstacle
from pivident.studies.excitation.account import (
    BINDING,
    NO_LIMIT,
    broken,
    headline,
    kind_words,
    limit_words,
    percentage,
)
from pivident.studies.excitation.design import (
    Design,
    PredictedError,
    pendant_positions,
    pendant_unit,
    posture_moves,
)
from pivident.studies.excitation.design_figures import (
    MOTION,
    errors_figure,
    motion_figure,
    predicted_correlation,
)
from pivident.studies.excitation.robot_programs import unwritten_programs

#: Digits of lengths [m].
_DIGITS = 5


def picture_values(design: Design) -> dict[str, Any]:
    """Robot and motion as `motion_values` has them, with ``bodies`` and ``obstacles``.

    ``bodies``: link, start and end in the link's frame, and radius of each capsule; ``obstacles``:
    shape, size, radius, length, rotation by rows and translation of each. All lengths in m.

    Args:
        design: the design.
    """
    motion = design.motion
    t = np.linspace(0.0, motion.duration, max(2, int(np.ceil(motion.duration * RATE)) + 1))
    positions: Any = SimpleNamespace(name=MOTION, t=t, q_measured=motion.at(t)[0])
    content = motion_values(design.robot, [positions])
    content["bodies"] = [
        {
            "link": int(body.link),
            "start": _rounded(body.start),
            "end": _rounded(body.end),
            "radius": round(float(body.radius), _DIGITS),
        }
        for body in design.bodies
    ]
    content["obstacles"] = [_obstacle(obstacle) for obstacle in design.obstacles]
    return content


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    """One obstacle with all sizes that its shape needs, and its pose."""
    return {
        "name": obstacle.name,
        "shape": obstacle.shape,
        "size": _rounded((0.0, 0.0, 0.0) if obstacle.size is None else obstacle.size),
        "radius": round(obstacle.radius, _DIGITS),
        "length": round(obstacle.length, _DIGITS),
        "rotation": [round(float(x), 9) for x in np.ravel(obstacle.rotation)],
        "translation": _rounded(obstacle.translation),
    }


def _rounded(vector: Any) -> list[float]:
    return [round(float(x), _DIGITS) for x in np.asarray(vector, dtype=float)]


#: Larger files stand beside the page, not inside it [characters].
MAX_HELD = 200_000

#: Types of files by the ending of their names.
_MEDIA = {"json": "application/json", "csv": "text/csv", "yaml": "application/yaml"}


@dataclass(frozen=True)
class DesignFile:
    """A file of a design.

    Attributes:
        name: of the file.
        words: what it is.
        text: its content; None for one that is no text.
    """

    name: str
    words: str
    text: str | None


def render_page(design: Design, files: Sequence[DesignFile] = ()) -> str:
    """The page as text.

    Args:
        design: the design.
        files: those that are written with it; small ones become part of the page.

    Returns:
        HTML.

    Raises:
        MissingExtra: plotly is not installed.
    """
    environment = page_environment("pivident.studies.excitation")
    # The room is drawn by what turns the arm's posture into faces, before that is first asked.
    after = PAGE_SCRIPTS.index("arm.js") + 1
    environment.globals["page_scripts"] = (*PAGE_SCRIPTS[:after], "room.js", *PAGE_SCRIPTS[after:])
    sections = [
        (key, heading, Markup(environment.get_template(f"design_{key}.html").render(content)))
        for key, heading, content in _sections(design, files)
    ]
    return page_of(environment, f"{design.robot.name}: exciting motion", sections)


def _sections(
    design: Design, files: Sequence[DesignFile]
) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Template, heading and content of each section, in order."""
    robot = design.robot
    yield "summary", "Summary", _summary(design)
    moves = posture_moves(design)
    yield (
        "replay",
        "The motion",
        {
            "robot": robot,
            "picture": picture_values(design),
            "axes": [(joint.name, pendant_unit(joint)) for joint in robot.joints],
            "postures": [(move, pendant_positions(design, move.q).tolist()) for move in moves],
        },
    )
    figures = [motion_figure(design, j) for j in range(robot.size)]
    yield "signals", "Signals and their limits", {"design": design, "figures": figures}
    yield "limits", "Use of the limits", {"design": design}
    yield (
        "errors",
        "Predicted standard errors",
        {
            "design": design,
            "figure_of_errors": errors_figure(design),
            "some_wanted": any(p.wanted for p in design.predicted),
            "gain": _gain,
            "percentage": percentage,
        },
    )
    correlation = predicted_correlation(design)
    if correlation is not None:
        content = {"map": correlation_figure(correlation), "strong": STRONG_CORRELATION}
        yield "correlations", "Correlations", content
    yield "undetermined", "What remains undetermined", {"reasons": list(design.reasons.items())}
    yield (
        "files",
        "Files, and how to go on",
        {
            "held": _held(files),
            "beside": [(file.name, file.words) for file in files if not _is_held(file)],
            "unwritten": unwritten_programs(design),
            "commands": next_commands(design),
            "twice": design.settings.get("about") in ("load", "gains"),
        },
    )


def _summary(design: Design) -> dict[str, Any]:
    """What was asked for and what was reached."""
    wrong = broken(design)
    start, end = (format_significant(x) for x in design.cost)
    first, last = (format_significant(x) for x in design.condition)
    determined = len(design.predicted) - len(design.undetermined)
    return {
        "design": design,
        "headline": headline(design),
        "broken": [limit_words(use) for use in wrong],
        "binding_heading": BINDING,
        "no_limit": NO_LIMIT,
        "binding": [limit_words(use) for use in design.binding if use not in wrong],
        "figures": [
            ("Motion", f"{format_exact(design.motion.duration)} s", kind_words(design)),
            ("Criterion", end, f"{design.cost_words}; start of the search {start}"),
            ("Condition number", last, f"start of the search {first}"),
            ("Determined", f"{determined} of {len(design.predicted)}", "parameters"),
            ("Search", f"{format_significant(design.seconds)} s", f"criterion {design.criterion}"),
        ],
        "settings": [(str(k), _setting(x)) for k, x in design.settings.items() if x is not None],
    }


def _setting(value: Any) -> str:
    """A setting as one reads it."""
    value = plain(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return format_exact(value)
    if isinstance(value, list) and all(isinstance(x, str) for x in value):
        return ", ".join(value)
    return value if isinstance(value, str) else strict_json(value)


def _gain(p: PredictedError) -> float:
    """By what factor σ becomes smaller; NaN where it was infinite before."""
    return p.before / p.std if math.isfinite(p.before) and p.std > 0.0 else math.nan


def next_commands(design: Design) -> tuple[str, ...]:
    """Commands with which the record of this motion is identified.

    Args:
        design: the design.
    """
    named = design.settings.get("robot")
    robot = shlex.quote(named) if isinstance(named, str) and named else "ROBOT"
    about = design.settings.get("about")
    if about in ("load", "gains"):
        command = "payload" if about == "load" else "gains"
        return (
            f"pivident init without_load.csv --robot {robot} --out experiment.toml",
            f"# add [[{command}.recording]] with the record with the load, and [payload] or "
            "[gains.payload]",
            f"pivident {command} experiment.toml",
        )
    return (
        f"pivident init record.csv --robot {robot} --out experiment.toml",
        "pivident check experiment.toml",
        "pivident identify experiment.toml --out result",
    )


def _is_held(file: DesignFile) -> bool:
    return file.text is not None and len(file.text) <= MAX_HELD


def _held(files: Sequence[DesignFile]) -> list[Download]:
    """Files inside the page."""
    return [
        Download(
            file.name,
            f"{file.name}: {file.words}",
            _MEDIA.get(file.name.rpartition(".")[2], "text/plain"),
            file.text or "",
            f"file-{k}",
            0,
        )
        for k, file in enumerate(filter(_is_held, files), start=1)
    ]
