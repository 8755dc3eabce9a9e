"""Work that methods share: the same results, computed once, and what it cost is known."""

import time

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.foundation.common_work import once, shared_work
from tests.estimation.literature.filters.scenes import planar_problem
from tests.estimation.output_error.arms import counted_simulations, problem as closed_loop


def slowly(made, seconds=0.02):
    def make():
        time.sleep(seconds)
        made.append(len(made))
        return made[-1]

    return make


def test_results_are_kept_inside_the_block_only():
    made = []
    assert once(("a",), slowly(made)) == 0
    with shared_work():
        assert [once(("a",), slowly(made)) for _ in range(3)] == [1, 1, 1]
        assert once(("b",), slowly(made)) == 2
    assert once(("a",), slowly(made)) == 3


def test_saved_time_is_that_of_all_that_was_reused():
    made = []
    with shared_work() as shared:
        once(("inner",), slowly(made))
        outer = lambda: once(("inner",), slowly(made)) + once(("more",), slowly(made))  # noqa: E731
        once(("outer",), outer)
        inner = shared.saved
        once(("outer",), outer)
    assert len(made) == 2
    assert inner >= 0.02 and shared.saved - inner >= 0.04


def test_a_failure_is_not_kept():
    def fail():
        raise ValueError("no")

    with shared_work():
        with pytest.raises(ValueError, match="no"):
            once(("a",), fail)
        assert once(("a",), lambda: 1) == 1


def test_methods_find_the_same_with_shared_work_in_any_order():
    names = ("ls", "tls", "irls", "ekf", "iv-full-rate")
    alone = {name: identify(planar_problem(samples=2500)[0], name) for name in names}
    problem = planar_problem(samples=2500)[0]
    with shared_work() as shared:
        together = {name: identify(problem, name) for name in reversed(names)}
    assert shared.saved > 0.0
    for name, own in alone.items():
        np.testing.assert_array_equal(together[name].theta, own.theta)
        np.testing.assert_array_equal(together[name].covariance, own.covariance)
        np.testing.assert_array_equal(together[name].robust_covariance, own.robust_covariance)


def test_simulations_that_output_errors_begin_with_are_shared(monkeypatch):
    runs = counted_simulations(monkeypatch)
    names = ("cloe", "clie", "ml", "oloe")
    alone = {name: identify(closed_loop(), name) for name in names}
    one, apart = closed_loop(), len([n for n in runs if n])
    runs.clear()
    with shared_work():
        together = {name: identify(one, name) for name in reversed(names)}
    assert len([n for n in runs if n]) == apart - 2  # of the three in the closed loop
    for name, own in alone.items():
        np.testing.assert_array_equal(together[name].theta, own.theta)
        np.testing.assert_array_equal(together[name].covariance, own.covariance)
        rms = [found.simulation.fit.rms for found in (own, together[name])]
        np.testing.assert_array_equal(*rms)
