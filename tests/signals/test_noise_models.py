import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import butter, lfilter

from pivident.foundation.errors import IdentificationError
from pivident.judgement.validation.residuals.autocorrelation import JointResidual, ljung_box
from pivident.signals.noise_models import (
    fit_ar,
    unmasked_stretches,
    whiten,
)

AR2 = [1.0, -1.5, 0.8]


def coloured(samples=34_500, seed=0, numerator=(1.0,), denominator=AR2):
    return lfilter(numerator, denominator, np.random.default_rng(seed).standard_normal(samples))


def burg_by_the_book(stretches, order):
    """Burg's recursion with shifted arrays, one pair of errors per stretch."""
    forward = [s[1:].copy() for s in stretches]
    backward = [s[:-1].copy() for s in stretches]
    a = np.ones(1)
    for _ in range(order):
        pairs = list(zip(forward, backward, strict=True))
        k = -2 * sum(f @ b for f, b in pairs) / sum(f @ f + b @ b for f, b in pairs)
        forward = [(f + k * b)[1:] for f, b in pairs]
        backward = [(b + k * f)[:-1] for f, b in pairs]
        a = np.r_[a, 0] + k * np.r_[0, a[::-1]]
    return a


def test_second_order_process_is_recovered():
    model = fit_ar(coloured(), order=2)
    np.testing.assert_allclose(model.coefficients, AR2, atol=0.015)
    assert model.innovation_variance == pytest.approx(1.0, rel=0.02)
    assert np.abs(np.roots(model.coefficients)).max() < 1


@given(st.integers(1, 12), st.integers(0, 5))
@settings(max_examples=20, deadline=None)
def test_coefficients_are_those_of_the_textbook(order, seed):
    v = coloured(400, seed)
    expected = burg_by_the_book([v - v.mean()], order)
    np.testing.assert_allclose(fit_ar(v, order=order).coefficients, expected, atol=1e-10)


def test_statsmodels_agrees():
    from statsmodels.regression.linear_model import burg

    v = coloured(2000)
    rho, variance = burg(v, order=6, demean=True)
    model = fit_ar(v, order=6)
    np.testing.assert_allclose(model.coefficients[1:], -rho, atol=1e-10)
    assert model.innovation_variance == pytest.approx(variance, rel=2e-3)


@given(st.lists(st.integers(40, 300), min_size=1, max_size=5), st.integers(1, 10))
@settings(max_examples=20, deadline=None)
def test_stretches_are_fitted_without_products_across_gaps(lengths, order):
    v = coloured(sum(lengths) + 10 * len(lengths))
    mask = np.ones(v.size, dtype=bool)
    stretches, start = [], 5
    for length in lengths:
        mask[start : start + length] = False
        stretches.append(v[start : start + length])
        start += length + 10
    mean = np.concatenate(stretches).mean()
    expected = burg_by_the_book([s - mean for s in stretches], order)
    v[mask] = 1e9
    found = fit_ar(v, order=order, mask=mask)
    np.testing.assert_allclose(found.coefficients, expected, atol=1e-10)
    same = fit_ar(v, order=order, segments=unmasked_stretches(mask))
    np.testing.assert_array_equal(same.coefficients, found.coefficients)
    assert found.samples == sum(lengths)


def test_short_stretches_are_ignored():
    v = coloured(3000)
    mask = np.zeros(3000, dtype=bool)
    mask[2000:] = np.arange(1000) % 20 == 0
    v[2001:] *= 1e3
    model = fit_ar(v, 30, mask=mask)
    assert model.samples == 2000
    assert model.innovation_variance == pytest.approx(1.0, rel=0.1)
    assert fit_ar(v, 30, mask=mask, shortest=10).samples > 2900


def test_transients_are_skipped():
    v = coloured(5000)
    spoilt = v.copy()
    spoilt[:100] += 1e6
    np.testing.assert_array_equal(
        fit_ar(spoilt, order=2, skip=100).coefficients, fit_ar(v[100:], order=2).coefficients
    )


def test_the_mean_does_not_matter():
    v = coloured(5000)
    np.testing.assert_allclose(
        fit_ar(v + 1e3, order=2).coefficients, fit_ar(v, order=2).coefficients, atol=1e-9
    )


def test_order_of_a_process_is_found_by_bic_and_nearly_by_aic():
    v = coloured()
    assert fit_ar(v, criterion="bic").order == 2
    assert 2 <= fit_ar(v, criterion="aic").order <= 12
    assert fit_ar(v, criterion="aicc").order <= fit_ar(v, criterion="aic").order


@given(st.integers(0, 100))
@settings(max_examples=20, deadline=None)
def test_models_of_all_orders_are_stable(seed):
    v = np.random.default_rng(seed).standard_normal(60).cumsum()
    model = fit_ar(v, order=25)
    assert np.abs(np.roots(model.coefficients)).max() < 1


def test_a_notch_in_the_spectrum_is_whitened():
    b, a = butter(2, 0.3)
    v = coloured(numerator=b, denominator=a)
    model = fit_ar(v, 200)
    white = whiten(model, v)[model.order :]
    assert model.innovation_variance == pytest.approx(0.0174, rel=0.02)
    assert ljung_box(JointResidual("white", (white,)), 40).statistic < 55.8
    assert ljung_box(JointResidual("coloured", (v,)), 40).p_value < 1e-6


def test_a_search_that_ends_at_its_largest_order_says_so():
    v = coloured(numerator=[1, -2, 1], denominator=[1.0])
    assert fit_ar(v, 10).at_bound
    assert not fit_ar(v, order=10).at_bound


def test_the_largest_order_shrinks_with_the_record():
    assert fit_ar(coloured(100)).order_max == 50


def test_whitening_undoes_the_colouring_column_by_column():
    rng = np.random.default_rng(0)
    white = rng.standard_normal((500, 3))
    model = fit_ar(coloured(), order=2)
    v = lfilter([1.0], model.coefficients, white, axis=0)
    np.testing.assert_allclose(whiten(model, v), white, atol=1e-10)
    np.testing.assert_allclose(whiten(model, v[:, 1]), white[:, 1], atol=1e-10)


def test_spectrum_integrates_to_the_variance():
    v = coloured(200_000)
    frequency = np.linspace(0, 500, 20_001)
    power = np.trapezoid(fit_ar(v, order=2).spectrum(frequency, 1000), frequency)
    assert power == pytest.approx(np.var(v), rel=0.01)


@pytest.mark.parametrize(
    ("v", "options", "message"),
    [
        (np.ones(100), {}, "constant"),
        (np.zeros(100), {}, "constant"),
        (np.arange(5.0), {}, "too few"),
        (np.arange(100.0), {"mask": np.ones(100)}, "too few"),
        (np.arange(100.0), {"order": 80}, "too few"),
        (np.arange(100.0), {"criterion": "fpe"}, "aic, aicc or bic"),
        (np.r_[np.arange(100.0), np.nan], {}, "NaN"),
    ],
)
def test_what_has_no_noise_model_is_refused(v, options, message):
    with pytest.raises(IdentificationError, match=message):
        fit_ar(v, **options)
