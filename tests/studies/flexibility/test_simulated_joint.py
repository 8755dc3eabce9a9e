"""The integrator against an exact solution, and the gear's faults against their meaning."""

import numpy as np
import pytest
from scipy.linalg import expm

from pivident.foundation.errors import IdentificationError
from pivident.studies.flexibility.simulated_joint import (
    GearFaults,
    MotorLoop,
    Sensors,
    TwoMassJoint,
    loop_motion,
    simulate_joint,
)


def exact_motion(joint, loop, q_ref, rate):
    """Held torque: the state goes from sample to sample by the matrix exponential."""
    jm, jl, k, d = joint.motor_inertia, joint.load_inertia, joint.stiffness, joint.damping
    fm, fl = joint.motor_viscous, joint.load_viscous
    a = np.zeros((5, 5))
    a[0, 1] = a[2, 3] = 1.0
    a[1, :5] = np.array([-k, -d - fm, k, d, 1.0]) / jm
    a[3, :4] = np.array([k, d, -k, -d - fl]) / jl
    step = expm(a / rate)
    x = np.array([q_ref[0], 0.0, q_ref[0], 0.0, 0.0])
    speed = np.gradient(q_ref, 1 / rate)
    last, out = q_ref[0], []
    for r, dr in zip(q_ref, speed, strict=True):
        x[4] = loop.kp * (r - x[0]) + loop.kd * (dr - (x[0] - last) * rate)
        last = x[0]
        out.append((x[0], x[2], x[4]))
        x = step @ x
    return np.array(out).T


def test_a_linear_joint_moves_as_the_matrix_exponential_says():
    joint = TwoMassJoint(60.0, 90.0, 2e5, 150.0, motor_viscous=40.0, load_viscous=20.0)
    loop = MotorLoop(6e4, 4e3)
    q_ref = 0.1 * np.sin(np.arange(1000) / 50.0)
    made = loop_motion(joint, loop, q_ref, 1000.0, steps=40)
    expected = exact_motion(joint, loop, q_ref, 1000.0)
    np.testing.assert_allclose(made[:2], expected[:2], atol=1e-9)
    np.testing.assert_allclose(made[2], expected[2], rtol=1e-6, atol=1e-3)


def test_weight_hangs_in_the_spring_from_the_start():
    joint = TwoMassJoint(60.0, 90.0, 2e5, 150.0, gravity_cos=500.0)
    made = loop_motion(joint, MotorLoop(6e4, 4e3), np.full(4000, 0.3), 1000.0)
    deflection = made[0] - made[1]
    np.testing.assert_allclose(deflection[[0, -1]], 500 * np.cos(0.3) / 2e5, rtol=0.02)


def test_backlash_lets_the_motor_turn_without_torque():
    joint = TwoMassJoint(60.0, 90.0, 2e6, 1500.0, gravity_cos=300.0)
    gear = GearFaults(backlash=2e-3)
    made = loop_motion(joint, MotorLoop(6e4, 4e3), np.full(4000, 0.0), 1000.0, gear=gear)
    assert (made[0] - made[1])[-1] == pytest.approx(1e-3 + 300 / 2e6, rel=0.02)


def test_sensors_count_delay_and_add_noise():
    joint, loop = TwoMassJoint(60.0, 90.0, 2e5, 150.0), MotorLoop(6e4, 4e3)
    q_ref = 0.2 * np.sin(np.arange(3000) / 200.0)
    plain = simulate_joint(joint, loop, q_ref, 1000.0)
    late = simulate_joint(joint, loop, q_ref, 1000.0, sensors=Sensors(link_step=1e-3, link_lag=3))
    np.testing.assert_allclose(late.q_link[3:], plain.q_link[:-3], atol=5.1e-4)
    counts = late.q_link / 1e-3
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)


def test_an_unstable_loop_is_refused():
    joint = TwoMassJoint(60.0, 90.0, 2e5, 150.0)
    with pytest.raises(IdentificationError, match="unstable; lower the gains"):
        loop_motion(joint, MotorLoop(1e9, 0.0), np.linspace(0, 1, 3000), 1000.0)
