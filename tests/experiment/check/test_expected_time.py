"""The expected time grows with what it depends on, and says what compiling adds."""

from types import SimpleNamespace

import pytest

from pivident.estimation.methods import METHODS
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.check.plan import (
    CONSISTENT,
    JUDGED,
    WRITTEN,
    expected_stages,
    expected_time,
)
from pivident.foundation.text.numbers import time_in_words
from tests.planar_log import EXPERIMENT, write_experiment

FOUR = ("ls", "iv", "iv-full-rate", "piv")

THREE = ("ls", "iv-full-rate", "piv")

#: Samples, joints, parameters, methods, whether there is a loop, whether its law is to be found,
#: and seconds measured by benchmarks/expected_time.py.
MEASURED = {
    "planar": (2000, 2, 13, THREE, False, False, 1.6),
    "UR10": (3441, 6, 58, THREE, False, False, 3.5),
    "EMPS": (24841, 1, 4, FOUR, True, False, 2.6),
    "KR300": (3200, 3, 21, FOUR, True, True, 3.9),
    "TX40": (37250, 6, 34, FOUR, True, False, 6.8),
    "seven": (20000, 8, 78, THREE, False, False, 8.8),
}


def problem_of(samples, joints, parameters, loop=True):
    return SimpleNamespace(
        recordings=[SimpleNamespace(samples=samples)],
        robot=SimpleNamespace(size=joints),
        names=range(parameters),
        loop=loop,
    )


def seconds(samples, joints, parameters, methods, loop, law, folds=5):
    problem = problem_of(samples, joints, parameters, True if loop else None)
    chosen = {name: METHODS[name] for name in methods}
    return expected_time(problem, chosen, folds, law_unknown=law)


@pytest.mark.parametrize("name", MEASURED)
def test_measured_identifications_are_within_a_factor_of_one_and_a_half(name):
    *given, measured = MEASURED[name]
    assert 1 / 1.5 < seconds(*given) / measured < 1.5


def test_folds_methods_and_law_cost_time():
    whole = seconds(30000, 6, 40, FOUR, True, True)
    assert seconds(30000, 6, 40, FOUR, True, True, folds=0) < 0.95 * whole
    assert seconds(30000, 6, 40, ("ls",), True, True) < 0.8 * whole
    assert seconds(30000, 6, 40, FOUR, True, False) < whole
    assert seconds(30000, 6, 40, FOUR, False, False) < seconds(30000, 6, 40, FOUR, True, False)


def test_stages_are_in_the_order_in_which_they_pass():
    chosen = {name: METHODS[name] for name in FOUR}
    stages = expected_stages(problem_of(30000, 6, 40), chosen, 5)
    assert [*stages] == [*FOUR, JUDGED, WRITTEN]
    both = expected_stages(problem_of(30000, 6, 40), chosen, 5, consistent=2)
    assert [*both] == [*FOUR, JUDGED, CONSISTENT, WRITTEN] and min(both.values()) > 0.0
    without = expected_stages(problem_of(30000, 6, 40, None), chosen, 5)
    assert without[JUDGED] < 0.9 * stages[JUDGED]  # no loop is simulated


def test_times_in_words():
    assert [time_in_words(s) for s in (0.2, 41.4, 89.6, 150.0)] == ["1 s", "41 s", "90 s", "2 min"]


def test_the_stored_plan_says_what_every_method_would_take(tmp_path):
    """The studio offers methods that the file does not name, with their time."""
    plan = check_experiment(write_experiment(tmp_path, EXPERIMENT)).as_json()["plan"]
    assert plan["seconds_of"].keys() == METHODS.keys()
    assert all(0.0 < each < 1e4 for each in plan["seconds_of"].values())
    assert plan["seconds_of"]["particle"] > plan["seconds_of"]["ls"]
