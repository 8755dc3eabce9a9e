"""A load from records without reference and law: instruments of the record, on a fixed flange."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.mounted import carrier_of, with_body
from pivident.robot.urdf import read_urdf
from pivident.studies.payload.identify_payload import identify_payload

LINK = """<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j{0}" type="revolute"><parent link="{3}"/><child link="{0}"/><origin xyz="{4}"/>
<axis xyz="{5}"/><limit lower="-3" upper="3" velocity="3" effort="90"/></joint>"""

#: Three joints; the first link is a frame with a mass of zero, the flange behind it one without.
ARM = f"""<robot name="arm"><link name="base"/>
{LINK.format("a", "0 0 0", 0, "base", "0 0 0.2", "0 0 1")}
{LINK.format("b", "0.1 0.01 0.2", 5, "a", "0 0 0.1", "0 1 0")}
{LINK.format("c", "0 0.02 0.1", 2, "b", "0 0 0.4", "1 0 0")}
<link name="flange"/><joint name="f" type="fixed"><parent link="c"/><child link="flange"/>
<origin xyz="0.02 0 0.25" rpy="0 1.2 0.4"/></joint></robot>"""

MASS, CENTRE = 1.5, (0.03, -0.02, 0.10)
INERTIA = (0.004, 0.0, 0.0, 0.005, 0.0, 0.003)
FRICTION = {"fv": 2.0, "fc": 3.0, "of": 0.3}


def moved(robot, seed) -> Recording:
    """Ten seconds of sines at 200 Hz, with noise on positions and torques."""
    rng = np.random.default_rng(seed)
    t = np.arange(2000) / 200.0
    parts = [
        (a / w * np.sin(w * t + p), a * np.cos(w * t + p), -a * w * np.sin(w * t + p))
        for w in 2 * np.pi * np.array([0.23, 0.41, 0.77])
        for a, p in [(rng.uniform(0.5, 1.2, (3, 1)), rng.uniform(0, 6, (3, 1)))]
    ]
    q, dq, ddq = sum(map(np.array, parts))
    problem = Problem(robot, (Recording("x", robot.joint_names, q.T, q.T, 200.0),))
    nominal = nominal_values(robot, problem.base.standard)
    for k, p in enumerate(problem.base.standard):
        nominal[k] = FRICTION.get(p.stem, nominal[k])
    phi = problem.regressor.matrix(q.T, dq.T, ddq.T)
    tau = phi @ problem.base.values(nominal)
    q = q.T + rng.normal(0, 1e-5, tau.shape)
    return Recording(
        "run", robot.joint_names, q, tau + rng.normal(0, 0.03, tau.shape), 200.0,
        torque_timing="sampled",
    )  # fmt: skip


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return read_urdf(path)


@pytest.fixture(scope="module")
def empty(robot):
    return Problem(robot, (moved(robot, 1),))


@pytest.fixture(scope="module")
def loaded(robot):
    return moved(with_body(robot, "flange", MASS, CENTRE, INERTIA), 2)


@pytest.mark.parametrize("method", ["iv-full-rate", "piv"])
def test_instruments_are_those_that_identification_takes(empty, loaded, method):
    found = identify_payload(empty, [loaded], method, link="flange")
    load = found.load
    assert found.converged and load.frame == "link 'flange', fixed to 'c'"
    kind = identify(replace(empty, recordings=(loaded,)), method).method.partition("(")[2]
    assert kind and found.method.partition("(")[2] == kind
    assert abs(load.mass - MASS) < 4 * load.mass_std and load.mass_std < 0.02
    deviation = (load.center_of_mass - CENTRE) / load.center_of_mass_std
    assert np.abs(deviation).max() < 4 and load.center_of_mass_std.max() < 2e-3


def test_a_fixed_link_is_a_frame_of_the_moving_one(robot, empty, loaded):
    arm = identify(empty, "ls")
    problem = replace(empty, recordings=(loaded,))
    number, pose = carrier_of(robot, "flange")
    assert number == 2
    tool = Pose(rotation_from_rpy(0.3, 0.0, -0.2), np.array([0.0, 0.05, 0.0]))
    own = identify_payload(arm, problem, "ls", frame=pose @ tool).load
    named = identify_payload(arm, problem, "ls", link="flange", frame=tool).load
    np.testing.assert_allclose(named.values, own.values, rtol=1e-9, atol=1e-12)
    assert named.frame.endswith("in the frame of link 'flange', fixed to 'c'")
    assert carrier_of(robot, "jb") == (1, None) and carrier_of(robot, None) == (2, None)
    with pytest.raises(RobotDescriptionError, match="is a part of the base"):
        carrier_of(robot, "base")
    with pytest.raises(RobotDescriptionError, match="no link 'flnge'"):
        carrier_of(robot, "flnge")
