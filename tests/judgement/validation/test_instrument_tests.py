"""Tests on instruments against dense algebra, linearmodels, their size and their power."""

import pickle

import numpy as np
import pytest
from scipy.linalg import eigh

from pivident.estimation.covariance.windows import OVERLAP, windows_of
from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.instrument_tests import (
    instrument_tests,
    relevance_test,
)
from pivident.judgement.validation.moment_sums import moment_sums
from pivident.judgement.validation.overidentification import (
    exogeneity_test,
    overidentification_test,
)
from tests.judgement.validation.simulated_moments import NAMES, rows, sums_of


def least_squares(columns, right):
    return np.linalg.lstsq(columns, right, rcond=None)[0]


def projected(columns, right):
    return columns @ least_squares(columns, right)


def square(columns, right):
    return float(np.sum((right - projected(columns, right)) ** 2))


@pytest.fixture(scope="module")
def example():
    return rows(np.random.default_rng(0), 600, correlation=0.3, shared=0.2)


@pytest.fixture(scope="module")
def found():
    problem, _ = tx40_scenario("fine", seed=1, samples=12000)
    return identify(problem, "iv-full-rate")


class TestAgainstDenseAlgebra:
    def test_durbin_wu_hausman_is_the_augmented_regression(self, example):
        phi, z, tau, _ = example
        test = exogeneity_test(sums_of(phi, z, tau), NAMES)
        rest = (phi - projected(z, phi))[:, :2]  # the offset is its own instrument
        small, large = square(phi, tau), square(np.hstack([phi, rest]), tau)
        expected = (small - large) / 2 / (large / (600 - 5))
        assert test.directions == 2
        assert test.white_statistic == pytest.approx(expected, rel=1e-8)
        theta = np.linalg.solve(z.T @ phi, z.T @ tau)
        assert np.allclose(test.difference, least_squares(phi, tau) - theta)

    def test_sargan_is_the_explained_square_of_two_stage_residuals(self, example):
        phi, z, tau, extra = example
        test = overidentification_test(sums_of(phi, z, tau, extra), NAMES)
        every = np.hstack([z, extra])
        theta = least_squares(projected(every, phi), tau)
        residual = tau - phi @ theta
        expected = np.sum(projected(every, residual) ** 2) / np.mean(residual**2)
        assert test.directions == 2
        assert test.j == pytest.approx(expected, rel=1e-8)
        start = np.linalg.solve(z.T @ phi, z.T @ tau)
        assert np.allclose(test.relative, (theta - start) / np.abs(start), atol=1e-9)

    def test_shea_r2_and_cragg_donald_follow_their_definitions(self, example):
        phi, z, tau, _ = example
        test = relevance_test(sums_of(phi, z, tau), NAMES)
        hat = projected(z, phi)
        for i in (0, 1):
            others = [k for k in range(3) if k != i]
            own = phi[:, i] - projected(phi[:, others], phi[:, i])
            fitted = hat[:, i] - projected(hat[:, others], hat[:, i])
            expected = (own @ fitted) ** 2 / (own @ own) / (fitted @ fitted)
            assert test.partial_r2[i] == pytest.approx(expected, rel=1e-6)
        assert test.partial_r2[2] == 1.0 and np.isinf(test.first_stage_f[2])
        one = np.ones((600, 1))
        proper, noisy = z[:, :2] - z[:, :2].mean(0), phi[:, :2] - phi[:, :2].mean(0)
        explained = projected(proper, noisy)
        noise = noisy - explained
        smallest = eigh(explained.T @ explained, noise.T @ noise / (600 - 3))[0][0] / 2
        assert test.cragg_donald == pytest.approx(smallest, rel=1e-6)
        first = square(one, phi[:, 0]) - square(z, phi[:, 0])
        assert test.white_f[0] == pytest.approx(first / 2 / square(z, phi[:, 0]) * 597, rel=1e-8)

    def test_condition_of_unit_columns(self, example):
        phi, z, tau, _ = example
        unit = (z / np.linalg.norm(z, axis=0)).T @ (phi / np.linalg.norm(phi, axis=0))
        test = relevance_test(sums_of(phi, z, tau), NAMES)
        assert test.condition == pytest.approx(np.linalg.cond(unit))

    def test_the_deviation_of_a_difference_is_that_without_each_window(self, example):
        phi, z, tau, _ = example
        test = exogeneity_test(sums_of(phi, z, tau), NAMES)
        (windows,) = windows_of([600])
        weight = np.zeros((windows.count, 600))
        for share in windows.shares(slice(0, 600)):
            weight[share.window, share.part] += 1 - share.rising
            weight[share.window + 1, share.part] += share.rising
        steps = []
        for w in 1 - weight:
            ls = np.linalg.solve(phi.T @ (w[:, None] * phi), phi.T @ (w * tau))
            steps.append(ls - np.linalg.solve(z.T @ (w[:, None] * phi), z.T @ (w * tau)))
        expected = np.sqrt(np.sum((np.array(steps) - test.difference) ** 2, axis=0) / OVERLAP)
        assert np.allclose(test.difference_std, expected, rtol=1e-6)


