"""Limits, start, divergence and refusals of the simulated loop."""

import numpy as np
import pytest

from pivident.dynamics.forward import make_model, mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.foundation.errors import (
    ExperimentError,
    MassMatrixNotPositiveDefinite,
    ShapeMismatch,
    SimulationDiverged,
)
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot
from tests.loop.simulation.loops import (
    CHANNELS,
    TX40_KD,
    TX40_KP,
    nominal_model,
    reversals,
    run,
    signals_of,
)

RATE = 5000.0
TX40_LAW = PD(TX40_KP, TX40_KD)
AMPLITUDE, FREQUENCY = [0.3, 0.2, 0.3, 0.5, 0.6, 0.8], [0.75, 0.6, 0.9, 1.0, 1.25, 1.5]


@pytest.fixture(scope="module")
def tx40():
    return nominal_model("staubli_tx40")


@pytest.fixture(scope="module")
def motion():
    return reversals(1500, RATE, AMPLITUDE, FREQUENCY)


def test_the_motion_follows_its_reference(tx40, motion):
    made = run(*tx40, TX40_LAW, signals_of(RATE, *motion))
    assert abs(made.q - motion[0]).max() < 0.02
    assert made.rate == RATE
    for channel in CHANNELS:
        assert getattr(made, channel).shape == motion[0].shape


def test_simulations_repeat_to_the_last_bit(tx40, motion):
    one, two = (run(*tx40, TX40_LAW, signals_of(RATE, *motion)) for _ in range(2))
    for channel in CHANNELS:
        np.testing.assert_array_equal(getattr(one, channel), getattr(two, channel))


def test_commands_stay_in_their_limits_and_torques_follow_the_drive_gain(tx40, motion):
    limit, gain = np.full(6, 4.0), np.array([4.0, 5.0, 3.0, 2.0, 2.0, 1.0])
    law = PD(TX40_KP / gain, TX40_KD / gain)
    signals = signals_of(RATE, *motion, limit=limit, drive_gain=gain)
    made = run(*tx40, law, signals)
    assert (abs(made.command).max(axis=0) <= limit).all()
    assert (abs(made.command) == limit).any()
    np.testing.assert_array_equal(made.tau, gain * made.command)


def test_gains_and_bounds_may_be_one_number(tx40, motion):
    every = signals_of(RATE, *motion, drive_gain=1, limit=1000, bound=1, speed_bound=100)
    made = run(*tx40, TX40_LAW, every)
    np.testing.assert_array_equal(made.q, run(*tx40, TX40_LAW, signals_of(RATE, *motion)).q)


def test_the_start_is_the_one_given(tx40, motion):
    start = motion[0][0] + 0.01, np.linspace(-0.5, 0.5, 6)
    made = run(*tx40, TX40_LAW, signals_of(RATE, *motion), start=start)
    np.testing.assert_array_equal(made.q[0], start[0])
    np.testing.assert_array_equal(made.dq[0], start[1])


def test_noise_is_heard_by_the_controller_only(tx40, motion):
    noise = 1e-5 * np.random.default_rng(0).standard_normal(motion[0].shape)
    quiet = run(*tx40, TX40_LAW, signals_of(RATE, *motion))
    made = run(*tx40, TX40_LAW, signals_of(RATE, *motion, noise=noise))
    assert abs(made.command - quiet.command).std() > 0.1
    assert abs(made.q - quiet.q).max() < 2e-5


def test_a_reversed_axis_is_found_with_joint_and_time(tx40, motion):
    gain = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    bound = np.full(6, 0.3)
    with pytest.raises(SimulationDiverged) as caught:
        run(*tx40, TX40_LAW, signals_of(RATE, *motion, drive_gain=gain, bound=bound))
    error = caught.value
    assert error.joint == "joint_4" and not error.speed
    assert 0.0 < error.time < 0.3
    assert error.deviation > error.bound == 0.3
    assert "'joint_4'" in str(error) and f"t = {error.time:.4f} s" in str(error)
    assert "rad away from its reference" in str(error)


def test_a_joint_that_is_too_fast_is_found(tx40, motion):
    speed = np.array([10.0, 10.0, 10.0, 10.0, 10.0, 2.0])
    with pytest.raises(SimulationDiverged, match="'joint_6' has a speed of 2") as caught:
        run(*tx40, TX40_LAW, signals_of(RATE, *motion, speed_bound=speed))
    assert caught.value.speed and caught.value.bound == 2.0
    first = np.flatnonzero(abs(motion[1][:, 5]) > 2.0)[0] / RATE
    assert caught.value.time == pytest.approx(first, abs=0.02)


