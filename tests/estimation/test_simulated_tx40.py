"""All methods on simulated TX40 records whose truth is known."""

import dataclasses
import json
from functools import cache

import numpy as np
import pytest
from benchmarks.torque_bound import bound, columns

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import build_regression, identify
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Arma
from pivident.estimation.methods import METHODS
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL, tx40_fine, tx40_scenario
from pivident.foundation.errors import IdentificationError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot


def truth_of(problem, truth):
    return np.array([truth[p.name] for p in problem.regressor.parameters])


@cache
def piv_of(scenario, seed):
    """Estimate by PIV and true parameters of a record of 28 parameters."""
    problem, truth = tx40_scenario(scenario, seed)
    return identify(problem, "piv"), truth_of(problem, truth)


@pytest.fixture(scope="module")
def fine():
    problem, truth = tx40_fine(seed=3)
    return problem, truth_of(problem, truth)


@pytest.fixture(scope="module")
def results(fine):
    names = ("iv-full-rate", "piv", "piv-as-printed")
    return {name: identify(fine[0], name) for name in names}


def test_piv_finds_the_truth_within_its_intervals(fine, results):
    _, truth = fine
    found = results["piv"]
    assert found.converged and found.iterations <= 5
    assert np.abs((found.theta - truth) / found.std).max() < 3.5
    assert np.median(np.abs(found.theta / truth - 1.0)) < 3e-4


def test_methods_rank_as_the_theory_says(fine, results):
    _, truth = fine
    ends = Bandpass(edge=100)  # as in the literature: one period of the cut-off
    results = results | {
        "ls": identify(fine[0], LeastSquares(signals=ends)),
        "iv": identify(fine[0], InstrumentalVariables(signals=ends)),
    }
    error = {name: np.median(np.abs(r.theta / truth - 1)) for name, r in results.items()}
    assert error["ls"] > error["iv"] > error["piv-as-printed"] > error["iv-full-rate"]
    assert error["piv"] < 1.2 * error["iv-full-rate"]
    # the prefilter's merit is the interval: the i.i.d. one of full-rate IV is far too wide
    wide = results["iv-full-rate"].method_std / results["piv"].method_std
    assert np.exp(np.mean(np.log(wide))) > 2.5
    # and as printed, with standstill, it is far too narrow
    printed = identify(dataclasses.replace(fine[0], mask=None), "piv-as-printed")
    assert np.mean(np.abs(printed.theta - truth) > 2 * printed.method_std) > 0.3


def test_dropping_the_ends_of_the_filters_improves_least_squares_several_times(fine):
    problem, truth = fine
    short = identify(problem, LeastSquares(signals=Bandpass(edge=100)))
    default = identify(problem, LeastSquares())
    error = [np.median(np.abs(r.theta / truth - 1)) for r in (short, default)]
    assert error[1] < 0.25 * error[0]


@pytest.mark.parametrize(("scenario", "precision"), [("fine", 1.5e-4), ("loop", 3e-6)])
def test_two_sigma_intervals_cover_the_truth(scenario, precision):
    # short version of benchmarks/statistical_truth.py: four records of 28 parameters
    error, std = [], []
    for seed in range(4):
        found, truth = piv_of(scenario, seed)
        error.append(found.theta - truth)
        std.append(found.std)
    error, std = np.abs(error), np.array(std)
    assert np.mean(error < 2 * std) >= 0.90
    assert 0.7 < np.sqrt(np.mean((error / std) ** 2)) < 1.3
    assert np.median(error / np.abs(truth)) < precision


def test_standstill_is_used_where_it_is_worth_it():
    """With the applied torque logged, friction at standstill is all that disturbs."""
    for scenario, joints in (("fine", range(3, 6)), ("loop", ())):
        found, _ = piv_of(scenario, 0)
        used = [j for j, joint in enumerate(found.joints) if joint.masked < 0.1]
        assert set(used) >= set(joints) and bool(used) == bool(joints)


def test_one_record_is_treated_as_another():
    """A coarse encoder's rounding is not stationary: the windows count, with wider intervals."""
    errors = []
    for seed in range(3):
        found, truth = piv_of("coarse", seed)
        errors.append(np.abs(found.theta - truth) / found.std)
    assert np.mean(np.array(errors) < 2.0) > 0.9
    problem, _ = tx40_scenario("coarse", 0)
    stationary = identify(problem, PrefilteredIV(covariance="stationary"))
    assert np.exp(np.mean(np.log(piv_of("coarse", 0)[0].std / stationary.std))) > 1.1


def test_columns_of_the_bound_are_those_of_the_regressor():
    problem, _ = tx40_scenario("fine", 0, 3000)
    rng = np.random.default_rng(0)
    motion = tuple(rng.uniform(-1.5, 1.5, (3, 20, 6)))
    names = tuple(p.name for p in problem.regressor.parameters)
    expected = problem.regressor.matrix(*motion)
    np.testing.assert_allclose(columns(names, *motion), expected, atol=1e-12)


def test_piv_is_as_precise_as_the_torque_equations_allow():
    # short version of benchmarks/statistical_truth.py
    names, least = bound("fine")
    found, _ = piv_of("fine", 0)
    assert found.names == tuple(f"{n}r" for n in names) or len(found.names) == len(names)
    assert 0.9 < np.exp(np.mean(np.log(found.std / least))) < 1.1


