"""What the questions are asked about: a planar arm's log, its experiment file, its URDF."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from tests.planar_arm import nominal_parameters, planar_motion, planar_record

RATE = 1000.0

Columns = dict[str, np.ndarray]

EXPERIMENT = """\
robot = "planar_2r"

[recording]
files = "log.csv"
columns = {t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["tau1", "tau2"]}

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[identify]
methods = ["ls"]
"""

#: The same with a URDF, which knows neither rotors nor that the arm hangs on a wall.
URDF_EXPERIMENT = EXPERIMENT.replace(
    '"planar_2r"',
    '{model = "arm.urdf", gravity = [0, -9.81, 0], rotor_inertia = [0.25, 0.1]}',
)

WITHOUT_ROTORS = URDF_EXPERIMENT.replace(", rotor_inertia = [0.25, 0.1]", "")

URDF = """\
<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper_arm">
    <inertial>
      <origin xyz="0.2 0 0"/>
      <mass value="4"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.054" iyz="0" izz="0.054"/>
    </inertial>
  </link>
  <link name="forearm">
    <inertial>
      <origin xyz="0.15 0 0"/>
      <mass value="2.5"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="upper_arm"/>
    <axis xyz="0 0 1"/>
    <limit lower="-2.97" upper="2.97" velocity="3.14" effort="80"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper_arm"/>
    <child link="forearm"/>
    <origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-2.62" upper="2.62" velocity="4.19" effort="40"/>
  </joint>
</robot>
"""


@cache
def _simulated() -> tuple[np.ndarray, ...]:
    rng, samples = np.random.default_rng(7), 3200
    q_ref = planar_motion(rng, RATE, samples, postures=12, reach=1.2)
    q, tau = planar_record(*nominal_parameters(), q_ref, RATE, rng)
    return np.arange(samples) / RATE, q, q_ref, tau


def log() -> Columns:
    """A log that nothing is wrong with: seconds, radians, newton metres, joint side."""
    t, q, r, tau = _simulated()
    named = {"time": t, "q1": q[:, 0], "q2": q[:, 1], "r1": r[:, 0], "r2": r[:, 1]}
    named |= {"tau1": tau[:, 0], "tau2": tau[:, 1]}
    return {name: column.copy() for name, column in named.items()}


def short_log() -> Columns:
    """Enough for questions about the experiment file, and quickly looked at."""
    return {name: column[:400] for name, column in log().items()}


def csv(columns: Mapping[str, np.ndarray], separator: str = ",") -> str:
    """The text of a log."""
    text = io.StringIO()
    table = np.column_stack(list(columns.values()))
    np.savetxt(text, table, fmt="%.15g", delimiter=separator, header=separator.join(columns),
               comments="")  # fmt: skip
    return text.getvalue()


def changed(**changes: Callable[[np.ndarray], np.ndarray]) -> Columns:
    """The log with some columns changed."""
    made = log()
    for name, change in changes.items():
        made[name] = change(made[name])
    return made


def renamed(columns: Columns, **names: str) -> Columns:
    """The log with other names of some columns."""
    return {names.get(name, name): values for name, values in columns.items()}


def exchanged(columns: Columns, *pairs: tuple[str, str]) -> Columns:
    """The log with the contents of some columns exchanged."""
    made = dict(columns)
    for a, b in pairs:
        made[a], made[b] = made[b], made[a]
    return made


def replaced(*changes: tuple[str, str], text: str = EXPERIMENT) -> str:
    """The experiment file with some text replaced."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


def with_table(lines: str, text: str = EXPERIMENT) -> str:
    """The experiment file with more at its end."""
    return text + lines + "\n"


def urdf(*changes: tuple[str, str]) -> dict[str, str]:
    """The arm's URDF with some text replaced."""
    return {"arm.urdf": replaced(*changes, text=URDF)}


@dataclass(frozen=True)
class Case:
    """Something that a user does wrong.

    Attributes:
        question: what was done.
        answer: words that one line of the answer must hold all together: cause and place.
        text: the experiment file.
        log: columns of log.csv, its text or bytes, or None for no such file.
        files: further files by name.
        command: what is typed.
        code: the exit code.
    """

    question: str
    answer: tuple[str, ...]
    text: str = EXPERIMENT
    log: Columns | str | bytes | None = field(default_factory=short_log)
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    command: tuple[str, ...] = ("check", "experiment.toml")
    code: int = 1
