"""The stage: lift of consistent estimates, left out parameters, reports, refusals."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.foundation.errors import (
    ContradictoryBounds,
    ExperimentError,
    IdentificationError,
    NoConsistentModelNear,
    RobotDescriptionError,
)
from pivident.models.consistency import nearest_consistent
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.constraints import Bounds, make_constraints
from pivident.models.consistency.metric import full_covariance, is_far, make_metric
from pivident.models.consistency.pseudo_inertia import from_triangle
from pivident.models.consistency.reference import make_reference
from pivident.robot.gallery import load_robot
from pivident.robot.inertia import from_center_of_mass
from tests.load_scenario import tx40_with_load
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


def test_a_solver_that_cannot_stay_at_distance_zero_makes_no_estimate_impossible(monkeypatch):
    """On some processors the prior's choice at distance zero ends with too little progress."""
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=1e-4)
    free = replace(
        free, judged=None, theta=np.where(np.array(free.names) == "iam6", 1e-3, free.theta)
    )
    exactly = nearest_consistent._kept
    monkeypatch.setattr(
        nearest_consistent,
        "_kept",
        lambda *given: replace(exactly(*given), status="NumericalError"),
    )
    model = make_consistent(free)
    assert model.was_consistent
    assert model.least_distance < nearest_consistent.CONSISTENT
    assert 0.0 < model.distance <= 0.21  # a tenth of the half width of an interval
    assert model.torque_cost < 1e-3 or np.isnan(model.torque_cost)


def test_a_consistent_estimate_is_lifted_and_keeps_its_torques():
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=1e-4)
    free = replace(
        free, judged=None, theta=np.where(np.array(free.names) == "iam6", 1e-3, free.theta)
    )
    before = free.theta.copy()
    model = make_consistent(free)
    assert model.was_consistent
    assert model.least_distance == 0.0
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
        ({"bounds": Bounds(mass={"forarm": (1.0, 2.0)})}, RobotDescriptionError, "forearm"),
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
    with pytest.raises(IdentificationError, match="no finite standard error"):
        make_consistent(replace(free, covariance=np.full_like(free.covariance, np.nan)))


def test_a_robot_without_nominal_values_gets_plain_bodies():
    free = synthetic_identification()
    bare = replace(
        free.robot,
        links=tuple(replace(link, inertia=np.zeros(10)) for link in free.robot.links),
        rotor_inertia=np.zeros(2),
    )
    model = make_consistent(replace(free, robot=bare))
    assert any("No nominal inertia of" in note for note in model.notes)
    assert all(body.mass > 0.0 for body in model.links)
    assert model.least_distance < 1.0


def test_everything_is_said_in_words_and_values():
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=0.02, seed=0)
    model = make_consistent(free, accept_far=True)
    text = str(model)
    for part in ("least distance", "mass [kg]", "link_5", "moved [σ]", "Held back by"):
        assert part in text
    values = json.loads(json.dumps(model.to_values(), allow_nan=False))
    assert values["method"] == "PC-IDIM-PIV"
    assert len(values["standard"]) == len(model.parameters)
    assert model.link("joint_3").mass == model.link("link_3").mass
    with pytest.raises(RobotDescriptionError, match="link_3"):
        model.link("link_33")


def test_prismatic_joints():
    free = synthetic_identification(robot_name="emps", relative_std=0.01)
    model = make_consistent(free)
    assert model.links[0].mass + model.value("ia1") == pytest.approx(free.value("m1"))


@pytest.mark.parametrize("apart", [0.0, 0.04, 0.3])
def test_a_thin_flange_is_real_wherever_the_reference_has_its_centre_of_mass(apart):
    """A plate of 80 x 80 x 10 mm; CAD has its centre elsewhere."""
    mass, width, thick = 0.5, 0.08, 0.01
    across, along = mass * (width**2 + thick**2) / 12.0, mass * width**2 / 6.0
    inertia = np.diag([across, across, along])
    free = synthetic_identification(relative_std=1e-4)
    flange, cad = (
        replace(free.robot.links[1], inertia=from_center_of_mass(mass, center, inertia))
        for center in (np.zeros(3), np.array([0.0, 0.0, apart]))
    )
    upper = free.robot.links[0]
    truth, reference = (replace(free.robot, links=(upper, own)) for own in (flange, cad))
    base = base_parameters(truth)
    values = nominal_values(truth, base.standard)
    exact = replace(free, robot=truth, judged=None, theta=base.values(values), recordings=())
    # what is open is said: then a plate in its true place is the only body there is
    bounds = Bounds(
        mass={"forearm": (0.499, 0.501)},
        center_of_mass={"forearm": ((-1e-3, 1e-3), (-1e-3, 1e-3), (-1e-3, 1e-3))},
    )
    model = make_consistent(exact, reference=reference, bounds=bounds)
    assert model.was_consistent
    conditions = make_constraints(
        truth, base.standard, make_reference(truth, base.standard, 0.01, reference)
    )
    for c in conditions:
        value = c.matrix @ values + c.offset
        if c.cone == "semidefinite":
            value = np.linalg.eigvalsh(from_triangle(value, c.order))
        assert value.min() >= 0.0, (c.subject, c.kind)


