"""Estimates on the lines of a periodic motion: bias, intervals, weights, and what is refused."""

import json

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identification_file import method_of_options, to_json
from pivident.estimation.identify import identify
from pivident.estimation.literature.frequency_domain import FrequencyDomain
from pivident.estimation.literature.whole_periods import (
    PeriodicRecord,
    derivatives_on_lines,
    low_lines,
    low_lines_of_all,
    torque_on_lines,
    whole_periods,
    window_around,
)
from pivident.estimation.signal_recipes import Algebraic, Bandpass
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.judgement.report.builder import render_report
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from tests.estimation.periodic_arm import LENGTH, RATE, periodic_problem, reference
from tests.planar_simulations import planar_problem

SEEDS = 40


@pytest.fixture(scope="module")
def estimates():
    """z-values of all parameters, shape (seeds, parameters), and errors of both methods."""
    z, errors = [], []
    for seed in range(SEEDS):
        problem, truth = periodic_problem(seed)
        found = identify(problem, "frequency")
        values = np.array([truth[p.name] for p in found.parameters])
        z.append((found.theta - values) / found.method_std)
        if seed < 3:
            other = identify(problem, "ls")
            errors.append([np.linalg.norm(own - values) for own in (found.theta, other.theta)])
    return np.array(z), np.array(errors)


def test_intervals_hold_the_truth(estimates):
    covered = np.mean(np.abs(estimates[0]) < 1.96)
    assert 0.90 <= covered <= 0.99


def test_the_feedback_makes_no_bias(estimates):
    """Mean errors below one standard error; friction at reversals keeps most of what there is."""
    z, errors = estimates
    assert np.abs(z.mean(axis=0)).max() < 1.0
    assert np.median(np.abs(z.mean(axis=0))) < 0.2
    assert np.median(errors[:, 0] / errors[:, 1]) < 0.5


def test_derivatives_on_lines_are_exact():
    rate, t = 100.0, np.arange(400) / 100.0
    omega = 2 * np.pi * np.array([0.5, 1.25])[:, None]
    q = np.sin(omega * t) + 0.3
    found = derivatives_on_lines(q, rate, np.array([5.0, 5.0]))
    truth = (q, omega * np.cos(omega * t), -(omega**2) * np.sin(omega * t))
    for own, exact in zip(found, truth, strict=True):
        np.testing.assert_allclose(own, exact, atol=1e-10)
    cut = derivatives_on_lines(q, rate, np.array([5.0, 1.0]))[0]
    np.testing.assert_allclose(cut[1], 0.3, atol=1e-12)


@pytest.mark.parametrize("timing", ["held", "averaged", "sampled"])
def test_torque_on_lines_is_where_the_positions_are(timing):
    """A sine that is averaged over the period before its sample, or held from it on."""
    rate, n = 100.0, 400
    h, omega = 1.0 / rate, 2 * np.pi * 2.25
    t = np.arange(n) / rate
    true = np.sin(omega * t)
    if timing == "averaged":
        logged = (np.cos(omega * (t - h)) - np.cos(omega * t)) / (omega * h)
        expected = true
    elif timing == "held":
        logged = true
        expected = np.sinc(2.25 * h) * np.sin(omega * (t - 0.5 * h))
    else:
        logged, expected = np.sin(omega * (t - 0.003)), true
    delay = 0.003 if timing == "sampled" else 0.0
    x = logged[:, None]
    record = Recording("sine", ("joint_1",), x, x, rate, torque_timing=timing, delay=delay)
    found = torque_on_lines(logged[None], record)
    np.testing.assert_allclose(found[0], expected, atol=1e-10)


def test_low_lines_keep_low_lines():
    rng = np.random.default_rng(4)
    x = rng.normal(size=(2, 60))
    low = low_lines(x, 7)
    lines = np.fft.rfft(x, axis=1)[:, :8] / 60
    np.testing.assert_allclose(np.fft.rfft(low, axis=1) / 15, lines, atol=1e-12)
    several = low_lines_of_all(np.repeat(x[:, None], 4, axis=1), 7)
    np.testing.assert_allclose(several, np.repeat(low[:, None], 4, axis=1), atol=1e-12)


