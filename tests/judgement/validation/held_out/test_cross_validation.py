"""Held-out motion: folds, prediction, replay, and methods side by side."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import AutoRegressive
from pivident.estimation.methods import METHODS
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.folds import (
    contiguous_folds,
    moving_part,
    nearest_division,
)
from pivident.judgement.validation.held_out.out_of_sample import (
    Ratio,
    _judged,
    compare_out_of_sample,
    error_ratio,
    is_worse,
)
from pivident.judgement.validation.held_out.prediction import (
    Judge,
    at_rest,
    level_beyond,
    motion_band,
    pooled,
    total_error,
)
from pivident.judgement.validation.held_out.replay import Replay, as_logged
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.friction import FrictionLaw, viscous
from pivident.robot.friction_terms.presliding import dahl
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf
from pivident.signals.bandpass import butterworth
from tests.judgement.validation import one_axis as axis
from tests.other_arms import Setting, make_log

FULL_RATE = LeastSquares(signals=RandomWalk())


@pytest.fixture(scope="module")
def made():
    return axis.motion()


@pytest.fixture(scope="module")
def problem(made):
    return axis.problem(axis.recording(made))


def test_folds_share_out_the_motion_and_keep_their_distance(made):
    recordings = [axis.recording(made, name=n).part(0, m) for n, m in (("a", 4000), ("b", 2500))]
    moving = [(100, 3900), (0, 2500)]
    folds = contiguous_folds(recordings, moving, 4, gap=0.2)
    seen = [np.zeros(r.samples, int) for r in recordings]
    for fold in folds:
        for piece in fold.held_out:
            seen[piece.recording][piece.span] += 1
        for piece, around in zip(fold.held_out, fold.left_out, strict=True):
            start, stop = moving[piece.recording]
            assert around.start == max(piece.start - 100, start)
            assert around.stop == min(piece.stop + 100, stop)
    assert seen[0].tolist() == [0] * 100 + [1] * 3800 + [0] * 100
    assert (seen[1] == 1).all()
    assert len(folds[2].held_out) == 2  # the third block runs over the end of the first recording


@pytest.mark.parametrize(
    ("count", "gap", "message"),
    [(1, 0.1, "at least 2"), (3, -1.0, "must not be negative"), (60, 0.1, "fewer folds")],
)
def test_impossible_folds_are_refused(made, count, gap, message):
    with pytest.raises(ExperimentError, match=message):
        contiguous_folds([axis.recording(made)], [(0, 4000)], count, gap)


def is_possible(recordings, moving, count, gap):
    """By the definition: each block is long enough, and so is what is left without it."""
    lengths = [stop - start for start, stop in moving]
    owners = np.concatenate([np.full(n, k) for k, n in enumerate(lengths)])
    block = np.arange(sum(lengths)) * count // sum(lengths)
    margin, place = round(gap * recordings[0].rate), np.concatenate([np.arange(n) for n in lengths])
    shortest = max(round(0.3 * recordings[0].rate), 250)
    for k in range(count):
        out = np.zeros(sum(lengths), bool)
        for r in range(len(recordings)):
            own = (owners == r) & (block == k)
            if own.any():
                low, high = place[own].min() - margin, place[own].max() + margin
                out |= (owners == r) & (place >= low) & (place <= high)
        # borders are rounded: a sample more or less
        if abs(np.sum(~out) - shortest) <= 2 or abs(sum(lengths) / count - shortest) <= 2:
            return None
        if sum(lengths) // count < shortest or np.sum(~out) < shortest:
            return False
    return True


@settings(max_examples=60, deadline=None)
@given(
    lengths=st.lists(st.integers(0, 2500), min_size=1, max_size=3).filter(any),
    wanted=st.integers(2, 12),
    gap=st.floats(0.0, 2.0),
)
@example([616], 2, 0.53)  # long enough for two blocks, and nothing is left to fit without one
def test_the_nearest_possible_number_of_blocks_is_taken(made, lengths, wanted, gap):
    recordings = [axis.recording(made).part(0, 2500) for _ in lengths]
    moving = [(0, n) for n in lengths]
    division = nearest_division(recordings, moving, wanted, gap)
    possible = {n: is_possible(recordings, moving, n, gap) for n in range(2, 20)}
    if division.count:
        assert possible[division.count] is not False
        contiguous_folds(recordings, moving, division.count, gap)
        nearer = [n for n, able in possible.items() if able]
        assert all(abs(n - wanted) >= abs(division.count - wanted) for n in nearer)
    else:
        assert True not in possible.values()
    assert bool(division.reason) == (division.count != wanted)


def test_a_time_in_the_wrong_unit_is_named_where_nothing_can_be_held_out(made):
    record = axis.recording(made)
    thousandfold = replace(record, rate=1000.0 * record.rate)  # stamps in seconds taken for ms
    division = nearest_division([thousandfold], [(0, 4000)], 5, 0.1)
    assert division.count == 0 and "at 500000 Hz" in division.reason.fact
    assert "check the unit of the time" in division.reason.advice


def test_blocks_that_a_motion_has_no_room_for_cost_a_line(problem):
    (record,) = problem.recordings
    short = replace(problem, recordings=(record.part(0, 1000),))
    judged = cross_validate(short, FULL_RATE, folds=5)
    assert judged.blocks == 3 and any("instead of 5" in note for note in judged.notes)
    assert "instead of 5" in str(compare_out_of_sample(short, {"ls": FULL_RATE}, folds=5))
    shorter = replace(problem, recordings=(record.part(0, 500),))
    judged = cross_validate(shorter, FULL_RATE, folds=5)
    assert judged.training_only and any(
        "Nothing is held out: the motion of" in n for n in judged.notes
    )
    with pytest.raises(IdentificationError, match="has no room for blocks"):
        compare_out_of_sample(shorter, {"ls": FULL_RATE}, folds=5)


def test_gaps_that_leave_nothing_are_refused(made):
    with pytest.raises(ExperimentError, match=r"leave less than 0\.5 s to fit"):
        contiguous_folds([axis.recording(made)], [(0, 4000)], 2, gap=5.0)


def test_standstill_at_the_ends_is_not_shared_out(made):
    rest = np.zeros((700, 1))
    record = axis.recording(made)
    waiting = replace(
        record,
        q=np.vstack([rest + record.q[:1], record.q]),
        tau=np.vstack([rest, record.tau]),
        q_ref=np.vstack([rest, record.q_ref]),
        dq_ref=None,
        ddq_ref=None,
    )
    start, stop = moving_part(axis.problem(waiting), Judge(waiting).kinematics)
    assert 690 <= start <= 720
    assert stop > 4600


def test_torques_of_a_held_out_block_do_not_reach_its_estimate(problem):
    (record,) = problem.recordings
    first = cross_validate(problem, FULL_RATE, folds=4)
    block = first.held_out[1]
    inside = (record.t >= block.start) & (record.t < block.stop)
    spoiled = replace(record, tau=np.where(inside[:, None], 500.0 - record.tau, record.tau))
    again = cross_validate(replace(problem, recordings=(spoiled,)), FULL_RATE, folds=4)
    same, other = ([h.identification.theta for h in c.held_out] for c in (first, again))
    np.testing.assert_allclose(same[1], other[1], rtol=1e-9)
    assert not np.allclose(same[0], other[0])
    assert again.held_out[1].prediction.total > 10 * first.held_out[1].prediction.total


def test_prediction_error_of_the_true_model_is_the_noise(made):
    noise = 2.0
    problem = axis.problem(axis.recording(made, noise))
    error = cross_validate(problem, FULL_RATE, folds=3).prediction
    # the torque of two neighbouring samples is averaged, and brought back to the instant
    assert error.rms[0] == pytest.approx(noise * axis.ALIGNED_NOISE, rel=0.1)
    assert error.relative[0] == pytest.approx(100 * error.rms[0] / error.torque[0])
    assert error.total == pytest.approx(error.relative[0])


def test_errors_of_a_stretch_are_those_of_the_whole_residual_there(made):
    """Only the stretch and what the low-pass reaches beyond it is predicted."""
    problem = axis.problem(axis.recording(made, 2.0))
    found, judge = identify(problem, FULL_RATE), Judge(problem.recordings[0])
    residual, span = judge.residual(found), slice(2000, 3500)
    whole = judge.error(problem.robot, residual, judge.in_band(residual), span)
    (alone,) = judge.score(found, [span])
    for name, value in vars(whole).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_allclose(getattr(alone, name), value, rtol=1e-10, err_msg=name)


def test_friction_with_memory_is_predicted_from_the_beginning(made):
    problem = axis.problem(axis.recording(made))
    robot, judge = problem.robot, Judge(problem.recordings[0])
    assert judge._around(robot, [slice(2000, 2500)]).start > 0
    remembering = robot.with_friction(FrictionLaw((viscous(), dahl(1e-3))))
    assert judge._around(remembering, [slice(2000, 2500)]).start == 0


def test_noise_level_and_width_of_the_low_pass():
    rate, band = 1000.0, 20.0
    white = np.random.default_rng(0).standard_normal((200_000, 2)) * [1.0, 3.0]
    level = level_beyond(white, rate, band)
    assert np.allclose(level, [2 / rate, 18 / rate], rtol=0.05)
    from pivident.judgement.validation.held_out.prediction import _width

    low = butterworth(white, rate, band)
    assert np.allclose(np.var(low, axis=0), level * _width(band), rtol=0.1)


def test_total_error_does_not_add_newtons_to_newton_metres():
    rms, size = np.array([3.0, 4.0]), np.array([30.0, 40.0])
    assert total_error(rms, size, ("N m", "N m")) == pytest.approx(10.0)
    assert total_error(np.array([3.0, 8.0]), size, ("N", "N m")) == pytest.approx(
        100 * np.sqrt((0.1**2 + 0.2**2) / 2)
    )


def test_motion_band_of_slow_records(made):
    record = axis.recording(made)
    assert motion_band(record) == 20.0
    assert motion_band(replace(record, rate=80.0, control_rate=80.0)) == 10.0


def test_nothing_held_out_is_said(problem):
    result = cross_validate(problem, FULL_RATE, folds=0)
    assert result.training_only
    assert "Nothing was held out" in result.warning
    assert "Nothing was held out" in str(result)
    assert result.prediction.total == pytest.approx(result.training.total)
    compared = compare_out_of_sample(problem, ["ls"], folds=0)
    assert compared.training_only and "Nothing was held out" in str(compared)


def test_the_fitted_recording_is_no_second_one(problem):
    with pytest.raises(ExperimentError, match="is the one that is fitted"):
        cross_validate(problem, FULL_RATE, recording=problem.recordings[0])


def test_second_recording_is_predicted_and_replayed(made, problem):
    other = axis.recording(axis.motion(2 * axis.PERIOD), seed=7, name="second")
    found = identify(problem, "iv-full-rate")
    result = cross_validate(problem, "iv-full-rate", recording=other, folds=4, identification=found)
    assert result.kind == "second recording" and result.identification is found
    assert [h.recording for h in result.held_out] == ["second"] * 4
    assert result.replay.position[0] < 2e-6
    # once the start is forgotten, what is left is the torque sensor's noise
    assert result.held_out[2].replay.torque[0] == pytest.approx(1.0, rel=0.1)
    text = str(result)
    assert "position rms" in text and "simulated loop" in text and "recording second" in text


def test_replay_with_a_wrong_mass_is_worse(problem):
    found = identify(problem, "iv-full-rate")
    heavy = replace(found, judged=None, theta=found.theta * [1.2, 1.0, 1.0, 1.0])
    replay = Replay(problem, Judge(problem.recordings[0]))
    span = [slice(200, None)]
    (right,), (wrong,) = replay.score(found, span), replay.score(heavy, span)
    assert wrong.position[0] > 10 * right.position[0]
    assert wrong.torque[0] > 2 * right.torque[0]


def test_simulated_torque_is_compared_as_it_was_logged(made):
    tau = np.arange(6.0)[:, None]
    record = axis.recording(made)
    assert as_logged(tau, record)[:, 0].tolist() == [0, 1, 2, 3, 4, 5]
    late = replace(record, delay=2 / axis.RATE)
    assert as_logged(tau, late)[:, 0].tolist() == [0, 0, 0, 1, 2, 3]
    averaged = replace(record, torque_timing="averaged")
    assert as_logged(tau, averaged)[:, 0].tolist() == [0, 0, 1, 2, 3, 4]


def test_a_virtual_loop_is_called_virtual(made):
    smoothed = replace(axis.problem(axis.recording(made)).loop, reference="smoothed")
    problem = replace(axis.problem(axis.recording(made)), loop=smoothed)
    assert "The replayed loop is virtual" in str(cross_validate(problem, FULL_RATE, folds=2))


def test_folds_of_a_repeated_motion_are_called_repetitions(problem):
    assert "these are errors on a repetition" in str(cross_validate(problem, FULL_RATE, folds=2))
    once = replace(problem, recordings=(problem.recordings[0].part(0, 1600),))
    assert "repetition" not in str(cross_validate(once, FULL_RATE, folds=2))


def test_folds_share_the_instruments_of_the_whole_record(problem):
    result = cross_validate(replace(problem, loop=None), "iv-full-rate", folds=3)
    used = result.identification.instruments
    assert used.kind != "loop" and result.replay is None
    assert all(h.identification.instruments is used for h in result.held_out)


def test_a_part_of_a_record_is_replayed_as_in_the_whole(problem):
    """The loop is simulated no further than what is scored."""
    found = identify(problem, "iv-full-rate")
    replay = Replay(problem, Judge(problem.recordings[0]))
    (alone,), (_, beside) = (
        replay.score(found, spans)
        for spans in ([slice(900, 1500)], [slice(0, 4000), slice(900, 1500)])
    )
    assert alone.torque[0] == beside.torque[0] and alone.position[0] == beside.position[0]
    assert replay.simulate(found, 1500).q.shape == (1, 1500)


def test_ratio_of_errors_has_students_interval(problem):
    a, b = (
        cross_validate(problem, method, folds=4)
        for method in (FULL_RATE, LeastSquares(signals=RandomWalk(order=2)))
    )
    ratio = error_ratio(a, b)
    logs = np.log([x.prediction.total_in_band for x in a.held_out]) - np.log(
        [x.prediction.total_in_band for x in b.held_out]
    )
    reach = 3.182446 * logs.std(ddof=1) / 2.0  # t of three degrees of freedom
    assert np.log(ratio.high / ratio.value) == pytest.approx(reach, rel=1e-5)
    assert ratio.value == pytest.approx(a.prediction.total_in_band / b.prediction.total_in_band)
    assert np.isnan(error_ratio(replace(a, held_out=a.held_out[:2]), b).low)


def test_methods_side_by_side_follow_the_ratio(problem):
    compared = compare_out_of_sample(problem, folds=3)
    error = {name: r.prediction.total_in_band for name, r in compared.results.items()}
    iv = min(("iv", "iv-full-rate"), key=error.__getitem__)
    assert compared.iv == iv and compared.piv == "piv"
    assert compared.best == min(error, key=error.__getitem__)
    assert compared.piv_over_iv.value == pytest.approx(error["piv"] / error[iv])
    low = compared.piv_over_iv.low
    assert compared.piv_is_worse == (error["piv"] > 1.02 * error[iv] and not low < 1.0)
    assert compared.recommended == (iv if compared.piv_is_worse else "piv")
    taken = compared.results[compared.recommended].method
    text = str(compared)
    assert f"take the estimate of {taken}" in text and "95 %:" in text
    assert all(r.method in text for r in compared.results.values())


def compared_with(problem, factors):
    """PIV and IV whose held-out errors in each block have the given ratios."""
    made = cross_validate(problem, METHODS["iv-full-rate"], folds=len(factors))

    def scaled(factor, error):
        return replace(
            error, rms_in_band=factor * error.rms_in_band, torque_in_band=error.torque_in_band
        )

    worse = replace(
        made,
        held_out=tuple(
            replace(h, prediction=scaled(f, h.prediction))
            for f, h in zip(factors, made.held_out, strict=True)
        ),
    )
    methods = {"piv": METHODS["piv"], "iv": METHODS["iv-full-rate"]}
    return _judged(methods, {"piv": worse, "iv": made}, {})


def test_a_difference_that_could_be_chance_decides_nothing(problem):
    chance = compared_with(problem, (0.9, 1.3, 0.92, 1.2, 0.95))
    assert (
        chance.piv_over_iv.value > 1.02 and chance.piv_over_iv.low < 1.0 < chance.piv_over_iv.high
    )
    assert chance.recommended == "piv" and chance.undecided and not chance.piv_is_worse
    (sentence,) = [s for s in chance.sentences() if "no difference within" in s]
    assert chance.piv_over_iv.range in sentence and "take the estimate of" in sentence
    sure = compared_with(problem, (1.3, 1.32, 1.28, 1.31, 1.3))
    assert sure.recommended == "iv" and sure.piv_is_worse and not sure.undecided


def test_without_an_interval_the_difference_itself_decides():
    assert is_worse(Ratio(1.1, np.nan, np.nan)) and not is_worse(Ratio(1.01, np.nan, np.nan))
    assert not is_worse(Ratio(1.021, 0.9, 1.16)) and is_worse(Ratio(1.1, 1.01, 1.2))


def test_what_rounds_to_zero_has_no_sign_of_its_own():
    assert str(Ratio(0.9998, 0.9996, 1.0002)) == "+0.0 % (95 %: +0.0 to +0.0 %)"
    assert str(Ratio(0.98, 0.97, 1.0)) == "-2.0 % (95 %: -3.0 to +0.0 %)"


def test_an_estimate_is_not_called_the_best_where_least_squares_predicts_better(problem):
    results = {name: cross_validate(problem, METHODS[name], folds=2) for name in ("ls", "piv")}
    best = min(results, key=lambda name: results[name].prediction.total_in_band)
    judged = _judged({name: METHODS[name] for name in results}, results, {})
    assert judged.recommended == "piv"
    for order in (judged, replace(judged, best="ls" if best == "piv" else "piv")):
        text = " ".join(order.sentences())
        assert ("Smallest held-out torque error" in text) == (order.best == "piv")
        assert ("has the smallest error" in text) == (order.best == "ls")


def test_a_method_that_fails_does_not_end_the_comparison(problem):
    compared = compare_out_of_sample(replace(problem, loop=None), ["ls"], folds=2)
    assert compared.recommended == "ls"
    assert "–" in str(compared.table())  # no loop, no replay
    with pytest.raises(ExperimentError, match="no method"):
        compare_out_of_sample(problem, [])


@pytest.mark.record
def test_emps_piv_with_a_noise_model_of_the_model_error_is_found_out(public_data):
    controller = Cascade(kp=[160.18], kv=[243.45], averaged=True)
    loop = replace(axis.problem(load_emps()).loop, controller=controller, limit=10.0)
    loop = replace(loop, drive_gain=35.15065188248547)
    problem = replace(axis.problem(load_emps()), robot=load_robot("emps"), loop=loop)
    methods = {
        "iv": METHODS["iv-full-rate"],
        "piv": PrefilteredIV(noise=AutoRegressive(motion_band=None)),
    }
    compared = compare_out_of_sample(problem, methods, recording=load_emps_pulses())
    assert compared.piv_is_worse and compared.recommended == "iv"
    assert compared.piv_over_iv.low > 2.0  # 16 against 4 %
    assert any("model error" in cause for cause in compared.causes)
    assert any("fc1" in cause for cause in compared.causes)
    assert "take the estimate of IDIM-IV" in str(compared)
    good = compare_out_of_sample(
        problem, ["iv-full-rate", "piv"], recording=load_emps_pulses(),
        identifications={"iv-full-rate": compared.results["iv"].identification},
    )  # fmt: skip
    assert good.recommended == "piv" and not good.piv_is_worse


def test_what_an_arm_held_by_friction_adds_to_the_error_is_told_apart():
    """Records with stops: friction holds a resting joint with up to 0.8 of its level."""
    made = make_log(21, Setting("regular", 200.0, 30.0, 2.0, 0.002, "none", 0.6))
    robot = parse_urdf(made.arm.urdf)
    record = Recording(
        "run", made.arm.joint_names, made.q, made.tau, 200.0, torque_timing="sampled"
    )
    found = identify(Problem(robot, (record,)), "ls")
    (error,) = Judge(record).score(found, [slice(0, record.samples)])
    assert error.relative_in_band[0] > 10.0 and error.moving_in_band[0] < 2.0
    assert "without standstill" in at_rest(error, 0)
    whole = pooled([error, error])
    np.testing.assert_allclose(whole.moving_in_band, error.moving_in_band)
