"""The stage: lift of consistent estimates, left out parameters, reports, refusals."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.consistency import Bounds, make_consistent
from pivident.consistency.metric import full_covariance
from pivident.dynamics.base_parameters import base_parameters
from pivident.errors import (
    ContradictoryBounds,
    ExperimentError,
    IdentificationError,
    NoConsistentModelNear,
)
from pivident.estimation.identify import identify
from pivident.robot import load_robot
from pivident.simulation.load_scenario import tx40_with_load
from pivident.simulation.scenarios import TX40_ESSENTIAL
from tests.synthetic_identification import synthetic_identification


@cache
def simulated(essential=False):
    """Least squares on a simulated TX40 with CAD inertias."""
    problem = tx40_with_load(seed=1, samples=6000).problem
    if essential:
        problem = replace(problem, parameters=tuple(TX40_ESSENTIAL))
    return identify(problem, "iv-full-rate")


def states(robot, count=60):
    return np.random.default_rng(5).uniform(-2.0, 2.0, (3, count, robot.size))


def test_a_consistent_estimate_is_lifted_and_keeps_its_torques():
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=1e-4)
    free = replace(free, theta=np.where(np.array(free.names) == "iam6", 1e-3, free.theta))
    before = free.theta.copy()
    model = make_consistent(free)
    assert model.was_consistent
    assert model.distance == 0.0
    assert model.p_value == 1.0
    assert not model.active
    assert np.array_equal(free.theta, before)
    assert model.free is free
    motion = states(free.robot)
    torque = free.predict(*motion)
    assert np.abs(model.predict(*motion) - torque).max() < 1e-10 * np.abs(torque).max()
    assert all(body.mass > 0.004 for body in model.links)
    assert np.abs(model.moved).max() < 1e-8


def test_true_bodies_are_found_again_where_the_prior_is_the_truth():
    """With exact base parameters and CAD values as reference nothing else is as near."""
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=1e-9)
    model = make_consistent(free)
    for link, body in zip(free.robot.links, model.links, strict=True):
        assert body.mass == pytest.approx(link.inertia[9], rel=2e-3)


def test_a_simulated_record_with_true_bodies():
    free = simulated()
    model = make_consistent(free)
    assert model.torque_error <= 1.01 * model.torque_error_free
    assert model.p_value > 1e-3
    # the torque sums say what the signals say
    predicted = np.concatenate([r.tau_model for r in free.recordings])
    motion = [np.concatenate([getattr(r, x) for r in free.recordings]) for x in ("q", "dq", "ddq")]
    assert model.predict(*motion) == pytest.approx(predicted, abs=0.2)


def test_left_out_parameters_are_near_zero_and_what_they_add_is_made_up_for():
    free = simulated(essential=True)
    model = make_consistent(free)
    base = base_parameters(free.robot)
    assert model.names == free.names
    values = dict(zip(base.names, model.base_values, strict=True))
    assert [values[n] for n in model.names] == pytest.approx(model.theta.tolist())
    assert model.torque_error <= 1.01 * model.torque_error_free
    without = make_consistent(replace(free, recordings=()))
    assert any("torque sums" in note for note in without.notes)
    assert np.isnan(without.torque_error)


def test_sums_from_a_file_give_the_same_model_as_signals():
    free = simulated(essential=True)
    model = make_consistent(free)
    read = replace(free, recordings=(), equations=None, torque_sums=model.sums)
    again = make_consistent(read)
    assert again.values == pytest.approx(model.values, rel=1e-9, abs=1e-12)
    assert again.torque_error == pytest.approx(model.torque_error)


def test_a_covariance_of_few_windows_gets_the_correlations_of_the_formula():
    free = synthetic_identification()
    windows = np.random.default_rng(0).normal(size=(3, free.theta.size)) * free.std
    poor = replace(free, covariance=windows.T @ windows)
    covariance, mixed = full_covariance(poor)
    assert mixed
    assert np.diag(covariance) == pytest.approx(np.diag(poor.covariance))
    assert full_covariance(free) == (pytest.approx(free.covariance), False)
    assert any("few windows" in note for note in make_consistent(poor).notes)


def test_an_estimate_that_is_nowhere_near_a_machine():
    """The sign of joint 2 is wrong in the log: a negative rotor cannot be explained away."""
    problem = tx40_with_load(seed=1, samples=6000).problem
    (recording,) = problem.recordings
    tau = recording.tau * np.where(np.arange(6) == 1, -1.0, 1.0)
    wrong = replace(problem, recordings=(replace(recording, tau=tau),))
    free = identify(wrong, "ls")
    with pytest.raises(NoConsistentModelNear, match="pivident audit") as caught:
        make_consistent(free)
    assert caught.value.distance > 10.0
    assert caught.value.error_consistent > 1.1 * caught.value.error_free
    assert {"link_2", "joint_2", "link_3"} & set(caught.value.at_fault)
    model = make_consistent(free, accept_far=True)
    assert model.values == pytest.approx(caught.value.model.values, abs=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"prior": "entropy"}, ExperimentError, "entropic"),
        ({"margin": -1.0}, ExperimentError, "margin"),
        ({"room": 0.0}, ExperimentError, "room"),
        ({"bounds": Bounds(mass={"forarm": (1.0, 2.0)})}, ExperimentError, "forearm"),
        ({"bounds": Bounds(mass={"forearm": (2.0, 1.0)})}, ExperimentError, "interval"),
        ({"bounds": Bounds(mass={"forearm": (None, "x")})}, ExperimentError, "interval"),
        ({"bounds": Bounds(mass={"forearm": (None, -1.0)})}, ContradictoryBounds, "forearm: mass"),
        (
            {"bounds": Bounds(mass={"forearm": (3.0, None)}, total_mass=(None, 2.0))},
            ContradictoryBounds,
            "total mass at most 2 kg",
        ),
        ({"bounds": Bounds(center_of_mass={"forearm": ((0, 1),)})}, ExperimentError, "three"),
        (
            {"bounds": Bounds(ellipsoid={"forearm": ((0, 0, 0), (1, 1, 0))})},
            ExperimentError,
            "axes",
        ),
        ({"reference": np.ones(3)}, ExperimentError, "standard parameters"),
        ({"reference": load_robot("emps")}, ExperimentError, "same arm"),
    ],
)
def test_refusals_say_what_is_wrong(options, error, says):
    with pytest.raises(error, match=says):
        make_consistent(synthetic_identification(), **options)


def test_no_deviations_no_metric():
    free = synthetic_identification()
    with pytest.raises(IdentificationError, match="no finite deviation"):
        make_consistent(replace(free, covariance=np.full_like(free.covariance, np.nan)))


def test_a_robot_without_nominal_values_gets_plain_bodies():
    free = synthetic_identification()
    bare = replace(
        free.robot,
        links=tuple(replace(link, inertia=np.zeros(10)) for link in free.robot.links),
        rotor_inertia=np.zeros(2),
    )
    model = make_consistent(replace(free, robot=bare))
    assert any("No inertia is known of" in note for note in model.notes)
    assert all(body.mass > 0.0 for body in model.links)
    assert model.distance < 1.0


def test_everything_is_said_in_words_and_values():
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=0.02, seed=0)
    model = make_consistent(free, accept_far=True)
    text = str(model)
    for part in ("σ away", "mass [kg]", "link_5", "moved [σ]", "Held back by"):
        assert part in text
    values = json.loads(json.dumps(model.to_values(), allow_nan=False))
    assert values["method"] == "PC-IDIM-PIV"
    assert len(values["standard"]) == len(model.parameters)
    assert model.link("joint_3").mass == model.link("link_3").mass
    with pytest.raises(KeyError, match="link_3"):
        model.link("link_33")


def test_prismatic_joints():
    free = synthetic_identification(robot_name="emps", relative_std=0.01)
    model = make_consistent(free)
    assert model.links[0].mass + model.value("ia1") == pytest.approx(free.value("m1"))
