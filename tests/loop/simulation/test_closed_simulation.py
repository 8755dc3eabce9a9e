"""Simulated control loops around mechanisms with closed loops."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import LoopNotClosed
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import simulate
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from tests.dynamics.closed.mechanisms import (
    MECHANISMS,
    VISCOUS,
    delta,
    five_bar,
    parallelogram,
    start,
)
from tests.forward_dynamics import acceleration
from tests.loop.simulation.loops import relative_rms, run, signals_of

RATE = 1000.0

#: The fast scheme extrapolates the inverse mass matrix between renewals, whatever the rate: found
#: were 3.4e-5 in torques and 4.7e-5 in accelerations, as shares of the largest …
RENEWED = 1e-4

#: … and in positions, speeds and torques of the loop, as shares of their changes, at most 1.3e-7,
#: 3.2e-6 and 2.3e-5.
AGREEMENT = {"q": 5e-7, "dq": 1e-5, "tau": 1e-4}


def dry_delta(level=0.3):
    """A Delta whose universal joints have Coulomb friction of some level."""
    law = FrictionLaw((viscous(), coulomb(gamma=100.0)))
    robot = delta(law=VISCOUS, passive=law)
    dry = {
        f"fc{robot.label(i)}": level
        for i, joint in enumerate(robot.tree.joints)
        if any(term.stem == "fc" for term in joint.friction.terms)
    }
    assert len(dry) == 6
    return replace(robot, friction_nominal=robot.friction_nominal | dry)


ROBOTS = {
    "five bar": lambda: five_bar(law=VISCOUS),
    "five bar with a hinge": lambda: five_bar(kind="axis", law=VISCOUS),
    "parallelogram": lambda: parallelogram(law=VISCOUS),
    "delta": lambda: delta(law=VISCOUS, passive=VISCOUS),
    "dry delta": dry_delta,
    "geared": MECHANISMS["geared"],
}


def reference(robot, seconds=2.0, rate=RATE, far=0.2):
    t = np.arange(int(seconds * rate))[:, None] / rate
    fade = np.sin(0.5 * np.pi * np.minimum(t / 0.3, 1.0)) ** 2
    rates = 5.0 + 2.3 * np.arange(robot.size)
    return start(robot) + far * fade * np.sin(rates * t)


def gains(robot):
    return PD(kp=[3000.0] * robot.size, kd=[60.0] * robot.size)


def model_of(robot):
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    return base, theta, make_model(robot, base.parameters, theta)


@pytest.mark.parametrize("name", ROBOTS)
def test_simulated_motions_obey_inverse_dynamics(name):
    robot = ROBOTS[name]()
    record = simulate(robot, Loop(gains(robot)), reference(robot), rate=RATE)
    motion = record.motion
    base, theta, _ = model_of(robot)
    assert record.truth == pytest.approx(dict(zip(base.names, theta, strict=True)))
    tau = regressor_of(robot, base.parameters).torque(motion.q, motion.dq, motion.ddq, theta)
    assert np.ptp(motion.q, axis=0).min() > 0.3
    np.testing.assert_allclose(tau, motion.tau, rtol=0, atol=RENEWED * np.abs(motion.tau).max())
    expected = acceleration(robot, base.parameters, theta, motion.q, motion.dq, motion.tau)
    np.testing.assert_allclose(motion.ddq, expected, rtol=0, atol=RENEWED * np.abs(expected).max())


@pytest.mark.parametrize("name", ROBOTS)
def test_the_fast_scheme_agrees_with_runge_kutta(name):
    robot = ROBOTS[name]()
    base, theta, model = model_of(robot)
    signals = signals_of(RATE, reference(robot, 1.0))
    fast = run(robot, model, gains(robot), signals)
    exact = run(robot, model, gains(robot), signals, oracle=4)
    for channel, tolerance in AGREEMENT.items():
        ours, theirs = getattr(fast, channel), getattr(exact, channel)
        assert relative_rms(ours - ours[0], theirs - theirs[0]).max() < tolerance, channel
    expected = acceleration(robot, base.parameters, theta, exact.q, exact.dq, exact.tau)
    np.testing.assert_allclose(exact.ddq, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["five bar", "delta"])
def test_held_torques_move_it_from_sample_to_sample_as_another_integrator_says(name):
    robot = ROBOTS[name]()
    base, theta, model = model_of(robot)
    signals = signals_of(RATE, reference(robot, 0.4))
    motion = run(robot, model, gains(robot), signals, oracle=2)
    size = robot.size

    def slope(_, state, tau):
        q, dq = state[None, :size], state[None, size:]
        ddq = acceleration(robot, base.parameters, theta, q, dq, tau[None])
        return np.concatenate([state[size:], ddq[0]])

    for k in range(250, 399, 12):
        begin = np.concatenate([motion.q[k], motion.dq[k]])
        found = solve_ivp(
            slope, (0.0, 1.0 / RATE), begin, "DOP853", args=(motion.tau[k],), rtol=1e-11, atol=1e-13
        )
        np.testing.assert_allclose(found.y[:size, -1], motion.q[k + 1], rtol=0, atol=1e-11)
        np.testing.assert_allclose(found.y[size:, -1], motion.dq[k + 1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("oracle", [None, 2])
def test_a_mechanism_that_is_pulled_apart_names_time_and_posture(oracle):
    robot = five_bar(lengths=(0.4, 0.45, 0.4, 0.45), law=VISCOUS)
    _, _, model = model_of(robot)
    t = np.arange(2000)[:, None] / RATE
    q_ref = start(robot) + np.hstack([0.6 * t**2, 0.0 * t])
    elbows = 0.4 * np.exp(1j * q_ref)
    apart = int(np.argmax(np.abs(elbows[:, 0] - elbows[:, 1] - 0.3) > 0.9))
    assert apart > 1000
    with pytest.raises(LoopNotClosed, match=r"t = 1\.2\d* s, a1 = 2\.89.*do not close") as caught:
        run(robot, model, gains(robot), signals_of(RATE, q_ref), oracle=oracle)
    assert caught.value.time == pytest.approx(apart / RATE, abs=0.06)
    one, two = caught.value.q
    stretched = abs(0.4 * np.exp(1j * one) - 0.4 * np.exp(1j * two) - 0.3)
    assert stretched == pytest.approx(0.9, abs=0.003)
