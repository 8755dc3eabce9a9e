"""Friction that changes with temperature is brought to one temperature, with honest intervals."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.common_work import shared_work
from pivident.foundation.errors import ExperimentError, IdentificationError, ShapeMismatch
from pivident.judgement.model_errors.corrections import corrections, with_corrections
from pivident.studies.prediction.predict import predict
from tests.judgement.model_errors import warming_arm as arm

SAMPLES = 12000


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("arm")


def corrected(problem, method="piv"):
    """What was corrected, and the estimate."""
    with shared_work():
        made = corrections(problem, method)
        return made, with_corrections(identify(made.problem, method), made)


@pytest.fixture(scope="module")
def found(folder):
    return corrected(arm.problem(folder, arm.recording(0, 0.3)))


def friction_errors(estimate, truth):
    """Errors of the friction parameters in standard errors."""
    place = [estimate.names.index(name) for name in truth]
    return (estimate.theta[place] - np.array(list(truth.values()))) / estimate.std[place]


def test_changes_per_kelvin_are_those_of_the_machine(found):
    made, estimate = found
    assert {own.joint for own in estimate.friction_warming} == {"j1", "j2"}
    viscous, coulomb = arm.changes(0.3)
    for own in estimate.friction_warming:
        j = arm.NAMES.index(own.joint)
        assert own.parameters == (f"fv{j + 1}", f"fc{j + 1}")
        error = np.array(own.per_kelvin) - [viscous[j], coulomb[j]]
        assert np.all(np.abs(error) < 3.5 * np.array(own.std))
        assert np.all(np.array(own.std) < 0.03 * np.abs([viscous[j], coulomb[j]]))
        mean = arm.temperatures(SAMPLES)[:, j].mean()
        assert own.reference == pytest.approx(mean)
    assert [cause.subject for cause in made.left_out] == ["j3"]


def test_friction_is_that_at_the_mean_temperature(found):
    _, estimate = found
    assert np.abs(friction_errors(estimate, arm.truth(0.3, SAMPLES))).max() < 3.5


def test_at_another_temperature_the_intervals_are_wider(folder, found):
    record = arm.recording(0, 0.3)
    _, cold = corrected(arm.problem(folder, record, reference_temperature=arm.START))
    assert np.abs(friction_errors(cold, arm.truth(0.3, SAMPLES, arm.START))).max() < 3.5
    k = cold.names.index("fc1")
    assert cold.std[k] > 2.0 * found[1].std[k]


def test_the_sentences_have_units_intervals_and_the_temperature(found):
    said = {w.subject: w for w in found[1].warnings if w.topic == "correction"}
    assert "N m s/rad per K and fc1 by -0.07" in said["j1"].message
    assert "it holds at 37.3 °C." in said["j1"].message
    low, high = said["j1"].evidence["fc1"].interval
    assert low < arm.changes(0.3)[1][0] < high
    text = "The friction of j3 does not follow its temperature of 25 to 33.6 °C, and is not"
    assert said["j3"].message == f"{text} corrected."
    assert all(w.severity == "note" for w in said.values())


def test_a_new_log_is_predicted_at_its_own_temperatures(found):
    _, estimate = found
    new = arm.recording(1, 0.3)
    warm, cold = predict(estimate, new), predict(estimate, replace(new, temperature=None))
    errors = [each.error.errors.relative_in_band for each in (warm, cold)]
    assert np.all(errors[0] < 1.0) and np.all(errors[1][:2] > 3.0 * errors[0][:2])
    assert np.array_equal(errors[0][2], errors[1][2])
    said = [f.message for f in cold.findings if f.topic == "friction by temperature"]
    assert len(said) == 2 and all("temperature of the log is not known" in text for text in said)
    assert any("changed to that of the log" in f.message for f in warm.findings)


def test_the_result_keeps_it_in_its_file(found, tmp_path):
    found[1].save(tmp_path)
    assert load_identification(tmp_path).friction_warming == found[1].friction_warming


def test_held_out_motion_is_predicted_as_without_a_change(folder):
    """Fitted with the change, judged at the reference on a run with other temperatures."""
    run, new = arm.recording(0, 0.3), arm.recording(1, 0.3)
    made, estimate = corrected(arm.problem(folder, run), "ls")
    steady = identify(arm.problem(folder, arm.recording(0, 0.0)), "ls")
    (cold,) = made.on([new])
    reached = predict(estimate, replace(cold, temperature=None)).error.errors.relative_in_band
    without = predict(steady, arm.recording(1, 0.0)).error.errors.relative_in_band
    assert np.all(reached < 1.15 * without)
    assert np.array_equal(made.on([run])[0].tau, made.problem.recordings[0].tau)


def test_without_a_change_the_estimate_stays_the_same_to_the_bit(folder):
    record = arm.recording(2, 0.0)
    plain = identify(arm.problem(folder, replace(record, temperature=None)), "ls")
    made, estimate = corrected(arm.problem(folder, record), "ls")
    assert not made.causes and not estimate.friction_warming
    for name in ("theta", "covariance", "robust_covariance"):
        assert getattr(estimate, name).tobytes() == getattr(plain, name).tobytes()
    assert sum("does not follow its temperature" in w.message for w in estimate.warnings) == 3


def test_kelvin_are_kelvin(folder):
    record = arm.recording(0, 0.3)
    kelvin = replace(record, temperature=record.temperature + 273.15)
    made, _ = corrected(arm.problem(folder, kelvin), "ls")
    assert any("it holds at 310 K" in f.message for f in made.findings())
    with pytest.raises(ExperimentError, match=r"304\.\d to 310\.\d on average; .* 25 °C are 298 K"):
        corrections(arm.problem(folder, kelvin, reference_temperature=25.0), "ls")


def test_temperatures_that_say_nothing_are_refused(folder):
    record = arm.recording(0, 0.3)
    constant = replace(record, temperature=np.full(record.q.shape, 30.0))
    with pytest.raises(ExperimentError, match="temperatures are 30 throughout"):
        corrections(arm.problem(folder, constant), "ls")
    other = replace(record, name="cold", temperature=None)
    with pytest.raises(ExperimentError, match="recording 'cold' has no temperature"):
        corrections(arm.problem(folder, record, other), "ls")
    with pytest.raises(IdentificationError, match=r"\[identify\] temperature"):
        corrections(arm.problem(folder, record), "ls", ["friction by temperature"])


def test_a_recording_keeps_its_temperatures():
    record = arm.recording(0, 0.3)
    part = record.part(seconds=(2.0, 3.0))
    assert np.array_equal(part.temperature, record.temperature[2000:3000])
    assert record.behind(1).temperature.shape == (SAMPLES, 2)
    with pytest.raises(ShapeMismatch, match="temperature"):
        replace(record, temperature=record.temperature[:, :2])
