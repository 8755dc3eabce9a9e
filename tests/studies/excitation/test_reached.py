"""Predicted beside reached standard errors, and the motion that the robot ran."""

import math
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import pivident as pv
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.foundation.errors import ExperimentError
from pivident.studies import (
    DesignFileError,
    DesignRequest,
    ExcitingMotion,
    MotionFamily,
    design_motion,
    followed_motion,
    reached_errors,
    write_design,
)
from pivident.studies.excitation.reached import ReachedError, ReachedErrors, sentences
from tests.planar_arm import LAW
from tests.planar_results import planar_results
from tests.studies.excitation.designs import made_design, named

PLANAR = pv.load_robot("planar_2r")
LOOP = pv.Loop(LAW)

#: Torque noise of rows that are independent at 40 Hz, as designs expect it, and of the samples.
ROWS = np.array([0.1, 0.05])
SAMPLES = ROWS * math.sqrt(1000.0 / 40.0)


#: Estimated noise models make standard errors of short records scatter by 8 % between seeds.
SCATTER = 0.25


@cache
def planar_design():
    request = DesignRequest(duration=8.0, seconds=1.0)
    with suppress(ExperimentError):  # compiles, for longer than this may take
        design_motion(PLANAR, replace(request, seconds=0.01), torque_noise=ROWS)
    return design_motion(PLANAR, request, torque_noise=ROWS)


@cache
def planar_record(scale=1.0, runs=1, stretch=1.0):
    """A record of the design in closed loop, with the noise that it expects or another one."""
    motion = planar_design().motion
    t = np.arange(0.0, motion.duration * stretch, 1e-3) / stretch
    reference = np.vstack([motion.start[None].repeat(300, 0)] + [motion.at(t)[0]] * runs)
    noise = np.broadcast_to(scale, 2) * SAMPLES
    made = pv.simulate(PLANAR, LOOP, reference, rate=1000, encoder=2e-6, torque=noise, seed=3)
    return replace(made.recording, name="log")


@cache
def planar_estimate(method="piv", **options):
    return pv.identify(pv.Problem(PLANAR, (planar_record(**options),), LOOP), method)


def stored(design, folder) -> Path:
    write_design(design, folder, 100.0)
    return folder / "design.json"


def recorded(motion, start=0.0, rate=200.0, seconds=None, change=None):
    """Positions as a logger sees them that starts before or within the motion."""
    t = np.arange(int((seconds or motion.duration + 2.0) * rate)) / rate
    q = motion.at(t - start)[0]
    if change is not None:
        q = change(q)
    return Recording(
        "log", PLANAR.joint_names, q, np.sin(t)[:, None] + q, rate, allow_constant=True
    )


def test_the_noise_that_was_expected_gives_what_was_predicted(tmp_path):
    file = stored(planar_design(), tmp_path)
    (found,) = reached_errors([file], [planar_record()], planar_estimate())
    assert len(found.compared) == len(base_parameters(PLANAR))
    assert found.ratio == pytest.approx(1.0, abs=SCATTER)
    assert "are as predicted" in str(found) and found.followed[0].is_same


def test_more_noise_on_one_joint_shows_on_that_joint(tmp_path):
    file = stored(planar_design(), tmp_path)
    options = {"scale": (1.0, 3.0)}
    (found,) = reached_errors([file], [planar_record(**options)], planar_estimate(**options))
    (quiet,) = reached_errors([file], [planar_record()], planar_estimate())
    ratios = {e.name: e.ratio / q.ratio for e, q in zip(found.errors, quiet.errors, strict=True)}
    assert ratios["fc2"] == pytest.approx(3.0, rel=0.2)  # no other joint tells of its friction
    by_joint = found.ratio_by_joint
    assert by_joint["shoulder"] < 1.5 < by_joint["elbow"] < 3.3
    text = str(found)
    assert "larger than predicted" in text and "on elbow" in text.replace("\n", " ")


