import pickle

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import (
    ConstantChannel,
    NonFiniteSamples,
    RecordingError,
    RecordingTooShort,
    SaturatedSignal,
    ShapeMismatch,
)


def motion(samples=400, joints=2, rate=100.0):
    t = np.arange(samples)[:, None] / rate
    phase = np.arange(joints)
    return np.sin(2.0 * t + phase), np.cos(3.0 * t + phase) + 0.1 * np.sin(17.0 * t)


def recording(**changes):
    q, tau = motion()
    fields = {"name": "run", "joint_names": ("a", "b"), "q": q, "tau": tau, "rate": 100.0}
    return Recording(**fields | changes)


def test_arrays_are_float64_in_c_order_and_read_only():
    q, tau = motion()
    made = recording(q=np.asfortranarray(q), tau=tau.astype(np.float32), q_ref=q)
    for values in made.channels().values():
        assert values.dtype == np.float64
        assert values.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            values[0, 0] = 1.0


def test_arrays_alone_make_a_recording():
    q, tau = motion()
    made = Recording.from_arrays(q, tau, 100.0, q_ref=q, torque_timing="sampled")
    assert made.joint_names == ("joint_1", "joint_2") and made.torque_timing == "sampled"
    assert np.array_equal(made.q_ref, q)
    names = ("shoulder", "elbow")
    made = Recording.from_arrays(q.tolist(), tau, 100.0, joint_names=names, inputs={"u": tau})
    assert made.joint_names == names and np.array_equal(made.inputs["u"], tau)


def test_vectors_are_those_of_one_joint():
    q, tau = motion(joints=1)
    made = Recording.from_arrays(q[:, 0], tau[:, 0], 100.0, q_ref=q[:, 0], inputs={"u": q[:, 0]})
    assert made.joints == 1
    assert np.array_equal(made.q, q) and np.array_equal(made.q_ref, q)
    assert made.inputs["u"].shape == q.shape


def test_arrays_that_do_not_fit_are_refused():
    q, tau = motion()
    with pytest.raises(ShapeMismatch):
        Recording.from_arrays(q, tau[:-1], 100.0)
    with pytest.raises(ShapeMismatch):
        Recording.from_arrays(q, tau[:, 0], 100.0)
    with pytest.raises(ShapeMismatch):
        Recording.from_arrays(1.0, tau, 100.0)
    with pytest.raises(RecordingError, match="not an array of real numbers"):
        Recording.from_arrays([[1.0, 2.0], [3.0]], tau, 100.0)
    with pytest.raises(TypeError, match="dealy"):
        Recording.from_arrays(q, tau, 100.0, dealy=1e-3)


def test_the_caller_keeps_arrays_that_can_be_written():
    q, _ = motion()
    made = recording(q=q)
    q[0, 0] = 5.0
    assert made.q[0, 0] != 5.0


def test_read_only_arrays_are_kept_without_a_copy():
    q, _ = motion()
    q.flags.writeable = False
    assert np.shares_memory(recording(q=q).q, q)


def test_times_follow_from_rate_and_start():
    made = recording(start_time=2.0)
    assert (made.samples, made.joints, made.dt) == (400, 2, 0.01)
    assert made.duration == pytest.approx(3.99)
    assert made.t[0] == 2.0
    assert made.t[-1] == pytest.approx(5.99)


def test_the_control_rate_is_the_sampling_rate_unless_it_is_given():
    assert recording().control_rate == 100.0
    assert recording(control_rate=1000.0).control_rate == 1000.0


def test_channels_lists_what_is_there_in_a_fixed_order():
    q, tau = motion()
    made = recording(inputs={"pulses": tau}, dq_ref=q, q_ref=q)
    assert list(made.channels()) == ["q", "tau", "q_ref", "dq_ref", "pulses"]


def test_a_part_keeps_its_time_and_shares_memory():
    made = recording(q_ref=motion()[0], inputs={"pulses": motion()[1]}, start_time=1.0)
    part = made.part(100, 200)
    assert part.samples == 100
    assert part.t[0] == pytest.approx(2.0)
    assert np.shares_memory(part.q, made.q)
    assert np.array_equal(part.inputs["pulses"], made.inputs["pulses"][100:200])
    assert part.q_ref is not None and part.dq_ref is None


def test_a_slice_is_cut_on_the_recordings_own_clock():
    made = recording(start_time=1.0)
    cut = made.slice(2.0, 3.0)
    assert (cut.samples, cut.t[0]) == (100, pytest.approx(2.0))
    assert np.array_equal(cut.q, made.q[100:200])
    assert made.slice(-5.0, 50.0).samples == made.samples


@pytest.mark.parametrize("times", [(7.0, 9.0), (-2.0, -1.0), (0.5, 0.5)])
def test_a_slice_without_samples_is_refused(times):
    with pytest.raises(RecordingError, match="no sample"):
        recording().slice(*times)


