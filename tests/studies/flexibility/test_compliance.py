"""Deflection taken apart: spring, friction, lag, hysteresis, backlash, transmission error."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.public_records import load_kuka_kr300
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import IdentificationError
from pivident.robot.gallery import load_robot
from pivident.studies.flexibility.compliance import identify_compliance, identify_compliances
from pivident.studies.flexibility.deflection_fit import find_orders
from pivident.studies.flexibility.simulated_joint import (
    GearFaults,
    MotorLoop,
    Sensors,
    TwoMassJoint,
    simulate_joint,
)
from tests.studies.flexibility import flexible_joint

RATE, REDUCTION = 500.0, 100.0

JOINT = TwoMassJoint(
    600.0, 900.0, 3e6, 3000.0, motor_coulomb=400.0, load_coulomb=50.0, gravity_cos=2000.0
)

SENSORS = Sensors(1e-6, 2e-6, 1e-6, 3e-6, 30.0)


def slow_motion(duration=16.0):
    t = np.arange(int(duration * RATE)) / RATE
    ramp = np.clip(np.minimum(t, duration - t), 0, 1)
    ramp = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    return ramp * (0.7 * np.sin(2 * np.pi * 0.11 * t) + 0.4 * np.sin(2 * np.pi * 0.37 * t + 1))


def geared(seed=0, joint=JOINT, sensors=SENSORS, gear=None, size=1.0):
    loop = MotorLoop(kp=4e5, kd=3e4)
    return simulate_joint(
        joint, loop, size * slow_motion(), RATE, sensors=sensors, gear=gear, seed=seed, steps=6
    )


def study(recording, **options):
    return identify_compliance(
        recording, motor_inertia=600.0, reduction=REDUCTION, gamma=JOINT.gamma, **options
    )


@pytest.mark.parametrize("seed", range(3))
def test_stiffness_friction_and_lag_are_separated(seed):
    found = study(geared(seed, sensors=replace(SENSORS, link_lag=1)))
    # The slow model leaves out the swinging after reversals: 0.1 % of the stiffness.
    assert found.stiffness.value == pytest.approx(3e6, rel=3e-3)
    assert found.friction.value == pytest.approx(400.0, rel=0.03)
    assert found.encoder_lag.value == pytest.approx(1 / RATE, rel=0.01)
    assert found.damping.covers(3000.0)
    assert found.stiffness.high < 1.05 * found.stiffness.low
    assert found.instrumented and found.unexplained < 0.02
    assert "delay between the encoders" in found.notes[0]


def test_noise_of_the_torque_does_not_stiffen_the_spring_with_a_reference():
    noisy = geared(sensors=replace(SENSORS, torque_noise=4000.0))
    with_reference = study(noisy)
    without = study(replace(noisy, q_ref=None))
    assert with_reference.stiffness.covers(3e6)
    assert without.stiffness.value > 1.04 * with_reference.stiffness.value


def test_transmission_error_is_found_with_order_and_amplitude_and_leaves_the_stiffness_alone():
    # Slow enough for the load to follow the error: its lines stay below the antiresonance.
    gear = GearFaults(error_amplitude=8e-5, error_order=0.9, reduction=REDUCTION)
    joint = replace(JOINT, stiffness=3e7, damping=3e4)
    found = study(geared(joint=joint, gear=gear, size=0.4))
    line = found.lines[0]
    assert line.order == pytest.approx(0.9, abs=0.01)
    assert line.amplitude.value == pytest.approx(8e-5, rel=0.1)
    assert found.stiffness.value == pytest.approx(3e7, rel=0.1)
    assert found.stiffness.covers(3e7)


def test_no_lines_are_found_in_noise():
    rng = np.random.default_rng(0)
    angle = np.cumsum(rng.uniform(0.01, 0.05, 4000))
    found = [find_orders(rng.standard_normal(4000), angle, 10.0) for _ in range(20)]
    assert sum(map(bool, found)) <= 2


def test_backlash_shows_where_the_torque_changes_its_sign():
    joint = replace(JOINT, gravity_cos=0.0, gravity_sin=1500.0)
    without = study(geared(joint=joint))
    found = study(geared(joint=joint, gear=GearFaults(backlash=1e-3)))
    assert found.backlash is not None and found.backlash.clear
    assert found.backlash.value == pytest.approx(1e-3, rel=0.3)
    assert without.backlash is not None and abs(without.backlash.value) < 2e-4
    assert study(geared(joint=replace(JOINT, gravity_cos=9000.0))).backlash is None


def test_hysteresis_of_the_spring_is_its_loop():
    t = np.arange(8000) / RATE
    q = 0.7 * np.sin(2 * np.pi * 0.11 * t) + 0.4 * np.sin(2 * np.pi * 0.37 * t + 1)
    dq = np.gradient(q, 1 / RATE)
    torque = 900 * np.gradient(dq, 1 / RATE) + 2000 * np.cos(q)
    z = np.zeros(len(t))
    for i in range(1, len(t)):
        z[i] = np.clip(z[i - 1] + 20 * (torque[i] - torque[i - 1]) / np.ptp(torque), -1, 1)
    deflection = torque / 3e6 - 1e-4 * z + 1e-6 * np.random.default_rng(1).standard_normal(len(t))
    tau = torque + 100 * np.tanh(dq / 0.01)
    made = Recording(
        "loop", ("j",), q[:, None], tau[:, None], RATE, q_link=(q - deflection)[:, None],
        torque_timing="sampled",
    )  # fmt: skip
    found = identify_compliance(made)
    assert found.hysteresis.clear
    assert found.hysteresis.value == pytest.approx(2e-4, rel=0.15)
    assert found.stiffness.value == pytest.approx(3e6, rel=0.05)
    assert "no reference was recorded" in found.notes[0]


def test_a_swinging_joint_has_no_estimate_of_slow_motion():
    swinging = identify_compliance(flexible_joint.record(1))
    assert swinging.unexplained == pytest.approx(0.88, abs=0.01)
    estimates = ("stiffness", "friction", "hysteresis", "damping", "encoder_lag", "offset")
    assert not any(getattr(swinging, name).is_known for name in (*estimates, "backlash"))
    assert not swinging.lines and np.isnan(swinging.deflection).all()
    assert len(swinging.notes) == 1 and "leaves 88 % of the deflection" in swinging.notes[0]
    slow = identify_compliance(flexible_joint.record(1, top=None))  # without its excitation
    assert slow.unexplained < 0.5 and all(getattr(slow, name).is_known for name in estimates)


def test_without_link_encoder_or_motion_it_is_refused():
    recorded = geared()
    with pytest.raises(IdentificationError, match="name its columns as q_link"):
        identify_compliance(replace(recorded, q_link=None))
    with pytest.raises(IdentificationError, match="record a longer motion"):
        identify_compliance(recorded.part(2000, 2150))


@pytest.fixture(scope="module")
def kuka(public_data):
    robot = load_robot("examples/kuka_kr300/kuka_kr300_axes_1_3.toml")
    ratio = np.diag(robot.transmission.reduction)
    return {
        motion: identify_compliances(
            load_kuka_kr300(motion, robot=robot), robot.rotor_inertia, ratio
        )
        for motion in "AB"
    }


@pytest.mark.record
def test_both_motions_of_the_kr300_agree_on_each_stiffness(kuka):
    for one, other in zip(kuka["A"], kuka["B"], strict=True):
        assert max(one.stiffness.low, other.stiffness.low) < min(
            one.stiffness.high, other.stiffness.high
        )
    for motion in "AB":
        for axis in (1, 2):
            stiffness = kuka[motion][axis].stiffness
            assert 1e6 < stiffness.low and stiffness.high < 2e7
    # Axis 1 turns there and back once in A: torque, speed and friction change sides together.
    assert np.isinf(kuka["A"][0].stiffness.high) and kuka["A"][0].stiffness.low > 1e6


@pytest.mark.record
def test_the_kr300s_gears_show_the_same_errors_in_both_motions(kuka):
    for axis, order in ((1, 3.09), (2, 2.688)):
        lines = [kuka[motion][axis].lines[0] for motion in "AB"]
        assert [line.order for line in lines] == pytest.approx([order, order], abs=0.005)
        first, second = (line.amplitude for line in lines)
        assert max(first.low, second.low) < min(first.high, second.high)


@pytest.mark.record
def test_most_of_the_kr300s_recorded_difference_is_lag_and_offset(kuka):
    for motion in "AB":
        for axis in range(3):
            found = kuka[motion][axis]
            assert found.encoder_lag.value == pytest.approx(2.74e-3, abs=0.1e-3)
            assert np.ptp(found.deflection) < 0.4 * np.ptp(found.recorded)
