"""Motion and torques of recordings as a file of Rerun: the arm, what was measured and modelled.

For each recording, by its name:

    NAME/arm/JOINT/JOINT/…        frame of each link in that of its parent, over time, and its bar
    NAME/torque/JOINT/measured    [N m or N], where the log has it
    NAME/torque/JOINT/modelled
    NAME/residual/JOINT           measured - modelled
    NAME/account                  errors in words and numbers

The timeline ``time`` is that of the log [s].
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.foundation.document.plot import kept_samples
from pivident.foundation.errors import ExportError
from pivident.foundation.extras import require
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.numbers import format_significant
from pivident.judgement.report.motion import motion_values
from pivident.robot.description import Robot
from pivident.robot.refusals import without_base
from pivident.studies.prediction.prediction import Prediction

#: Poses per second, and most poses and points of a curve in one recording.
POSE_RATE, MOST_POSES, MOST_POINTS = 50.0, 20_000, 200_000

#: Colours of measured and modelled torque and of their difference, as in reports.
COLORS = {"measured": (90, 90, 90), "modelled": (0, 114, 178), "residual": (213, 94, 0)}

#: Axes that Rerun may draw upward.
AXES = "XYZ"


def write_rerun(predictions: Sequence[Prediction], path: Path) -> None:
    """Write predictions as one ``.rrd`` file, whole or not at all.

    Args:
        predictions: of one result for some recordings.
        path: the file.

    Raises:
        MissingExtra: rerun-sdk is not installed.
        RobotDescriptionError: a robot on a measured base.
        ExportError: two recordings have the same name.
    """
    rr = require("rerun", extra="rerun", purpose="a file of Rerun")
    names = [one.recording for one in predictions]
    if len(set(names)) < len(names):
        raise ExportError(
            f"two recordings have the same name ({', '.join(names)})",
            advice="name one log with --log",
        )
    for one in predictions:
        without_base(one.robot, "a file of Rerun", "export it as JSON")
    with atomic_folder(path.parent) as build:
        stream = rr.RecordingStream("pivident", recording_id=path.stem)
        stream.save(build / path.name, default_blueprint=_layout(predictions))
        for one in predictions:
            _log_arm(stream, one)
            _log_torques(stream, one)
            text = rr.TextDocument(one.account().body)
            stream.log(rr.new_entity_path([one.recording, "account"]), text, static=True)
        stream.flush()
        stream.disconnect()


def poses(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames of the links in those of their parents.

    Args:
        robot: the robot.
        q: positions of all joints of the tree [rad or m], shape (instants, joints).

    Returns:
        Translations [m], shape (instants, joints, 3), and quaternions x y z w, (instants, joints,
        4).
    """
    places = np.empty((*q.shape, 3))
    turns = np.empty((*q.shape, 4))
    for j, joint in enumerate(robot.tree.joints):
        fixed = Rotation.from_matrix(joint.rotation)
        places[:, j] = joint.translation
        if joint.kind == "revolute":
            turns[:, j] = (
                fixed * Rotation.from_rotvec(np.outer(q[:, j], [0.0, 0.0, 1.0]))
            ).as_quat()
        else:
            turns[:, j] = fixed.as_quat()
            places[:, j] += np.outer(q[:, j], joint.rotation[:, 2])
    return places, turns


def _log_arm(stream: Any, shown: Prediction) -> None:
    """The frames of the links over time, and a bar from each link to those that hang on it."""
    import rerun as rr

    robot, t = shown.robot, shown.t
    count = int(np.clip(np.ceil((t[-1] - t[0]) * POSE_RATE) + 1, 2, MOST_POSES))
    instants = np.linspace(t[0], t[-1], count)
    q = np.array([np.interp(instants, t, column) for column in shown.q.T])
    if robot.constraints is not None:
        still = np.zeros_like(q)
        q = np.asarray(ClosedChains(robot).motion(q, still, still).q)
    places, turns = poses(robot, q.T)
    size = np.linalg.norm(robot.gravity)
    up = -robot.gravity / size if size else np.array([0.0, 0.0, 1.0])
    axis = int(np.argmax(np.abs(up)))
    view = f"RIGHT_HAND_{AXES[axis]}_{'UP' if up[axis] > 0 else 'DOWN'}"
    base = rr.new_entity_path([shown.recording, "arm"])
    stream.log(base, getattr(rr.ViewCoordinates, view), static=True)
    index = rr.TimeColumn("time", duration=instants)
    for j, path in enumerate(_link_paths(robot, shown.recording)):
        columns = rr.Transform3D.columns(translation=places[:, j], quaternion=turns[:, j])
        stream.send_columns(path, indexes=[index], columns=columns)
    for link, bars in _bars(robot).items():
        at = base if link < 0 else _link_paths(robot, shown.recording)[link]
        stream.log(f"{at}/bars", rr.LineStrips3D(bars), static=True)


