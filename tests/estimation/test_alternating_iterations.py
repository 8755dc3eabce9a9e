"""Iterations that would go back and forth for ever: between two estimates, or with a few rows."""

import numpy as np
import pytest

from pivident.estimation.identification import Iteration
from pivident.estimation.identify import identify
from pivident.estimation.iteration import _takes_back
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import load_scenario


@pytest.mark.parametrize(("third", "back"), [(1.0, True), (1.5, False), (3.0, False)])
def test_a_step_that_takes_back_the_one_before_is_seen(third, back):
    history = [Iteration(np.array([x, 2.0]), 0.0, 0.0) for x in (1.0, 2.0, third)]
    assert _takes_back(history) == back
    assert not _takes_back(history[:2])


@pytest.mark.parametrize("run", [0, 3])
def test_idim_iv_ends_where_it_used_to_alternate(run):
    """Coarse counts in the loop, a joint at the edge of its standstill: estimates of period two."""
    (scenario,) = load_scenario("paper").chosen_conditions(["joint-known"])
    bench = Bench(scenario)
    found = identify(bench.problem(run), scenario.methods["iv"])
    assert found.converged and found.iterations < 12
    assert np.median(np.abs(found.theta / bench.expected - 1.0)) < 0.1
