"""Each kind of instruments against the true motion and the noise that made the record."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from pivident.data.recording.recording import Recording
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.loop.instruments.interleaved_halves import interleaved_instruments
from pivident.loop.instruments.reference_response import (
    answers_to_noise,
    followed,
    response_instruments,
    virtual_instruments,
)
from pivident.loop.instruments.repeated_motion import repetition_instruments
from pivident.loop.instruments.second_sensor import sensor_instruments

RATE = 200.0
NOISE = 2e-4  # of the encoders [rad]


def sines(t, period=None):
    """A smooth motion of two joints, periodic where a period [s] is given."""
    base = 1.0 / period if period else 0.137
    fast = 5.0 if period else 4.7309
    first = np.sin(2 * np.pi * base * t) + 0.4 * np.sin(2 * np.pi * fast * base * t + 1.0)
    second = 0.7 * np.cos(2 * np.pi * 2 * base * t) + 0.3 * np.sin(2 * np.pi * 7 * base * t)
    return np.stack([first, second], axis=1)


def record(true, *, seed=0, rate=RATE, **channels):
    """A record of a motion with white noise of the encoders; the torque does not matter here."""
    rng = np.random.default_rng(seed)
    noise = NOISE * rng.standard_normal(true.shape)
    return Recording(
        "run", ("a", "b"), true + noise, rng.standard_normal(true.shape), rate, **channels
    )


def kinematics(*recordings):
    return [estimate_kinematics(r, RandomWalk()) for r in recordings]


def accelerations(true, rate=RATE):
    return np.gradient(np.gradient(true, axis=0), axis=0).T * rate**2


def used(kin, motion):
    valid = np.ones(kin.q.shape[1], bool) if motion.valid is None else motion.valid
    return np.flatnonzero(valid & (np.arange(valid.size) >= 50) & (np.arange(valid.size) < 5950))


T = np.arange(6000) / RATE


def test_the_response_of_the_reference_is_the_motion_without_its_noise():
    reference = sines(T)
    true = np.roll(reference, 6, axis=0)  # a loop that lags by 30 ms
    true[:6] = reference[0]
    (kin,) = kinematics(record(true, q_ref=reference))
    made = response_instruments([kin])
    (motion,) = made.motions
    part = used(kin, motion)
    left = motion.ddq[:, part] - accelerations(true)[:, part]
    measured = kin.ddq[:, part] - accelerations(true)[:, part]
    noise = measured - measured.mean(axis=1, keepdims=True)
    for j in range(2):
        assert np.std(left[j]) < 0.05 * np.std(accelerations(true)[j])
        assert abs(np.corrcoef(left[j], noise[j])[0, 1]) < 0.2
    assert made.exogenous and not made.shares_noise
    assert (made.agreement > 0.97).all()


def test_speed_commands_are_integrated_and_held_at_the_positions():
    true = sines(T)
    commands = np.gradient(true, axis=0) * RATE + 0.01  # an offset that the integral runs away with
    (kin,) = kinematics(record(true, dq_ref=commands))
    made = response_instruments([kin])
    (motion,) = made.motions
    part = used(kin, motion)
    assert np.abs(motion.q[:, part] - true.T[:, part]).max() < 0.1
    assert (made.agreement > 0.97).all()
    assert "speed commands" in made.found[0]


@pytest.mark.parametrize("late", [0, 1, 3])
def test_a_reference_made_from_measured_positions_is_found_out(late):
    true = sines(T)
    run = record(true)
    noise = run.q - true
    innocent = replace(run, q_ref=true)
    guilty = replace(run, q_ref=true - 0.5 * np.roll(noise, late, axis=0))
    assert not any(a.matters for a in answers_to_noise(kinematics(innocent)[0]))
    assert all(a.matters for a in answers_to_noise(kinematics(guilty)[0]))
    made = response_instruments(kinematics(guilty))
    assert not made.exogenous and "'a'" in made.shares_noise


def test_a_foreign_reference_does_not_agree_with_the_motion():
    other = sines(T * 1.31 + 5.0)
    made = response_instruments(kinematics(record(sines(T), q_ref=other)))
    assert (made.agreement < 0.3).all()


@pytest.mark.parametrize("period", [5.0, 4.0 + 0.37 / RATE])
def test_repetitions_are_the_motion_with_other_noise(period):
    true = sines(T, period)
    (kin,) = kinematics(record(true))
    made = repetition_instruments([kin])
    (motion,) = made.motions
    part = used(kin, motion)
    assert part.size > 5500
    own = (kin.ddq - accelerations(true))[:, part]
    others = (motion.ddq - accelerations(true))[:, part]
    for j in range(2):
        assert np.std(others[j]) < 0.75 * np.std(own[j])  # the mean of four or more others
        assert abs(np.corrcoef(own[j], others[j])[0, 1]) < 0.1
    assert made.exogenous


def test_a_second_run_repeats_the_first_wherever_its_log_began():
    true = sines(np.arange(7000) / RATE)
    late = sines(np.arange(7000) / RATE + 0.4 / RATE)
    runs = kinematics(record(true, seed=1), record(late, seed=2))
    made = repetition_instruments(runs)
    part = slice(100, 6800)
    own = (runs[0].ddq - accelerations(true))[:, part]
    others = (made.motions[0].ddq - accelerations(true))[:, part]
    for j in range(2):
        assert np.std(others[j]) < 1.2 * np.std(own[j])
        assert abs(np.corrcoef(own[j], others[j])[0, 1]) < 0.1


def test_a_motion_that_does_not_repeat_is_refused():
    with pytest.raises(IdentificationError, match="no motion repeats"):
        repetition_instruments(kinematics(record(sines(T))))


def test_the_virtual_loop_is_its_differential_equation_without_its_delay():
    q, hertz = sines(T)[:, 0], 6.0
    omega = 2.0 * np.pi * hertz
    damping = 2.0 * np.sqrt(0.5) * omega
    _, followed_there, _ = lsim(([omega**2], [1.0, damping, omega**2]), q - q[0], T)
    later = np.interp(T + damping / omega**2, T, followed_there + q[0])
    made = followed(q, RATE, hertz)
    assert np.abs(made - later)[200:-200].max() < 1e-3


def test_the_virtual_loop_leaves_out_noise_above_its_bandwidth():
    true = sines(T)
    (kin,) = kinematics(record(true))
    made = virtual_instruments([kin])
    (motion,) = made.motions
    (quiet,) = virtual_instruments([replace(kin, q=np.ascontiguousarray(true.T))]).motions
    part = used(kin, motion)
    noise = (motion.ddq - quiet.ddq)[:, part]
    own = (kin.ddq - accelerations(true))[:, part]
    assert (np.std(noise, axis=1) < 0.8 * np.std(own, axis=1)).all()
    assert (made.agreement > 0.9).all() and not made.exogenous


def test_halves_share_no_white_noise():
    true = sines(T)
    (kin,) = kinematics(record(true))
    made = interleaved_instruments([kin])
    regressors = made.regressors[0]
    part = slice(100, 5900)
    a = (regressors.ddq - accelerations(true))[:, part]
    b = (made.motions[0].ddq - accelerations(true))[:, part]
    for j in range(2):
        assert abs(np.corrcoef(a[j], b[j])[0, 1]) < 0.15
    assert not made.shares_noise


def test_coloured_noise_of_the_encoders_is_noticed_by_the_halves():
    true = sines(T)
    rng = np.random.default_rng(5)
    noise = 1e-3 * rng.standard_normal(true.shape)
    for k in range(1, len(noise)):
        noise[k] += 0.9 * noise[k - 1]
    run = replace(record(true), q=true + noise)
    kin = estimate_kinematics(run, RandomWalk(f50_max=3.0, measurement_noise="white"))
    assert "correlated" in interleaved_instruments([kin]).shares_noise


def test_a_second_encoder_needs_noise_of_its_own():
    true = sines(T)
    rng = np.random.default_rng(9)
    run = record(true)
    own = replace(run, q_link=true + NOISE * rng.standard_normal(true.shape))
    same = replace(run, q_link=run.q)
    assert not sensor_instruments(kinematics(own)).shares_noise
    assert "correlated" in sensor_instruments(kinematics(same)).shares_noise
    with pytest.raises(IdentificationError, match="second encoder"):
        sensor_instruments(kinematics(run))


def integrated_record(seed=21, **noise):
    """A record with speeds of a sensor of their own, offset and drifting a little."""
    true = sines(T)
    rng = np.random.default_rng(seed)
    dq = np.gradient(true, axis=0) * RATE + 5e-3 * rng.standard_normal(true.shape) + 2e-3
    return record(true, dq=dq), true


def test_measured_speeds_are_the_motion_without_the_noise_of_the_positions():
    run, true = integrated_record()
    (kin,) = kinematics(run)
    made = sensor_instruments([kin])
    (motion,) = made.motions
    assert not made.shares_noise and (made.agreement > 0.9).all()
    assert "measured speeds (dq)" in made.found[0]
    part = slice(100, 5900)
    assert np.abs(motion.q - true.T)[:, part].max() < 5e-3  # the offset has drifted 60 mrad
    own = (kin.ddq - accelerations(true))[:, part]
    noise = (motion.ddq - accelerations(true))[:, part]
    for j in range(2):
        assert abs(np.corrcoef(own[j], noise[j])[0, 1]) < 0.15


def ema(x, share):
    out = np.array(x)
    for k in range(1, len(x)):
        out[k] = out[k - 1] + share * (x[k] - out[k - 1])
    return out


@pytest.mark.parametrize("counts", [0.0, 2 * np.pi / 2**14])
@pytest.mark.parametrize("share", [1.0, 0.3, 0.05])
@pytest.mark.parametrize("digits", [12, 2])
def test_speeds_that_are_differences_of_the_positions_are_no_second_sensor(counts, share, digits):
    run = record(sines(T))
    q = np.round(run.q / counts) * counts if counts else run.q
    dq = np.round(ema(np.diff(q, axis=0, prepend=q[:1]) * RATE, share), digits)
    made = sensor_instruments(kinematics(replace(run, q=q, dq=dq)))
    assert "is correlated with that of the positions" in made.shares_noise


@pytest.mark.parametrize("counts", [0.0, 2 * np.pi / 2**14])
@pytest.mark.parametrize("digits", [12, 2])
def test_neither_counts_nor_rounding_make_two_sensors_one(counts, digits):
    run, _ = integrated_record()
    q = np.round(run.q / counts) * counts if counts else run.q
    assert not sensor_instruments(
        kinematics(replace(run, q=q, dq=np.round(run.dq, digits)))
    ).shares_noise


def test_a_second_encoder_is_taken_before_speeds_unless_it_is_the_first():
    run, true = integrated_record()
    other = true + NOISE * np.random.default_rng(2).standard_normal(true.shape)
    both = sensor_instruments(kinematics(replace(run, q_link=other)))
    assert "second encoders" in both.found[0]
    copied = sensor_instruments(kinematics(replace(run, q_link=run.q)))
    assert "measured speeds" in copied.found[0] and not copied.shares_noise


def test_speeds_in_another_unit_are_refused():
    run, true = integrated_record()
    other = true + NOISE * np.random.default_rng(2).standard_normal(true.shape)
    good = replace(run, q_link=other, dq=np.rad2deg(run.dq))
    assert "second encoders" in sensor_instruments(kinematics(good)).found[0]
    with pytest.raises(IdentificationError, match=r"dq of joint 'a' is 57\.3 times"):
        sensor_instruments(kinematics(replace(run, dq=np.rad2deg(run.dq))))