def test_both_distances_are_what_they_say():
    """The least one over points that a machine can have; the other that of the values."""
    free = simulated(essential=True)
    bounds = Bounds(center_of_mass={"link_4": ((0.2, 0.3), (-1.0, 1.0), (-1.0, 1.0))})
    model = make_consistent(free, bounds=bounds, accept_far=True)
    base = base_parameters(free.robot)
    metric = make_metric(free, base, model.sums, reference_scales(free, base))
    x = np.linalg.solve(metric.root, base.values(model.values) - metric.center)
    assert model.distance == pytest.approx(np.linalg.norm(x), rel=1e-6)
    assert 0.0 < model.least_distance <= model.distance
    assert model.distance**2 <= model.least_distance**2 * (1.0 + 1e-4) + 1.96**2 + 1e-3
    values = model.to_values()
    assert values["least_distance"] == model.least_distance
    assert values["distance"] == model.distance
    assert values["base"][0]["moved"] == pytest.approx((model.theta - free.theta)[0] / free.std[0])


def reference_scales(free, base):
    return make_reference(free.robot, base.standard, 0.01).scales[base.kept]


@pytest.mark.parametrize("case", ["not finite", "same", "zero"])
def test_a_formula_covariance_that_tells_nothing_is_named(case):
    free = synthetic_identification()
    formula = free.formula_covariance.copy()
    names = free.names
    if case == "not finite":
        formula[2, :] = formula[:, 2] = np.nan
        expected = {names[2]}
    elif case == "zero":
        formula[3, 3] = 0.0
        expected = {names[3]}
    else:  # two parameters that only come together
        formula[1, 1] = formula[4, 4] = formula[1, 4] = formula[4, 1] = 1e-4
        expected = {names[1], names[4]}
    with pytest.raises(IdentificationError, match="identify without") as caught:
        make_consistent(replace(free, formula_covariance=formula))
    assert any(f"weakest parameter is {name};" in str(caught.value) for name in expected)


def test_a_singular_covariance_of_the_method_takes_the_correlations_of_the_formula():
    free = synthetic_identification()
    poor = replace(free, covariance=np.outer(free.std, free.std))
    assert full_covariance(poor)[1]
    make_consistent(poor)


def test_rotors_that_nobody_described_are_not_taken_for_links():
    """A URDF has no rotors: what joint 1 carries beyond the links is its rotor, not a heavy arm."""
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=1e-3)
    robot = free.robot
    bare = replace(robot, rotor_inertia=np.zeros(robot.size))
    heavy = np.array([1.0 if name == "zz1r" else 0.0 for name in free.names])
    model = make_consistent(replace(free, robot=bare, judged=None, theta=free.theta + 3.0 * heavy))
    nominal = np.array([link.inertia[9] for link in robot.links])
    masses = np.array([body.mass for body in model.links])
    assert np.abs(masses / nominal - 1.0).max() < 0.3
    assert 2.0 < model.value("ia1") < 4.5
    assert any("No rotor inertia of" in note for note in model.notes)


def test_being_better_than_nonsense_is_no_good():
    assert is_far(p_value=1e-9, free=0.8, consistent=0.3)
    assert not is_far(p_value=0.5, free=0.8, consistent=0.3)
    assert not is_far(p_value=1e-9, free=0.06, consistent=0.05)


def test_signs_that_no_machine_has_are_told_without_bounds():
    free = synthetic_identification(relative_std=1e-3)
    wrong = np.where(np.char.startswith(free.names, "zz"), -50.0, free.theta)
    with pytest.raises(IdentificationError, match=r"too far from any machine|--accept-far"):
        make_consistent(replace(free, judged=None, theta=wrong, torque_sums=None))