def _link_paths(robot: Robot, recording: str) -> list[str]:
    """Path of each link, below that of its parent."""
    import rerun as rr

    parts: list[list[str]] = []
    for joint in robot.tree.joints:
        above = [recording, "arm"] if joint.parent < 0 else parts[joint.parent]
        parts.append([*above, joint.name])
    return [rr.new_entity_path(own) for own in parts]


def _bars(robot: Robot) -> dict[int, list[list[Any]]]:
    """Lines in the frame of each link (-1: the base), from its origin to what hangs on it."""
    drawn = motion_values(robot, [])
    found: dict[int, list[list[Any]]] = {}
    for joint in drawn["joints"]:
        if joint["way"]:
            found.setdefault(joint["parent"], []).append([[0, 0, 0], joint["translation"]])
    for link, tip in enumerate(drawn["tip"]):
        if tip is not None:
            found.setdefault(link, []).append([[0, 0, 0], tip])
    for link, *point in drawn["ends"]:
        found.setdefault(link, []).append([[0, 0, 0], point])
    return found


def _log_torques(stream: Any, shown: Prediction) -> None:
    """Curves of measured and modelled torque and of their difference."""
    import rerun as rr

    curves = {"modelled": shown.tau_model}
    if shown.tau is not None:
        curves |= {"measured": shown.tau, "residual": shown.tau - shown.tau_model}
    for j, (name, unit) in enumerate(zip(shown.robot.joint_names, shown.units, strict=True)):
        for kind, torque in curves.items():
            parts = ["residual", name] if kind == "residual" else ["torque", name, kind]
            path = rr.new_entity_path([shown.recording, *parts])
            label = rr.SeriesLines(names=f"{kind} [{unit}]", colors=COLORS[kind])
            stream.log(path, label, static=True)
            kept = kept_samples(torque[:, j], MOST_POINTS)
            index = rr.TimeColumn("time", duration=shown.t[kept])
            columns = rr.Scalars.columns(scalars=torque[kept, j])
            stream.send_columns(path, indexes=[index], columns=columns)


def _layout(predictions: Sequence[Prediction]) -> Any:
    """The arm beside the torques of its joints; a tab for each recording."""
    import rerun as rr
    import rerun.blueprint as rrb

    tabs = []
    for shown in predictions:
        torques = []
        for j, name in enumerate(shown.robot.joint_names):
            torque = rr.new_entity_path([shown.recording, "torque", name])
            residual = rr.new_entity_path([shown.recording, "residual", name])
            title = name
            if shown.error is not None:
                title = f"{name}: error {format_significant(shown.error.errors.relative[j])} %"
            contents = [f"{torque}/**", f"{residual}/**"]
            torques.append(rrb.TimeSeriesView(name=title, origin="/", contents=contents))
        arm = rrb.Spatial3DView(name="arm", origin=rr.new_entity_path([shown.recording, "arm"]))
        account = rrb.TextDocumentView(
            name="errors", origin=rr.new_entity_path([shown.recording, "account"])
        )
        beside = rrb.Horizontal(rrb.Vertical(arm, account), rrb.Vertical(*torques))
        tabs.append(rrb.Horizontal(beside, name=shown.recording))
    return rrb.Blueprint(rrb.Tabs(*tabs) if len(tabs) > 1 else tabs[0])
