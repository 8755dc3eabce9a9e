"""Sums and tests against direct solutions on stacked rows."""

import numpy as np
import pytest

from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.cause_sums import CauseSums, JointRows
from pivident.judgement.model_errors.column_tests import Normal, Partition
from pivident.judgement.model_errors.score_tests import ScoreTests

ROWS, BLOCKS = 600, 5


def made(seed=0, size=0.0):
    """Two joints, three parameters and three causes, one of which has a size."""
    rng = np.random.default_rng(seed)
    columns = (np.array([0, 1, 3, 4]), np.array([1, 2, 4, 5]))
    theta = np.array([1.0, -2.0, 0.5, size, 0.0, 0.0])
    records = []
    for _ in range(2):
        record = []
        for own in columns:
            x = rng.standard_normal((own.size, ROWS))
            tau = theta[own] @ x + 0.1 * rng.standard_normal(ROWS)
            record.append(JointRows(own, x, tau))
        records.append(record)
    variance = np.array([0.01, 0.02])
    tests = score_tests(records, variance)
    return records, variance, tests


def score_tests(records, variance):
    # none explains too little to be tested
    causes = [Cause(kind, "", kind, "", lambda m: m.q, least=-np.inf) for kind in "abc"]
    first = np.array([3, 4, 5, 6])
    return ScoreTests(CauseSums(records, variance, first, BLOCKS), causes, first, 3)


def stacked(records, variance, rows=slice(None)):
    """X and τ of all rows, weighted."""
    x, tau = [], []
    for record in records:
        for r, lam in zip(record, variance, strict=True):
            full = np.zeros((r.tau[rows].size, 6))
            full[:, r.columns] = r.x[:, rows].T / np.sqrt(lam)
            x.append(full)
            tau.append(r.tau[rows] / np.sqrt(lam))
    return np.vstack(x), np.concatenate(tau)


@pytest.mark.parametrize("corrected", [[], [0], [0, 1]])
def test_fit_is_that_of_the_stacked_rows(corrected):
    records, variance, tests = made(size=0.3)
    x, tau = stacked(records, variance)
    own = tests.columns(corrected)
    expected = np.linalg.solve(x[:, own].T @ x[:, own], x[:, own].T @ tau)
    fit = tests.fit(own)
    np.testing.assert_allclose(fit.theta, expected, rtol=1e-9)
    assert fit.residual == pytest.approx(np.sum((tau - x[:, own] @ expected) ** 2), rel=1e-8)


def test_unseen_blocks_are_predicted_by_the_others():
    records, variance, tests = made(size=0.3)
    own = tests.columns([])
    total = 0.0
    length = 2 * ROWS
    for block in range(BLOCKS):
        seen, unseen = [[], []], [[], []]
        for k, record in enumerate(records):
            number = (k * ROWS + np.arange(ROWS)) * BLOCKS // length
            for target, part in ((seen, number != block), (unseen, number == block)):
                x, tau = stacked([record], variance, part)
                target[0].append(x[:, own])
                target[1].append(tau)
        theta = np.linalg.lstsq(np.vstack(seen[0]), np.concatenate(seen[1]), rcond=None)[0]
        total += np.sum((np.concatenate(unseen[1]) - np.vstack(unseen[0]) @ theta) ** 2)
    assert tests.fit(own).unseen == pytest.approx(total, rel=1e-8)


