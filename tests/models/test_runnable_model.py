from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identification_file import save_identification
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import ExportError
from pivident.foundation.text.finding import Finding
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.exported import Verification, compared, random_states
from pivident.models.runnable_model import RunnableModel, runnable_model
from pivident.robot.gallery import load_robot
from pivident.robot.inertia import from_center_of_mass
from tests.synthetic_identification import synthetic_identification


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40"])
def test_lifted_estimate_has_its_torques_and_a_mass_on_every_link(robot):
    free = synthetic_identification(robot_name=robot)
    model = runnable_model(free)
    states = random_states(free.robot)
    np.testing.assert_allclose(model.torque(*states), free.predict(*states), rtol=0, atol=1e-10)
    assert all(model.link(i).mass > 0.0 for i in range(free.robot.size))
    assert not model.consistent and model.estimate is free
    assert model.origin.method == "IDIM-PIV" and model.origin.sources == free.sources
    assert "not determined" in model.notes[0]


def test_consistent_model_keeps_its_values_and_intervals():
    found = make_consistent(synthetic_identification())
    model = runnable_model(found, identification="ab", intervals=True)
    assert model.consistent and model.origin.method == "PC-IDIM-PIV"
    assert model.origin.identification == "ab"
    np.testing.assert_array_equal(model.values, found.values)
    np.testing.assert_allclose(model.base_values, found.base_values)
    # a profile interval contains its point, up to the solver's accuracy
    low, high = model.intervals.T
    slack = 1e-3 * np.maximum(np.abs(model.values), 0.1)
    assert (low <= model.values + slack).all() and (model.values <= high + slack).all()


def test_a_scale_that_is_an_assumption_is_said_with_every_model(tmp_path):
    """Also of an estimate that was loaded, whose recordings are not there."""
    said = "the scale to N m is an assumption"
    warning = Finding("warning", "torque scale", "assumed", said)
    free = replace(synthetic_identification(), warnings=(warning,))
    save_identification(free, tmp_path / "identification.json")
    for one in (free, load_identification(tmp_path / "identification.json")):
        assert said in runnable_model(one).notes
        assert said in runnable_model(make_consistent(one)).notes


def test_a_loaded_identification_is_as_good(tmp_path):
    free = synthetic_identification()
    save_identification(free, tmp_path)
    loaded = make_consistent(load_identification(tmp_path))
    states = random_states(free.robot)
    here = runnable_model(make_consistent(free)).torque(*states)
    np.testing.assert_allclose(runnable_model(loaded).torque(*states), here, atol=1e-9)


def test_nominal_model_is_the_description():
    robot = load_robot("planar_2r")
    model = runnable_model(robot)
    body = model.link(0)
    again = from_center_of_mass(body.mass, body.center_of_mass, body.inertia)
    np.testing.assert_allclose(again, robot.links[0].inertia, atol=1e-15)
    moments, axes = body.principal
    assert np.linalg.det(axes) > 0.0 and (np.diff(moments) >= 0.0).all()
    np.testing.assert_allclose(axes @ np.diag(moments) @ axes.T, body.inertia, atol=1e-15)


def test_values_that_cannot_be_are_refused():
    model = runnable_model(load_robot("planar_2r"))
    values = model.values.copy()
    values[3] = np.nan
    with pytest.raises(ExportError, match="value of yy1 is not finite"):
        RunnableModel(model.robot, model.parameters, values, False, model.origin)
    with pytest.raises(ExportError, match="give one value for each"):
        RunnableModel(model.robot, model.parameters, values[:3], False, model.origin)
    with pytest.raises(ExportError, match="type str"):
        runnable_model("identification.json")


def test_comparison_finds_a_difference_of_one_part_in_a_million():
    model = runnable_model(synthetic_identification())
    same = compared("us", model.robot, model.torque, model.torque)
    assert same.agrees and same.largest == 0.0
    off = compared("us", model.robot, model.torque, lambda *s: model.torque(*s) * (1 + 1e-6))
    assert not off.agrees and off.relative == pytest.approx(1e-6, rel=1e-6)
    nan = compared("us", model.robot, model.torque, lambda *s: model.torque(*s) * np.nan)
    assert not nan.agrees


def test_what_was_skipped_agrees_with_nothing():
    skipped = Verification("C", skipped="no compiler")
    assert not skipped.agrees and str(skipped) == "Not loaded back: no compiler"


def test_states_stay_within_limits_and_rated_speeds():
    robot = load_robot("staubli_tx40")
    q, dq, _ = random_states(robot)
    limits = np.array([j.position_limits for j in robot.joints])
    assert (q >= limits[:, 0]).all() and (q <= limits[:, 1]).all()
    assert (np.abs(dq) <= robot.rated_speeds).all()
