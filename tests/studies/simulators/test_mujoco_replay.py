"""Replays in MuJoCo: joints that are held, and laws against the compiled loop."""

import mujoco
import numpy as np
import pytest

from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PD, PID, Cascade
from pivident.robot.mjcf import read_mjcf
from pivident.studies.simulators.mujoco_replay import Replay, fine_settings, held_spec, replay
from tests.robot.test_mjcf import arm, engine, random_mjcf


def test_held_joints_are_those_of_a_frozen_robot(tmp_path):
    rng = np.random.default_rng(8)
    spec = mujoco.MjSpec()
    while sum(1 for b in spec.bodies if len(b.joints) == 1) < 3:
        spec = random_mjcf(rng, 6)
    spec.compile()
    alone = [b.joints[0].name for b in spec.bodies if len(b.joints) == 1]
    names = [j.name for j in spec.joints if j.name not in alone[:2]]
    frozen = {alone[0]: 0.7, alone[1]: -0.4}
    q, dq, ddq = rng.uniform(-1, 1, (3, 4, len(names)))
    held = held_spec(spec, names, frozen).compile()
    tau, _ = engine(held, names, q, dq, ddq)
    every = [j.name for j in spec.joints]
    at = [every.index(name) for name in names]
    whole = np.zeros((3, 4, len(every)))
    whole[:, :, at] = q, dq, ddq
    for name, position in frozen.items():
        whole[0, :, every.index(name)] = position
    expected, _ = engine(spec.compile(), every, *whole)
    np.testing.assert_allclose(tau, expected[:, at], atol=1e-8)


def test_a_floating_base_is_held_and_actuators_go(tmp_path):
    more = '<actuator><motor joint="a"/></actuator>'
    more += '<keyframe><key qpos="0 0 0 1 0 0 0 0 0"/></keyframe>'
    path = arm(tmp_path, root='<freejoint name="root"/>', more=more)
    model = held_spec(mujoco.MjSpec.from_file(str(path)), ("a", "b"), {}).compile()
    assert (model.nq, model.nu, model.nkey) == (2, 0, 0)


@pytest.mark.parametrize(
    "law",
    [PD(30.0, 2.0), PID(30.0, 2.0, [40.0, 20.0], 5e-3), Cascade(15.0, 2.0, 3.0, averaged=True)],
)
def test_laws_move_the_robot_as_in_the_compiled_loop(tmp_path, law):
    path = arm(tmp_path)
    robot = read_mjcf(path)
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    theta[[p.stem == "fc" for p in parameters]] = 0.0
    rate, n = 500.0, 2
    t = np.arange(600) / rate
    q_ref = 0.3 * np.sin(2 * np.pi * np.outer(t, [1.0, 1.5]))
    signals = LoopSignals(
        rate, q_ref, None, 0.1 * np.ones((1, n)), None, np.array([1.0, 2.0]), np.full(n, 40.0),
        np.full(n, 5.0), np.full(n, 500.0), drive_delay=3.3e-3,
    )  # fmt: skip
    ours = simulate(make_model(robot, parameters, theta), law, signals, robot.joint_names)
    spec = mujoco.MjSpec.from_file(str(path))
    for joint in spec.joints:
        joint.frictionloss = 0.0
    spec = fine_settings(held_spec(spec, robot.joint_names, {}), 1.0 / rate)
    run = Replay(law, signals, np.tile(q_ref[0], (300, 1)), 2)
    found = replay(spec, robot.joint_names, run, 3.3e-3, np.zeros(n))
    np.testing.assert_allclose(found, ours.q[::2][:300], atol=2e-5)
