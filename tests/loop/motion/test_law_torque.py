"""The torque of a log without torque: what the simulated loop's law commanded, to rounding."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import ExperimentError
from pivident.loop.motion.law_torque import with_law_torque
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD, PID, Cascade, PythonController
from pivident.loop.simulation.simulated_record import simulate
from pivident.robot.gallery import load_robot

KP, KD = np.array([6000.0, 2500.0]), np.array([180.0, 60.0])

#: A law that adds to its output what the arm's own weight is about, and cuts it off.
LOOPS = {
    "pd": Loop(PD(KP, KD), drive_gain=np.array([1.0, 0.5])),
    "filtered derivative": Loop(PD(KP, KD, derivative_time=2e-3)),
    "limited pid": Loop(PID(KP, KD, ki=10 * KP, derivative_time=1e-3), limit=[30.0, 10.0]),
    "cascade": Loop(Cascade([30.0, 30.0], KD, ki=[2.0, 2.0], averaged=True)),
    "gravity at the reference": Loop(PD(KP, KD), drive_gain=2.0, feed_forward="gravity"),
    "gravity as measured": Loop(PD(KP, KD), drive_gain=2.0, feed_forward="gravity_measured"),
    "computed torque": Loop(PD(KP, KD), feed_forward="computed_torque"),
}


@pytest.fixture(scope="module")
def robot():
    return load_robot("planar_2r")


def without_torque(recording: Recording, **changed: object) -> Recording:
    """The recording as a log without torque holds it."""
    still = np.zeros_like(recording.tau)
    return replace(recording, tau=still, torque_source="none", **changed)


@pytest.mark.parametrize("name", LOOPS)
def test_the_torque_is_what_the_simulated_law_commanded(name, robot):
    loop = LOOPS[name]
    # the law reads the noise that the log holds; that of its first sample is in no filter
    noise = 0.0 if name in ("limited pid", "cascade") else 1e-5
    made = simulate(robot, loop, encoder=noise, duration=3.0, seed=1)
    found = with_law_torque(robot, loop, without_torque(made.recording))
    assert found.torque_source == "law"
    assert found.torque_scale == ()
    later = slice(50, None) if getattr(loop.controller, "derivative_time", 0.0) else slice(1, None)
    if name == "limited pid":
        later = slice(0, None)
        limit = np.asarray(loop.limit)
        assert np.any(np.abs(made.motion.tau) == limit), "the limit has to be reached"
    np.testing.assert_allclose(found.tau[later], made.motion.tau[later], rtol=0.0, atol=1e-8)


def test_a_python_law_is_called_at_every_sample(robot):
    def law(k, q, q_ref, dq_ref):
        return KP * (q_ref - q) + 0.5 * KD * dq_ref

    recording = simulate(robot, LOOPS["pd"], duration=2.0).recording
    found = with_law_torque(
        robot, Loop(PythonController(law), drive_gain=2.0), without_torque(recording)
    )
    q_ref, dq_ref = recording.q_ref, recording.dq_ref
    expected = 2.0 * (KP * (q_ref - recording.q) + 0.5 * KD * dq_ref)
    np.testing.assert_allclose(found.tau, expected, rtol=1e-12, atol=1e-9)


def test_known_inputs_and_counts_belong_to_the_law(robot):
    recording = simulate(robot, LOOPS["pd"], duration=2.0).recording
    dither = np.sin(np.arange(recording.samples))[:, None] * np.ones(2)
    count = 1e-3
    loop = replace(LOOPS["pd"], count=count)
    found = with_law_torque(robot, loop, without_torque(recording, inputs={"dither": dither}))
    q = count * np.round(recording.q / count)
    rate = np.vstack([np.zeros(2), np.diff(q, axis=0)]) * recording.rate
    expected = KP * (recording.q_ref - q) + KD * (recording.dq_ref - rate) + dither
    np.testing.assert_allclose(found.tau, expected * [1.0, 0.5], rtol=0.0, atol=1e-8)


def test_the_recording_says_where_its_torque_comes_from(robot):
    recording = without_torque(simulate(robot, LOOPS["pd"], duration=2.0).recording)
    assert "tau" not in repr(recording)
    assert not recording.has_torque
    found = with_law_torque(robot, LOOPS["pd"], recording)
    assert "tau by the control law" in repr(found)
    assert any("commands at the recorded positions" in said for said in found.account)
    part = found.part(100, 600)
    assert part.torque_source == "law"
    np.testing.assert_array_equal(part.tau, found.tau[100:600])


def test_a_law_at_another_rate_is_noted(robot):
    recording = simulate(robot, LOOPS["pd"], duration=2.0).recording
    slow = Recording.from_arrays(
        recording.q[::4],
        None,
        250.0,
        joint_names=robot.joint_names,
        q_ref=recording.q_ref[::4],
        dq_ref=recording.dq_ref[::4],
        control_rate=1000.0,
    )
    found = with_law_torque(robot, LOOPS["pd"], slow)
    assert any("at the 1000 Hz of the control loop" in note for note in found.notes)
    # what the spline makes of the reference's corners, 0.3 % of the torque
    error = found.tau - recording.tau[::4]
    assert np.std(error) < 0.02 * np.std(recording.tau)
    fast = with_law_torque(
        robot, LOOPS["pd"], without_torque(replace(recording, control_rate=500.0))
    )
    assert any("at the 1000 Hz of the log, in place of the 500 Hz" in note for note in fast.notes)


def test_an_unknown_drive_gain_marks_the_scale(robot):
    loop = replace(LOOPS["filtered derivative"], gain_known=False)
    made = simulate(robot, loop, duration=2.0)
    found = with_law_torque(robot, loop, without_torque(made.recording))
    assert {(s.joint, s.basis) for s in found.torque_scale} == {
        (name, "output") for name in robot.joint_names
    }


@pytest.mark.parametrize(
    ("loop", "changed", "said"),
    [
        (None, {}, "no control law is known"),
        (replace(LOOPS["pd"], reference="smoothed"), {}, "virtual one"),
        (LOOPS["pd"], {"q_ref": None}, "no reference q_ref"),
        (LOOPS["pd"], {"torque_side": "link"}, "behind the gears"),
        (replace(LOOPS["gravity as measured"], gain_known=False), {}, "feeds forward gravity"),
        (Loop(PD([0.0, 1.0], [0.0, 1.0])), {}, "commands 0 to shoulder"),
    ],
)
def test_what_is_missing_is_named(loop, changed, said, robot):
    recording = without_torque(simulate(robot, LOOPS["pd"], duration=2.0).recording, **changed)
    with pytest.raises(ExperimentError, match=said) as caught:
        with_law_torque(robot, loop, recording)
    assert recording.name in str(caught.value)


def test_a_measured_torque_stays(robot):
    recording = simulate(robot, LOOPS["pd"], duration=2.0).recording
    assert with_law_torque(robot, LOOPS["pd"], recording) is recording
