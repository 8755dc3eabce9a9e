import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.foundation.errors import IdentificationFileError
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.model_json import read_model, to_json, verify_json
from pivident.models.runnable_model import runnable_model
from pivident.robot.gallery import load_robot
from tests.robot.random_robots import random_robot
from tests.synthetic_identification import synthetic_identification


def random_model(seed):
    model = runnable_model(random_robot(seed))
    rng = np.random.default_rng(seed)
    return replace(model, values=rng.uniform(0.1, 0.9, model.values.size))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_masses_and_inertias_in_the_file_make_the_torques(seed):
    model = random_model(seed)
    check = verify_json(to_json(model), model)
    assert check.agrees, str(check)


def test_model_comes_back_exactly(tmp_path):
    model = runnable_model(make_consistent(synthetic_identification()), identification="ab")
    (tmp_path / "model.json").write_bytes(to_json(model).content)
    loaded = read_model(tmp_path / "model.json")
    np.testing.assert_array_equal(loaded.values, model.values)
    assert loaded.origin == model.origin and loaded.consistent and loaded.notes == model.notes
    q = np.random.default_rng(0).normal(size=(3, 10, 2))
    np.testing.assert_array_equal(loaded.torque(*q), model.torque(*q))


def test_content_has_units_intervals_and_groups():
    found = make_consistent(synthetic_identification())
    model = runnable_model(found, intervals=True)
    content = json.loads(to_json(model).content)
    assert content["origin"]["method"] == "PC-IDIM-PIV"
    assert content["units"]["inertia"] == "kg m²"
    by_name = {p["name"]: p for p in content["parameters"]}
    assert by_name["fv1"]["unit"] == "N m s/rad" and by_name["fv1"]["joint"] == "shoulder"
    low, high = by_name["fv1"]["interval"]
    assert low < by_name["fv1"]["value"] < high
    # nothing tells how heavy the first link is: no highest mass
    assert by_name["m1"]["interval"][1] is None
    base = {p["name"]: p for p in content["base_parameters"]}
    assert base["zz1r"]["group"].startswith("zz1 + ")
    assert base["zz1r"]["interval"][0] < base["zz1r"]["estimate"] < base["zz1r"]["interval"][1]
    assert content["robot"]["joints"][0]["friction"][0]["function"] == "viscous"
    link = content["links"][0]
    np.testing.assert_allclose(
        np.multiply(link["center_of_mass"], link["mass"]), link["first_moments"]
    )


def test_link_without_mass_has_no_centre():
    model = runnable_model(load_robot("planar_2r"))
    massless = np.where([p.name == "m2" for p in model.parameters], 0.0, model.values)
    model = replace(model, values=massless)
    first, second = json.loads(to_json(model).content)["links"]
    assert first["center_of_mass"] is not None and second["center_of_mass"] is None
    assert second["first_moments"][0] != 0.0
    assert verify_json(to_json(model), model).agrees


ORIGIN = {"method": "m", "version": "", "sources": {}, "identification": ""}


def test_a_changed_number_is_seen(tmp_path):
    content = json.loads(to_json(runnable_model(load_robot("planar_2r"))).content)
    (entry,) = [p for p in content["parameters"] if p["name"] == "m2"]
    entry["value"] = 1e9
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content))
    with pytest.raises(IdentificationFileError, match=r"parameter m2 is 1000000000\.0 in"):
        read_model(path)


def test_a_model_that_calls_itself_consistent_must_be(tmp_path):
    model = runnable_model(make_consistent(synthetic_identification()))
    values = np.where([p.name == "m2" for p in model.parameters], -3.0, model.values)
    path = tmp_path / "model.json"
    path.write_bytes(to_json(replace(model, values=values)).content)
    with pytest.raises(IdentificationFileError, match=r"no body .* 'forearm' \(-3 kg\)"):
        read_model(path)
    path.write_bytes(to_json(replace(model, values=values, consistent=False)).content)
    np.testing.assert_array_equal(read_model(path).values, values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "other"}, "is no model: its format is 'other'"),
        ({"schema": 9}, "layout 9, this version reads 1; install a newer"),
        ({"robot": {}}, "field required"),
        ({"origin": {"who": 1}}, r"origin\.method: field required"),
        ({"origin": ORIGIN | {"sources": [1]}}, r"origin\.sources = \[1\]"),
        ({"origin": ORIGIN | {"method": 5}}, r"origin\.method = 5: must be a valid string"),
        ({"origin": [1]}, r"origin = \[1\]"),
        ({"notes": 3}, "notes = 3"),
        ({"consistent": "no"}, "consistent = 'no'"),
        ({"parameters": []}, "the parameter xx1 is None in 'parameters'"),
    ],
)
def test_damaged_model_is_refused(tmp_path, change, message):
    content = json.loads(to_json(runnable_model(load_robot("planar_2r"))).content)
    (tmp_path / "model.json").write_text(json.dumps(content | change))
    with pytest.raises(IdentificationFileError, match=message):
        read_model(tmp_path / "model.json")