def test_a_motion_that_was_run_twice_counts_twice(tmp_path):
    file = stored(planar_design(), tmp_path)
    (found,) = reached_errors([file], [planar_record(runs=2)], planar_estimate(runs=2))
    assert len(found.followed[0].starts) == 2
    assert found.ratio == pytest.approx(1.0, abs=SCATTER)
    once = {p.name: p.alone for p in planar_design().predicted}
    for error in found.errors:
        assert error.predicted == pytest.approx(once[error.name] / math.sqrt(2.0))


def test_half_the_speed_is_another_motion(tmp_path):
    file = stored(planar_design(), tmp_path)
    slow = {"stretch": 2.0}
    (found,) = reached_errors([file], [planar_record(**slow)], planar_estimate("ls", **slow))
    assert found.errors == () and math.isnan(found.ratio)
    assert "holds another motion than the design" in found.reason
    assert "σ predicted" not in str(found)


def test_what_earlier_records_know_is_left_out_of_the_prediction_for_one_record():
    """I of the record alone is what all of it has beyond that of the earlier estimate."""
    (first,) = planar_results("piv")
    design = design_motion(first.robot, DesignRequest(duration=6.0, seconds=1.0), after=[first])
    std = np.array([p.std for p in design.predicted])
    total = np.linalg.inv(design.correlation * np.outer(std, std))
    alone = np.linalg.inv(total - np.linalg.inv(first.covariance))
    np.testing.assert_allclose(
        [p.alone for p in design.predicted], np.sqrt(np.diag(alone)), rtol=1e-3
    )
    assert all(p.std < p.alone for p in design.predicted)
    blind = planar_design()
    assert [p.alone for p in blind.predicted] == pytest.approx([p.std for p in blind.predicted])


def test_earlier_records_count_where_the_estimate_uses_them(tmp_path):
    before = tuple(replace(p, before=2.0 * p.std) for p in planar_design().predicted)
    file = stored(replace(planar_design(), predicted=before), tmp_path)
    record, result = planar_record(), planar_estimate()
    (found,) = reached_errors([None, file], [record, record], result)
    assert found.with_earlier and "earlier recordings count" in " ".join(sentences(found))
    assert [e.predicted for e in found.errors] == [p.std for p in before]
    (alone,) = reached_errors([file], [record], result)
    assert not alone.with_earlier


def test_records_that_the_prediction_does_not_know_of_end_the_comparison(tmp_path):
    file = stored(planar_design(), tmp_path)
    (found,) = reached_errors([file, None], [planar_record()] * 2, planar_estimate())
    assert not found.errors and "1 more recording" in found.reason


@pytest.mark.parametrize("start", [0.7312, 0.0, -0.413])
@pytest.mark.parametrize("kind", ["fourier", "splines", "postures"])
def test_the_start_of_the_motion_is_found_between_samples(start, kind):
    motion = made_design(kind=kind).motion
    found = followed_motion(recorded(motion, start), motion)
    assert found.is_same and found.starts == (pytest.approx(start, abs=1e-4),)
    assert found.rms.max() < 1e-3 and not found.deviating
    assert found.covered == pytest.approx(1.0 + min(start, 0.0) / motion.duration, abs=0.01)


def test_a_constant_deviation_is_measured():
    motion = made_design().motion
    shift = np.array([0.0, 0.2])
    found = followed_motion(recorded(motion, 0.5, change=lambda q: q + shift), motion)
    assert found.rms == pytest.approx([0.0, 0.2], abs=2e-3)
    spread = motion.sampled(50.0)[0][:, 1].std()
    assert found.share[1] == pytest.approx(0.2 / spread, rel=0.02)
    assert found.deviating == (("elbow",) if 0.2 / spread > 0.1 else ())


