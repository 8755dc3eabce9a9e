import numpy as np
import pytest
from scipy.signal import lfilter

import pivident as pv
from pivident.data.recording.recording import Recording
from pivident.estimation import iteration
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.signal_recipes import RandomWalk
from pivident.loop.motion.motion import SimulatedMotion
from pivident.loop.motion.simulated_detail import with_simulated_detail
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from pivident.signals.instants import derivatives_at_instants
from tests.signals.motions import RATE as FINE_RATE, point_to_point

RATE = 1000.0
INNER = slice(60, -60)


def recording(q):
    return Recording.from_arrays(q, np.cos(q), RATE)


def sharp_motion(samples=4000):
    """Two joints whose accelerations jump."""
    t = np.arange(samples) / RATE
    ddq = np.column_stack([np.sign(np.sin(2 * np.pi * 1.3 * t)), np.sign(np.cos(5.0 * t))])
    dq = np.cumsum(ddq, axis=0) / RATE
    return np.cumsum(dq - dq.mean(axis=0), axis=0) / RATE


def noisy(q, seed):
    return q + 1e-5 * np.random.default_rng(seed).standard_normal(q.shape)


def with_resonance(q, rate, seed):
    """Quiet encoders, the second with a line at 200 Hz."""
    rng = np.random.default_rng(seed)
    pole = 0.998 * np.exp(2j * np.pi * 200.0 / rate)
    line = lfilter([1.0], np.real(np.poly([pole, pole.conj()])), rng.standard_normal(len(q)))
    return np.column_stack([q, q + 3e-8 * line]) + 2e-6 * rng.standard_normal((len(q), 2))


def test_the_smoothers_of_a_record_make_its_positions():
    q = with_resonance(point_to_point()[0], FINE_RATE, 0)
    record = Recording.from_arrays(q, np.cos(q), FINE_RATE)
    kinematics = estimate_kinematics(record, RandomWalk())
    assert [smoother.colour is None for smoother in kinematics.smoothers] == [True, False]
    for j, smoother in enumerate(kinematics.smoothers):
        np.testing.assert_allclose(smoother.smoothed(record.q[:, j]), kinematics.q[j], atol=1e-12)


def test_with_the_true_motion_only_smoothed_noise_is_left():
    q = sharp_motion()
    kinematics = estimate_kinematics(recording(noisy(q, 1)), RandomWalk())
    found = with_simulated_detail(kinematics, SimulatedMotion(q.T.copy(), RATE))
    for j, smoother in enumerate(kinematics.smoothers):
        noise = smoother.smoothed(noisy(q, 1)[:, j] - q[:, j])
        position = q[:, j] + noise
        forward = np.diff(position) * RATE
        dq, ddq = (forward[1:] + forward[:-1]) / 2, np.diff(forward) * RATE
        dq, ddq = derivatives_at_instants(dq, ddq)
        np.testing.assert_allclose(found.q[j], position, atol=1e-12)
        np.testing.assert_allclose(found.dq[j, 1:-1][INNER], dq[INNER], atol=1e-8)
        np.testing.assert_allclose(found.ddq[j, 1:-1][INNER], ddq[INNER], atol=1e-4)
    # the jumps of the acceleration, which the smoother rounds off
    error = found.ddq - kinematics.ddq
    assert np.abs(error[:, INNER]).max() > 0.3


def test_a_motion_from_the_record_adds_nothing():
    q = sharp_motion()
    kinematics = estimate_kinematics(recording(noisy(q, 2)), RandomWalk())
    motion = SimulatedMotion(noisy(q, 3).T.copy(), RATE, from_record=True)
    assert with_simulated_detail(kinematics, motion) is kinematics


def test_what_the_record_contradicts_is_not_added():
    """The second joint of the simulated loop rings at 150 Hz, less than the encoders' noise."""
    q = sharp_motion()
    kinematics = estimate_kinematics(recording(noisy(q, 2)), RandomWalk())
    rings = q.copy()
    rings[:, 1] += 6e-6 * np.sin(2 * np.pi * 150.0 * np.arange(len(q)) / RATE)
    found = with_simulated_detail(kinematics, SimulatedMotion(rings.T.copy(), RATE))
    right = with_simulated_detail(kinematics, SimulatedMotion(q.T.copy(), RATE))
    np.testing.assert_array_equal(found.ddq[1], kinematics.ddq[1])
    np.testing.assert_array_equal(found.ddq[0], right.ddq[0])


