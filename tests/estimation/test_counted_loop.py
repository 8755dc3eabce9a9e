"""A law that reads whole counts shakes the robot; simulated with them, friction is right again."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.didim import LOOPS, offsets
from pivident.estimation.identify import identify
from pivident.foundation.errors import ExperimentError
from pivident.judgement.diagnostics.verdict import verdict
from pivident.loop.simulation.control_loop import Loop
from pivident.studies.many.study.bench import Bench
from tests.studies.many.study.small import small

NOISE = {"encoder": 0.0, "torque": 0.02, "counts": 3600, "rounding": "loop"}


@pytest.fixture(scope="module")
def bench():
    return Bench(small(noise=NOISE, record={"rate": 1000}, trajectory={"duration": 8.0}))


@pytest.fixture(scope="module")
def found(bench):
    """Estimates of two records with the counts, and of the same without."""
    problems = [bench.problem(run) for run in range(2)]
    untold = [replace(p, loop=replace(p.loop, count=0.0)) for p in problems]
    return [[identify(p, "didim") for p in own] for own in (problems, untold)]


def errors(bench, found):
    return np.array([(own.theta - bench.expected) / own.std for own in found])


def test_the_problem_knows_what_its_law_reads(bench):
    assert np.allclose(bench.problem(0).loop.counts(2), 2 * np.pi / 3600)


def test_counts_take_the_bias_of_the_friction(bench, found):
    told, untold = found
    assert all(own.converged for own in told)
    k = told[0].names.index("fc2")
    right = bench.expected[k]
    bias = abs(np.mean([own.theta[k] for own in untold]) / right - 1.0)
    left = abs(np.mean([own.theta[k] for own in told]) / right - 1.0)
    assert bias > 0.1 and left < 0.2 * bias
    some = bench.expected != 0.0
    typical = [
        np.median(np.abs(np.array([o.theta for o in own])[:, some] / bench.expected[some] - 1.0))
        for own in found
    ]
    assert typical[0] < 0.25 * typical[1]


def test_intervals_hold_the_truth_with_the_counts_only(bench, found):
    told, untold = (np.abs(errors(bench, own)) for own in found)
    # both records share the shaken motion, and the friction of its last joint misses in both or
    # in neither: 90 % over other motions, 85 or 100 % here
    assert np.mean(told <= 2.0) > 0.8 and told.max() < 4.0
    assert np.mean(untold <= 2.0) < 0.8


def test_places_of_the_counts_are_spread_evenly_and_not_repeated(bench):
    problem = bench.problem(0)
    count = problem.loop.counts(2)
    first, second = (offsets(problem, k) / count for k in range(2))
    assert first.shape == (2 * LOOPS, 2)
    for own in (first, second):
        assert np.all(np.abs(own) <= 0.5)
        gaps = np.diff(np.sort(own % 1.0, axis=0), axis=0)
        assert np.allclose(gaps, 1.0 / (2 * LOOPS))
    assert np.abs(first - second).min() > 1e-3


def test_other_methods_estimate_as_ever_and_say_what_they_leave_out(bench, found):
    problem = bench.problem(0)
    fine = replace(problem, loop=replace(problem.loop, count=0.0))
    told, untold = identify(problem, "piv"), identify(fine, "piv")
    assert np.array_equal(told.theta, untold.theta)
    assert [w.kind for w in told.warnings if w.topic == "loop"] == ["counts"]
    assert not any(w.topic == "loop" for w in (*untold.warnings, *found[0][0].warnings))
    (finding,) = (s for s in verdict(told).statements if s.kind == "counts")
    assert finding.severity == "warning" and "didim" in finding.next_step


def test_an_open_loop_is_shaken_by_the_torques_that_drive_it(bench):
    own = identify(bench.problem(0), "oloe")
    assert not [w for w in own.warnings if w.kind == "counts"]
    k = own.names.index("fc2")
    assert own.theta[k] == pytest.approx(bench.expected[k], rel=0.02)


def test_the_result_says_how_it_was_made(found):
    own = found[0][0]
    assert own.method == "DIDIM (loops with counts)" and own.is_decimated
    assert "filtered rows" in str(own)


def test_a_virtual_loop_is_refused(bench):
    problem = bench.problem(0)
    virtual = replace(problem, loop=replace(problem.loop, reference="smoothed"))
    with pytest.raises(ExperimentError, match="measurement itself takes its place"):
        identify(virtual, "didim")


def test_a_negative_count_is_refused(bench):
    law = bench.problem(0).loop.controller
    for count in (-1e-3, np.nan, [1e-3, np.inf]):
        with pytest.raises(ExperimentError, match="count of the loop is"):
            Loop(law, count=count)
