"""Records of a robot of one's own: true to the model, noisy as asked, inside the limits."""

from dataclasses import replace

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import ExperimentError, ShapeMismatch, SimulationDiverged

ROBOT = pv.load_robot("planar_2r")
LOOP = pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))


def made(**options):
    return pv.simulate(ROBOT, LOOP, **{"duration": 2.0} | options)


def test_torques_of_the_motion_are_those_of_the_true_parameters():
    record = made(values={"fc1": 9.0, "zz2": 0.1})
    assert record.truth["fc1"] == 9.0 and record.truth["zz2"] == 0.1
    motion = record.motion
    regressor = Regressor.build(ROBOT, pv.base_parameters(ROBOT).parameters)
    torque = regressor.torque(motion.q, motion.dq, motion.ddq, np.array([*record.truth.values()]))
    assert np.abs(torque - motion.tau).max() < 1e-6 * np.abs(motion.tau).max()


def test_noise_is_as_large_as_asked():
    record = made(encoder=[1e-5, 0.0], torque=[0.0, 0.2])
    errors = record.recording.q - record.motion.q, record.recording.tau - record.motion.tau
    assert errors[0][:, 0].std() == pytest.approx(1e-5, rel=0.1)
    assert errors[1][:, 1].std() == pytest.approx(0.2, rel=0.1)
    assert not errors[0][:, 1].any() and not errors[1][:, 0].any()


def test_the_law_reads_the_noise():
    quiet, noisy = made(), made(encoder=1e-4)
    assert np.std(noisy.motion.tau - quiet.motion.tau) > 0.1


def test_a_seed_is_a_record():
    first, again, other = (made(seed=seed, encoder=1e-5).recording for seed in (3, 3, 4))
    assert np.array_equal(first.q, again.q)
    assert not np.allclose(first.q_ref, other.q_ref)


def test_random_moves_keep_within_the_limits():
    joints = tuple(
        replace(joint, position_limits=limits)
        for joint, limits in zip(ROBOT.joints, ((-0.5, 1.5), (-3.0, 3.0)), strict=True)
    )
    recording = pv.simulate(replace(ROBOT, joints=joints), LOOP, duration=20.0).recording
    low, high = recording.q_ref.min(axis=0), recording.q_ref.max(axis=0)
    assert (low >= [-0.3, -1.5]).all() and (high <= [1.3, 1.5]).all()
    assert (high - low > [1.2, 2.2]).all()
    fastest = np.abs(recording.dq_ref).max(axis=0) / ROBOT.rated_speeds
    assert (fastest <= 0.8 + 1e-9).all() and fastest.max() > 0.7


def test_an_estimate_finds_the_truth():
    record = made(duration=6.0, values={"fv1": 3.0})
    found = pv.identify(pv.Problem(ROBOT, (record.recording,), LOOP), "ls")
    truth = np.array([record.truth[name] for name in found.names])
    assert np.abs(found.theta - truth).max() < 0.05


def test_a_reference_of_ones_own_is_followed():
    t = np.arange(0.0, 2.0, 0.001)
    reference = np.column_stack([np.sin(2.0 * t), 0.8 * np.sin(3.0 * t)])
    record = made(reference=reference)
    assert np.array_equal(record.recording.q_ref, reference)
    speed = np.column_stack([2.0 * np.cos(2.0 * t), 2.4 * np.cos(3.0 * t)])
    assert np.abs(record.recording.dq_ref - speed)[1:-1].max() < 1e-4
    fed = pv.simulate(ROBOT, replace(LOOP, feed_forward="computed_torque"), reference)
    lag, less = (np.std(r.motion.q - reference) for r in (record, fed))
    assert less < 0.5 * lag


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"values": {"fc7": 1.0}}, "no base parameter 'fc7'"),
        ({"values": {"fc1": np.nan}}, "'fc1' is nan"),
        ({"rate": 0.0}, "rate is 0 Hz"),
        ({"duration": 0.0}, "duration is 0 s"),
        ({"encoder": -1.0}, "encoder is -1"),
        ({"torque": [0.1, 0.1, 0.1]}, "each of the 2 joint"),
        ({"loop": pv.PD(1.0, 1.0)}, "give the control loop"),
    ],
)
def test_what_cannot_be_simulated_is_refused_by_name(options, words):
    with pytest.raises(ExperimentError, match=words):
        pv.simulate(**{"robot": ROBOT, "loop": LOOP, "duration": 1.0} | options)


def test_a_reference_of_another_robot_is_refused():
    with pytest.raises(ShapeMismatch, match=r"\(100, 3\), but \(100, 2\)"):
        made(reference=np.zeros((100, 3)))


def test_a_robot_without_masses_says_what_to_give():
    links = tuple(replace(link, inertia=np.zeros(10)) for link in ROBOT.links)
    bare = replace(ROBOT, links=links, rotor_inertia=np.zeros(2))
    with pytest.raises(ExperimentError, match=r"neither masses nor inertias.*zz1r"):
        pv.simulate(bare, LOOP)


def test_a_loop_that_is_too_stiff_is_named():
    with pytest.raises(SimulationDiverged, match=r"elbow|shoulder"):
        pv.simulate(ROBOT, pv.Loop(pv.PD(kp=6e6, kd=2e5)))
