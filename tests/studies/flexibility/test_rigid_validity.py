"""The predicted error of a rigid model against rigid identifications of flexible joints."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.robot.gallery import load_robot
from pivident.studies.flexibility.joint_study import rigid_validity
from pivident.studies.flexibility.simulated_joint import (
    MotorLoop,
    Sensors,
    TwoMassJoint,
    simulate_joint,
)

RATE = 1000.0


def flexible_record(antiresonance, top):
    stiffness = 90.0 * (2 * np.pi * antiresonance) ** 2
    damping = 0.02 * np.sqrt(stiffness * 90.0)
    joint = TwoMassJoint(60.0, 90.0, stiffness, damping, motor_viscous=40.0, motor_coulomb=20.0)
    t = np.arange(8000) / RATE
    ramp = np.clip(np.minimum(t, 8 - t) / 0.5, 0, 1)
    ramp = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    lines = zip(np.linspace(0.2, top, 6), (0, 1, 2.5, 4, 5, 3), strict=True)
    q_ref = ramp * sum(0.5 / f * np.sin(2 * np.pi * f * t + phase) for f, phase in lines)
    made = simulate_joint(
        joint, MotorLoop(2e4, 2e3), q_ref, RATE, sensors=Sensors(1e-6, 1e-6, 1e-6, 1e-6)
    )
    return joint, replace(made, joint_names=("carriage",))


def judged(joint, recording, **options):
    return rigid_validity(
        recording,
        stiffness=joint.stiffness,
        motor_inertia=joint.motor_inertia,
        load_inertia=joint.load_inertia,
        damping=joint.damping,
        **options,
    )


def rigid_inertia(recording):
    """Least squares with the rigid one-axis robot of the gallery."""
    found = identify(Problem(load_robot("emps"), (recording,)), "ls")
    return found.theta[list(found.names).index("m1r")]


@pytest.mark.parametrize(
    ("antiresonance", "top", "severity"),
    [(4, 1, "warning"), (4, 3, "error"), (8, 3, "warning"), (12, 1, "ok"), (40, 3, "ok")],
)
def test_predicted_error_is_that_of_a_rigid_identification(antiresonance, top, severity):
    joint, recording = flexible_record(antiresonance, top)
    expected = judged(joint, recording)
    measured = 100 * (rigid_inertia(recording) / 150.0 - 1)
    assert expected.inertia_error == pytest.approx(measured, rel=0.03, abs=0.1)
    assert expected.severity == severity
    assert f"{expected.inertia_error:+.2g} %" in expected.sentences[0]


def test_the_link_encoder_errs_the_other_way():
    joint, recording = flexible_record(6, 2)
    expected = judged(joint, recording, encoder="link")
    measured = 100 * (rigid_inertia(replace(recording, q=recording.q_link)) / 150.0 - 1)
    assert measured < -1
    assert expected.inertia_error == pytest.approx(measured, rel=0.05, abs=0.1)


def test_a_fast_loop_gets_a_warning_of_its_own():
    joint, recording = flexible_record(12, 1)
    warned = judged(joint, recording, bandwidth=8.0)
    assert warned.severity == "warning"
    assert any("bandwidth of 8 Hz" in sentence for sentence in warned.sentences)
    assert judged(joint, recording, bandwidth=2.0).severity == "ok"


def test_nonsense_is_refused():
    _, recording = flexible_record(12, 1)
    with pytest.raises(IdentificationError, match="stiffness of joint 'carriage'"):
        rigid_validity(recording, stiffness=0.0, motor_inertia=1.0, load_inertia=1.0)
    with pytest.raises(IdentificationError, match="q_link"):
        rigid_validity(
            replace(recording, q_link=None),
            stiffness=1e5,
            motor_inertia=1.0,
            load_inertia=1.0,
            encoder="link",
        )
