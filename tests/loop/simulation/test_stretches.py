"""Long runs are simulated and differentiated in stretches; the cuts change nothing."""

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.problem import Problem
from pivident.loop.motion.motion import SimulatedMotion
from pivident.loop.simulation.closed_loop import simulate_blocks
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.friction import FrictionLaw, lugre, viscous
from pivident.robot.gallery import load_robot
from tests.loop.simulation.loops import TX40_KD, TX40_KP, nominal_model, reversals, run, signals_of

RATE = 5000.0
LAW = PD(TX40_KP, TX40_KD)


@pytest.fixture(scope="module")
def motion():
    return reversals(1500, RATE, [0.3, 0.2, 0.3, 0.5, 0.6, 0.8], [0.75, 0.6, 0.9, 1.0, 1.25, 1.5])


@pytest.mark.parametrize("block", [1, 7, 512, 5000])
def test_simulation_does_not_depend_on_the_length_of_its_stretches(motion, block):
    robot, model = nominal_model("staubli_tx40")
    signals = signals_of(RATE, *motion)
    whole = run(robot, model, LAW, signals)
    channels = [
        made.copy()
        for _, made, _ in simulate_blocks(model, LAW, signals, robot.joint_names, block=block)
    ]
    together = np.concatenate(channels, axis=1)
    expected = (whole.q, whole.dq, whole.ddq, whole.tau, whole.command)
    for made, own in zip(together, expected, strict=True):
        np.testing.assert_array_equal(made, own)


def test_states_of_friction_go_on_from_one_stretch_to_the_next(motion):
    law = FrictionLaw((*lugre(1e-3, 0.2, 0.3), viscous()))
    robot = load_robot("staubli_tx40").with_friction(law)
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    for k, p in enumerate(parameters):
        theta[k] = {"fc": 5.0, "fv": 3.0, "fd": 1.0}.get(p.stem, theta[k])
    model = make_model(robot, parameters, theta)
    signals = signals_of(RATE, *motion)
    whole = run(robot, model, LAW, signals)
    assert whole.friction_states.shape[1] == 6
    states = [
        own.copy()
        for _, _, own in simulate_blocks(model, LAW, signals, robot.joint_names, block=400)
    ]
    np.testing.assert_array_equal(np.concatenate(states), whole.friction_states)


def test_derivatives_of_a_stretch_are_those_of_the_whole_record():
    rng = np.random.default_rng(3)
    q = np.cumsum(rng.standard_normal((2, 900)), axis=1)
    motion = SimulatedMotion(q, RATE)
    for span in (slice(0, 1), slice(0, 300), slice(299, 302), slice(898, 900), slice(850, 5000)):
        for own, whole in zip(motion.stretch(span), (motion.q, motion.dq, motion.ddq), strict=True):
            np.testing.assert_array_equal(own, whole[:, span])


@pytest.mark.parametrize("factor", [1, 2, 3])
@pytest.mark.parametrize("differences", [True, False])
def test_instruments_of_slower_logs_are_every_second_or_third_sample(motion, factor, differences):
    """20,000 samples of control: several stretches, none a multiple of the factor."""
    robot, _ = nominal_model("planar_2r")
    rate, samples = 3000.0, 36001
    t = np.arange(samples)[:, None] / rate
    q_ref = np.sin(2 * np.pi * t * [0.5, 0.7]) * [0.4, 0.3]
    law = PD([6000, 2500], [180, 60])
    log = Recording(
        "slow", robot.joint_names, q_ref[::factor], np.cos(q_ref[::factor]), rate / factor,
        q_ref=q_ref[::factor], control_rate=rate,
    )  # fmt: skip
    problem = Problem(robot, (log,), Loop(law))
    auxiliary = AuxiliaryModel(problem, differences=differences, torque=True)
    theta = problem.initial_values()
    (made,) = auxiliary.simulate(theta)
    signals, start = auxiliary.signals[0]
    model = make_model(robot, problem.regressor.parameters, theta, clip=True)
    whole = run(robot, model, law, signals, start=start)
    np.testing.assert_array_equal(made.q.T, whole.q[::factor][: log.samples])
    np.testing.assert_array_equal(made.tau.T, whole.tau[::factor][: log.samples])
    if not differences:
        np.testing.assert_array_equal(made.ddq.T, whole.ddq[::factor][: log.samples])
