"""What was written can be read: results at every condition number and size of their parameters."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from pivident.estimation.covariance import inverse_gram, rounded_away
from pivident.estimation.identification import Identification
from pivident.estimation.identification_file import save_identification, to_dict, to_json
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.simulation_result import LoopParameter
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.codec import decode
from pivident.foundation.errors import IdentificationFileError
from pivident.foundation.text.plain_values import plain
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.export.formats import export_model
from pivident.models.runnable_model import runnable_model
from pivident.studies.comparison.compare import compare
from pivident.studies.comparison.entry import load_entries
from pivident.studies.prediction.new_logs import stored_result
from tests.planar_simulations import planar_problem
from tests.synthetic_identification import synthetic_identification

KINDS = ("covariance", "robust_covariance", "formula_covariance")
KEPT = ("theta", *KINDS)


@cache
def known():
    return {name: synthetic_identification(robot_name=name) for name in ("planar_2r", "emps")}


def observations(rng, size, log_condition):
    """W of that condition number, with columns of the same length."""
    left, _ = np.linalg.qr(rng.standard_normal((4 * size, size)))
    right, _ = np.linalg.qr(rng.standard_normal((size, size)))
    w = left * np.logspace(0.0, -log_condition, size) @ right
    return w / np.linalg.norm(w, axis=0)


def inverse(gram):
    try:
        return np.linalg.inv(gram)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(gram)


def badly_made(found, seed, log_condition, power, spread):
    """The result with parameters of any size, and covariances as elimination rounds them."""
    rng = np.random.default_rng(seed)
    size = len(found.names)
    w = observations(rng, size, log_condition)
    unit = 10.0 ** (power + spread * rng.uniform(-1.0, 1.0, size))
    bread = inverse(w.T @ w)
    scores = w * rng.uniform(0.1, 3.0, (len(w), 1))
    robust = bread @ (scores.T @ scores) @ bread.T * np.outer(unit, unit)
    formula = bread * np.outer(unit, unit)
    theta = unit * rng.standard_normal(size)
    theta[rng.integers(size)] = 0.0
    theta[rng.integers(size)] *= 1e-30
    values = {"covariance": robust, "robust_covariance": robust, "formula_covariance": formula}
    return replace(found, judged=None, theta=theta, torque_sums=None, **values)


def is_covariance(matrix):
    assert (matrix == matrix.T).all()
    std = np.sqrt(np.diag(matrix))
    assert np.isfinite(std).all()
    scale = np.where(std > 0.0, std, 1.0)
    assert np.linalg.eigvalsh(matrix / scale / scale[:, None])[0] > -1e-9


@settings(max_examples=60, deadline=None)
@given(
    robot=st.sampled_from(["planar_2r", "emps"]),
    seed=st.integers(0, 2**32 - 1),
    log_condition=st.floats(0.0, 14.0),
    power=st.floats(-60.0, 60.0),
    spread=st.floats(0.0, 12.0),
)
@example("planar_2r", 0, 4.6, 0.0, 1.0)  # the condition numbers 4e4 and 8e5
@example("planar_2r", 0, 5.9, 0.0, 1.0)
def test_results_of_any_condition_and_size_come_back(
    tmp_path_factory, robot, seed, log_condition, power, spread
):
    made = badly_made(known()[robot], seed, log_condition, power, spread)
    for kind in KINDS:
        is_covariance(getattr(made, kind))
    folder = tmp_path_factory.mktemp("written")
    save_identification(made, folder)
    loaded = load_identification(folder)
    for name in KEPT:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(made, name))
    assert json.loads(to_json(loaded)) == json.loads(to_json(made))
    q, dq, ddq = np.random.default_rng(seed).normal(size=(3, 5, made.robot.size))
    again = stored_result(folder).model  # what `pivident predict` takes
    np.testing.assert_array_equal(again.predict(q, dq, ddq), made.predict(q, dq, ddq))
    (entry,) = load_entries([folder])  # `pivident compare`
    np.testing.assert_array_equal(entry.covariance, made.robust_covariance)
    assert compare([made, loaded], ["made", "loaded"]).marked(1) == ()
    assert export_model(runnable_model(loaded), "json").content  # `export --free`


def test_a_covariance_stays_as_it_is_to_the_last_bit():
    rng = np.random.default_rng(3)
    w = observations(rng, 9, 5.0)
    half = np.linalg.inv(np.linalg.cholesky(w.T @ w))
    sound = half.T @ half
    assert rounded_away(sound) is sound
    held = sound.copy()
    held[2] = held[:, 2] = 0.0  # one that nothing determines, or a bound holds
    assert rounded_away(held) is held
    unknown = np.full((3, 3), np.nan)
    assert rounded_away(unknown) is unknown


@pytest.mark.parametrize("log_condition", [1.0, 4.0, 6.0])
def test_rounding_is_taken_off_and_nothing_else(log_condition):
    """Against the inverse from singular values, of which none is the square of a small one."""
    rng = np.random.default_rng(4)
    w = observations(rng, 9, log_condition)
    _, values, right = np.linalg.svd(w, full_matrices=False)
    truth = (right.T / values**2) @ right
    std = np.sqrt(np.diag(truth))
    rounding = 10.0 ** (2 * log_condition) * 1e-14
    for found in (rounded_away(np.linalg.inv(w.T @ w)), inverse_gram(w.T @ w)):
        assert np.abs(found - truth).max() <= rounding * np.outer(std, std).max()
    lowest = np.linalg.eigvalsh(inverse_gram(w.T @ w) / np.outer(std, std))[0]
    assert lowest > 0.0, "definite at every condition number that is solved"


def test_a_variance_that_rounding_made_negative_is_what_is_not_known():
    wrong = np.diag([4.0, -9.0, 0.0])
    wrong[0, 2] = wrong[2, 0] = 1e-9  # beside a variance of zero
    np.testing.assert_allclose(rounded_away(wrong), np.diag([4.0, 9.0, 0.0]))


def test_files_that_earlier_versions_wrote_are_read(tmp_path):
    """Asymmetric by 2e-5 of the standard errors, at a condition number of 8e5."""
    content = to_dict(synthetic_identification())
    matrix = np.array(content["robust_covariance"])
    matrix[0, 1] += 2e-5 * np.sqrt(matrix[0, 0] * matrix[1, 1])
    file = tmp_path / "identification.json"
    file.write_text(json.dumps(content | {"robust_covariance": matrix.tolist()}))
    loaded = load_identification(file)
    np.testing.assert_array_equal(loaded.robust_covariance, 0.5 * (matrix + matrix.T))
    matrix[0, 1] += 2e-3 * np.sqrt(matrix[0, 0] * matrix[1, 1])
    file.write_text(json.dumps(content | {"robust_covariance": matrix.tolist()}))
    with pytest.raises(IdentificationFileError, match="robust_covariance is not symmetric"):
        load_identification(file)


@pytest.mark.parametrize("log_condition", [0.0, 4.6, 5.9])
def test_consistent_parameters_are_found_at_every_condition_number_that_is_solved(log_condition):
    """As `pivident export` needs them: the formula's correlations are definite."""
    found = known()["planar_2r"]
    w = observations(np.random.default_rng(5), len(found.names), log_condition)
    scale = found.std / np.sqrt(np.diag(inverse_gram(w.T @ w)))
    formula = inverse_gram(w.T @ w) * np.outer(scale, scale)
    robust = badly_made(found, 5, log_condition, 0.0, 0.0).covariance
    robust = robust * np.outer(*2 * [found.std / np.sqrt(np.diag(robust))])
    kinds = {"covariance": robust, "robust_covariance": robust, "formula_covariance": formula}
    model = make_consistent(replace(found, **kinds))
    assert np.abs(model.moved).max() < 3.0


@cache
def short_problem():
    (recording,) = planar_problem().recordings
    return replace(planar_problem(), recordings=(recording.part(0, 2500),))


#: Written by the same lines as those of another method, and slow; fits of simulations are in
#: ``test_stored_simulation``.
LEFT_OUT = {"set-membership", "frequency", "ukf", "cdkf", "particle", "piv-as-printed"}


@pytest.mark.parametrize(
    "name", [n for n in METHODS if n not in LEFT_OUT | {"cloe", "clie", "ml", "oloe"}]
)
def test_what_every_method_writes_is_read(tmp_path, name):
    made: Identification = identify(short_problem(), METHODS[name])
    for kind in KINDS:
        is_covariance(getattr(made, kind))
    save_identification(made, tmp_path)
    loaded = load_identification(tmp_path)
    for key in KEPT:
        np.testing.assert_array_equal(getattr(loaded, key), getattr(made, key))
    assert json.loads(to_json(loaded)) == json.loads(to_json(made))


def test_an_unknown_of_the_loop_whose_error_is_not_known_comes_back():
    made = LoopParameter("kp1", "N m/rad", 6000.0, np.nan)
    back = decode(LoopParameter, plain(made))
    assert back.value == made.value and np.isnan(back.std)