def test_agreement_with_linearmodels(example):
    iv = pytest.importorskip("linearmodels.iv")
    phi, z, tau, extra = example
    exact = iv.IV2SLS(tau, phi[:, 2:], phi[:, :2], z[:, :2]).fit(cov_type="unadjusted")
    sums = sums_of(phi, z, tau, extra)
    hausman = exact.wu_hausman()
    test = exogeneity_test(sums, NAMES)
    assert test.white_statistic == pytest.approx(hausman.stat, rel=1e-6)
    first = exact.first_stage.diagnostics
    relevance = relevance_test(sums, NAMES)
    assert np.allclose(relevance.partial_r2[:2], first["shea.rsquared"], rtol=1e-6)
    more = iv.IV2SLS(tau, phi[:, 2:], phi[:, :2], np.hstack([z[:, :2], extra]))
    sargan = more.fit(cov_type="unadjusted").sargan
    hansen = overidentification_test(sums, NAMES)
    assert hansen.j == pytest.approx(sargan.stat, rel=1e-6)
    assert hansen.j_p_value == pytest.approx(sargan.pval, rel=1e-4)
    assert hansen.directions == sargan.df


class TestSizeAndPower:
    """Short version of benchmarks/instrument_test_sizes.py."""

    def rejections(self, runs=200, **case):
        rng = np.random.default_rng(3)
        count = np.zeros(4)
        for _ in range(runs):
            sums = sums_of(*rows(rng, **case))
            dwh, j = exogeneity_test(sums, NAMES), overidentification_test(sums, NAMES)
            count += dwh.rejects, j.rejects, dwh.white_p_value < 0.05, j.j_p_value < 0.05
        return count / runs

    @pytest.mark.parametrize("correlation", [0.0, 0.9])
    def test_robust_tests_hold_their_size_whatever_the_correlation(self, correlation):
        dwh, j, _, j_white = self.rejections(correlation=correlation)
        assert 0.015 <= dwh <= 0.09 and 0.015 <= j <= 0.09
        assert (j_white > 0.2) == (correlation > 0)

    def test_noise_shared_by_regressor_and_residual_is_noticed(self):
        dwh, j, _, _ = self.rejections(50, correlation=0.9, shared=0.1)
        assert dwh > 0.9 and j < 0.2

    def test_an_instrument_that_knows_the_residual_is_noticed(self):
        assert self.rejections(50, correlation=0.9, invalid=0.3)[1] > 0.9

    def test_irrelevant_instruments_are_called_weak(self):
        rng = np.random.default_rng(4)
        found = [relevance_test(sums_of(*rows(rng, relevant=False)), NAMES) for _ in range(200)]
        rejected = np.mean([t.p_values[1] < 0.05 for t in found])
        assert 0.015 <= rejected <= 0.09
        assert np.mean(["fv1" in t.weak for t in found]) > 0.95
        assert "weak" in str(found[0])

    def test_one_column_of_two_without_an_instrument(self):
        """Both first stages are strong, their combination is not: Cragg and Donald notice."""
        rng = np.random.default_rng(5)
        phi, z, tau, _ = rows(rng)
        phi[:, 1] = phi[:, 0] + 0.5 * rng.standard_normal(len(phi))
        test = relevance_test(sums_of(phi, z, tau), NAMES)
        assert test.first_stage_f[:2].min() > 100 and not test.weak
        assert test.cragg_donald < 10 and test.partial_r2[:2].max() < 0.1
        assert "combination" in str(test)


class TestOnAnIdentification:
    def test_sums_give_the_estimate_and_its_deviations_again(self, found):
        sums = moment_sums(found)
        theta = np.linalg.solve(sums.block("z", "phi"), sums.block("z", "tau"))[:, 0]
        assert np.allclose(theta, found.theta, rtol=1e-8)
        assert sums.rows == sum(j.rows for j in found.joints)
        assert np.allclose(sums.windows.sum(axis=0)[:, :-1], sums.gram[:-1, :-1][:, : 2 * 28])
        assert sums.shares.sum() == pytest.approx(1.0)

    def test_all_tests_speak(self, found):
        tests = instrument_tests(found)
        assert tests.relevance.weak == () and tests.relevance.cragg_donald > 1000
        assert tests.overidentification.further == "reference"
        assert tests.overidentification.directions > 20
        assert not tests.overidentification.rejects
        assert tests.exogeneity.difference.shape == (28,)
        words = str(tests)
        assert "Relevance" in words and "Hausman" in words and "Φ(q_ref)" in words
        assert instrument_tests(found, "delayed").overidentification.further == "delayed"

    def test_decimated_equations_have_delayed_instruments(self):
        problem, _ = tx40_scenario("fine", seed=1)
        found = identify(problem, "iv")
        tests = instrument_tests(found)
        assert tests.overidentification.further == "delayed"
        assert tests.relevance.statistic > 100
        with pytest.raises(IdentificationError, match="decimated"):
            instrument_tests(found, "reference")

    def test_least_squares_has_no_instruments(self, found):
        problem, _ = tx40_scenario("fine", seed=1, samples=12000)
        with pytest.raises(IdentificationError, match="no instruments"):
            instrument_tests(identify(problem, "ls"))

    def test_without_further_instruments_there_is_nothing_to_contradict(self, found):
        with pytest.raises(IdentificationError, match="as many instruments"):
            overidentification_test(moment_sums(found), found.names)

    def test_a_result_travels_between_processes_with_its_equations(self, found):
        copy = pickle.loads(pickle.dumps(found))
        assert np.allclose(moment_sums(copy).gram, moment_sums(found).gram)
