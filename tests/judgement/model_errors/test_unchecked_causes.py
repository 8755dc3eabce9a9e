"""What is said not to be shown is not shown and changes the estimate as said; what is not, is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.model_errors.named_causes import MATTERS, named_causes
from pivident.judgement.model_errors.score_tests import ScoreTests
from pivident.judgement.model_errors.unchecked_causes import COMMON, checked_gains

from .faulty_tx40 import causes, right_estimate, right_problem

AXIS = "geometry of joint_3: correction of the length along x from joint_2 to joint_3"


def part(problem, share):
    """The first part of a record, on which less is seen."""
    recordings = tuple(r.slice(0.0, share * r.duration) for r in problem.recordings)
    return replace(problem, recordings=recordings)


@pytest.fixture(scope="module")
def found():
    problem = part(tx40_scenario("fine", 2)[0], 0.4)
    estimate = identify(problem, "piv")
    return problem, estimate, named_causes(problem, estimate)


def with_error(problem, one, size):
    """The record beside a description that is off by a size."""
    return one.cause.correct(problem, np.array([size]))


def test_the_gravest_comes_first(found):
    errors = found[2]
    assert errors.named == ()
    shifts = [one.shift for one in errors.unchecked]
    assert shifts == sorted(shifts, reverse=True) and shifts[-1] > MATTERS
    for one in errors.unchecked:
        assert one.size == COMMON[one.cause.kind, one.cause.unit] < one.shown_from


def test_such_an_error_changes_the_estimate_unseen_and_a_larger_one_is_named(found):
    problem, estimate, errors = found
    small = [u for u in errors.unchecked if u.cause.kind == "geometry"]
    one = max((u for u in small if np.isfinite(u.shown_from)), key=lambda u: u.shown_from / u.size)
    wrong = with_error(problem, one, one.size)
    changed = identify(wrong, "piv")
    k = estimate.names.index(one.parameter)
    shift = abs(changed.theta[k] - estimate.theta[k]) / estimate.std[k]
    assert 0.7 < shift / one.shift < 1.4
    assert named_causes(wrong, changed).named == ()
    wrong = with_error(problem, one, 1.2 * one.shown_from)
    (first, *_) = named_causes(wrong, identify(wrong, "piv")).named
    assert one.cause.kind in {first.cause.kind, *(c.kind for c in first.alternatives)}


def test_a_gain_that_no_record_shows_scales_the_parameters(found):
    _, estimate, errors = found
    (one,) = (u for u in errors.unchecked if str(u.cause).startswith("torque gain: "))
    assert np.isinf(one.shown_from) and one.relative == pytest.approx(1.0)
    k = estimate.names.index(one.parameter)
    # the band alone knows less than the whole record does
    assert 2.0 < one.shift <= 0.01 * abs(estimate.theta[k]) / estimate.std[k]


def test_the_long_record_checks_what_the_short_one_does_not(found):
    whole = named_causes(right_problem()[0], right_estimate())
    assert len(whole.unchecked) < len(found[2].unchecked)
    # 1 mm there is named, see test_named_causes
    assert AXIS in causes() and AXIS not in {str(one.cause) for one in whole.unchecked}


def test_what_one_window_alone_knows_leaves_the_standard_errors_of_the_estimate(found, monkeypatch):
    def singular(*given):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(ScoreTests, "covariance", singular)
    problem, estimate, errors = found
    gravest = named_causes(problem, estimate).unchecked[0]
    k = estimate.names.index(gravest.parameter)
    change = gravest.relative / 100 * abs(estimate.theta[k])
    assert gravest.shift == pytest.approx(change / estimate.free_std[k])
    assert gravest.shift >= errors.unchecked[0].shift


def test_the_verdict_says_it_without_a_reservation(found):
    problem, estimate, errors = found
    said = verdict(diagnose(problem, {"piv": estimate}, folds=2))
    notes = [s for s in said.statements if s.kind == "not checked"]
    assert 1 < len(notes) <= 3
    shifts = []
    for note in notes:
        assert note.severity == "note" and note not in said.reservations
        one = next(u for u in errors.unchecked if str(u.cause) in note.evidence)
        assert f"{one.size:g} {one.cause.unit} would change {one.parameter} by " in note.message
        assert note.evidence[str(one.cause)].bound == one.shown_from
        shifts.append(one.shift)
    assert shifts == sorted(shifts, reverse=True) and shifts[0] == errors.unchecked[0].shift
    assert said.answer("torque") == "yes"


@pytest.mark.parametrize("factor", [1.0, 1.5, 0.5])
def test_a_gain_is_checked_where_joints_share_bodies_and_agree(factor):
    problem = part(tx40_scenario("fine", 2)[0], 0.4)
    scale = np.array([1.0, 1.0, factor, 1.0, 1.0, 1.0])
    recordings = tuple(replace(r, tau=r.tau * scale) for r in problem.recordings)
    wrong = replace(problem, recordings=recordings)
    checked = named_causes(wrong, identify(wrong, "piv")).checked_gains
    assert ("joint_3" in checked) == (factor == 1.0)


def test_a_gain_that_the_parameters_take_up_is_not_checked():
    def score(joint, size, std, kind="torque gain"):
        cause = SimpleNamespace(kind=kind, subject=joint)
        return SimpleNamespace(cause=cause, size=np.array([size]), std=np.array([std]))

    scores = [
        score("known", 0.1, 0.5),
        score("hidden", 0.0, 0.0),
        score("vague", 0.1, 4.0),
        score("other", 0.1, 0.5, "gear ratio"),
    ]
    assert checked_gains(SimpleNamespace(tried=100, freedom=60), scores) == ("known",)