def test_a_motion_of_which_little_was_recorded_is_named(tmp_path):
    design = made_design()
    record = recorded(design.motion, 0.0, seconds=2.0)
    found = followed_motion(record, design.motion)
    assert not found.is_same and found.covered == pytest.approx(1 / 3, abs=0.02)
    (made,) = reached_errors([stored(design, tmp_path)], [record], planar_estimate())
    assert "holds 3" in made.reason and "% of the designed motion" in made.reason


def test_other_motion_in_the_record_is_measured():
    motion = made_design().motion

    def wave(q):
        q = q.copy()
        q[:400] += 0.5 * np.sin(np.pi * np.arange(400) / 400)[:, None] ** 2
        return q

    found = followed_motion(recorded(motion, 3.0, seconds=10.0, change=wave), motion)
    assert found.starts == (pytest.approx(3.0, abs=1e-3),) and found.is_same
    assert found.other == pytest.approx(2.0, abs=0.2)


def test_unrelated_motions_are_told_from_each_other():
    rng = np.random.default_rng(5)
    motion = made_design().motion
    for _ in range(20):
        other = ExcitingMotion(MotionFamily("fourier", 6.0, 9), rng.standard_normal((9, 2)))
        assert not followed_motion(recorded(other), motion).is_same


def test_a_joint_that_stands_still_in_the_design_deviates_once_it_moves():
    motion = made_design().motion
    still = motion.coefficients.copy()
    still[1:, 1] = 0.0
    quiet = ExcitingMotion(motion.family, still)
    assert not followed_motion(recorded(quiet), quiet).deviating
    assert followed_motion(recorded(motion), quiet).deviating == ("elbow",)


def test_designs_of_other_robots_are_named(tmp_path):
    record, result = planar_record(), planar_estimate()
    other = stored(named(made_design(), "a", "b"), tmp_path / "names")
    (found,) = reached_errors([other], [record], result)
    assert "another robot, with the joints a, b" in found.reason
    design = made_design()
    fewer = replace(
        design, predicted=design.predicted[:-1], correlation=design.correlation[:-1, :-1]
    )
    (found,) = reached_errors([stored(fewer, tmp_path / "fewer")], [record], result)
    assert found.reason.endswith(f"predicts nothing of {result.names[-1]}.")


def test_a_design_for_a_load_is_not_one_of_this_record(tmp_path):
    design = made_design()
    own = (*design.predicted[:-1], replace(design.predicted[-1], name="load m"))
    design = replace(design, predicted=own)
    (found,) = reached_errors([stored(design, tmp_path)], [planar_record()], planar_estimate())
    assert "asks for load m, from two runs of the motion" in found.reason


def test_a_damaged_design_is_an_error_that_names_its_file(tmp_path):
    file = stored(planar_design(), tmp_path)
    file.write_text(file.read_text("utf-8")[:400], encoding="utf-8")
    with pytest.raises(DesignFileError, match=r"design\.json"):
        reached_errors([file], [planar_record()], planar_estimate())


def test_ratios_of_what_is_unknown_do_not_count():
    errors = (
        ReachedError("a", "", "j", 1.0, 2.0),
        ReachedError("b", "", "j", 2.0, 1.0),
        ReachedError("c", "", "j", math.inf, 1.0),
        ReachedError("d", "", "j", 1.0, math.nan),
        ReachedError("e", "", "j", 0.0, 1.0),
    )
    found = ReachedErrors(Path("design.json"), "IDIM-PIV", errors=errors)
    assert found.ratio == pytest.approx(1.0) and [e.name for e in found.compared] == ["a", "b"]
    assert "Estimated, although the design predicted nothing: c." in str(found)
    values = found.to_values()
    assert values["parameters"][2]["ratio"] is None and values["ratio"] == pytest.approx(1.0)


def test_nothing_to_compare_is_said():
    found = ReachedErrors(Path("design.json"), "IDIM-PIV", reason="The robot is another one.")
    assert str(found).splitlines()[1:] == ["The robot is another one."]
    assert found.ratio_by_joint == {}
