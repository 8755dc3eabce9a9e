"""Simulations that have an answer on paper."""

import numpy as np
import pytest

from pivident.dynamics.forward import make_model, mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot
from tests.loop.simulation.loops import TX40_KD, TX40_KP, reversals, run, signals_of
from tests.robot.kinematics import potential_energy

RATE = 1000.0
FREE = {n: PD(np.zeros(n), np.zeros(n)) for n in (1, 2)}


def carriage(**values):
    """A mass on a rail with only the given parameters."""
    robot = load_robot("emps")
    parameters = standard_parameters(robot)
    theta = np.array([values.get(p.name, 0.0) for p in parameters])
    return robot, make_model(robot, parameters, theta)


def frictionless(name):
    robot = load_robot(name)
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    for k, p in enumerate(parameters):
        if p.friction is not None or p.coupling is not None:
            theta[k] = 0.0
    return robot, parameters, theta


def energies(robot, parameters, theta, made):
    """Kinetic and potential energy of a motion, shape (samples,) each [J]."""
    masses = mass_matrix(robot, parameters, theta, made.q)
    kinetic = 0.5 * np.einsum("si,sij,sj->s", made.dq, masses, made.dq)
    return kinetic, np.array([potential_energy(robot, q) for q in made.q])


@pytest.mark.parametrize("oracle", [None, 1])
def test_a_mass_under_a_sampled_pd_law_is_a_linear_recursion(oracle):
    mass, kp, kd, h = 2.0, 900.0, 40.0, 1.0 / RATE
    q_ref, dq_ref = reversals(400, RATE, [0.1], [2.0])
    law = PD([kp], [kd])
    made = run(*carriage(m1=mass), law, signals_of(RATE, q_ref, dq_ref), oracle=oracle)
    x = v = last = 0.0
    for k in range(400):
        u = kp * (q_ref[k, 0] - x) + kd * (dq_ref[k, 0] - (x - last) / h)
        np.testing.assert_allclose(
            [made.q[k, 0], made.dq[k, 0], made.tau[k, 0], made.ddq[k, 0]],
            [x, v, u, u / mass],
            atol=1e-9,
        )
        last = x
        x += h * v + 0.5 * h**2 * u / mass
        v += h * u / mass


def test_viscous_friction_is_an_exponential():
    robot, model = carriage(m1=2.0, fv1=30.0)
    signals = signals_of(RATE, np.zeros((300, 1)))
    made = run(robot, model, FREE[1], signals, start=(np.zeros(1), np.ones(1)))
    decay = np.exp(-30.0 / 2.0 * np.arange(300) / RATE)
    # what a Taylor polynomial of fourth order leaves: 300 steps of 0.015^5/120
    np.testing.assert_allclose(made.dq[:, 0], decay, rtol=3e-9)
    np.testing.assert_allclose(made.q[:, 0], 2.0 / 30.0 * (1.0 - decay), atol=1e-9)
    np.testing.assert_allclose(made.ddq[:, 0], -15.0 * decay, rtol=3e-9)


def test_dry_friction_brakes_steadily_and_then_holds():
    robot, model = carriage(m1=2.0, fc1=10.0)
    signals = signals_of(RATE, np.zeros((400, 1)))
    made = run(robot, model, FREE[1], signals, start=(np.zeros(1), np.ones(1)))
    t = np.arange(150) / RATE
    # (2/π) atan(2000 v) is one but for a thousandth until the end
    np.testing.assert_allclose(made.dq[:150, 0], 1.0 - 5.0 * t, atol=2e-3)
    assert abs(made.dq[300:]).max() < 1e-3
    assert np.diff(abs(made.dq[:, 0])).max() < 1e-9


def test_a_constant_torque_offset_acts_like_a_force():
    robot, model = carriage(m1=2.0, off1=-3.0)
    made = run(robot, model, FREE[1], signals_of(RATE, np.zeros((100, 1))))
    t = np.arange(100) / RATE
    np.testing.assert_allclose(made.q[:, 0], 0.5 * 1.5 * t**2, atol=1e-12)


@pytest.mark.parametrize(("oracle", "tolerance"), [(None, 5e-6), (8, 1e-12)])
def test_a_falling_double_pendulum_keeps_its_energy(oracle, tolerance):
    robot, parameters, theta = frictionless("planar_2r")
    model = make_model(robot, parameters, theta)
    signals = signals_of(4000.0, np.zeros((8000, 2)), bound=np.full(2, 100.0))
    made = run(robot, model, FREE[2], signals, oracle=oracle)
    kinetic, potential = energies(robot, parameters, theta, made)
    assert np.ptp(made.q[:, 0]) > 1.0
    assert np.ptp(kinetic + potential) < tolerance * kinetic.max()


def test_work_of_the_tx40_is_energy_and_heat():
    robot = load_robot("staubli_tx40")
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    model = make_model(robot, parameters, theta)
    rate = 20000.0
    motion = reversals(6000, rate, [0.3, 0.2, 0.3, 0.5, 0.6, 0.8], [1.5, 1.25, 1.75, 2.0, 2.5, 3.0])
    made = run(robot, model, PD(TX40_KP, TX40_KD), signals_of(rate, *motion))
    stored = np.sum(energies(robot, parameters, theta, made), axis=0)
    dissipative = theta.copy()
    dissipative[
        [k for k, p in enumerate(parameters) if p.is_inertial or p.stem in ("ia", "iam")]
    ] = 0
    friction = Regressor.build(robot, parameters).torque(made.q, made.dq, made.ddq, dissipative)
    heat = np.trapezoid((friction * made.dq).sum(axis=1), dx=1.0 / rate)
    # the torque is held over each period, so its work is exactly torque times way
    work = (made.tau[:-1] * np.diff(made.q, axis=0)).sum()
    assert heat > 1.0
    assert work == pytest.approx(stored[-1] - stored[0] + heat, rel=1e-4)


def test_a_pd_loop_at_rest_sags_by_its_load_over_its_gain():
    robot, parameters, theta = frictionless("planar_2r")
    theta[[k for k, p in enumerate(parameters) if p.stem == "fv"]] = 5.0
    model = make_model(robot, parameters, theta)
    posture = np.array([0.4, -0.7])
    kp = np.array([2000.0, 800.0])
    made = run(robot, model, PD(kp, [80.0, 20.0]), signals_of(RATE, np.tile(posture, (4000, 1))))
    load = Regressor.build(robot, parameters).torque(
        made.q[-1:], np.zeros((1, 2)), np.zeros((1, 2)), theta
    )[0]
    np.testing.assert_allclose(made.q[-1], posture - load / kp, atol=1e-6)