@pytest.mark.parametrize("name", ["iv", "iv-full-rate", "piv", "didim"])
def test_a_robot_without_rotors_starts_from_least_squares(name):
    problem, truth = tx40_scenario("fine", 0)
    bare = dataclasses.replace(problem.robot, rotor_inertia=np.zeros(6))
    found = identify(dataclasses.replace(problem, robot=bare, initial={}), name)
    assert found.converged
    assert np.median(np.abs(found.theta / truth_of(problem, truth) - 1.0)) < 5e-3


def test_all_rows_vote_when_the_user_wants_them_all():
    problem = dataclasses.replace(tx40_scenario("loop", 0)[0], mask=None)
    found = identify(problem, "piv")
    assert max(joint.masked for joint in found.joints) < 0.03


def test_results_do_not_depend_on_the_block_size(fine, results, monkeypatch):
    from pivident.estimation import full_rate

    monkeypatch.setattr(full_rate, "BLOCK", 1000)
    again = identify(fine[0], "piv")
    assert np.allclose(again.theta, results["piv"].theta, rtol=1e-8)
    assert np.allclose(again.std, results["piv"].std, rtol=1e-8)


def test_two_halves_as_two_recordings_agree_with_the_whole(fine, results):
    problem, _ = fine
    whole = problem.recordings[0]
    halves = (whole.part(0, 17000), whole.part(17000, whole.samples))
    split = Problem(
        problem.robot, halves, problem.loop, problem.parameters, initial=problem.initial
    )
    found = identify(split, "piv")
    assert found.converged
    assert np.abs((found.theta - results["piv"].theta) / results["piv"].std).max() < 2.0


def test_build_regression_gives_the_equation_that_ls_solves(fine):
    problem, truth = fine
    phi, tau = build_regression(problem)
    assert phi.shape == (*tau.shape, len(truth))
    flat = phi.reshape(-1, len(truth))
    theta = np.linalg.lstsq(flat, tau.ravel(), rcond=None)[0]
    assert np.median(np.abs(theta / truth - 1)) < 1e-2


def test_an_identification_predicts_torque(fine, results):
    problem, truth = fine
    found = results["piv"]
    recording = problem.recordings[0]
    q, dq, ddq = recording.q_ref[::50], recording.dq_ref[::50], recording.ddq_ref[::50]
    exact = problem.regressor.torque(q, dq, ddq, truth)
    assert np.abs(found.predict(q, dq, ddq) - exact).max() < 2e-3 * np.abs(exact).max()
    assert found.value("zz1") == found.value("zz1r")
    with pytest.raises(KeyError, match="zz1r"):
        found.value("nonsense")


@pytest.mark.record
def test_the_independent_reference_record(reference_dir):
    data = np.load(reference_dir / "tx40_simulated_record.npz")
    about = json.loads((reference_dir / "tx40_simulated_record.json").read_text())
    truth = {name.lower(): value for name, value in about["parameters"].items()}
    robot = load_robot("staubli_tx40")
    recording = Recording(
        "reference", robot.joint_names, data["q"], data["tau"], about["rate_hz"],
        q_ref=data["q_ref"], dq_ref=data["dq_ref"],
    )  # fmt: skip
    start = {n: 0.0 if n.startswith("f") else 1.1 * v for n, v in truth.items()}
    problem = Problem(
        robot, (recording,), Loop(PD(data["kp"], data["kd"])), tuple(TX40_ESSENTIAL), initial=start
    )
    found = identify(problem, METHODS["piv"])
    expected = truth_of(problem, truth)
    assert found.converged and found.iterations <= 5
    assert np.abs((found.theta - expected) / found.std).max() < 3.5
    assert np.median(np.abs(found.theta / expected - 1)) <= 3e-4


def test_gains_too_soft_for_their_inverse_are_named(fine):
    problem, _ = fine
    gains = np.full(6, 1e4), np.full(6, 3e4)  # kd/kp = 3 s
    soft = dataclasses.replace(problem, loop=Loop(PD(*gains)))
    with pytest.raises(IdentificationError, match=r"joint_1.*takes \d+ s to forget.*direct"):
        identify(soft, "piv")


def test_arma_noise_does_as_well_as_ar(fine):
    whole, truth = fine
    half = (whole.recordings[0].part(0, 17000),)
    problem = dataclasses.replace(whole, recordings=half)
    found, by_ar = (identify(problem, own) for own in (PrefilteredIV(noise=Arma(8, 4)), "piv"))
    assert found.converged
    for (
        joint
    ) in found.joints:  # an iteration that does not converge falls back to AR, with a warning
        warned = any(
            repr(joint.name) in w.message and "did not converge" in w.message
            for w in found.warnings
        )
        assert joint.ar_order == 12 or warned
    assert sum(j.ar_order == 12 for j in found.joints) >= 3
    assert np.abs((found.theta - truth) / found.std).max() < 4
    assert np.median(np.abs(found.theta - by_ar.theta) / by_ar.std) < 0.5


def test_a_motion_that_hardly_separates_parameters_is_named(fine):
    problem, _ = fine
    short = dataclasses.replace(problem, recordings=(problem.recordings[0].part(0, 6000),))
    found = identify(short, "ls")
    text = next(w.advised for w in found.warnings if "hardly separates" in w.message)
    assert "second, different motion" in text and found.condition > 200
