"""Filters as methods: against the truth, against least squares, on folds, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identification_file import method_of_options
from pivident.estimation.identify import identify
from pivident.estimation.literature.filters.filter_setup import acting_torques
from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    ExtendedKalman,
    UnscentedKalman,
)
from pivident.estimation.literature.filters.particle_filter import Particles
from pivident.estimation.literature.filters.state_filter import windows_covariance
from pivident.estimation.methods import METHODS
from pivident.foundation.errors import ExperimentError, FilterDiverged
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.folds_from_rows import filters_without
from tests.estimation.literature.filters.scenes import planar_problem


@pytest.fixture(scope="module")
def arm():
    return planar_problem(seed=3, samples=6000)


@pytest.fixture(scope="module")
def least(arm):
    problem, theta = arm
    return np.abs(identify(problem, "ls").theta - theta)


@pytest.mark.parametrize("name", ["ekf", "ukf", "cdkf"])
def test_kalman_filters_are_nearer_than_least_squares(arm, least, name):
    problem, theta = arm
    found = identify(problem, name)
    error = np.abs(found.theta - theta)
    assert np.median(error) < 0.5 * np.median(least)
    z = (found.theta - theta) / np.sqrt(np.diag(found.covariance))
    assert 0.3 < np.sqrt(np.mean(z**2)) < 1.7
    assert any(f.topic == "filter" and "white noises" in f.message for f in found.warnings)
    assert method_of_options(found.options, None, found.method) == found.method_used
    assert 0.0 < found.relative_error < 1.0 and found.method == METHODS[name].label


def test_particles_agree_with_the_extended_filter():
    problem, _ = planar_problem(seed=4, samples=2500)
    kalman = identify(problem, "ekf")
    found = identify(problem, Particles(particles=200, seed=1))
    std = np.sqrt(np.diag(kalman.covariance))
    assert np.median(np.abs(found.theta - kalman.theta) / std) < 10.0  # chance, see the docs
    ratio = np.sqrt(np.diag(found.covariance)) / std
    assert 0.1 < np.median(ratio) < 3.0
    few = [identify(problem, Particles(particles=20, seed=1)).theta for _ in range(2)]
    np.testing.assert_array_equal(*few)


def test_initial_values_lead_to_the_same_estimate(arm):
    problem, theta = arm
    near = {name: 0.8 * value for name, value in zip(problem.names, theta, strict=True)}
    started = replace(problem, initial=near)
    first = identify(started, ExtendedKalman(start="initial", passes=2))
    least = identify(problem, ExtendedKalman())
    std = np.sqrt(np.diag(least.covariance))
    assert (np.abs(first.theta - least.theta) < 2.0 * std).all()
    assert len(first.history) == 2


def test_noises_that_are_given_are_taken(arm):
    problem, _ = arm
    small = identify(problem, ExtendedKalman(torque_noise=0.05, encoder_noise=(2e-6, 2e-6)))
    large = identify(problem, ExtendedKalman(torque_noise=0.5, encoder_noise=2e-6))
    assert (np.diag(large.covariance) > 4.0 * np.diag(small.covariance)).any()
    assert any("not white of unit variance" in f.message for f in large.warnings)
    with pytest.raises(ExperimentError, match="torque_noise has 3 numbers for 2 joints"):
        identify(problem, ExtendedKalman(torque_noise=(1.0, 1.0, 1.0)))


def test_a_filter_that_diverges_names_the_sample_of_the_record(arm):
    problem, _ = arm
    with pytest.raises(FilterDiverged, match=r"sample \d+, joint .* standard deviations"):
        identify(problem, ExtendedKalman(torque_noise=1e-6, encoder_noise=1e-12))


def test_folds_are_filtered_anew(arm):
    problem, _ = arm
    judged = cross_validate(problem, "ekf", folds=3)
    least = cross_validate(problem, "ls", folds=3)
    assert judged.kind == least.kind == "folds"
    assert (judged.prediction.relative < 1.05 * least.prediction.relative).all()
    too_long = Particles(particles=10_000)
    found = replace(identify(problem, "ekf"), method_used=too_long)
    assert "would take too long" in str(filters_without(problem, found, [None, None])[0])


def test_torques_that_act_before_a_sample(arm):
    recording = arm[0].recordings[0]
    tau = recording.tau
    held = acting_torques(recording)
    np.testing.assert_array_equal(held[1:], tau[:-1])
    averaged = acting_torques(replace(recording, torque_timing="averaged"))
    np.testing.assert_array_equal(averaged, tau)
    sampled = acting_torques(replace(recording, torque_timing="sampled"))
    np.testing.assert_allclose(sampled[1:], 0.5 * (tau[1:] + tau[:-1]), atol=1e-12)


def test_windows_give_the_covariance_of_the_noise_that_was_there():
    """Weighted means of coloured noise: P is too small, windows are not."""
    rng = np.random.default_rng(0)
    spread, formula, robust = [], [], []
    for _ in range(200):
        white = rng.standard_normal(2100)
        noise = np.convolve(white, np.ones(10), "valid")[:2000]
        information, moment = 1e-6, 0.0
        marks = [(np.zeros(1), np.array([[1.0 / information]]))]
        for own in noise.reshape(40, 50):
            information += own.size / 10.0
            moment += own.sum() / 10.0
            marks.append((np.array([moment / information]), np.array([[1.0 / information]])))
        spread.append(marks[-1][0][0])
        formula.append(marks[-1][1][0, 0])
        robust.append(windows_covariance(marks)[0, 0])
    assert np.mean(formula) < 0.2 * np.var(spread)
    np.testing.assert_allclose(np.mean(robust), np.var(spread), rtol=0.3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ExtendedKalman(start="ls"), "start is 'ls'"),
        (lambda: ExtendedKalman(spread=0.0), "spread is 0.0"),
        (lambda: ExtendedKalman(drift=-1.0), "drift is -1.0"),
        (lambda: ExtendedKalman(passes=0), "passes is 0"),
        (lambda: ExtendedKalman(encoder_noise=-1.0), "encoder_noise is -1.0"),
        (lambda: UnscentedKalman(alpha=0.0), "alpha is 0.0"),
        (lambda: UnscentedKalman(square_root="yes"), "square_root is 'yes'"),
        (lambda: CentralDifferenceKalman(step=0.5), "step is 0.5"),
        (lambda: Particles(particles=3), "particles is 3"),
        (lambda: Particles(discount=1.0), "discount is 1.0"),
        (lambda: Particles(seed=-1), "seed is -1"),
    ],
)
def test_options_that_cannot_be_are_refused(make, message):
    with pytest.raises(ExperimentError, match=message):
        make()
