"""The public records as ready recordings.

Each is a set of arguments of `load_recording`, plain data that an experiment file can repeat; the
facts in it (units, sides, signs, gains, timing) are those that reproduce the published results.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pivident.data.recording.datasets import fetch
from pivident.data.recording.load import load_recording
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import RecordingError
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission

#: Motor positions and motor torque references, logged at the rate of the control loop. Despite
#: its name the file curr_data.csv holds newton metres. At the log's zero the arm does not stand at
#: the zero of every description: the gallery's robot needs no offset, the FIGAROH URDF needs
#: position_offset = [0, -π/2, π/2, 0, 0, 0].
STAUBLI_TX40: dict[str, Any] = {
    "name": "staubli_tx40",
    "columns": {
        "q": [f"Joint_{j}" for j in range(1, 7)],
        "tau": [f"Joint_{j}" for j in range(1, 7)],
    },
    "units": {"q": "rad", "tau": "N m"},
    "side": "motor",
    "rate": 5000.0,
    "torque_timing": "held",
}

#: Load side, drive input in volts; the gain is the file's own gtau [N/V].
EMPS: dict[str, Any] = {
    "name": "emps",
    "columns": {"q": "qm", "q_ref": "qg", "tau": "vir", "t": "t"},
    "units": {"q": "m", "q_ref": "m", "tau": {"unit": "V", "gain": 35.15065188248547}, "t": "s"},
    "torque_timing": "held",
}

#: The pulses are logged as 0 or 5 but act as 5.07 V: with that the recorded drive input follows
#: from the control law to 5 mV instead of 50 mV.
EMPS_PULSES: dict[str, Any] = EMPS | {
    "name": "emps_pulses",
    "columns": EMPS["columns"] | {"inputs": {"pulses": "pulses_N"}},
    "units": EMPS["units"] | {"inputs": {"pulses": 5.07 / 5.0}},
}

#: Positions behind the gear, relative to the start pose; torques before it. The feed-forward
#: torque is in the unit of the controller's output, motor torque.
KUKA_KR300: dict[str, Any] = {
    "columns": {
        "q": "rec__act_pos_mot_deg",
        "tau": "rec__act_torque_abs_nm",
        "q_ref": "rec__ref_pos_deg",
        "dq_ref": "rec__ref_vel_simple_deg_per_s",
        "t": "rec__time_cont",
        "inputs": {"feed_forward": "tau_ff_all"},
    },
    "units": {
        "q": "deg",
        "tau": "N m",
        "q_ref": "deg",
        "dq_ref": "deg/s",
        "t": "s",
        "inputs": {"feed_forward": "N m"},
    },
    "side": {"q": "joint", "tau": "motor"},
    "position_offset": [0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0],
    "torque_timing": "sampled",
}

KR300_TRANSMISSION = Transmission(
    reduction=np.diag([1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340]),
    drive_gain=np.ones(6),
    position_offset=np.zeros(6),
)


#: Keys of the files of each run that can be named; the first run is the default.
RUNS: dict[str, dict[str, tuple[str, ...]]] = {
    "staubli_tx40": {"all": ("q", "tau")},
    "emps": {"estimation": ("estimation",), "pulses": ("pulses",)},
    "kuka_kr300": {"A": ("A",), "B": ("B",)},
}

#: Files of a record: one, or several by key.
Files = str | Path | Mapping[str, str | Path]


def public_facts(
    dataset: str, run: str, robot: Robot | None = None, files: Files | None = None
) -> tuple[Files, dict[str, Any]]:
    """Files of a public record, and the arguments of `load_recording` that describe them."""
    if files is None:
        keys = RUNS[dataset][run]
        fetched = fetch(dataset, *keys)
        files = fetched if len(keys) > 1 else fetched[keys[0]]
    if dataset == "staubli_tx40":
        return files, STAUBLI_TX40
    if dataset == "emps":
        return files, EMPS if run == "estimation" else EMPS_PULSES
    axes = 6 if robot is None else robot.size
    facts = KUKA_KR300 if axes >= 6 else _first_axes(axes)
    if robot is None:
        facts = facts | {"transmission": KR300_TRANSMISSION}
    elif axes <= 3:  # axes 4 to 6 have no encoder behind the gear
        facts = _with_link_encoders(facts, axes)
    return files, facts


def load_public(
    dataset: str, run: str, files: Files | None = None, robot: Robot | None = None
) -> Recording:
    """A public record by its names; see `public_facts` for arguments and errors."""
    files, facts = public_facts(dataset, run, robot, files)
    if dataset == "kuka_kr300":
        return load_recording(files, name=f"kuka_kr300_{run}", **facts, robot=robot)
    return load_recording(files, **facts, robot=robot or load_robot(dataset))


def load_staubli_tx40(
    files: Mapping[str, str | Path] | None = None, robot: Robot | None = None
) -> Recording:
    """The Stäubli TX40 record: 45 000 samples of six axes at 5 kHz, without reference.

    Args:
        files: its two files as ``q`` and ``tau``; those of `fetch` where they are not given.
        robot: gives joint names, transmission and zero position; the gallery's robot otherwise.

    Returns:
        The recording in SI units on the joint side.

    Raises:
        DatasetUnavailable: the files are not here and cannot be fetched.
    """
    return load_public("staubli_tx40", "all", files, robot)


def load_emps(file: str | Path | None = None, robot: Robot | None = None) -> Recording:
    """The EMPS estimation record: 24 841 samples of one axis at 1 kHz, with reference.

    Args:
        file: DATA_EMPS.mat; that of `fetch` where it is not given.
        robot: gives the joint's name; the gallery's robot otherwise.

    Returns:
        The recording in SI units on the joint side.

    Raises:
        DatasetUnavailable: the file is not here and cannot be fetched.
    """
    return load_public("emps", "estimation", file, robot)


def load_emps_pulses(file: str | Path | None = None, robot: Robot | None = None) -> Recording:
    """The EMPS validation record: the same reference, with pulses added to the drive input.

    Args:
        file: DATA_EMPS_PULSES.mat; that of `fetch` where it is not given.
        robot: gives the joint's name; the gallery's robot otherwise.

    Returns:
        The recording in SI units on the joint side.

    Raises:
        DatasetUnavailable: the file is not here and cannot be fetched.
    """
    return load_public("emps", "pulses", file, robot)


def load_kuka_kr300(
    motion: Literal["A", "B"] = "A", file: str | Path | None = None, robot: Robot | None = None
) -> Recording:
    """A KUKA KR300 record: 2501 samples of six axes at 250 Hz, reference and feed-forward.

    Args:
        motion: which of the two motions.
        file: its .npz file; that of `fetch` where it is not given.
        robot: gives joint names and transmission; the record's own ones otherwise. A robot of
            fewer joints gets the first axes of the record.

    Returns:
        The recording in SI units on the joint side.

    Raises:
        RecordingError: there is no such motion.
        DatasetUnavailable: the file is not here.
    """
    if motion not in ("A", "B"):
        raise RecordingError(f"the KR300 record has motions A and B, not {motion!r}")
    return load_public("kuka_kr300", motion, file, robot)


def _with_link_encoders(facts: dict[str, Any], axes: int) -> dict[str, Any]:
    """The same with the encoders behind the gears, for flexible joints."""
    columns = facts["columns"] | {"q_link": f"rec__act_pos_se_deg[:{axes}, :]"}
    return facts | {"columns": columns, "units": facts["units"] | {"q_link": "deg"}}


def _first_axes(axes: int) -> dict[str, Any]:
    """`KUKA_KR300` without the axes behind the first few."""
    columns = KUKA_KR300["columns"]
    named = {key: f"{columns[key]}[:{axes}, :]" for key in ("q", "tau", "q_ref", "dq_ref")} | {
        "inputs": {key: f"{name}[:{axes}, :]" for key, name in columns["inputs"].items()}
    }
    offset = KUKA_KR300["position_offset"][:axes]
    return KUKA_KR300 | {"columns": columns | named, "position_offset": offset}
