"""What the questions are asked about: a planar arm's log, its experiment file, its URDF."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.robot import load_robot
from pivident.simulation.closed_loop import LoopSignals, simulate
from pivident.simulation.controllers import PD
from pivident.simulation.reference import point_to_point

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
    robot = load_robot("planar_2r")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    rng = np.random.default_rng(7)
    samples = 3200
    postures = rng.uniform(-1.2, 1.2, (12, 2))
    q_ref, _, _ = point_to_point(postures, 0.8 * robot.rated_speeds, RATE, samples)
    noise = 2e-6 * rng.standard_normal(q_ref.shape)
    infinite = np.full(2, np.inf)
    signals = LoopSignals(
        RATE, q_ref, None, None, noise, np.ones(2), infinite, np.full(2, 0.5), np.full(2, 50.0)
    )
    law = PD(np.array([6000.0, 2500.0]), np.array([180.0, 60.0]))
    made = simulate(make_model(robot, base.parameters, theta), law, signals, robot.joint_names)
    return np.arange(samples) / RATE, made.q + noise, q_ref, made.tau


def log() -> Columns:
    """A log that nothing is wrong with: seconds, radians, newton metres, joint side."""
    t, q, r, tau = _simulated()
    named = {"time": t, "q1": q[:, 0], "q2": q[:, 1], "r1": r[:, 0], "r2": r[:, 1]}
    named |= {"tau1": tau[:, 0], "tau2": tau[:, 1]}
    return {name: column.copy() for name, column in named.items()}


def short_log() -> Columns:
    """Enough for questions about the experiment file, and quickly looked at."""
    return {name: column[:150] for name, column in log().items()}


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
