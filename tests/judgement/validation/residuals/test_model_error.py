"""Noise separated from model error, by repetition and by held-out blocks."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.repeated_motion import (
    RepeatedMotion,
    find_period,
    find_repetition,
    repeated_motion,
)
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Repetition
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.residuals.model_error import (
    JointModelError,
    ModelError,
    model_error,
    model_error_by_held_out_blocks,
    model_error_by_repetition,
)
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.gallery import load_robot
from tests.judgement.validation import one_axis as axis

FULL_RATE = LeastSquares(signals=RandomWalk())


@pytest.fixture(scope="module")
def made():
    return axis.motion()


def test_period_is_found_from_the_reference(made):
    assert find_period(axis.recording(made)) == axis.PERIOD


def test_period_is_found_from_positions_without_a_reference(made):
    record = axis.recording(made, q_ref=None, dq_ref=None, ddq_ref=None)
    assert find_period(record) == axis.PERIOD
    rng = np.random.default_rng(1)
    noisy = replace(record, q=record.q + 2e-4 * rng.standard_normal(record.q.shape))
    assert abs(find_period(noisy) - axis.PERIOD) <= 1


def test_a_motion_that_repeats_once_in_part_has_no_period(made):
    record = axis.recording(made)
    bent = record.q_ref.copy()
    bent[2300:2400] += 0.02 * np.hanning(100)[:, None]
    assert find_period(replace(record, q_ref=bent)) is None


def test_a_ramp_has_no_period(made):
    q = np.linspace(0.0, 1.0, 3000)[:, None]
    ramp = replace(axis.recording(made).part(0, 3000), q_ref=q)
    assert find_period(ramp) is None


def test_an_input_that_does_not_repeat_ends_the_repetition(made):
    pulses = np.where(np.arange(len(made.q)) // 333 % 2, 5.0, 0.0)[:, None]
    assert find_period(axis.recording(made, inputs={"pulses": pulses})) is None


def test_fewer_than_two_periods_do_not_repeat(made):
    record = axis.recording(made).part(0, 2 * axis.PERIOD - 10)
    assert find_repetition([record]) is None
    with pytest.raises(IdentificationError, match="Repeat the motion"):
        repeated_motion([record], Repetition().period)


def test_two_recordings_of_one_motion_repeat_each_other(made):
    short = axis.PERIOD + 300
    first, second = (axis.recording(made, seed=s, name=f"run {s}").part(0, short) for s in (1, 2))
    found = find_repetition([first, second])
    assert found is not None and found.period is None
    assert found.count == short
    assert "run 1" in found.description and "run 2" in found.description
    _, _, times = found.split([np.ones((1, short))] * 2, [np.ones((1, short), bool)] * 2)
    assert all((n == 2).all() for n in times)


def test_split_is_exact_and_unbiased():
    rng = np.random.default_rng(0)
    cycle, repeats = 500, 5
    model = rng.standard_normal(cycle)
    noise = 0.3 * rng.standard_normal((repeats, cycle))
    signal = (model + noise).reshape(1, -1)
    motion = RepeatedMotion((np.arange(repeats * cycle) % cycle,), cycle, cycle, "")
    repeating, rest, times = motion.split([signal], [np.ones(signal.shape, bool)])
    assert np.allclose(repeating[0][0, :cycle], model + noise.mean(axis=0))
    deviation = (noise - noise.mean(axis=0)).ravel()
    assert np.allclose(rest[0][0], deviation * np.sqrt(repeats / (repeats - 1)))
    assert (times[0] == repeats).all()
    # variance of the noise, four degrees of freedom of five: 0.09 within four deviations
    bound = 4 * 0.09 * np.sqrt(2 / (cycle * (repeats - 1)))
    assert abs(np.mean(rest[0] ** 2) - 0.09) < bound


def test_samples_that_nobody_repeats_are_left_out_of_the_split():
    motion = RepeatedMotion((np.array([0, 1, 2, 0, 1, 3]),), 3, 3, "")
    signal = np.array([[1.0, 2.0, 3.0, 3.0, 4.0, 9.0]])
    _, rest, times = motion.split([signal], [np.ones((1, 6), bool)])
    assert times[0][0].tolist() == [2, 2, 1, 2, 2, 0]
    assert rest[0][0, [2, 5]].tolist() == [0.0, 0.0]


def test_repetition_measures_noise_and_model_error(made):
    noise, error = 1.0, 3.0
    problem = axis.problem(axis.recording(made, noise, error))
    found = model_error(problem, identify(problem, FULL_RATE))
    assert found is not None and found.source == "repetition"
    (joint,) = found.joints
    # white noise, averaged over two neighbours, below 20 Hz: 2/rate per Hz over 18 Hz
    assert joint.noise == pytest.approx(np.sqrt(2 / axis.RATE * 17.96), rel=0.15)
    # the force that depends on the place, but for what the parameters took of it
    assert joint.model == pytest.approx(error / np.sqrt(2), rel=0.15)
    kept = axis.ALIGNED_NOISE**2
    assert joint.noise_share_all == pytest.approx(kept / (kept + joint.model**2), rel=0.1)
    assert found.mostly_model_error
    text = str(found)
    assert "it is model error" in text and "Repeatability" in text and "repeats ±2σ" in text
    ratio = re.search(r"include the model error are (\S+) times as large\.", text)
    assert ratio and float(ratio[1]) > 1.0


def test_repeatability_is_what_repeated_records_spread_by(made):
    estimates, foretold, total = [], [], []
    for seed in range(30):
        problem = axis.problem(axis.recording(made, 1.0, 3.0, seed=seed))
        found = identify(problem, FULL_RATE)
        split = model_error_by_repetition(problem, found)
        estimates.append(found.theta)
        foretold.append(split.repeatability)
        total.append(found.robust_std)
    spread = np.std(estimates, axis=0, ddof=1)
    ratio = np.mean(foretold, axis=0) / spread
    assert (np.abs(np.log(ratio)) < 0.5).all()  # 30 runs: the spread itself is known to 13 %
    assert (np.mean(total, axis=0) > 2 * spread).all()


def test_decimated_estimates_are_split_without_repeatability(made):
    problem = axis.problem(axis.recording(made, 1.0, 3.0))
    split = model_error_by_repetition(problem, identify(problem, "ls"))
    assert split.repeatability is None
    assert "Repeatability" not in str(split)


def test_held_out_blocks_tell_model_error_from_noise(made):
    shares = []
    for error in (0.0, 3.0):
        record = axis.recording(made, 3.0, error, q_ref=None, dq_ref=None, ddq_ref=None)
        smoothed = Loop(axis.CONTROLLER, reference="smoothed")
        problem = Problem(load_robot("emps"), (record,), smoothed)
        split = model_error_by_held_out_blocks(cross_validate(problem, FULL_RATE, folds=4))
        shares.append(split.noise_share)
    assert shares[0] > 0.8
    assert shares[1] < 0.5
    assert "at most" in str(split) and "estimate's own error" in str(split)


def split_of(*shares):
    """A split by held-out blocks with the given shares of noise and their deviations."""
    joints = tuple(
        JointModelError(f"joint_{i}", "N m", 1.0, s**0.5, (1 - s) ** 0.5, s, std)
        for i, (s, std) in enumerate(shares, 1)
    )
    return ModelError("IDIM-PIV", "held-out blocks", "errors", 20.0, joints, None)


def test_intervals_of_a_share_are_ones_that_a_share_can_have():
    split = split_of((0.83, 0.107), (1.0, 0.0), (0.091, 0.0115), (0.02, 0.03))
    intervals = [joint.share_interval for joint in split.joints]
    assert np.allclose(intervals, [(0.616, 1.0), (1.0, 1.0), (0.068, 0.114), (0.0, 0.08)])
    rows = [line.split("N m")[1].split() for line in split.joint_table().text().splitlines()[1:]]
    assert [" ".join(row) for row in rows] == [
        "83 62 to 100",
        "100 –",
        "9.1 6.8 to 11.4",
        "2.0 0.0 to 8.0",
    ]
    (said,) = split.sentences()[:1]
    shares = "at most 2.0 % (2σ: 0.0 to 8.0 %) of the error's variance on joint_4 and at most 100 %"
    assert shares in said


def test_a_share_that_may_be_anything_is_not_reported():
    (said,) = split_of((0.43, 0.42)).sentences()
    assert said == (
        "Below 20 Hz, the held-out motion does not distinguish noise from model error: noise may "
        "account for 0 to 100 % of the variance (2σ) (errors)."
    )
    told, untold = split_of((0.43, 0.42), (0.83, 0.107)).sentences()
    assert "noise accounts for at most 83 % (2σ: 62 to 100 %) of the error's variance; the" in told
    assert "on joint_1: noise may account for 0 to 100 % of the variance (2σ)." in untold


def test_joints_that_tell_nothing_alone_may_tell_something_together():
    split = split_of(*[(0.2, 0.3)] * 9)
    assert not any(joint.is_reported for joint in split.joints) and split.mostly_model_error
    assert split.sentences()[-1].startswith("Over all joints less than half is noise: a longer")


def test_nothing_repeated_and_nothing_held_out_gives_no_split(made):
    record = axis.recording(made).part(0, 1500)
    problem = axis.problem(record)
    found = identify(problem, FULL_RATE)
    training = cross_validate(problem, FULL_RATE, folds=0, identification=found)
    assert model_error(problem, found) is None
    assert model_error(problem, found, training) is None


def test_noise_model_from_repetition_frees_piv_of_the_model_error(made):
    problem = axis.problem(axis.recording(made, 0.3, 4.0), mask=None)
    truth = np.array([axis.TRUTH[p.name] for p in problem.regressor.parameters])
    plain, repeated = (
        identify(problem, PrefilteredIV(noise=noise) if noise else "piv")
        for noise in (None, Repetition())
    )
    error = {k: np.abs(r.theta / truth - 1) for k, r in (("plain", plain), ("rep", repeated))}
    assert error["rep"].max() < 0.5 * error["plain"].max()


@pytest.mark.record
def test_emps_noise_from_its_periods(public_data):
    robot, loop = load_robot("emps"), _emps_loop()
    problem = Problem(robot, (load_emps(),), loop)
    assert find_period(problem.recordings[0]) == 6240
    pulses = load_emps_pulses()
    assert find_period(pulses) is None  # the pulses do not repeat with the reference
    judged = {
        name: cross_validate(problem, method, recording=pulses, folds=0)
        for name, method in {
            "iv": "iv-full-rate",
            "repetition": PrefilteredIV(noise=Repetition()),
        }.items()
    }
    found = judged["repetition"]
    assert found.identification.converged
    assert found.replay.total <= judged["iv"].replay.total < 5.72
    split = model_error_by_repetition(problem, found.identification)
    assert 0.01 < split.joints[0].noise_share < 0.04  # 1 to 3 % in an independent evaluation
    assert (split.repeatability < 0.25 * found.identification.robust_std).all()


def _emps_loop():
    controller = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    return Loop(controller, 35.15065188248547, 10.0)
