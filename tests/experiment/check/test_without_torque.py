"""`check` on a log without torque: what stays open, torques that nobody named, what is missing."""

import pytest

from pivident.experiment.check.experiment_check import check_experiment
from tests.planar_log import write_experiment
from tests.positions_only import POSITIONS_ONLY, WITHOUT_LAW, write_positions


def remarks(path) -> dict[str, object]:
    return {remark.kind: remark for remark in check_experiment(path).remarks}


def test_a_known_law_needs_no_torque(tmp_path):
    found = check_experiment(write_positions(tmp_path))
    assert not found.refused
    assert [(r.severity, r.kind) for r in found.remarks] == [("warning", "scale")]
    assert found.plan is not None


def test_what_is_missing_stops(tmp_path):
    found = check_experiment(write_positions(tmp_path, WITHOUT_LAW))
    (remark,) = found.remarks
    assert remark.refused
    assert remark.heading == "line 6, [recording] columns"
    assert "[controller]" in remark.next_step


def test_columns_that_read_like_torques_are_named(tmp_path):
    found = remarks(write_experiment(tmp_path, POSITIONS_ONLY))
    assert "'tau1', 'tau2'" in found["torque not named"].message


def test_methods_that_take_it_for_measured_are_named(tmp_path):
    text = POSITIONS_ONLY.replace("[identify]", '[identify]\nmethods = ["ls"]')
    found = remarks(write_positions(tmp_path, text))
    assert found["biased"].place == ("identify", "methods")


@pytest.mark.parametrize(
    ("old", "new", "kind"),
    [
        ('q = "deg", q_ref = "deg"', 'q = "rad", q_ref = "rad"', "reach"),
        ("kp = [6000, 2500]", "kp = [6e7, 2.5e7]", "unstable"),
    ],
)
def test_positions_and_law_are_checked_all_the_same(tmp_path, old, new, kind):
    assert kind in remarks(write_positions(tmp_path, POSITIONS_ONLY.replace(old, new)))