def test_a_slide_that_is_too_far_or_too_fast_is_so_in_metres():
    robot, model = nominal_model("emps")
    q_ref = np.linspace(0.0, 1.0, 2000)[:, None]
    for bounds, said in (
        ({"bound": np.array([0.1])}, "m away from its reference"),
        ({"speed_bound": np.array([0.2]), "bound": np.array([np.inf])}, "m/s at t = "),
    ):
        with pytest.raises(SimulationDiverged, match=said) as caught:
            run(robot, model, PD([500.0], [50.0]), signals_of(1000.0, q_ref, **bounds))
        assert "rad" not in str(caught.value)


@pytest.mark.parametrize("oracle", [None, 4])
def test_an_indefinite_mass_matrix_is_found_with_joint_and_time(oracle):
    robot = load_robot("planar_2r")
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    theta[[p.name for p in parameters].index("mx2")] = 3.0  # with the elbow bent that is possible
    q_ref = np.stack([np.zeros(1000), np.linspace(0.5 * np.pi, 0.0, 1000)], axis=1)
    pivots = np.linalg.det(mass_matrix(robot, parameters, theta, q_ref))
    model = make_model(robot, parameters, theta)
    signals = signals_of(1000.0, q_ref, bound=np.full(2, 1.0))
    with pytest.raises(MassMatrixNotPositiveDefinite) as caught:
        run(robot, model, PD([5e4, 5e3], [500.0, 50.0]), signals, oracle=oracle)
    assert caught.value.joint == "elbow"
    assert caught.value.time == pytest.approx(np.argmax(pivots < 0.0) / 1000.0, abs=0.05)
    assert caught.value.pivot <= 0.0


@pytest.mark.parametrize("rate", [500.0, 5000.0])
def test_a_reference_that_is_not_a_number_ends_the_run(rate):
    robot, model = nominal_model("planar_2r")
    q_ref = np.zeros((300, 2))
    q_ref[150, 1] = np.nan
    with pytest.raises(SimulationDiverged) as caught:
        run(robot, model, PD([500.0, 200.0], [50.0, 20.0]), signals_of(rate, q_ref))
    assert caught.value.time == pytest.approx(150 / rate)
    assert caught.value.joint == "elbow"


@pytest.mark.parametrize("rate", [500.0, 5000.0])
def test_a_loop_that_explodes_ends(rate):
    robot, model = nominal_model("planar_2r")
    unbounded = {"bound": np.full(2, np.inf), "speed_bound": np.full(2, np.inf)}
    q_ref = np.full((3000, 2), 0.1)
    q_ref[:10] = 0.0
    law = PD([1e9, 1e9], [1e7, 1e7])  # far beyond what so slow a clock allows
    with pytest.raises((SimulationDiverged, MassMatrixNotPositiveDefinite)):
        run(robot, model, law, signals_of(rate, q_ref, **unbounded))


def test_an_inertia_next_to_nothing_ends_soon():
    # stiffness grows without limit there; the simulation must not
    robot = load_robot("planar_2r")
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    for k, p in enumerate(parameters):
        if p.is_inertial or p.stem == "ia":
            theta[k] *= 1e-12
    model = make_model(robot, parameters, theta)
    q_ref, dq_ref = reversals(40, RATE, [0.1, 0.1], [1.0, 1.5])
    with pytest.raises((SimulationDiverged, MassMatrixNotPositiveDefinite)):
        run(robot, model, PD([5.0, 2.0], [0.5, 0.2]), signals_of(RATE, q_ref, dq_ref))


def test_signals_that_do_not_belong_together_are_refused(tx40, motion):
    q_ref, dq_ref = motion
    for name, changes in (
        ("q_ref", {"q_ref": q_ref[:, :5]}),
        ("dq_ref", {"dq_ref": dq_ref[:-1]}),
        ("inputs", {"inputs": q_ref[:100]}),
        ("noise", {"noise": q_ref[:, :1]}),
    ):
        signals = signals_of(RATE, **({"q_ref": q_ref, "dq_ref": dq_ref} | changes))
        with pytest.raises(ShapeMismatch, match=name):
            run(*tx40, TX40_LAW, signals)


def test_gains_of_another_robot_are_refused(tx40, motion):
    with pytest.raises(ExperimentError, match="the robot has 6 joints"):
        run(*tx40, PD(np.ones(5), np.ones(5)), signals_of(RATE, *motion))
