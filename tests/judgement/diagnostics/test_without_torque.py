"""The verdict on a log without torque: what positions alone cannot tell."""

import pytest

from pivident.estimation.identify import identify
from pivident.estimation.summary import rows_line
from pivident.experiment.experiment import load_experiment
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from tests.positions_only import POSITIONS_ONLY, write_positions


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    problem = load_experiment(write_positions(tmp_path_factory.mktemp("log"))).problem()
    results = {"cloe": identify(problem, "cloe")}
    return results["cloe"], verdict(diagnose(problem, results, folds=0))


def test_the_common_scale_is_a_statement(judged):
    _, found = judged
    (scale,) = [s for s in found.statements if s.kind == "scale"]
    assert scale.severity == "warning"
    assert "inertias, friction, gravity" in scale.message
    assert "declared gains" in scale.message


def test_methods_that_are_biased_here_are_not_recommended(judged):
    _, found = judged
    (feedback,) = [s for s in found.statements if s.topic == "feedback"]
    assert feedback.severity == "ok" and not feedback.next_step


def test_signals_are_not_called_measured(judged):
    result, _ = judged
    (record,) = result.recordings
    assert record.torque_label == "of the control law"
    assert "logged torque" not in rows_line(result)


def test_ratios_are_the_headline(tmp_path):
    text = POSITIONS_ONLY.replace("kp =", 'drive_gain = "unknown"\nkp =')
    problem = load_experiment(write_positions(tmp_path, text)).problem()
    found = verdict(identify(problem, "ls"))
    assert "ratios to the drive gain" in found.headline
    assert [s.kind for s in found.statements if s.topic == "without torque"] == ["ratio", "biased"]