def test_size_has_its_standard_error():
    """Rows of white noise: the jackknife agrees with the formula, and so does the sensitivity."""
    records, variance, tests = made(size=0.3)
    x, _ = stacked(records, variance)
    score = tests.all_scores([])[1][0]
    own = tests.columns([0])
    inverse = np.linalg.inv(x[:, own].T @ x[:, own])
    residual = 0.5 * (1.0 + 0.1**2 / 0.02)  # of unit variance on the first joint
    assert score.size[0] == pytest.approx(0.3, abs=0.02)
    assert score.std[0] == pytest.approx(np.sqrt(residual * inverse[3, 3]), rel=0.4)
    assert score.significance < 1e-6
    gain = tests.sensitivity(own)
    expected = np.linalg.solve(x[:, :3].T @ x[:, :3], x[:, :3].T @ x[:, 3:4])
    np.testing.assert_allclose(gain, expected, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(score.shift, -gain[:, 0] * score.size[0], rtol=1e-6, atol=1e-9)


def test_chance_is_not_significant():
    """Of 100 causes without a size about five are significant at 5 %."""
    found = []
    for seed in range(50):
        _, _, tests = made(seed)
        found += [score.significance for score in tests.all_scores([])[1].values()]
    assert 0.01 <= np.mean(np.array(found) < 0.05) <= 0.12


def test_columns_that_the_model_has_are_not_distinct():
    records, variance, _ = made()
    for record in records:
        for r in record:
            if 3 in r.columns:  # the first cause is the first parameter once more
                r.x[2] = r.x[0]
    tests = score_tests(records, variance)
    _, scores = tests.all_scores([])
    assert set(scores) == {1, 2}


def test_a_cause_that_is_corrected_already_hides_its_like():
    """Also where the motion hardly separates the parameters."""
    rng = np.random.default_rng(0)
    x = rng.standard_normal((6, ROWS))
    x[1] = x[0] + 1e-4 * x[1]
    x[3] = x[2] + 0.5 * x[0] + 0.01 * x[3]
    x[4] = x[3]  # causes a and b are the same torque
    tau = x[0] + 0.3 * x[3] + 0.1 * rng.standard_normal(ROWS)
    tests = score_tests([[JointRows(np.arange(6), x, tau)]], np.array([0.01]))
    assert set(tests.all_scores([])[1]) == {0, 1, 2}
    assert set(tests.all_scores([0])[1]) == {2}
    assert tests.columns([0, 1]).tolist() == [0, 1, 2, 3]
    assert np.isfinite(tests.covariance(tests.columns([0, 1]), np.zeros(4))).all()


def test_several_columns_are_tested_as_whole_fits_have_them():
    """A cause of two columns beside one of a single column."""
    records, variance, _ = made(size=0.3)
    causes = [
        Cause(kind, "", kind, "", lambda m: m.q, count, least=-np.inf)
        for kind, count in (("a", 2), ("b", 1))
    ]
    first = np.array([3, 5, 6])
    tests = ScoreTests(CauseSums(records, variance, first, BLOCKS), causes, first, 2)
    for corrected in ([], [1]):
        base, scores = tests.all_scores(corrected)
        columns = tests.columns([*corrected, 0])
        fit = tests.fit(columns)
        covariance = tests.covariance(columns, fit.theta)
        np.testing.assert_allclose(scores[0].size, fit.theta[-2:], rtol=1e-8)
        np.testing.assert_allclose(scores[0].covariance, covariance[-2:, -2:], rtol=1e-7)
        assert scores[0].explained == pytest.approx(1.0 - fit.residual / base.residual, abs=1e-9)
        assert scores[0].unseen == pytest.approx(1.0 - fit.unseen / base.unseen, abs=1e-9)


def test_two_causes_meet_only_once_one_of_them_stays():
    """Of all columns against all there are as many as causes squared, in each part of the rows."""
    records, variance, _ = made(size=0.3)
    first = np.array([2, 3, 6])  # a cause of one column and one of three
    sums = CauseSums(records, variance, first, BLOCKS)
    x, tau = stacked(records, variance)
    whole, right = x.T @ x, x.T @ tau
    every = np.arange(6)

    def entries(rows, columns):
        return sums.windows.of(rows, columns).sum(axis=0)

    own = np.array([3, 4, 5])
    np.testing.assert_allclose(entries(own[:, None], own), whole[3:, 3:], rtol=1e-10)
    np.testing.assert_allclose(entries(every[:, None], every[:2]), whole[:, :2], rtol=1e-10)
    np.testing.assert_allclose(entries(every[:2, None], every), whole[:2], rtol=1e-10)
    np.testing.assert_allclose(sums.windows.tau.sum(axis=0), right, rtol=1e-10)
    with pytest.raises(ValueError, match="neither of which stays"):
        entries(every[:, None], every)
    sums.stay(np.array([2]))
    np.testing.assert_allclose(entries(every[:, None], every), whole, rtol=1e-10)
    x_x = sums.blocks.of(every[:, None], every).sum(axis=0)
    np.testing.assert_allclose(x_x, x.T @ x, rtol=1e-10)
    assert sums.squares.sum() == pytest.approx(tau @ tau)


def test_columns_join_each_part_as_a_whole_solution_has_them():
    """δ and θ of a cause of three columns, with each window left out in turn."""
    records, variance, _ = made(size=0.3)
    first, stay = np.array([2, 3, 6]), np.array([0, 1])
    sums = CauseSums(records, variance, first, BLOCKS)
    whole, windows = sums.windows.total, sums.windows
    part = Partition.of(Normal(whole, windows), np.isin(np.arange(6), stay), np.ones(6))
    own = np.array([1, 3])  # among the others
    theta, delta = part.joined(own)
    columns = np.r_[stay, 2 + own]
    gram, right = whole.of(columns[:, None], columns)[0], whole.tau[0, columns]
    parts = windows.of(columns[:, None], columns), windows.tau[:, columns]
    for k, (x, tau) in enumerate(zip(*parts, strict=True)):
        direct = np.linalg.solve(gram - x, right - tau)
        np.testing.assert_allclose(np.r_[theta[k], delta[k]], direct, rtol=1e-8, atol=1e-12)
    each = part.schur(own[:, None])[..., 0, 0]
    np.testing.assert_allclose(each, part.schur(own)[:, [0, 1], [0, 1]], rtol=1e-10)


@pytest.mark.parametrize("corrected", [[], [0], [2, 0]])
def test_scores_are_those_of_whole_fits(corrected):
    """The partition gives what a solution with all columns gives."""
    _, _, tests = made(size=0.3)
    base, scores = tests.all_scores(corrected)
    for number, score in scores.items():
        columns = tests.columns([*corrected, number])
        fit = tests.fit(columns)
        covariance = tests.covariance(columns, fit.theta)
        np.testing.assert_allclose(score.size, fit.theta[-1:], rtol=1e-8)
        np.testing.assert_allclose(score.covariance, covariance[-1:, -1:], rtol=1e-7)
        assert score.explained == pytest.approx(1.0 - fit.residual / base.residual, abs=1e-9)
        assert score.unseen == pytest.approx(1.0 - fit.unseen / base.unseen, abs=1e-9)


def test_sizes_are_those_by_instruments():
    """Of a column that the motion of the instruments follows by four fifths."""
    rng = np.random.default_rng(4)
    measured = rng.standard_normal((6, ROWS))
    x = measured.copy()
    x[3] = 1.25 * measured[3] + 0.1 * rng.standard_normal(ROWS)
    tau = np.array([1.0, -2.0, 0.5, 0.3, 0.0, 0.0]) @ measured + 0.05 * rng.standard_normal(ROWS)
    variance, columns = np.array([0.0025]), np.arange(6)
    causes = [Cause(kind, "", kind, "", lambda m: m.q, least=-np.inf) for kind in "abc"]
    first = np.array([3, 4, 5, 6])

    def again(chosen):
        own = [0, 1, 2, *(3 + "abc".index(cause.kind) for cause in chosen)]
        return [[JointRows(np.arange(len(own)), measured[own], tau)]]

    sums = CauseSums([[JointRows(columns, x, tau)]], variance, first, BLOCKS)
    tests = ScoreTests(sums, causes, first, 3, again)
    (size, covariance), (other, _) = tests.sizes([0, 2])
    assert size[0] == pytest.approx(0.3, abs=0.01)
    assert tests.all_scores([])[1][0].size[0] == pytest.approx(0.24, abs=0.01)
    assert other[0] == pytest.approx(0.0, abs=0.01)
    own, noise = [0, 1, 2, 3], 0.05**2
    inverse = np.linalg.inv(x[own] @ measured[own].T)
    of_noise = noise * inverse @ (x[own] @ x[own].T) @ inverse.T
    assert covariance[0, 0] == pytest.approx(of_noise[3, 3], rel=0.5)
    theta, _ = tests.estimate([0])
    np.testing.assert_allclose(theta, inverse @ x[own] @ tau, rtol=1e-9)


def test_without_instruments_sizes_are_those_of_the_tests():
    _, _, tests = made(size=0.3)
    ((size, covariance),) = tests.sizes([0])
    score = tests.all_scores([])[1][0]
    np.testing.assert_allclose(size, score.size, rtol=1e-8)
    np.testing.assert_allclose(covariance, score.covariance, rtol=1e-7)
