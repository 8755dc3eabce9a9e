"""Closed mechanisms: a Lagrangian in closed form, energy, friction of passive joints."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import INERTIAL
from pivident.robot.friction import (
    FrictionLaw,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    ripple,
    spring,
    viscous,
)
from tests.dynamics.closed.mechanisms import (
    MECHANISMS,
    VISCOUS,
    delta,
    energy,
    five_bar,
    parallelogram,
    spatial_loop,
    start,
    states,
)
from tests.forward_dynamics import acceleration


def nominal(robot):
    parameters = standard_parameters(robot)
    return parameters, nominal_values(robot, parameters)


def lagrangian_torque(robot, length, q, dq, ddq):
    """Of the parallelogram: crank and rocker turn about their pivots, the coupler only moves.

    T = ½ (J_c + J_r + J_m + m l²) dq²,   V = g ((h_c + h_r) sin q + (k_c + k_r) cos q + m l sin q)
    """
    ten = {
        joint.name: dict(zip(INERTIAL, link.inertia, strict=True))
        for joint, link in zip(robot.tree.joints, robot.tree.links, strict=True)
    }
    crank, coupler, rocker = ten["crank"], ten["coupler"], ten["rocker"]
    inertia = crank["zz"] + rocker["zz"] + robot.rotor_inertia[0] + coupler["m"] * length**2
    along = crank["mx"] + rocker["mx"] + coupler["m"] * length
    across = crank["my"] + rocker["my"]
    friction = sum(robot.friction_nominal.values()) * dq
    return inertia * ddq + 9.81 * (along * np.cos(q) - across * np.sin(q)) + friction


@pytest.mark.parametrize("kind", ["point", "axis"])
def test_the_parallelogram_obeys_its_lagrangian(kind):
    for seed in range(5):
        robot = parallelogram(seed, law=VISCOUS, kind=kind)
        assert len(robot.friction_nominal) == 3
        q, dq, ddq = states(robot, 40, seed, speed=5.0)
        expected = lagrangian_torque(robot, 0.4, q, dq, ddq)
        parameters, theta = nominal(robot)
        ours = regressor_of(robot, parameters).torque(q, dq, ddq, theta)
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-10)
        back = acceleration(robot, parameters, theta, q, dq, expected)
        np.testing.assert_allclose(back, ddq, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_torque_of_an_acceleration_is_the_torque_that_caused_it(name):
    robot = MECHANISMS[name]()
    parameters, theta = nominal(robot)
    q, dq, tau = states(robot, 30, 11, speed=5.0)
    ddq = acceleration(robot, parameters, theta, q, dq, tau)
    back = regressor_of(robot, parameters).torque(q, dq, ddq, theta)
    np.testing.assert_allclose(back, tau, rtol=0, atol=1e-9)


#: Torques of the position: a spring, a strut, ripple.
OF_POSITION = FrictionLaw((viscous(), spring(), *counterbalance(0.6, 0.3), *ripple(3.0)))


@pytest.mark.parametrize(
    "robot", [five_bar(law=VISCOUS), delta(law=VISCOUS), parallelogram(law=VISCOUS)], ids=str
)
@pytest.mark.parametrize("whose", ["passive joints", "motors", "all joints"])
def test_springs_and_ripple_are_those_of_the_inverse_model(robot, whose):
    if whose != "motors":
        passive = tuple(replace(j, friction=OF_POSITION) for j in robot.passive_joints)
        robot = replace(robot, passive_joints=passive)
    if whose != "passive joints":
        robot = replace(robot, joints=tuple(j.with_friction(OF_POSITION) for j in robot.joints))
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    rng = np.random.default_rng(8)
    for k, p in enumerate(parameters):
        if p.friction is not None:
            theta[k] = rng.uniform(0.5, 2.0)
    assert sum(p.stem == "ks" for p in parameters) >= 1
    q, dq, tau = states(robot, 20, 11, speed=3.0)
    ddq = acceleration(robot, parameters, theta, q, dq, tau)
    back = regressor_of(robot, parameters).torque(q, dq, ddq, theta)
    np.testing.assert_allclose(back, tau, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", MECHANISMS)
def test_power_is_the_rate_of_energy_and_of_friction(name):
    robot = MECHANISMS[name]()
    parameters, theta = nominal(robot)
    chains, step = ClosedChains(robot), 1e-4
    regressor = regressor_of(robot, parameters)
    for q, dq, ddq in zip(*states(robot, 8, 12), strict=True):
        t = step * np.arange(-2, 3)
        path = np.array([q + dq * x + 0.5 * ddq * x**2 for x in t]).T
        speed = np.array([dq + ddq * x for x in t]).T
        motion = chains.motion(path, speed, np.repeat(ddq[:, None], 5, axis=1))
        total = [sum(energy(robot.tree, motion.q[:, k], motion.dq[:, k])) for k in range(5)]
        rate = (total[0] - 8.0 * total[1] + 8.0 * total[3] - total[4]) / (12.0 * step)
        lost = sum(
            value * motion.dq[p.joint, 2] ** 2
            for p, value in zip(parameters, theta, strict=True)
            if p.stem == "fv"
        )
        tau = regressor.torque(q[None], dq[None], ddq[None], theta)[0]
        assert tau @ dq == pytest.approx(rate + lost, abs=1e-8)


def fall(robot, seconds, tolerance=1e-11):
    """Energy of a mechanism that is let go, at fifty times, and how much of it changes hands."""
    parameters, theta = nominal(robot)
    assert not any(p.friction for p in parameters)
    size, still = robot.size, np.zeros((1, robot.size))

    def slope(_, state):
        q, dq = state[None, :size], state[None, size:]
        return np.concatenate(
            [state[size:], acceleration(robot, parameters, theta, q, dq, still)[0]]
        )

    begin = np.concatenate([start(robot), np.zeros(size)])
    times = np.linspace(0.0, seconds, 50)
    found = solve_ivp(slope, (0.0, seconds), begin, "DOP853", times, rtol=tolerance, atol=tolerance)
    assert found.success
    chains = ClosedChains(robot)
    q, dq = found.y[:size], found.y[size:]
    motion = chains.motion(q, dq, np.zeros(q.shape))
    return np.array(
        [energy(robot.tree, motion.q[:, k], motion.dq[:, k]) for k in range(len(times))]
    )


@pytest.mark.parametrize(
    ("robot", "seconds"),
    [(five_bar(), 0.3), (parallelogram(), 1.0), (delta(), 0.3)],
    ids=["five bar", "parallelogram", "delta"],
)
def test_a_mechanism_that_falls_keeps_its_energy(robot, seconds):
    kinetic, potential = fall(robot, seconds).T
    total = kinetic + potential
    exchanged = np.ptp(potential)
    assert exchanged > 0.5
    np.testing.assert_allclose(total, total[0], rtol=0, atol=1e-8 * exchanged)


def test_passive_friction_brakes_by_the_square_of_its_gain():
    robot = MECHANISMS["delta"]()
    parameters, theta = nominal(robot)
    braked = theta.copy()
    only = next(k for k, p in enumerate(parameters) if p.name == "fv[rod2]")
    braked[only] += 0.5
    q, dq, ddq = states(robot, 15, 4)
    regressor = regressor_of(robot, parameters)
    more = regressor.torque(q, dq, ddq, braked) - regressor.torque(q, dq, ddq, theta)
    chains = ClosedChains(robot)
    for extra, x, v in zip(more, q, dq, strict=True):
        row = chains.start(x).gain[parameters[only].joint]
        np.testing.assert_allclose(extra, 0.5 * row * (row @ v), rtol=0, atol=1e-12)
    assert np.abs(more).max() > 1e-3


def test_coulomb_friction_of_a_passive_joint_pushes_against_its_own_speed():
    law = FrictionLaw((viscous(), coulomb("sign")))
    robot = spatial_loop(2, "axis", 2)
    passive = tuple(replace(j, friction=law) for j in robot.passive_joints)
    robot = replace(robot, passive_joints=passive)
    parameters = standard_parameters(robot)
    unit = np.array([float(p.stem == "fc") for p in parameters])
    q, dq, ddq = states(robot, 25, 4)
    tau = regressor_of(robot, parameters).torque(q, dq, ddq, unit)
    chains = ClosedChains(robot)
    others = [i for i in range(robot.tree.size) if i not in robot.places]
    for own, x, v in zip(tau, q, dq, strict=True):
        gain = chains.start(x).gain[others]
        np.testing.assert_allclose(own, gain.T @ np.sign(gain @ v), rtol=0, atol=1e-11)


def test_mass_matrices_are_symmetric_and_positive():
    for name in MECHANISMS:
        robot = MECHANISMS[name]()
        parameters, theta = nominal(robot)
        for mass in mass_matrix(robot, parameters, theta, states(robot, 10, 2)[0]):
            np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-13)
            assert np.linalg.eigvalsh(mass)[0] > 0.0


@pytest.mark.parametrize(
    ("terms", "name"),
    [
        ((viscous(), dahl(1e-2)), "fc"),
        ((viscous(), *lugre(1e-3, 0.5, 0.1)), "fc"),
        ((viscous(), coulomb(), load_dependent()), "fl"),
    ],
    ids=["dahl", "lugre", "load"],
)
def test_friction_with_a_memory_is_refused(terms, name):
    robot = five_bar().with_friction(FrictionLaw(terms))
    with pytest.raises(RobotDescriptionError, match=rf"{name}\[a1\].*closed loops"):
        regressor_of(robot, standard_parameters(robot))
