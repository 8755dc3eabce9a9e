"""Weights of samples, samples that were not measured, joints without an equation."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.data.recording.usable_samples import filled
from pivident.estimation.identify import identify
from pivident.estimation.instrumental_variables import IV_FULL_RATE
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import (
    BrokenMotion,
    ExperimentError,
    NonFiniteSamples,
    RecordingError,
)
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.loop.simulation.control_loop import Loop
from tests.estimation.test_known_parameters import close, dense, scaled
from tests.planar_arm import LAW, nominal_parameters, planar_motion, planar_record

RATE = 500.0
SAMPLES = 4000
FULL = LeastSquares(signals=RandomWalk())


@pytest.fixture(scope="module")
def signals():
    rng = np.random.default_rng(3)
    base, theta = nominal_parameters()
    q_ref = planar_motion(rng, RATE, SAMPLES, postures=12)
    q, tau = planar_record(base, theta, q_ref, RATE, rng, encoder_noise=1e-5)
    return base.robot, q, tau + 0.05 * rng.standard_normal(tau.shape), q_ref


def problem_of(signals, q=None, tau=None, **options):
    robot, own_q, own_tau, q_ref = signals
    recording = Recording.from_arrays(
        own_q if q is None else q, own_tau if tau is None else tau, RATE,
        joint_names=robot.joint_names, q_ref=q_ref, **options,
    )  # fmt: skip
    return Problem(robot, (recording,), Loop(LAW))


@pytest.fixture(scope="module")
def problem(signals):
    return problem_of(signals)


@pytest.fixture(scope="module")
def weights():
    return np.random.default_rng(5).uniform(0.1, 10.0, (SAMPLES, 2))


def weighted_rows(problem, method, weights):
    """Rows of the same equations without weights, and the weights that belong to them."""
    found = identify(problem, method)
    phi, z, tau = dense(found)
    own = found.equations.records[0].used
    return phi, z, tau, np.concatenate([weights[used, j] for j, used in enumerate(own)])


def blocks_by_joint(found):
    """Dense rows ordered joint by joint, as `weighted_rows` has its weights."""
    size, rows = found.theta.size, {0: [], 1: []}
    for block in found.equations.blocks():
        for j, own in enumerate(block.joints):
            phi, z = np.zeros((2, own.tau.size, size))
            phi[:, own.columns], z[:, own.columns] = own.phi.T, own.z.T
            rows[j].append((phi[own.used], z[own.used], own.tau[own.used]))
    joined = [np.concatenate(part) for j in rows for part in zip(*rows[j], strict=True)]
    return [np.concatenate([joined[k], joined[k + 3]]) for k in range(3)]


def test_weighted_least_squares_is_that_of_statsmodels(problem, weights):
    sm = pytest.importorskip("statsmodels.api")
    found = identify(replace(problem, weights=weights), FULL)
    plain = identify(problem, FULL)
    phi, _, tau = blocks_by_joint(plain)
    used = plain.equations.records[0].used
    own = np.concatenate([weights[used[j], j] for j in (0, 1)])
    # the same rows in N m, weighted by those of the samples over the variance of the joint
    joint = np.concatenate([np.full(used[j].sum(), j) for j in (0, 1)])
    root = np.sqrt(plain.equations.variance)[joint]
    total = own / found.equations.variance[joint]
    size = scaled(phi)
    made = sm.WLS(tau * root, phi * root[:, None] / size, weights=total).fit()
    assert close(found.theta, made.params / size, size)
    white = np.linalg.inv((phi * root[:, None]).T @ (phi * root[:, None] * total[:, None]))
    assert np.allclose(found.formula_covariance, white, rtol=1e-7, atol=0.0)
    assert not np.allclose(found.theta, plain.theta, rtol=1e-4)


def test_weighted_instrumental_variables(problem):
    weights = 2.0 + np.sin(np.linspace(0.0, 20.0, SAMPLES))[:, None] * [1.0, -1.0]
    found = identify(replace(problem, weights=weights), IV_FULL_RATE)
    phi, z, tau = dense(found)
    expected = np.linalg.solve(z.T @ phi / scaled(phi), z.T @ tau) / scaled(phi)
    assert close(found.theta, expected, scaled(phi), 1e-6)
    plain = identify(problem, IV_FULL_RATE)
    assert np.abs(found.theta - plain.theta).max() > 1e-6
    ratio = found.std / plain.std
    assert (ratio > 0.5).all() and (ratio < 2.5).all()


def test_a_weight_of_all_samples_is_none(problem):
    for method in (FULL, "piv"):
        plain = identify(problem, method)
        same = identify(replace(problem, weights=np.ones((SAMPLES, 2))), method)
        twice = identify(replace(problem, weights={"shoulder": 1.0, "elbow": 1.0}), method)
        assert np.allclose(same.theta, plain.theta, rtol=1e-12, atol=1e-14)
        assert np.allclose(same.std, plain.std, rtol=1e-9)
        assert np.allclose(twice.theta, plain.theta, rtol=1e-12, atol=1e-14)


def test_a_weight_of_a_joint_is_worth_a_variance(problem):
    plain = identify(problem, FULL)
    found = identify(replace(problem, weights={"elbow": 100.0}), FULL)
    assert np.allclose(found.equations.variance, plain.equations.variance, rtol=1e-9)
    phi, _, tau = dense(found)
    expected = np.linalg.lstsq(phi / scaled(phi), tau, rcond=None)[0] / scaled(phi)
    assert close(found.theta, expected, scaled(phi))
    elbow = list(problem.names).index("fv2")
    assert found.formula_std[elbow] < 0.3 * plain.formula_std[elbow]


@pytest.mark.parametrize("method", [FULL, IV_FULL_RATE, "piv", "iv"])
def test_a_weight_of_zero_leaves_a_sample_out(problem, method):
    weights = np.ones((SAMPLES, 2))
    weights[1000:1400, 1] = 0.0
    valid = weights > 0.0
    found = identify(replace(problem, weights=weights), method)
    (whole,) = problem.recordings
    line = filled(np.where(valid, whole.tau, np.nan), positions=False)
    cut = replace(whole, tau=line, valid=valid)
    expected = identify(replace(problem, recordings=(cut,)), method)
    assert np.array_equal(found.theta, expected.theta)
    assert found.joints[1].rows < identify(problem, method).joints[1].rows
    assert found.joints[0].rows == identify(problem, method).joints[0].rows


@pytest.mark.parametrize("method", ["ls", "iv", "piv", "ekf", "oloe"])
def test_what_a_sample_of_weight_zero_holds_is_of_no_consequence(signals, method):
    weights = np.ones((SAMPLES, 2))
    weights[1000:1040, 1] = 0.0
    _, _, tau, _ = signals
    wrong = np.where(weights > 0.0, tau, tau + 100.0)
    pair = [replace(problem_of(signals, tau=each), weights=weights) for each in (tau, wrong)]
    right, other = (identify(each, method) for each in pair)
    assert np.array_equal(right.theta, other.theta)


@pytest.mark.parametrize("method", ["frequency", "ekf", "particle"])
def test_methods_of_all_torques_at_once_take_no_joint_without_equation(problem, method):
    with pytest.raises(ExperimentError, match="joint 'shoulder' has no equation"):
        identify(replace(problem, without_equation="shoulder"), method)


@pytest.mark.parametrize("method", [FULL, IV_FULL_RATE])
@pytest.mark.parametrize("timing", ["sampled", "held"])
def test_missing_torques_leave_the_rows_that_remain(signals, method, timing):
    _, _, tau, _ = signals
    tau = tau.copy()
    rng = np.random.default_rng(1)
    gone = rng.choice(SAMPLES, 300, replace=False)
    tau[gone, 1] = np.nan
    tau[2000:2100, 0] = np.nan
    gappy = problem_of(signals, tau=tau, gaps="leave out", torque_timing=timing)
    found = identify(gappy, method)
    whole = identify(problem_of(signals, torque_timing=timing), method)
    used, before = found.equations.records[0].used, whole.equations.records[0].used
    assert not used[1, gone].any() and not used[0, 2000:2100].any()
    rows = blocks_by_joint(whole)
    keep = np.concatenate([used[j][before[j]] for j in (0, 1)])
    joint = np.concatenate([np.full(before[j].sum(), j) for j in (0, 1)])[keep]
    scale = np.sqrt(whole.equations.variance / found.equations.variance)[joint]
    phi, z, tau_kept = (x[keep] * (scale[:, None] if x.ndim == 2 else scale) for x in rows)
    size = scaled(phi)
    expected = np.linalg.solve(z.T @ phi / size, z.T @ tau_kept) / size
    assert used.sum() == keep.sum() < before.sum()
    # a held torque is moved to the instants with a thousandth of what is further away
    exact = method is FULL and timing == "sampled"
    assert close(found.theta, expected, size, 1e-9 if exact else 1e-3)


def test_missing_positions_cost_all_equations_there(signals, problem):
    _, q, _, _ = signals
    q = q.copy()
    q[1500:1504, 1] = np.nan
    q[[700, 900], 0] = np.nan
    gappy = problem_of(signals, q=q, gaps="leave out")
    for method in (FULL, "piv"):
        found, whole = identify(gappy, method), identify(problem, method)
        used = found.equations.records[0].used
        assert not used[:, 1500:1504].any() and not used[:, [700, 900]].any()
        assert np.abs((found.theta - whole.theta) / whole.std).max() < 2.0
    notes = " ".join(gappy.recordings[0].notes)
    assert "q of elbow is empty, NaN or infinite at samples 1500 to 1503" in notes
    assert "left out of the equations of all joints" in notes
    q[2000:2200, 0] = np.nan
    with pytest.raises(BrokenMotion):
        problem_of(signals, q=q, gaps="leave out")
    with pytest.raises(NonFiniteSamples):
        problem_of(signals, q=q)


@pytest.mark.parametrize("method", [FULL, "ls", IV_FULL_RATE, "piv", "irls"])
def test_a_joint_left_out_moves_but_has_no_equation(signals, problem, method):
    alone = identify(replace(problem, without_equation="shoulder"), method)
    _, _, tau, _ = signals
    tau = tau.copy()
    tau[:, 0] = np.nan
    silent = identify(problem_of(signals, tau=tau, gaps="leave out"), method)
    assert alone.names == silent.names
    assert "fv1" not in alone.names and "fv2" in alone.names
    assert np.allclose(alone.theta, silent.theta, rtol=1e-9)
    assert alone.joints[0].rows == 0 and np.isnan(alone.joints[0].relative_error)
    _, theta = nominal_parameters()
    true = dict(zip(problem.names, theta, strict=True))
    own = [k for k, n in enumerate(alone.names) if n in ("mx2", "my2", "ia2", "fv2", "fc2")]
    off = [abs(alone.theta[k] - true[alone.names[k]]) / alone.std[k] for k in own]
    assert max(off) < 6.0
    assert "left out" in " ".join(w.message for w in alone.warnings)


@pytest.mark.parametrize("method", ["piv", "cloe"])
def test_with_its_parameters_known_the_loop_can_be_simulated(problem, method):
    _, theta = nominal_parameters()
    true = dict(zip(problem.names, theta, strict=True))
    own = {name: true[name] for name in problem.names[:6]}
    found = identify(replace(problem, without_equation=("shoulder",), fixed=own), method)
    assert found.instruments.kind == "loop"
    off = (found.theta - theta)[6:] / found.std[6:]
    assert np.abs(off).max() < 6.0


def test_a_result_with_a_joint_left_out_is_judged(problem, tmp_path):
    short = replace(problem, without_equation=("shoulder",))
    found = identify(short, "piv")
    judged = cross_validate(short, "piv", folds=3)
    assert judged.prediction.relative_in_band[1] < 2.0
    assert "elbow" in found.summary()
    assert str(verdict(diagnose(short, {"piv": found})))
    found.save(tmp_path)


def test_weights_go_with_the_samples(problem, weights):
    part = replace(problem, weights=weights).recordings[0].part(100, 900)
    assert np.array_equal(part.weights, weights[100:900])


@pytest.mark.parametrize(
    ("given", "kind", "words"),
    [
        ({"weights": np.ones((10, 2))}, ExperimentError, "shape"),
        ({"weights": np.full((SAMPLES, 2), np.nan)}, RecordingError, "weight of shoulder"),
        ({"weights": -np.ones((SAMPLES, 2))}, RecordingError, "weight of shoulder"),
        ({"weights": {"wrist": 1.0}}, ExperimentError, "no joint 'wrist'"),
        ({"weights": [np.ones((SAMPLES, 2))] * 2}, ExperimentError, "2 recordings"),
        ({"without_equation": ("wrist",)}, ExperimentError, "no joint 'wrist'"),
        ({"without_equation": ("shoulder", "elbow")}, ExperimentError, "no joint has"),
    ],
)
def test_weights_and_joints_are_checked(problem, given, kind, words):
    with pytest.raises(kind, match=words):
        replace(problem, **given)


def test_methods_without_weights_say_so(problem):
    with pytest.raises(ExperimentError, match="weights"):
        identify(replace(problem, weights={"elbow": 2.0}), "cloe")