def test_the_window_is_zero_where_a_joint_is_slow_and_goes_around_the_period():
    slow = np.zeros((1, 100), bool)
    slow[0, :3] = slow[0, 50] = True
    window = window_around(slow, np.array([4.0]))[0]
    assert (window[[96, 97, 0, 2, 6, 46, 50, 54]] < 1e-9).all()
    assert (window[[20, 30, 70, 80]] > 1.0 - 1e-9).all()
    assert ((window >= 0.0) & (window <= 1.0)).all()


def test_rows_are_lines_weighted_by_the_noise_between_periods():
    """The normal equations by rows are those by complex lines (Parseval)."""
    problem, _ = periodic_problem(0)
    found = identify(problem, "frequency")
    (record,) = found.equations.records
    assert isinstance(record, PeriodicRecord) and found.converged
    regressor, rows = problem.regressor, record.t.size // 2
    own = slice(regressor.offsets[0], regressor.offsets[1])
    phi = record.phi[own].reshape(-1, rows, 2)
    lines = np.fft.rfft(phi, axis=1) * record.weights[0][None, :, None]
    twice = np.where(np.arange(lines.shape[1]) == 0, 1.0, 2.0)[None, :, None]
    by_lines = np.einsum("akh,bkh->ab", lines * twice, lines.conj()).real / rows
    white = record._columns(regressor, 0)[0]
    np.testing.assert_allclose(white @ white.T, by_lines, rtol=1e-9, atol=1e-9)
    assert found.instruments.kind == "repetition"
    assert "5 periods of 4 s, lines to 20 Hz" in found.instruments.found[0]


def test_one_long_period_less_is_the_transient():
    (record,) = periodic_problem(0)[0].recordings
    places = whole_periods(record, None, 1)
    assert (places.start, places.length, places.count) == (LENGTH, LENGTH, 5)
    assert whole_periods(record, LENGTH / RATE, 0).count == 6


def test_what_has_no_whole_periods_is_refused_with_the_next_step():
    with pytest.raises(IdentificationError, match=r"'run1' has no whole periods.*use piv or iv"):
        identify(planar_problem(), "frequency")
    problem, _ = periodic_problem(0, periods=2)
    with pytest.raises(IdentificationError, match=r"2 periods of 4 s.*transient = 0"):
        identify(problem, "frequency")
    with pytest.raises(IdentificationError, match="needs a whole number"):
        identify(problem, FrequencyDomain(period=1.00005))
    with pytest.raises(ExperimentError, match="cutoff and bandwidth of a bandpass"):
        FrequencyDomain(signals=Algebraic())
    with pytest.raises(ExperimentError, match="transient is -1"):
        FrequencyDomain(transient=-1)
    with pytest.raises(ExperimentError, match="period is 0"):
        FrequencyDomain(period=0.0)


def test_a_wrong_model_widens_the_intervals():
    """Without the elbow's dry friction, what is left repeats; the finding names the joint."""
    problem, _ = periodic_problem(0)
    names = tuple(n for n in problem.names if n != "fc2")
    found = identify(type(problem)(problem.robot, problem.recordings, None, names), "frequency")
    (finding,) = [w for w in found.warnings if w.kind == "repeats" and w.subject == "elbow"]
    assert "repeats from period to period" in str(finding)
    right = identify(problem, "frequency")
    assert (
        found.std[found.names.index("fv2r" if "fv2r" in found.names else "fv2")]
        > 3.0 * (right.std[right.names.index("fv2r" if "fv2r" in right.names else "fv2")])
    )


def test_results_are_stored_reported_and_judged():
    problem, _ = periodic_problem(1)
    method = FrequencyDomain(signals=Bandpass(cutoff=60.0), period=LENGTH / RATE)
    found = identify(problem, method)
    assert "equations to 20" in str(found) and found.method == "IDIM-FD (repetition)"
    stored = json.loads(to_json(found))
    assert stored["kind"] == "frequency"
    for kind in ("frequency", None):
        assert method_of_options(stored["options"], kind, found.method) == found.method_used
    assert "IDIM-FD" in render_report([found])
    judged = cross_validate(problem, method, folds=3)
    assert judged.prediction.total_in_band < 1.0
    assert reference().shape[0] == 6 * LENGTH
