"""Can a real machine have these parameters? The consistent stage, where it ran."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from pivident.estimation.equation_record import FittedRecording
from pivident.foundation.document.plot import MEASURED, Figure, Plot, colour, empty_plot
from pivident.judgement.diagnostics.consistent_estimate import (
    CONFIDENCE,
    ConsistentEstimate,
    NoConsistentEstimate,
)
from pivident.judgement.report.sections.base import Section
from pivident.models.consistency.metric import HALF_INTERVAL
from pivident.models.consistency.pseudo_inertia import link_body, outline
from pivident.robot.closed_chains import link_frames
from pivident.robot.description import Robot
from pivident.robot.frames import Pose

#: What is seen of the arm: title and the two coordinates of the base frame.
VIEWS = (("Side view", (0, 2)), ("Top view", (0, 1)))


def bodies_figure(
    robot: Robot, inertial: Sequence[np.ndarray], q: np.ndarray, view: tuple[str, tuple[int, int]]
) -> Figure:
    """The joints as a line, and the mass of each link as an ellipsoid.

    Links with a nominal mass have that body dotted; ``inertial`` holds ten parameters of each link
    that is a body, ``q`` is the posture of all joints [rad or m], ``view`` one of ``VIEWS``.
    """
    title, plane = view
    frames = link_frames(robot, q)
    plot = empty_plot(f"{'xyz'[plane[1]]} [m]")
    plot.x_axis(f"{'xyz'[plane[0]]} [m]")
    plot.y_axis(scaleanchor="x", scaleratio=1)
    plot.update(showlegend=True, legend={"orientation": "h", "y": -0.16, "yanchor": "top"})
    for joint, frame in zip(robot.tree.joints, frames, strict=True):
        start = np.zeros(3) if joint.parent < 0 else frames[joint.parent].translation
        ends = np.stack([start, frame.translation])[:, list(plane)]
        _line(plot, ends, MEASURED, width=3, mode="lines+markers")
    bodies = [(k, link) for k, link in enumerate(robot.tree.links) if link.is_body]
    for (k, link), own in zip(bodies, inertial, strict=True):
        name = html.escape(link.name, quote=False)
        if link.inertia[9] > 0.0:
            _body(plot, link.inertia, frames[k], plane, f"{name}, nominal", MEASURED, dash="dot")
        _body(plot, own, frames[k], plane, f"{name}, {own[9]:.3g} kg", colour(k), fill="toself")
    return Figure(
        plot,
        height=460,
        title=title,
        label=f"{title} of the arm with the ellipsoids of {len(bodies)} links",
        note="grey: joints; coloured: consistent bodies; dotted: nominal bodies, where known",
    )


def moved_figure(
    names: Sequence[str],
    moved: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    method: int,
    *,
    left_out: int = 0,
) -> Figure:
    """Each parameter's free interval (grey) and its consistent one (coloured), in σ.

    ``moved`` is consistent less free value, ``low`` and ``high`` the ends of the consistent
    interval less the free value, all in σ of the free estimate, shape (parameters,); no interval is
    drawn where an end is NaN.
    """
    note = (
        f"grey: free estimate ± {HALF_INTERVAL:g} σ; coloured: consistent estimate with its 95 % "
        "interval"
    )
    if left_out:
        note += (
            f"; wider where the {left_out} base parameters that the estimate takes for zero may "
            "differ from it"
        )
    labels = [html.escape(name, quote=False) for name in names]
    plot = empty_plot("")
    plot.x_axis("distance from the free estimate [σ]", zeroline=True)
    plot.y_axis(autorange="reversed", automargin=True, dtick=1, tickfont={"size": 11})
    for title, ends, own, width in (
        ("free", (-HALF_INTERVAL, HALF_INTERVAL), MEASURED, 7),
        ("consistent", (low, high), colour(method), 3),
    ):
        x, y = [], []
        left, right = (np.broadcast_to(end, len(labels)) for end in ends)
        for label, a, b in zip(labels, left, right, strict=True):
            x += [float(a), float(b), None]
            y += [label, label, None]
        plot.add(
            x=x, y=y, mode="lines", name=title, line={"color": own, "width": width}, opacity=0.75
        )
    plot.add(
        x=np.asarray(moved, dtype=np.float32),
        y=labels,
        mode="markers",
        name="consistent estimate",
        marker={"color": colour(method), "size": 7},
    )
    most = int(np.argmax(np.abs(moved)))
    return Figure(
        plot,
        height=80 + 18 * len(labels),
        title="Free and consistent intervals",
        label=f"Free and consistent 95 % intervals of {len(labels)} base parameters in standard "
        f"errors of the free estimate; {names[most]} moved most, by {abs(moved[most]):.2g} σ",
        note=note,
    )


def _body(
    plot: Plot,
    inertial: np.ndarray,
    frame: Pose,
    plane: tuple[int, int],
    name: str,
    own: str,
    **look: str,
) -> None:
    """Outline and centre of mass of one link; nothing where no ellipsoid has its moments."""
    link = link_body(name, inertial)
    points = outline(link, frame, plane)
    if not np.isfinite(points).all():
        return
    dash = look.get("dash", "solid")
    fill = look.get("fill", "none")
    _line(plot, points, own, width=1.6, dash=dash, name=name, fill=fill, legend=fill != "none")
    center = (frame.rotation @ link.center_of_mass + frame.translation)[list(plane)]
    plot.add(
        x=[float(center[0])],
        y=[float(center[1])],
        mode="markers",
        name=name,
        marker={"color": own, "size": 6, "symbol": "cross"},
        showlegend=False,
    )


def _line(
    plot: Plot,
    points: np.ndarray,
    own: str,
    *,
    width: float,
    mode: str = "lines",
    dash: str = "solid",
    name: str = "joints",
    fill: str = "none",
    legend: bool = False,
) -> None:
    plot.add(
        x=points[:, 0].astype(np.float32),
        y=points[:, 1].astype(np.float32),
        mode=mode,
        name=name,
        line={"color": own, "width": width, "dash": dash},
        fill=fill,
        opacity=0.8,
        showlegend=legend,
    )


#: An end of an interval that nothing bounds is drawn this far away [σ].
FAR = 20.0


class ConsistencySection(Section):
    """For each estimate: how far it had to move, what that costs, and the bodies of the links."""

    title = "Physical consistency"
    anchor = "consistency"

    @property
    def applies(self) -> bool:
        """Only where the stage ran."""
        return bool(self.data.diagnostics.consistent)

    def context(self) -> dict[str, Any]:
        """Tables and figures of each estimate, reasons where there is none."""
        diagnostics = self.data.diagnostics
        names = list(diagnostics.identifications)
        made = [(names.index(name), found) for name, found in diagnostics.consistent.items()]
        last = made[-1][0]
        return {
            "confidence": f"{CONFIDENCE:.0%}".replace("%", " %"),
            "failed": [
                (k, found.label, found.reason)
                for k, found in made
                if isinstance(found, NoConsistentEstimate)
            ],
            "estimates": [
                {
                    "method": k,
                    "label": found.label,
                    "opened": k == last,
                    "found": found,
                    "figures": _figures(found, k),
                }
                for k, found in made
                if isinstance(found, ConsistentEstimate)
            ],
            "several": len(made) > 1,
        }


def _posture(robot: Robot, recordings: Sequence[FittedRecording]) -> np.ndarray:
    """Positions of all joints at the first sample; without a record at the robot's own posture."""
    if not recordings:
        return np.zeros(robot.size) if robot.constraints is None else robot.constraints.posture
    own = recordings[0].q[0]
    if robot.constraints is None:
        return own
    from pivident.dynamics.closed_chains.closed_motion import ClosedChains

    return ClosedChains(robot).start(own).q


def _figures(found: ConsistentEstimate, method: int) -> tuple[Figure, ...]:
    """The arm with its bodies, and free and consistent intervals."""
    model = found.model
    free, std = model.free.theta, model.free.std
    moved, low, high = (
        np.clip(x, -FAR, FAR)
        for x in (model.moved, *((end - free) / std for end in (found.base.low, found.base.high)))
    )
    q = _posture(model.robot, model.free.recordings)
    left_out = model.base_values.size - len(model.names)
    inertial = [row.inertia for row in found.links]
    return (
        *(bodies_figure(model.robot, inertial, q, view) for view in VIEWS),
        moved_figure(model.names, moved, low, high, method, left_out=left_out),
    )
