"""The expected time grows with what it depends on, and says what compiling adds."""

from types import SimpleNamespace

import pytest

from pivident.check.expected_time import expected_time
from pivident.check.plan import in_words
from pivident.estimation.methods import METHODS

FOUR = ("ls", "iv", "iv-full-rate", "piv")

#: Samples, joints, parameters, methods, whether the law is to be found, and seconds measured.
MEASURED = {
    "TIAGo": (6174, 5, 40, ("ls",), False, 11.6),
    "EMPS": (24841, 1, 4, FOUR, False, 14.1),
    "UR10e": (27082, 6, 58, ("ls", "piv"), True, 34.0),
    "TX40": (37250, 6, 34, FOUR, False, 37.2),
}


def seconds(samples, joints, parameters, methods, law, folds=5):
    problem = SimpleNamespace(
        recordings=[SimpleNamespace(samples=samples)],
        robot=SimpleNamespace(size=joints),
        names=range(parameters),
    )
    return expected_time(problem, [METHODS[m] for m in methods], folds, law_unknown=law)


@pytest.mark.parametrize("name", MEASURED)
def test_measured_identifications_are_within_a_factor_of_two(name):
    *given, measured = MEASURED[name]
    assert 0.5 < seconds(*given) / measured < 2.0


def test_folds_methods_and_law_cost_time():
    whole = seconds(30000, 6, 40, FOUR, True)
    assert seconds(30000, 6, 40, FOUR, True, folds=0) < 0.7 * whole
    assert seconds(30000, 6, 40, ("ls",), True) < 0.8 * whole
    assert seconds(30000, 6, 40, FOUR, False) < whole


def test_times_in_words():
    assert [in_words(s) for s in (0.2, 41.4, 89.6, 150.0)] == ["1 s", "41 s", "90 s", "2 min"]
