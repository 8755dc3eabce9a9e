import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identification_file import save_identification
from pivident.foundation.errors import (
    IdentificationError,
    IdentificationFileError,
    NoConsistentModelNear,
)
from pivident.judgement.diagnostics.consistent_estimate import consistent_estimate
from pivident.judgement.diagnostics.stored_consistent import write_consistent
from pivident.models.consistency.consistent_model import ConsistentModel, make_consistent
from pivident.models.consistency.options import ConsistencyOptions
from pivident.models.exported import random_states
from pivident.models.runnable_model import impossible_value, runnable_model
from pivident.models.stored_model import stored_model
from pivident.robot.description import INERTIAL
from pivident.robot.gallery import load_robot
from pivident.robot.inertia import from_center_of_mass
from tests.synthetic_identification import synthetic_identification


@pytest.fixture(scope="module")
def free():
    return synthetic_identification()


def with_stage(folder, free):
    """A result with its consistent stage; returns the values that the stage found."""
    save_identification(free, folder)
    estimate = consistent_estimate(free, ConsistencyOptions())
    write_consistent(estimate, folder, folder / "identification.json")
    return estimate.model.values


def test_consistent_parameters_are_made_where_there_are_none(tmp_path, free):
    save_identification(free, tmp_path)
    model, files = stored_model(tmp_path)
    assert files == (tmp_path / "identification.json",)
    assert model.consistent and model.intervals is None
    assert len(model.origin.identification) == 64
    states = random_states(free.robot)
    here = runnable_model(make_consistent(free)).torque(*states)
    np.testing.assert_allclose(model.torque(*states), here, atol=1e-9)


def test_consistent_file_beside_it_is_taken(tmp_path, free):
    values = with_stage(tmp_path, free)
    model, files = stored_model(tmp_path)
    assert [file.name for file in files] == ["identification.json", "consistent.json"]
    np.testing.assert_array_equal(model.values, values)
    assert model.intervals.shape == (values.size, 2) and model.estimate is not None
    alone, _ = stored_model(tmp_path / "consistent.json")
    np.testing.assert_array_equal(alone.values, values)
    assert alone.origin == model.origin and alone.estimate is None


def test_consistent_file_of_another_estimate_is_not_taken(tmp_path, free):
    with_stage(tmp_path, free)
    other = replace(free, judged=None, theta=free.theta * 1.01)
    save_identification(other, tmp_path)
    model, files = stored_model(tmp_path)
    assert len(files) == 1 and "made from another identification" in model.notes[-1]
    states = random_states(free.robot)
    expected = runnable_model(make_consistent(other)).torque(*states)
    np.testing.assert_allclose(model.torque(*states), expected, atol=1e-9)


def test_free_estimate_is_lifted(tmp_path, free):
    with_stage(tmp_path, free)
    model, _ = stored_model(tmp_path / "identification.json", free=True)
    assert not model.consistent
    states = random_states(free.robot)
    np.testing.assert_allclose(model.torque(*states), free.predict(*states), atol=1e-10)
    with pytest.raises(IdentificationFileError, match=r"free estimate is in identification\.json"):
        stored_model(tmp_path / "consistent.json", free=True)


def test_estimate_that_is_too_poor_names_the_way_out(tmp_path, free):
    heavy = replace(free, judged=None, theta=-5.0 * free.theta)
    save_identification(heavy, tmp_path)
    with pytest.raises(NoConsistentModelNear) as caught:
        stored_model(tmp_path)
    assert any("--free" in note for note in caught.value.__notes__)


def test_model_is_there_without_intervals_that_cannot_be_found(tmp_path, free, monkeypatch):
    def failing(self, confidence=0.95, of="estimated"):
        raise IdentificationError("the solver failed")

    save_identification(free, tmp_path)
    assert stored_model(tmp_path, intervals=True)[0].intervals is not None
    monkeypatch.setattr(ConsistentModel, "intervals", failing)
    model, _ = stored_model(tmp_path, intervals=True)
    assert model.intervals is None and "the solver failed" in model.notes[-1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": 7}, "layout 7, this version reads 1"),
        ({"standard": []}, "not those of its robot"),
        ({"standard": [{"name": "xx1", "value": None}]}, r"standard\.0\.value = None"),
        ({"robot_description": None}, "robot_description = None"),
        ({"identification": {}}, r"identification\.file"),
    ],
)
def test_damaged_consistent_file_is_named(tmp_path, free, change, message):
    with_stage(tmp_path, free)
    path = tmp_path / "consistent.json"
    path.write_text(json.dumps(json.loads(path.read_text("utf-8")) | change))
    with pytest.raises(IdentificationFileError, match=message) as caught:
        stored_model(path)
    assert caught.value.file == str(path)


@pytest.mark.parametrize(
    "text",
    ["", "no JSON", "[]", '{"schema": 0, "standard": []}', '{"identification": {"sha256": 3}}'],
)
def test_what_is_no_file_of_this_estimate_is_left_alone_and_said(tmp_path, free, text):
    save_identification(free, tmp_path)
    (tmp_path / "consistent.json").write_text(text)
    model, files = stored_model(tmp_path)
    assert [file.name for file in files] == ["identification.json"] and model.consistent
    assert "consistent.json" in model.notes[-1] and "was not used" in model.notes[-1]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("m2", -3.0, r"forearm.*\(-3 kg\)"),
        ("zz2", 0.0, "forearm"),
        ("fv1", -0.5, "fv1 = -0.5 N m s/rad is negative"),
        ("ia2", -0.1, "ia2 = -0.1 kg m² is negative"),
    ],
)
def test_values_of_no_machine_are_not_called_consistent(tmp_path, free, name, value, message):
    with_stage(tmp_path, free)
    path = tmp_path / "consistent.json"
    content = json.loads(path.read_text("utf-8"))
    (entry,) = [entry for entry in content["standard"] if entry["name"] == name]
    entry["value"] = value
    path.write_text(json.dumps(content))
    for place in (path, tmp_path):
        with pytest.raises(IdentificationFileError, match=message):
            stored_model(place)


def test_coupled_motors_that_would_feed_energy_in_are_seen():
    model = runnable_model(load_robot("staubli_tx40"))
    bodies = {p.name: v for p, v in zip(model.parameters, model.values, strict=True)}
    for i in range(1, 7):
        ten = from_center_of_mass(1.0, np.array([0.1, 0.0, 0.2]), np.eye(3))
        bodies |= {f"{stem}{i}": v for stem, v in zip(INERTIAL, ten.tolist(), strict=True)}

    def with_coupling(share):
        product = share * np.sqrt(bodies["fv5"] * bodies["fv6"])
        values = [bodies[p.name] if p.stem != "fvm" else product for p in model.parameters]
        return impossible_value(replace(model, values=np.array(values)))

    assert with_coupling(0.99) == ""
    assert "viscous friction of the coupled joints" in with_coupling(1.01)
