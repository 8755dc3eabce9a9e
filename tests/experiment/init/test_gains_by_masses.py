"""Currents of an arm beside the masses of its description: which gains follow, and which do not."""

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.problem import Problem
from pivident.experiment.init.torque_unit import compare, gains_of, torque_unit
from pivident.robot.mounted import with_body
from pivident.robot.urdf import read_urdf

LINK = """<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>
<inertia ixx="{6}" iyy="{6}" izz="{6}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j{0}" type="revolute"><parent link="{3}"/><child link="{0}"/><origin xyz="{4}"/>
<axis xyz="{5}"/><limit lower="-3" upper="3" velocity="3" effort="90"/></joint>"""

ARM = f"""<robot name="arm"><link name="base"/>
{LINK.format("a", "0 0 0.05", 6, "base", "0 0 0.2", "0 0 1", 0.05)}
{LINK.format("b", "0.05 0.01 0.2", 5, "a", "0 0 0.1", "0 1 0", 0.06)}
{LINK.format("c", "0.02 0.02 0.15", 3, "b", "0 0 0.4", "0 1 0", 0.03)}
{LINK.format("d", "0.03 0 0.08", 0.6, "c", "0 0 0.35", "1 0 0", 0.002)}
</robot>"""

GAINS = np.array([31.0, 24.0, 15.0, 6.0])
FRICTION = {"fv": 1.5, "fc": 2.0, "ia": 0.3}
TIMES = np.arange(5000) / 250.0


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return read_urdf(path)


def currents(robot, seed=3, noise=0.02):
    """Positions and currents of twenty seconds at 250 Hz."""
    rng = np.random.default_rng(seed)
    motion = np.zeros((3, robot.size, TIMES.size))
    for w in 2 * np.pi * np.array([0.17, 0.43, 0.81]):
        a, p = rng.uniform(0.4, 0.9, (4, 1)), rng.uniform(0, 6, (4, 1))
        x = w * TIMES + p
        motion += a / w * np.sin(x), a * np.cos(x), -a * w * np.sin(x)
    q, dq, ddq = (x.T for x in motion)
    problem = Problem(robot, (Recording("x", robot.joint_names, q, q, 250.0),))
    nominal = nominal_values(robot, problem.base.standard)
    for k, p in enumerate(problem.base.standard):
        nominal[k] = FRICTION.get(p.stem, nominal[k])
    tau = problem.regressor.matrix(q, dq, ddq) @ problem.base.values(nominal)
    tau = tau + noise * tau.std(axis=0) * rng.normal(size=tau.shape)
    return q + rng.normal(0, 1e-5, q.shape), tau / GAINS


def test_right_masses_give_the_gains(robot):
    found = compare(robot, *currents(robot), TIMES)
    gains, ratios, assumed = gains_of(robot, found, 1.0)
    np.testing.assert_allclose(gains, GAINS, rtol=0.02)
    assert found.is_gain.all() and not ratios and not assumed


def test_a_gain_that_another_body_makes_is_not_written(robot):
    """Four kilograms beside the forearm: what the joints share gives the ratios that masses miss.

    By its masses alone the elbow would have 45 % of its torque.
    """
    carried = with_body(robot, "c", 4.0, (-0.3, 0.0, -0.1), (0.02, 0.01, 0.02, 0, 0, 0))
    found = compare(robot, *currents(carried), TIMES)
    gains, ratios, assumed = gains_of(robot, found, 1.0)
    assert found.load is None and abs(found.factors[2] * GAINS[2] - 1.0) > 0.3
    assert ratios == [0, 2] and not assumed
    np.testing.assert_allclose(gains[:3] / gains[1], GAINS[:3] / GAINS[1], rtol=0.02)
    said = torque_unit(robot, found, "A", True, None).seen
    assert "jc 12.9 by what it shares with the others (its masses leave" in said
    assert "another shape than that of the description, correlation 0.57" in said


def test_a_vague_gain_is_neither_written_nor_taken_for_others(robot):
    """A third of the gain is more than `pivident gains` calls known."""
    found = compare(robot, *currents(robot, noise=10.0), TIMES)
    half = 2.0 * found.standard_errors / np.abs(found.factors)
    assert np.isfinite(half[1:3]).all() and (half[1:3] > 0.25).all()
    unit = torque_unit(robot, found, "A", True, None)
    assert unit.value == [{"unit": "A", "gain": 1.0, "scale": "assumed"}] * 4
    assert "jb unknown (its masses leave ± 3" in unit.seen


def test_noise_does_not_change_the_shape_of_a_torque(robot):
    found = compare(robot, *currents(robot, noise=1.0), TIMES)
    assert found.is_gain[1:3].all() and (found.shape[1:3] > 0.98).all()
