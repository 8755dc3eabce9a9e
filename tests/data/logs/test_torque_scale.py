"""A torque scale that nobody vouches for is carried from the file to verdict and report."""

import pytest

from pivident.data.logs.torque_scale import (
    TorqueScale,
    scale_headline,
    scale_sentences,
    torque_scales,
)
from pivident.data.logs.units import factor_to_si
from pivident.estimation.identification_file import to_dict
from pivident.estimation.identify import identify
from pivident.experiment.experiment import load_experiment
from pivident.experiment.recording_tables import log_of
from pivident.foundation.errors import RecordingError
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.report.builder import render_report
from tests.planar_log import EXPERIMENT, write_experiment

ASSUMED = '{unit = "A", gain = 2.0, scale = "assumed"}'
MASSES = '{unit = "A", gain = 2.0, scale = "masses"}'


def experiment_with(folder, tau):
    text = EXPERIMENT.replace('tau = "N m"', f"tau = {tau}")
    return load_experiment(write_experiment(folder, text))


def test_a_mark_is_part_of_the_unit():
    assert factor_to_si("tau", {"unit": "mA", "gain": 2.0, "scale": "masses"}) == (2e-3, False)
    assert factor_to_si("tau", {"unit": "kN m", "scale": "assumed"}) == (1e3, False)
    for unit in (
        {"unit": "A", "gain": 2.0, "scale": "weighed"},
        {"unit": "A", "scale": "assumed"},  # amperes without any gain
        {"gain": 2.0, "scale": "assumed"},
    ):
        with pytest.raises(RecordingError):
            factor_to_si("tau", unit)
    with pytest.raises(RecordingError, match="'masses' or 'assumed'"):
        factor_to_si("tau", {"unit": "A", "gain": 2.0, "scale": "weighed"})


def test_marks_are_those_of_their_joints():
    known, assumed = {"unit": "A", "gain": 2.0}, {"unit": "A", "gain": 1.0, "scale": "assumed"}
    (only,) = torque_scales([known, assumed], ("shoulder", "elbow"))
    assert only == TorqueScale("elbow", "A", "assumed")
    assert len(torque_scales(assumed, ("shoulder", "elbow"))) == 2
    assert torque_scales("N m", ("shoulder", "elbow")) == torque_scales(None, ("elbow",)) == ()


def test_each_basis_has_its_sentence():
    marks = [TorqueScale("a", "A", "assumed"), TorqueScale("b", "V", "masses")]
    assumed, masses = scale_sentences([*marks, *marks])
    assert assumed.startswith("The torque of a is in units of the log (A)")
    assert "torque of b (V) was taken from the masses" in masses
    for last in (masses, *scale_sentences(marks[:1]), *scale_sentences(marks[1:])):
        assert "[recording.units]" in last and "pivident gains" in last
    assert "pivident gains" not in assumed  # what to enter is said once


@pytest.mark.parametrize(
    ("tau", "headline"),
    [
        (
            ASSUMED,
            "Parameters are in units of the logged torque; its scale to N m is an assumption.",
        ),
        (f'["N m", {MASSES}]', "The torque scale was taken from the description's masses"),
    ],
)
def test_verdict_report_and_file_say_that_the_scale_is_assumed(tmp_path, tau, headline):
    result = identify(experiment_with(tmp_path, tau).problem(), "ls")
    (mark, *_) = result.torque_scale
    found = verdict(result)
    assert headline in found.headline
    (said,) = [s for s in found.statements if s.topic == "torque scale"]
    assert said.severity == "warning" and "[recording.units]" in said.message
    assert sum(said.message == s.message for s in found.statements) == 1
    assert said.as_json() in to_dict(result)["warnings"]
    assert mark.basis in ("assumed", "masses") and mark.unit == "A"
    head = render_report([result]).split('id="', 1)[1].split("key-figures")[0]
    assert headline.split(";")[0].split("'")[0] in head


def test_a_gain_of_ones_own_takes_its_place(tmp_path):
    result = identify(experiment_with(tmp_path, '{unit = "A", gain = 2.0}').problem(), "ls")
    assert result.torque_scale == ()
    assert verdict(result).scale == ""
    assert not any(s.topic == "torque scale" for s in verdict(result).statements)


def test_an_audit_does_not_take_an_assumed_scale_for_confirmed(tmp_path):
    for tau, count in ((MASSES, 1), ('"N m"', 0)):
        experiment = experiment_with(tmp_path, tau)
        (entry,) = experiment.content.recording
        audit = audit_log(log_of(entry, experiment.robot, tmp_path))
        assumed = [f for f in audit.of("scale") if f.kind == "assumed"]
        assert [f.severity for f in assumed] == ["warning"] * count


def test_the_output_of_a_law_with_unknown_gain_is_a_ratio():
    marks = [TorqueScale("a", "output", "output"), TorqueScale("b", "A", "assumed")]
    assumed, output = scale_sentences(marks)
    assert output.startswith("The torque of a is in units of the controller's output")
    assert "drive_gain" in output
    assert "[recording.units]" in assumed
    assert "[recording.units]" not in output
    assert scale_sentences(marks[:1]) == (output,)
    assert scale_headline(marks).startswith("Parameters are ratios to the drive gain")