@pytest.mark.parametrize("indices", [(-1, 50), (0, 401), (50, 50), (60, 50)])
def test_a_part_outside_the_recording_is_refused(indices):
    with pytest.raises(RecordingError, match="do not lie inside"):
        recording().part(*indices)


def test_a_part_may_stand_still():
    q = motion()[0]
    q[100:200] = q[100]
    assert recording(q=q).part(100, 200).samples == 100


def test_a_recording_survives_pickling():
    made = pickle.loads(pickle.dumps(recording()))
    assert made.joint_names == ("a", "b")


@pytest.mark.parametrize("channel", ["q", "tau", "q_ref", "dq_ref", "ddq_ref", "inputs"])
def test_a_channel_of_another_shape_is_refused(channel):
    wrong = motion(399)[0]
    value = {"pulses": wrong} if channel == "inputs" else wrong
    with pytest.raises(ShapeMismatch) as caught:
        recording(**{channel: value})
    assert (399, 2) in (caught.value.shape, caught.value.expected)


@pytest.mark.parametrize("q", [np.zeros(400), np.zeros((400, 3)), np.array(1.0)])
def test_positions_that_are_not_samples_by_joints_are_refused(q):
    with pytest.raises(ShapeMismatch):
        recording(q=q)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", ["q", "tau", "q_ref", "inputs"])
def test_samples_that_are_not_finite_are_refused_with_their_place(channel, value):
    values = motion()[0]
    values[[37, 52], 1] = value
    with pytest.raises(NonFiniteSamples) as caught:
        recording(**{channel: {"pulses": values} if channel == "inputs" else values})
    assert (caught.value.joint, caught.value.sample, caught.value.count) == ("b", 37, 2)


@pytest.mark.parametrize("channel", ["q", "tau"])
def test_a_constant_channel_is_refused_unless_it_is_allowed(channel):
    values = motion()[0]
    values[:, 1] = 0.25
    with pytest.raises(ConstantChannel, match="freeze that joint") as caught:
        recording(**{channel: values})
    assert (caught.value.channel, caught.value.joint, caught.value.value) == (channel, "b", 0.25)
    assert recording(**{channel: values}, allow_constant=True).samples == 400


def test_a_constant_reference_is_no_error():
    assert recording(dq_ref=np.zeros((400, 2))).dq_ref is not None


def test_a_saturated_torque_is_refused_unless_it_is_allowed():
    tau = np.clip(motion()[1], -0.5, None)
    with pytest.raises(SaturatedSignal) as caught:
        recording(tau=tau)
    assert (caught.value.joint, caught.value.value) == ("a", -0.5)
    assert recording(tau=tau, saturation="allow").saturation == "allow"


def test_too_few_samples_are_refused():
    q, tau = motion(15)
    with pytest.raises(RecordingTooShort, match="15 sample"):
        recording(q=q, tau=tau)


@pytest.mark.parametrize("field", ["rate", "control_rate"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_a_rate_that_is_not_positive_is_refused(field, value):
    with pytest.raises(RecordingError, match="positive"):
        recording(**{field: value})


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("rate", 0.0, "positive"),
        ("control_rate", 1e12, "unlike any robot"),
        ("joint_names", ("a", "a"), "repeated"),
        ("joint_names", (), "missing"),
        ("torque_timing", "late", "held, averaged, sampled"),
        ("saturation", "perhaps", "refuse, allow"),
        ("delay", np.nan, "delay"),
        ("drive_delay", -1e-3, "declared by delay"),
        ("drive_delay", 0.3, "0.3e-3 for 0.3 ms"),
        ("start_time", np.inf, "start_time"),
        ("inputs", {"tau": np.zeros((400, 2))}, "rename"),
        ("q", np.ones((400, 2)) * 1j, "complex"),
        ("q", np.array([["x", "y"]] * 400), "not an array of real numbers"),
    ],
)
def test_options_that_mean_nothing_are_refused(field, value, message):
    with pytest.raises(RecordingError, match=message):
        recording(**{field: value})


def test_a_log_without_torque_says_so():
    q, _ = motion()
    made = Recording.from_arrays(q, None, 100.0, q_ref=q + 0.01)
    assert made.torque_source == "none"
    assert not made.has_torque
    assert not made.tau.any()
    assert "tau" not in repr(made)
    assert "No torque was logged." in made.account
    assert not any("A torque sample" in said for said in made.account)
    assert made.part(0, 100).torque_source == "none"


def test_torques_come_from_known_sources():
    with pytest.raises(RecordingError, match="torque_source is 'guessed'"):
        recording(torque_source="guessed")


def test_what_only_a_measured_torque_tells_is_refused():
    recording().require_torque("a law is identified")
    for source in ("law", "none"):
        with pytest.raises(RecordingError, match=r"'run' has no measured torque, and a law is"):
            recording(torque_source=source).require_torque("a law is identified")
