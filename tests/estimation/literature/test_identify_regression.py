"""Regressions as methods of ``identify``, on a record and from an experiment file."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identification_file import to_dict
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.literature.frequency_domain import FrequencyDomain
from pivident.estimation.literature.neural_networks import Adaline, Hopfield
from pivident.estimation.literature.penalised_regression import PriorRegression, Ridge
from pivident.estimation.literature.robust_regression import RobustRegression
from pivident.estimation.literature.rows import Regression
from pivident.estimation.literature.set_membership import SetMembership
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.estimation.stored_identification import load_identification
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.robot.gallery import load_robot
from tests.planar_arm import NAME, nominal_parameters, planar_motion, planar_record
from tests.planar_log import EXPERIMENT, write_experiment

RATE, SAMPLES = 1000.0, 12000

#: Methods that are least squares where the noise is small, whatever the motion.
REGRESSIONS = [
    name
    for name, method in METHODS.items()
    if isinstance(method, Regression) and not isinstance(method, (LeastSquares, FrequencyDomain))
]


@pytest.fixture(scope="module")
def record():
    base, theta = nominal_parameters()
    rng = np.random.default_rng(4)
    q_ref = planar_motion(rng, RATE, SAMPLES)
    q, tau = planar_record(base, theta, q_ref, RATE, rng)
    tau = tau + 0.2 * rng.standard_normal(tau.shape)
    robot = load_robot(NAME)
    recording = Recording("run", robot.joint_names, q, tau, RATE, q_ref=q_ref)
    return Problem(robot, (recording,)), dict(zip(base.names, theta.tolist(), strict=True))


@pytest.mark.parametrize("name", REGRESSIONS)
def test_estimates_are_near_the_truth_with_intervals_files_and_held_out_errors(
    record, name, tmp_path
):
    problem, truth = record
    found = identify(problem, name)
    expected = np.array([truth[n] for n in found.names])
    assert found.method == METHODS[name].label and found.converged
    inside = np.abs(found.theta - expected) < 3.0 * found.std
    assert inside.mean() > 0.7
    least = identify(problem, "ls")
    # the middle of a box of intervals is no best fit
    loosest = 3.0 if name == "set-membership" else 1.2
    assert found.relative_error < loosest * least.relative_error
    for covariance in (found.covariance, found.robust_covariance):
        assert np.linalg.eigvalsh(covariance).min() > 0.0
    path = tmp_path / "found.json"
    path.write_text(json.dumps(to_dict(found)))
    assert load_identification(path).method_used == found.method_used
    folds = cross_validate(problem, METHODS[name], folds=3)
    other = cross_validate(problem, METHODS["ls"], folds=3)
    assert folds.prediction.total_in_band < 1.25 * loosest * other.prediction.total_in_band


def test_robust_regression_ignores_spikes_that_spoil_least_squares(record):
    problem, truth = record
    (recording,) = problem.recordings
    tau = recording.tau.copy()
    tau[np.random.default_rng(0).integers(0, SAMPLES, 60), 0] += 400.0
    spoiled = replace(problem, recordings=(replace(recording, tau=tau),))
    wide = {"signals": RandomWalk()}
    expected = np.array([truth[n] for n in problem.names])
    size = np.maximum(np.abs(expected), 0.1)
    error = {
        method.label: np.linalg.norm((identify(spoiled, method).theta - expected) / size)
        for method in (LeastSquares(**wide), RobustRegression(loss="bisquare", **wide))
    }
    assert error["IDIM-IRLS"] < 0.1 * error["IDIM-WLS"]


def test_a_prior_that_is_wrong_is_named(record):
    problem, truth = record
    wrong = replace(problem, initial={"fv1": 3.0 * truth["fv1"]})
    found = identify(wrong, PriorRegression(spread=0.05))
    (finding,) = [w for w in found.warnings if w.kind == "prior contradicted"]
    assert finding.subject == "fv1"
    right = replace(problem, initial={"fv1": 1.02 * truth["fv1"]})
    assert not [w for w in identify(right, "map").warnings if w.kind == "prior contradicted"]


def test_a_sharp_prior_of_some_parameters_holds_them(record):
    problem, truth = record
    names = ("fv1", "fc1")
    covariance = np.diag([1e-8, 1e-8]) + 1e-9
    method = PriorRegression(names=names, prior_covariance=tuple(map(tuple, covariance)))
    given = replace(problem, initial={name: truth[name] for name in names})
    found = identify(given, method)
    for name in names:
        assert found.params[name] == pytest.approx(truth[name], abs=1e-3)


def test_options_of_an_experiment_file_reach_the_methods(tmp_path):
    text = EXPERIMENT + (
        "\n[identify.irls]\nloss = 'bisquare'\nmax_iterations = 7\n"
        "[identify.map]\nspread = 0.1\ndeviation = { fv1 = 0.5 }\n"
        "[identify.set-membership]\nbound = [3.0, 2.0]\n"
        "[identify.ridge]\npenalty = 1e-3\n"
        "[identify.adaline]\nrate = 0.5\nsignals = 'random_walk'\n"
        "[identify.hopfield]\ntime = 1e5\n"
    )
    names = '["irls", "map", "set-membership", "ridge", "adaline", "hopfield", "tls", "ml-ls"]'
    text = text.replace('methods = ["ls"]', f"methods = {names}", 1)
    methods = load_experiment(write_experiment(tmp_path, text)).methods()
    bandpass = methods["tls"].signals
    assert methods["irls"] == RobustRegression(loss="bisquare", max_iterations=7, signals=bandpass)
    assert methods["map"] == PriorRegression(spread=0.1, deviation={"fv1": 0.5}, signals=bandpass)
    assert methods["set-membership"] == SetMembership(bound=(3.0, 2.0), signals=bandpass)
    assert methods["ridge"] == Ridge(penalty=1e-3, signals=bandpass)
    assert methods["adaline"] == Adaline(rate=0.5, signals=RandomWalk())
    assert methods["hopfield"] == Hopfield(time=1e5, signals=bandpass)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: RobustRegression(loss="cauchy"), "'huber', 'bisquare'"),
        (lambda: Ridge(penalty=-1.0), "positive"),
        (lambda: PriorRegression(names=("a",), prior_covariance=((-1.0,),)), "positive definite"),
        (
            lambda: PriorRegression(names=("a", "b"), prior_covariance=((1.0, 2.0), (2.0, 1.0))),
            "smallest eigenvalue -1",
        ),
        (lambda: PriorRegression(names=("a",)), "needs 1 rows"),
        (lambda: PriorRegression(deviation={"fv1": 0.0}), "deviation of fv1"),
        (lambda: SetMembership(bound=(1.0, 0.0)), "positive"),
        (lambda: Adaline(rate=2.5), "between 0 and 2"),
        (lambda: Hopfield(reach=0.5), "reach is 0.5; more than 1"),
    ],
)
def test_options_that_make_no_sense_are_refused(make, message):
    with pytest.raises(ExperimentError, match=message):
        make()


def test_names_and_numbers_that_do_not_fit_are_refused(record):
    problem, _ = record
    with pytest.raises(ExperimentError, match="'fv9', which is no parameter"):
        identify(problem, PriorRegression(deviation={"fv9": 1.0}))
    with pytest.raises(ExperimentError, match="3 numbers for 2 joints"):
        identify(problem, SetMembership(bound=(1.0, 1.0, 1.0)))
    with pytest.raises(IdentificationError, match="no parameters explain all rows"):
        identify(problem, SetMembership(bound=1e-4))
