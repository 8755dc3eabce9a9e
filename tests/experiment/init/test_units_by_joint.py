"""Turning and sliding joints in units of their own, as a SCARA's controller logs them."""

import numpy as np
import pytest

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from pivident.robot.modified_dh import parse_modified_dh
from tests.judgement.audit import scara

ROBOT = """
name = "two axes"
gravity = "-z"

[[joints]]
name = "J1"
rated_speed = 4.0
position_limits = [-3.0, 3.0]
link = {mass = 3, first_moments = [0.6, 0, 0], inertia_at_origin = [0.01, 0, 0, 0.17, 0, 0.17]}

[[joints]]
name = "J2"
kind = "prismatic"
d = 0.3
rated_speed = 1.0
position_limits = [0.0, 0.4]
link = {mass = 1.5, inertia_at_origin = [0.01, 0, 0, 0.01, 0, 0.01]}
"""

HEADER = "Time [ms];J1.PosFbk [deg];J1.TrqFbk [Nm];J2.PosFbk [mm];J2.TrqFbk [N]"


def test_all_joints_are_found_with_their_units(tmp_path):
    (tmp_path / "arm.toml").write_text(ROBOT, encoding="utf-8")
    robot = parse_modified_dh(ROBOT)
    t = np.arange(4000) / 1000.0
    phase = np.outer(t, [5.0, 7.0])
    size, rest, omega = np.array([1.0, 0.1]), np.array([0.0, 0.2]), np.array([5.0, 7.0])
    q, dq = rest + size * np.sin(phase), size * omega * np.cos(phase)
    ddq = -size * omega**2 * np.sin(phase)
    standard = standard_parameters(robot)
    theta = nominal_values(robot, standard)
    tau = Regressor.build(robot, standard).torque(q, dq, ddq, theta) + 0.5 * np.sign(dq)
    rng = np.random.default_rng(1)
    q, tau = q + 1e-6 * rng.normal(size=q.shape), tau + 0.01 * rng.normal(size=q.shape)
    table = np.column_stack([1e3 * t, np.rad2deg(q[:, 0]), tau[:, 0], 1e3 * q[:, 1], tau[:, 1]])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, fmt="%.9g", delimiter=";", header=HEADER, comments="")
    draft = draft_experiment([path], str(tmp_path / "arm.toml"), out=tmp_path / "experiment.toml")
    said = {f"{a.table}.{a.key}": a.value for a in draft.assumptions}
    assert said["recording.units.q"] == ["deg", "mm"]
    assert said["recording.units.tau"] == ["N m", "N"]
    (tmp_path / "experiment.toml").write_text(draft.text, encoding="utf-8")
    (recording,) = load_experiment(tmp_path / "experiment.toml").recordings()
    assert np.allclose(recording.q, q, atol=1e-5) and np.allclose(recording.tau, tau, atol=1e-4)


@pytest.mark.parametrize(("unit", "per_metre"), [("m", 1.0), ("mm", 1e3)])
def test_a_slide_in_metres_moves_beside_joints_in_degrees(tmp_path, unit, per_metre):
    (tmp_path / "arm.urdf").write_text(scara.urdf("0 0 1"), encoding="utf-8")
    record = scara.recording(scara.arm("0 0 1"), np.ones(3))
    t = np.arange(record.samples) / record.rate
    scale = np.array([180.0 / np.pi, 180.0 / np.pi, per_metre])
    table = np.column_stack([t, record.q * scale, record.tau])
    header = "time," + ",".join(f"{c}_{j}" for c in ("pos", "trq") for j in record.joint_names)
    np.savetxt(tmp_path / "log.csv", table, fmt="%.9g", delimiter=",", header=header, comments="")
    draft = draft_experiment(
        [tmp_path / "log.csv"], str(tmp_path / "arm.urdf"), out=tmp_path / "experiment.toml"
    )
    said = {f"{a.table}.{a.key}": a.value for a in draft.assumptions}
    assert said["robot.joints"] == ["turn", "elbow", "slide"]
    assert said["recording.units.q"] == ["deg", "deg", unit]