def test_joints_with_visible_counts_stay_as_they_are():
    q = sharp_motion()
    measured = noisy(q, 4)
    measured[:, 1] = np.round(measured[:, 1] / 2e-3) * 2e-3
    kinematics = estimate_kinematics(recording(measured), RandomWalk())
    assert kinematics.smoothers[0] is not None and kinematics.smoothers[1] is None
    found = with_simulated_detail(kinematics, SimulatedMotion(q.T.copy(), RATE))
    np.testing.assert_array_equal(found.ddq[1], kinematics.ddq[1])
    assert not np.array_equal(found.ddq[0], kinematics.ddq[0])


@pytest.mark.parametrize("recipe", [RandomWalk(order=2, passes=2), pv.Bandpass(cutoff=40.0)])
def test_recipes_without_a_linear_smoother_are_left_alone(recipe):
    q = sharp_motion()
    kinematics = estimate_kinematics(recording(noisy(q, 5)), recipe)
    assert with_simulated_detail(kinematics, SimulatedMotion(q.T.copy(), RATE)) is kinematics


MASS, VISCOUS, COULOMB, SLOPE = 90.0, 200.0, 30.0, 1500.0
KP, KD = 60_000.0, 3_000.0


def axis():
    law = FrictionLaw((viscous(), coulomb(gamma=SLOPE)))
    return pv.load_robot("emps").with_friction({"carriage": law})


def moved_axis(seed):
    """An axis under PD control, by the midpoint rule in steps of 1/16 ms, and noise in its loop."""
    t = np.arange(6000) / RATE
    reference = 0.1 * np.sin(2 * np.pi * 0.7 * t) + 0.05 * np.sin(2 * np.pi * 1.9 * t)
    speed = np.gradient(reference, 1 / RATE)
    noise = 3e-6 * np.random.default_rng(seed).standard_normal(t.size)

    def acceleration(u, v):
        return (u - VISCOUS * v - COULOMB * 2 / np.pi * np.arctan(SLOPE * v)) / MASS

    q, v, last = 0.0, float(speed[0]), -float(speed[0]) / RATE
    measured, torque = np.empty(t.size), np.empty(t.size)
    h = 1 / (16 * RATE)
    for k in range(t.size):
        measured[k] = q + noise[k]
        seen = (measured[k] - last) * RATE
        last = measured[k]
        torque[k] = u = KP * (reference[k] - measured[k]) + KD * (speed[k] - seen)
        for _ in range(16):
            middle = v + 0.5 * h * acceleration(u, v)
            q, v = q + h * middle, v + h * acceleration(u, middle)
    record = Recording.from_arrays(
        measured[:, None],
        torque[:, None],
        RATE,
        joint_names=("carriage",),
        q_ref=reference[:, None],
        dq_ref=speed[:, None],
        torque_timing="held",
    )
    loop = pv.Loop(pv.PD([KP], [KD]))
    return pv.Problem(axis(), (record,), loop, parameters=("m1r", "fv1", "fc1"))


def test_steep_reversals_do_not_bias_the_estimate(monkeypatch):
    """Twelve records of a stiff axis; its friction turns round within a few milliseconds."""
    truth = np.array([MASS, VISCOUS, COULOMB])

    def mean_error():
        found = [pv.identify(moved_axis(seed), "piv") for seed in range(12)]
        assert found[0].names == ("m1r", "fv1", "fc1")
        return np.mean([(f.theta - truth) / f.std for f in found], axis=0)

    with_detail = mean_error()
    monkeypatch.setattr(iteration, "with_simulated_detail", lambda kinematics, motion: kinematics)
    without = mean_error()
    assert np.abs(with_detail).max() < 1.2
    assert np.abs(without).max() > 2 * np.abs(with_detail).max()
