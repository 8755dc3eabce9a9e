import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.consistency.consistent_model import ConsistentModel, make_consistent
from pivident.consistency.options import ConsistencyOptions
from pivident.errors import IdentificationError, IdentificationFileError, NoConsistentModelNear
from pivident.estimation.export import save_identification
from pivident.export.exported import random_states
from pivident.export.runnable_model import runnable_model
from pivident.export.stored_model import stored_model
from pivident.validation.consistent_estimate import consistent_estimate
from pivident.validation.consistent_files import write_consistent
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
    other = replace(free, theta=free.theta * 1.01)
    save_identification(other, tmp_path)
    model, files = stored_model(tmp_path)
    assert len(files) == 1
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
    heavy = replace(free, theta=-5.0 * free.theta)
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
