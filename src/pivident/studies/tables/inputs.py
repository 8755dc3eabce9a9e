"""Tables of what is given: robot, recordings, problem, and what an audit says of a log.

Tables of consistent models and of their intervals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.problem import Problem
from pivident.foundation.document.table import Table, Values
from pivident.foundation.text.finding import Quantity
from pivident.judgement.audit.audit import Audit
from pivident.models.consistency.consistent_model import ConsistentModel
from pivident.models.consistency.profile_intervals import ENDS, ProfileIntervals
from pivident.robot.description import Joint, Robot


def recording_signals(recording: Recording) -> Table:
    """One row for each joint of each sample; all channels side by side.

    Units are those of joints, rad or m and N m or N, which a recording by itself does
    not distinguish; inputs are in the unit of the controller's output.
    """
    samples, joints = recording.samples, recording.joints
    columns: dict[str, np.ndarray | tuple[str, ...]] = {
        "t_s": np.repeat(recording.t, joints),
        "joint": tuple(recording.joint_names) * samples,
    }
    columns |= {
        name: np.ascontiguousarray(values).ravel() for name, values in recording.channels().items()
    }
    meanings = {
        "q": "joint position [rad or m]",
        "tau": "joint torque [N m or N]",
        "q_ref": "reference position [rad or m]",
        "dq_ref": "reference speed [rad/s or m/s]",
        "ddq_ref": "reference acceleration [rad/s² or m/s²]",
        "q_link": "position behind the gear [rad or m]",
        "dq": "measured speed [rad/s or m/s]",
    }
    return Table("signals", columns, {k: v for k, v in meanings.items() if k in columns})


def robot_joints(robot: Robot) -> Table:
    """One row for each joint; those that loops move along have no motor and no rotor."""
    rows, tree = [], robot.tree
    rotors = np.full(tree.size, math.nan)
    rotors[list(robot.places)] = robot.rotor_inertia
    for joint, link, rotor in zip(tree.joints, tree.links, rotors, strict=True):
        low, high = joint.position_limits or (math.nan, math.nan)
        rows.append(
            {
                "joint": joint.name,
                "kind": joint.kind,
                "moves": link.name,
                "hangs_on": "base" if joint.parent < 0 else tree.links[joint.parent].name,
                "position_low": float(low),
                "position_high": float(high),
                "position_unit": joint.position_unit,
                "rated_speed": _known(joint.rated_speed),
                "speed_unit": f"{joint.position_unit}/s",
                "torque_limit": _known(joint.torque_limit),
                "torque_unit": joint.torque_unit,
                "rotor_inertia": float(rotor),
                "rotor_unit": "kg m²" if joint.kind == "revolute" else "kg",
                "friction": str(joint.friction),
            }
        )
    return Table.of_rows("joints", rows)


def robot_parameters(robot: Robot) -> Table:
    """The base parameters, with their nominal values."""
    base = base_parameters(robot)
    nominal = base.values(nominal_values(robot, base.standard))
    rows = [
        {
            "parameter": name,
            "joint": robot.tree.joints[p.joint].name,
            "kind": p.stem,
            "nominal": float(value),
            "unit": p.unit,
            "group": group,
        }
        for name, p, value, group in zip(
            base.names, base.parameters, nominal, base.expressions, strict=True
        )
    ]
    meanings = {"nominal": "value of the robot's description, zero where none is known"}
    return Table.of_rows("parameters", rows, meanings)


def problem_parameters(problem: Problem) -> Table:
    """The parameters that are to be estimated."""
    start = problem.initial_values()
    base = problem.base.parameters
    rows = [
        {
            "parameter": name,
            "joint": problem.robot.tree.joints[base[k].joint].name,
            "kind": base[k].stem,
            "initial": float(value),
            "unit": base[k].unit,
            "group": group,
        }
        for k, name, value, group in zip(
            problem.selection, problem.names, start, problem.expressions, strict=True
        )
    ]
    return Table.of_rows("parameters", rows, {"initial": "where the iteration starts"})


def problem_recordings(problem: Problem) -> Table:
    """One row for each recording."""
    rows = [
        {
            "recording": r.name,
            "samples": r.samples,
            "rate_hz": float(r.rate),
            "control_rate_hz": float(r.control_rate),
            "duration_s": r.duration,
            "channels": ", ".join(r.channels()),
            "sha256": " ".join(s.sha256 for s in r.sources),
        }
        for r in problem.recordings
    ]
    return Table.of_rows("recordings", rows)


def problem_signals(problem: Problem) -> Table:
    """All recordings, one row for each joint of each sample, with the units of the joints.

    A channel that a recording does not have is NaN there.
    """
    recordings = [(r.name, r.t, r.channels()) for r in problem.recordings]
    made = signals_table(recordings, problem.robot.joints)
    return Table("signals", made.columns, recording_signals(problem.recordings[0]).meanings)


def signals_table(
    recordings: Sequence[tuple[str, np.ndarray, Mapping[str, np.ndarray]]],
    joints: Sequence[Joint],
) -> Table:
    """One row for each joint of each sample of recordings that may have different channels.

    Args:
        recordings: name, time of each sample [s], and channels of shape (samples, joints).
        joints: of the robot.
    """
    samples = sum(len(t) for _, t, _ in recordings)
    columns: dict[str, Values] = {
        "recording": [name for name, t, _ in recordings for _ in range(len(t) * len(joints))],
        "t_s": np.concatenate([np.repeat(t, len(joints)) for _, t, _ in recordings]),
        "joint": [joint.name for joint in joints] * samples,
    }
    for name in dict.fromkeys(name for *_, channels in recordings for name in channels):
        parts = [
            own.get(name, np.full((len(t), len(joints)), math.nan)) for _, t, own in recordings
        ]
        columns[name] = np.concatenate([np.ravel(part) for part in parts])
    columns["position_unit"] = [joint.position_unit for joint in joints] * samples
    columns["torque_unit"] = [joint.torque_unit for joint in joints] * samples
    return Table("signals", columns)


def audit_findings(audit: Audit) -> Table:
    """What an audit found, check by check."""
    rows = [
        {
            "severity": f.severity,
            "topic": f.topic,
            "kind": f.kind,
            "subject": f.subject,
            **_quantity(f.quantity),
            "t_s": _known(f.time),
            "message": f.message,
            "next_step": f.next_step,
        }
        for f in audit.findings
    ]
    empty = (
        "severity", "topic", "kind", "subject", "value", "low", "high", "bound", "unit", "t_s",
        "message", "next_step",
    )  # fmt: skip
    return Table.of_rows("findings", rows, {"bound": "value from which it would be worse"}, empty)


def _quantity(decisive: Quantity | None) -> dict[str, float | str]:
    """The decisive number of a finding in columns."""
    low, high = (None, None) if decisive is None else decisive.interval or (None, None)
    return {
        "value": _known(None if decisive is None else decisive.value),
        "low": _known(low),
        "high": _known(high),
        "bound": _known(None if decisive is None else decisive.bound),
        "unit": "" if decisive is None else decisive.unit,
    }


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)


consistent_links, consistent_moved = ConsistentModel.table, ConsistentModel.moved_table
profile_intervals = ProfileIntervals.table


def consistent_parameters(model: ConsistentModel) -> Table:
    """All standard parameters with their 95 % intervals, which take a second or two."""
    made = model.intervals(of="standard").table().columns
    tree = model.robot.tree
    head = {
        "parameter": made["quantity"],
        "joint": [tree.joints[p.joint].name for p in model.parameters],
        "link": [tree.links[p.joint].name for p in model.parameters],
    }
    return Table("parameters", head | {k: own for k, own in made.items() if k != "quantity"}, ENDS)
