"""Ranges over blocks against closed forms, over friction laws against the corrected estimates."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.estimation.parameter_rows import ParameterRange, range_texts
from pivident.estimation.summary import comparison_table, identification_table
from pivident.experiment.experiment import load_experiment
from pivident.judgement.diagnostics.diagnostics import diagnose_one
from pivident.judgement.diagnostics.model_error_statements import intervals
from pivident.judgement.diagnostics.ranges import (
    block_ranges,
    friction_ranges,
    jackknife_std,
    much_wider,
)
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.diagnostics.verdict_file import save_verdict
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.named_causes import ModelErrors, NamedCause
from pivident.judgement.model_errors.score_tests import Score
from pivident.judgement.validation.held_out.cross_validation import (
    CrossValidation,
    HeldOut,
    cross_validate,
)
from tests.conftest import REPOSITORY
from tests.synthetic_identification import synthetic_identification


def validation(whole, shifts, recordings, kind="folds"):
    """Held-out stretches whose estimates are off by multiples of σ, of these recordings."""
    folds = [replace(whole, judged=None, theta=whole.theta + shift * whole.std) for shift in shifts]
    held_out = [
        HeldOut(name, 0.0, 1.0, fold)
        for fold, own in zip(folds, recordings, strict=True)
        for name in own
    ]
    return CrossValidation("IDIM-PIV", kind, whole, tuple(held_out), training=None)


def friction_cause(shift, *alternatives, kind="friction"):
    """A named cause that changes the estimate so, with others that change it otherwise."""
    cause = Cause(kind, "", kind, "N m", lambda motion: motion.q)
    one = np.ones((1, 1))
    score = Score(cause, one[0], one, 1e-9, 0.1, 0.1, shift)
    nothing = np.zeros(2)
    others = (cause,) * len(alternatives)
    return NamedCause(score, 5.0, "fv1", nothing, others, np.array([shift, *alternatives]))


def test_jackknife_of_a_mean_is_its_standard_error():
    """σ_J² = s²/n, exactly."""
    sample = np.random.default_rng(0).normal(size=(12, 3)) * [1.0, 10.0, 0.1]
    without = np.array([np.delete(sample, k, axis=0).mean(axis=0) for k in range(12)])
    expected = sample.std(axis=0, ddof=1) / np.sqrt(12)
    np.testing.assert_allclose(jackknife_std(without), expected, rtol=1e-12)


def test_range_over_blocks():
    whole = synthetic_identification()
    shifts = np.array([-1.0, 0.5, 0.0, 0.25, 1.0])
    ranges = block_ranges(validation(whole, shifts, ["a", "a", "ab", "b", "b"]))
    half = 2.0 * np.sqrt(4.0 / 5.0 * np.sum((shifts - shifts.mean()) ** 2)) * whole.std
    np.testing.assert_allclose([r.low for r in ranges], whole.theta - half)
    np.testing.assert_allclose([r.high for r in ranges], whole.theta + half)
    assert {(r.by, r.estimates) for r in ranges} == {("blocks", 5)}
    assert [r.name for r in ranges] == list(whole.names)


def test_blocks_that_are_recordings_are_called_so():
    whole = synthetic_identification()
    made = block_ranges(validation(whole, [0.0, 1.0, 2.0], ["a", "bc", "d"]))
    assert {r.by for r in made} == {"recordings"}
    assert block_ranges(validation(whole, [0.0, 1.0], ["a", "b"])) == ()
    unseen = validation(whole, [0.0, 1.0, 2.0], ["a", "b", "c"], "second recording")
    assert block_ranges(unseen) == ()


def test_range_over_friction_laws_is_that_of_the_corrected_estimates():
    """Each law stands beside the friction that was named before it, and beside nothing else."""
    whole = synthetic_identification()
    rng = np.random.default_rng(1)
    first, other, delay, second = rng.normal(size=(4, whole.theta.size))
    named = (
        friction_cause(first, other),
        friction_cause(delay, kind="delay"),
        friction_cause(second),
    )
    ranges = friction_ranges(whole, ModelErrors(named, 3, 0.1, 0.1))
    all_estimates = whole.theta + np.array([0.0 * first, first, other, first + second])
    np.testing.assert_allclose([r.low for r in ranges], all_estimates.min(axis=0))
    np.testing.assert_allclose([r.high for r in ranges], all_estimates.max(axis=0))
    assert {(r.by, r.estimates) for r in ranges} == {("friction laws", 4)}
    assert friction_ranges(whole, ModelErrors(named[1:2], 3, 0.1, 0.1)) == ()


def test_scatter_that_chance_explains_is_not_wider():
    """Estimates whose σ is right: in hardly any of 100 results one of 13 ranges is named."""
    whole = synthetic_identification()
    rng, named = np.random.default_rng(2), 0
    for _ in range(100):
        shifts = rng.normal(size=(5, whole.theta.size)) * np.sqrt(5.0) / 4.0
        named += bool(much_wider(whole, block_ranges(validation(whole, shifts, "aaaaa"))))
    assert named <= 5


def test_a_block_that_alone_shows_a_parameter_is_no_model_error():
    """Without it the estimate is off by 6 σ, and has five times the σ."""
    whole = synthetic_identification()
    made = validation(whole, [6.0, 0.1, -0.1, 0.0, 0.2], "aaaaa")
    assert len(much_wider(whole, block_ranges(made))) == whole.theta.size
    first, *others = made.held_out
    poor = replace(first.identification, robust_covariance=25.0 * whole.robust_covariance)
    made = replace(made, held_out=(replace(first, identification=poor), *others))
    assert much_wider(whole, block_ranges(made)) == []


def test_what_is_much_wider_is_a_note_with_the_worst_three(tmp_path):
    whole = synthetic_identification()
    half = 2.0 * np.array([1.0, 9.0, 2.2, 4.0, 6.0, 5.0, *np.ones(7)]) * whole.std
    ends = zip(whole.names, whole.theta - half, whole.theta + half, strict=True)
    ranges = tuple(ParameterRange(n, a, b, "friction laws", 3) for n, a, b in ends)
    diagnostics = replace(diagnose_one({"piv": whole}), ranges={"piv": ranges})
    (finding,) = intervals(diagnostics, "piv")
    a, b, c = (whole.names[k] for k in (1, 4, 5))
    assert f"{a} 9.0 times (over friction laws), {b} 6.0 times" in finding.message
    assert f"{c} 5.0 times (over friction laws) and 2 more." in finding.message
    assert finding.severity == "note" and len(finding.evidence) == 5
    assert not list(intervals(diagnose_one({"piv": whole}), "piv"))
    found = verdict(diagnostics)
    save_verdict(found, tmp_path / "verdict.json")
    (first, *_) = stored = json.loads((tmp_path / "verdict.json").read_text("utf-8"))["ranges"]
    assert first == {
        "name": whole.names[0], "low": ranges[0].low, "high": ranges[0].high,
        "by": "friction laws", "estimates": 3, "by_noise": 0.0,
    }  # fmt: skip
    assert len(stored) == 13


def test_tables_show_the_range_over_everything():
    whole = synthetic_identification()
    name, low, high = whole.names[1], whole.theta[1] - 0.3, whole.theta[1] + 0.4
    ranges = (
        ParameterRange(name, low, whole.theta[1] + 0.1, "blocks", 5),
        ParameterRange(name, whole.theta[1], high, "friction laws", 3),
    )
    (text,) = filter(None, range_texts(whole.names, ranges))
    assert text == f"{low:.2f} … {high:.2f}"
    for table in (
        identification_table(whole, ranges=ranges),
        comparison_table([whole, whole], None, ranges, whole.method),
    ):
        (line,) = [x for x in table.splitlines() if x.startswith(f"{name} ")]
        assert text in line
        assert "range: ±2σ of a jackknife over 5 blocks, with 4 degrees of freedom" in table
        assert "3 friction laws that fit" in table
    assert "range" not in identification_table(whole)


@pytest.mark.record
def test_friction_of_the_tx40_varies_between_blocks_as_its_intervals_say(public_data):
    experiment = load_experiment(REPOSITORY / "examples" / "staubli_tx40" / "experiment.toml")
    problem, method = experiment.problem(), experiment.methods(["piv"])["piv"]
    found = identify(problem, method)
    ranges = block_ranges(cross_validate(problem, method, folds=5, identification=found))
    scatter = {own.name: 0.25 * (own.high - own.low) for own in ranges}
    for name in ("fv1", "fc1"):
        std = found.std[found.names.index(name)]
        assert 0.5 < std / scatter[name] < 2.0
        assert std < 0.05 * found.value(name)
