"""The columns of a recording in the order of a robot's joints: names decide, not positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import ExperimentError, require_kind
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot
from pivident.robot.naming import near_names, numbered_joints


def in_order_of(robot: Robot, recording: Recording) -> Recording:
    """The recording with a column for each joint of a robot, in the order of the robot.

    Columns with names are found by them. Joints that nobody named (``joint_1`` …, as
    `Recording.from_arrays` calls them) are those of the robot, in its order.

    Args:
        robot: whose joints are wanted.
        recording: of these joints, in any order.

    Returns:
        The recording itself where nothing is to be done.

    Raises:
        ExperimentError: other joints than those of the robot; names both.
    """
    require_kind("recording", recording, Recording, "Recording.from_arrays makes one")
    wanted, there = robot.joint_names, recording.joint_names
    if there == wanted:
        return recording
    if set(there) == set(wanted):
        return reordered(recording, [there.index(name) for name in wanted])
    if there == tuple(numbered_joints(len(wanted))):
        return replace(recording, joint_names=wanted)
    counts = f" ({len(there)} joints instead of {len(wanted)})" if len(there) != len(wanted) else ""
    strange = [name for name in there if name not in wanted]
    near = {name: near_names(name, set(wanted) - set(there)) for name in strange}
    meant = [f"{name} may be {names[0]}" for name, names in near.items() if names]
    raise ExperimentError(
        f"recording {recording.name!r} has the joints {listed(there)}, robot {robot.name!r} has "
        f"{listed(wanted)}{counts}",
        advice=_renaming(len(there) == len(wanted), meant),
    )


def _renaming(as_many: bool, meant: Sequence[str]) -> str:
    """What to do about other names, a half sentence."""
    if not as_many:
        return "give one column for each joint of the robot"
    hint = f"{'; '.join(meant)}. R" if meant else "r"
    return (
        f"{hint}ename them in the order of the columns, such as "
        "dataclasses.replace(recording, joint_names=robot.joint_names) for that of the robot"
    )


def reordered(recording: Recording, order: Sequence[int]) -> Recording:
    """The recording with its joints in another order.

    Args:
        recording: the recording.
        order: for each new column the index of the one that it comes from.
    """
    names = tuple(recording.joint_names[j] for j in order)
    return recording.indexed((slice(None), list(order)), {"joint_names": names})
