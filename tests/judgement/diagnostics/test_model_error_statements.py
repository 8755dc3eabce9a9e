"""The verdict names causes of model error, in words, once, with what to do."""

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from tests.judgement.model_errors.faulty_tx40 import (
    causes,
    right_estimate,
    right_problem,
    with_fault,
    with_uneven_friction,
)

LATE = "delay: torques logged later than positions"


def judged(problem, result):
    return diagnose(problem, {"piv": result}, folds=0)


def test_nothing_is_found_on_a_right_model():
    diagnostics = judged(right_problem()[0], right_estimate())
    statements = [s for s in verdict(diagnostics).statements if s.topic == "model"]
    finding, *others = statements
    assert (finding.severity, finding.kind) == ("ok", "no cause found")
    assert all((s.severity, s.kind) == ("note", "not checked") for s in others)
    assert f"None of {len(causes())} causes" in finding.message
    np.testing.assert_array_equal(diagnostics.identifications["piv"].std, right_estimate().std)


@pytest.fixture(scope="module")
def late():
    problem = with_fault(causes()[LATE], [0.2])
    result = identify(problem, "piv")
    return result, judged(problem, result)


def test_delay_is_a_reservation_with_its_size(late):
    _, diagnostics = late
    found = verdict(diagnostics)
    assert found.severity == "warning"
    (finding,) = (s for s in found.statements if s.topic == "model" and s.severity != "note")
    assert (finding.severity, finding.kind) == ("warning", "delay")
    size = finding.evidence["size"]
    assert size.unit == "ms" and size.interval[0] < 0.2 < size.interval[1]
    assert "--free delay" in finding.next_step
    assert "standard errors" in finding.message
    assert "%" in finding.basis and f"{len(causes())} causes" in finding.basis


def test_friction_that_changes_over_the_travel_is_left_to_the_curves():
    """`pivident laws` has no law of the position; its ranges are those of friction all the same."""
    problem = with_uneven_friction(1, 2.0)
    diagnostics = judged(problem, identify(problem, "piv"))
    found = verdict(diagnostics)
    (finding,) = (s for s in found.statements if s.kind == "uneven friction")
    assert finding.severity == "warning" and "`pivident friction`" in finding.next_step
    (item,) = (i for i in found.summary.items if i.text.startswith("Uneven friction: joint_2"))
    assert item.command == "friction"
    assert {own.by for own in diagnostics.ranges["piv"]} == {"friction laws"}


def test_intervals_stay_and_friction_is_not_blamed(late):
    result, diagnostics = late
    own = diagnostics.identifications["piv"]
    np.testing.assert_array_equal(own.covariance, result.covariance)
    np.testing.assert_array_equal(own.robust_covariance, result.robust_covariance)
    statements = verdict(diagnostics).statements
    friction = [s for s in statements if s.topic == "friction"]
    assert all(s.severity == "note" and "wrong" not in s.message for s in friction)
