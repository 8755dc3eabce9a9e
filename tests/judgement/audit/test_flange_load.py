"""A body on the flange that the description lacks is told from gains that are wrong."""

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.experiment.check.remark import of_finding
from pivident.experiment.init.torque_unit import compare, torque_unit
from pivident.judgement.audit.flange_load import flange_load
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.scale import check_scale
from pivident.judgement.audit.timing import check_timing
from pivident.robot.urdf import read_urdf

RATE = 250.0
JOINTS = [  # origin, axis, mass, centre of mass
    ("0 0 0.15", "0 0 1", 8.0, "0 0 0.05"),
    ("0 0.1 0", "0 1 0", 12.0, "0 0 0.3"),
    ("0 -0.1 0.6", "0 1 0", 5.0, "0 0 0.25"),
    ("0 0 0.5", "0 1 0", 2.0, "0 0.08 0"),
    ("0 0.1 0", "0 0 1", 2.0, "0 0 0.08"),
]
FRICTION = np.array([8.0, 8.0, 5.0, 2.0, 2.0])


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    text = '<robot name="arm"><link name="l0"/>'
    for j, (origin, axis, mass, com) in enumerate(JOINTS, start=1):
        i = 0.02 * mass
        text += f"""<link name="l{j}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
          <inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>
          <joint name="j{j}" type="revolute"><parent link="l{j - 1}"/><child link="l{j}"/>
          <origin xyz="{origin}"/><axis xyz="{axis}"/>
          <limit lower="-3" upper="3" velocity="3" effort="300"/></joint>"""
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(text + "</robot>", encoding="utf-8")
    return read_urdf(path)


def signals(robot, mass, gain):
    """Positions and torques of 24 s with a body of some mass 0.1 m beside the last joint."""
    rng = np.random.default_rng(4)
    t = np.arange(int(24 * RATE)) / RATE
    q, dq, ddq = np.zeros((3, len(t), robot.size))
    for j in range(robot.size):
        for w in rng.uniform(0.5, 3.5, 6):
            size, phase = rng.uniform(0.1, 0.35), rng.uniform(0, 2 * np.pi)
            q[:, j] += size * np.sin(w * t + phase)
            dq[:, j] += size * w * np.cos(w * t + phase)
            ddq[:, j] -= size * w * w * np.sin(w * t + phase)
    parameters = [p for p in standard_parameters(robot) if p.is_inertial]
    theta = nominal_values(robot, tuple(parameters))
    last = dict(xx=0.012, yy=0.002, zz=0.012, my=0.1, m=1.0)
    for k, p in enumerate(parameters):
        if p.joint == robot.size - 1:
            theta[k] += mass * last.get(p.stem, 0.0)
    tau = Regressor.build(robot, parameters).torque(q, dq, ddq, theta)
    tau += FRICTION * np.tanh(60 * dq) + 0.5 * FRICTION * dq + [0.8, 0.8, 0.4, 0.3, 0.3] * ddq
    return t, q, gain * tau + 0.05 * rng.normal(size=tau.shape)


def log_of(robot, t, q, tau):
    both = {"q": q, "tau": tau}
    return Log("log", robot.joint_names, {}, {"t": t}, logged=both, channels=both, robot=robot)


def model_of(log):
    return build_inverse_model(log, check_timing(log))


def test_mass_and_gains_are_found_together(robot):
    gain = np.array([0.08, 0.08, 0.1, 0.12, 0.12])
    model = model_of(log_of(robot, *signals(robot, 1.5, gain)))
    load = flange_load(model, np.array([0.09, 0.09, 0.12, 0.3, np.nan]))
    assert load.mass == pytest.approx(1.5, abs=4 * load.standard_error + 0.02)
    assert load.standard_error < 0.1
    np.testing.assert_allclose(load.factors, gain, rtol=0.04)


def test_a_body_that_the_arm_did_not_carry(robot):
    """The description has a tool of 1.6 kg more than the arm."""
    log = log_of(robot, *signals(robot, -1.6, 1.0))
    model = model_of(log)
    load = flange_load(model, np.ones(5))
    assert load.mass == pytest.approx(-1.6, abs=4 * load.standard_error + 0.02)
    (found,) = [f for f in check_scale(log, model).findings if f.severity != "ok"]
    assert found.kind == "load" and "has too much: 1.5" in found.message
    assert found.next_step.startswith("Take it out of the link of j5")


def test_no_more_is_taken_out_than_there_is(robot):
    """A last link of 2 kg cannot have 3 kg too much."""
    model = model_of(log_of(robot, *signals(robot, -3.0, 1.0)))
    assert flange_load(model, np.ones(5)) is None


def test_no_load_is_invented(robot):
    for gain in (1.0, np.array([1.0, 1.0, 1.0, 2.0, 6.0])):
        model = model_of(log_of(robot, *signals(robot, 0.0, gain)))
        assert flange_load(model, np.ones(5) * gain) is None


def test_newton_metres_with_a_tool_stay_newton_metres(robot):
    t, q, tau = signals(robot, 1.5, 1.0)
    found = compare(robot, q, tau, t)
    unit = torque_unit(robot, found, None, False, None)
    assert unit.value == "N m" and unit.sure == "likely"
    assert "1.5" in unit.seen and "j5" in unit.seen


def test_the_audit_names_the_load_in_place_of_gains(robot):
    log = log_of(robot, *signals(robot, 2.5, 1.0))
    findings = [f for f in check_scale(log, model_of(log)).findings if f.severity != "ok"]
    assert [(f.kind, f.severity, f.subject) for f in findings] == [("load", "warning", "j5")]
    assert findings[0].quantity.value == pytest.approx(2.5, abs=0.2)


def test_a_wrong_gain_is_still_named_beside_a_load(robot):
    log = log_of(robot, *signals(robot, 1.5, np.array([1.0, 1.0, 4.0, 1.0, 1.0])))
    findings = [f for f in check_scale(log, model_of(log)).findings if f.severity != "ok"]
    assert "j3" in [f.subject for f in findings if f.kind == "gain"]


def test_the_load_is_mended_in_the_robots_file_and_its_condition_is_told(robot):
    log = log_of(robot, *signals(robot, 2.5, 1.0))
    finding = next(f for f in check_scale(log, model_of(log)).findings if f.kind == "load")
    assert of_finding(finding, ("recording", 0)).place == ("robot", "model")
    assert "if the masses of the description are exact" in finding.message
    assert "centre of mass and inertia to the link of j5" in finding.next_step


def test_a_rotor_that_is_not_described_is_no_gain(robot):
    log = log_of(robot, *signals(robot, 0.0, 1.0))
    scale = check_scale(log, model_of(log))
    # the rotor of j5 makes 7 times the torque of its link
    np.testing.assert_allclose(scale.factors, 1.0, atol=0.05)
    assert all(f.severity == "ok" for f in scale.findings)
