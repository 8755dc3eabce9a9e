"""The fit against SciPy's least squares and against the truth."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from pivident.estimation.output_error import fit as fit_module
from pivident.estimation.output_error.fit import FitOptions, fit_simulation
from pivident.estimation.output_error.loop_unknowns import Unknown, with_values
from pivident.estimation.output_error.simulated_errors import simulated_errors
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES
from pivident.foundation.errors import (
    IdentificationError,
    RankDeficientRegressor,
    SimulationDiverged,
)
from pivident.loop.simulation.direction import Direction
from tests.estimation.output_error.arms import counted_simulations, loop, stretch, truth, unknowns
from tests.planar_arm import nominal_parameters

PLAIN = FitOptions(channels=(POSITIONS,), noise=None)


def test_without_noise_the_truth_is_found():
    _, theta = nominal_parameters()
    sought = unknowns()
    fit = fit_simulation([stretch(loop(1.2 * theta))], sought, PLAIN)
    expected = nominal_parameters()[1]
    np.testing.assert_allclose(fit.values, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())
    assert fit.converged and not fit.held.any() and not fit.bound.any()


def test_estimates_are_those_of_another_optimiser():
    _, theta = nominal_parameters()
    sought = unknowns("zz1", "fv1", "fc2", "mx2")
    start = with_values(
        loop(theta, samples=1500), sought, 1.1 * truth(("zz1r", "fv1", "fc2", "mx2"))
    )
    own = stretch(start, noise=1e-5)
    fit = fit_simulation([own], sought, PLAIN)

    def errors(values):
        moved = own.with_loop(with_values(own.loop, sought, values * fit.values))
        (made,) = simulated_errors([moved], [], (POSITIONS,), [5])
        return (made.errors[0] / np.sqrt(fit.noise.variance[0])[:, None]).ravel()

    other = least_squares(errors, np.full(4, 1.05), method="lm", diff_step=1e-6)
    np.testing.assert_allclose(other.x, 1.0, atol=0.02 * np.min(fit.std / np.abs(fit.values)))
    # λ is that of the errors that are left, so that their sum is the number of rows
    assert 2.0 * other.cost == pytest.approx(2 * fit.errors[0].shape[2], rel=0.02)
    covariance = np.linalg.inv(other.jac.T @ other.jac) * np.outer(fit.values, fit.values)
    np.testing.assert_allclose(fit.formula_covariance, covariance, rtol=0.02)


def test_standard_errors_are_those_of_many_records():
    _, theta = nominal_parameters()
    sought = unknowns("zz1", "fv1", "fc2", "mx2")
    true = truth(("zz1r", "fv1", "fc2", "mx2"))
    base = stretch(loop(theta, samples=1500))
    errors = []
    for seed in range(30):
        noise = 1e-5 * np.random.default_rng(seed).standard_normal(base.q.shape)
        own = base.with_loop(base.loop)
        object.__setattr__(own, "q", base.q + noise)
        fit = fit_simulation([own], sought, PLAIN)
        errors.append((fit.values - true) / fit.std)
    # mean squares of 30 numbers of unit variance scatter by 26 %
    spread = np.mean(np.square(errors), axis=0)
    assert (spread > 0.35).all() and (spread < 2.2).all()


def test_initial_states_are_found_with_the_unknowns():
    _, theta = nominal_parameters()
    sought = unknowns("zz1", "fv1", "fc1", "fv2")
    true = truth(("zz1r", "fv1", "fc1", "fv2"))
    wrong = with_values(loop(theta, samples=1500), sought, 1.05 * true)
    wrong = wrong.moved(Direction("initial_position", joint=0), 0.02)
    own = stretch(wrong, start_std=np.full(4, 0.1))
    # joint 1 of the record starts where the reference does
    fit = fit_simulation([own], sought, PLAIN)
    start = fit.stretches[0].loop.begin[0]
    # thinned rows hardly see the first milliseconds of a stiff loop
    np.testing.assert_allclose(start, wrong.signals.q_ref[0], atol=3e-4)
    np.testing.assert_allclose(fit.values, true, rtol=1e-4)


def test_a_bound_that_binds_is_reported():
    _, theta = nominal_parameters()
    true = truth(("fc2",))[0]
    sought = [*unknowns("zz1", "fv1")]
    sought.append(Unknown("fc2", "N m", Direction("parameter", "fc2"), 0.0, 0.8 * true))
    start = with_values(loop(theta), sought, np.array([*truth(("zz1r", "fv1")), 0.5 * true]))
    fit = fit_simulation([stretch(start, noise=1e-6)], sought, PLAIN)
    assert fit.bound.tolist() == [False, False, True]
    assert fit.value("fc2") == pytest.approx(0.8 * true) and fit.std[2] > 0.0


def test_what_nothing_determines_is_refused_or_held():
    _, theta = nominal_parameters()
    gains = [Unknown(f"drive_gain{j + 1}", "", Direction("drive_gain", joint=j)) for j in range(2)]
    own = stretch(loop(1.01 * theta), noise=1e-6)
    # positions know ratios of gains, inertias and friction only
    with pytest.raises(RankDeficientRegressor, match=r"drive_gain"):
        fit_simulation([own], [*unknowns(), *gains], PLAIN)
    options = FitOptions(channels=(POSITIONS,), noise=None, undetermined="hold")
    fit = fit_simulation([own], [*unknowns(), *gains], options)
    held = [u.name for u, h in zip(fit.unknowns, fit.held, strict=True) if h]
    assert len(held) == 1 and held[0].startswith("drive_gain")
    assert fit.value(held[0]) == 1.0 and fit.std[fit.held][0] == 0.0
    error = np.abs(fit.values - np.r_[theta, 1.0, 1.0])
    assert (error <= 5.0 * fit.std + 1e-12).all()
    # torques fix the scale
    both = FitOptions(noise=None)
    assert not fit_simulation([own], [*unknowns(), *gains], both).held.any()


def test_a_loop_that_diverges_names_joint_and_time():
    _, theta = nominal_parameters()
    own = stretch(loop(theta, samples=1500))
    tight = own.with_loop(with_values(own.loop, unknowns("zz1"), np.array([200.0])))
    with pytest.raises(SimulationDiverged, match=r"joint 'shoulder' .* t = "):
        fit_simulation([tight], unknowns("zz1"), PLAIN)


def test_torques_that_were_not_measured_cannot_be_compared():
    own = stretch(loop(samples=600))
    object.__setattr__(own, "tau", None)
    with pytest.raises(IdentificationError, match=r"'run' has no measured torque"):
        fit_simulation([own], unknowns("zz1"), FitOptions(channels=(TORQUES,)))


def test_derivatives_of_the_point_before_serve_behind_a_small_step(monkeypatch):
    _, theta = nominal_parameters()
    runs = counted_simulations(monkeypatch)
    sought = unknowns("zz1", "fv1", "fc2", "mx2")
    start = with_values(
        loop(theta, samples=1500), sought, 2.0 * truth(("zz1r", "fv1", "fc2", "mx2"))
    )
    own = stretch(start, noise=1e-5)
    kept = fit_simulation([own], sought, PLAIN)
    with_tangents = np.count_nonzero(runs)
    assert 0 < with_tangents < len(runs)
    runs.clear()
    monkeypatch.setattr(fit_module, "STEADY", 0.0)
    renewed = fit_simulation([own], sought, PLAIN)
    assert all(runs) and len(runs) > with_tangents
    assert (np.abs(kept.values - renewed.values) <= 0.05 * renewed.std).all()
    np.testing.assert_allclose(kept.std, renewed.std, rtol=0.02)
    np.testing.assert_allclose(kept.rms[0], renewed.rms[0], rtol=1e-4)


def test_outliers_weigh_little_with_hubers_loss():
    _, theta = nominal_parameters()
    sought = unknowns("zz1", "fv1", "fc1", "fv2")
    true = truth(("zz1r", "fv1", "fc1", "fv2"))
    own = stretch(loop(theta), noise=1e-6)
    own.q[2000:2100] += 1e-4  # a bump that no motion makes
    plain = fit_simulation([own], sought, PLAIN)
    robust = fit_simulation(
        [own], sought, FitOptions(channels=(POSITIONS,), noise=None, robust=True)
    )
    error = [np.linalg.norm((f.values - true) / true) for f in (plain, robust)]
    assert error[1] < 0.3 * error[0]


def test_a_fit_that_gets_stuck_has_not_converged(monkeypatch):
    # derivatives promise smaller errors, but no step delivers them
    _, theta = nominal_parameters()

    def stuck(search, point, solved, damping):
        return np.zeros_like(solved.step), 0, damping, None

    monkeypatch.setattr(fit_module._Search, "_advance", stuck)
    sought = unknowns("zz1", "fv1")
    start = with_values(loop(theta, samples=1500), sought, 1.2 * truth(("zz1r", "fv1")))
    assert not fit_simulation([stretch(start, noise=1e-6)], sought, PLAIN).converged
