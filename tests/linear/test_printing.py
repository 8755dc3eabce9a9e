"""Models as text and as figures."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lfilter

from pivident.linear.conversion import from_scipy, known_model
from pivident.linear.estimate import polynomial_text, printed, with_standard_error
from pivident.linear.model import gain, polynomials, response_and_gradient
from pivident.linear.sriv import riv


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(0)
    u = np.sign(rng.standard_normal((3000, 2)))
    a = [1, -1.5, 0.7]
    y = lfilter([1, 0.5], a, u[:, 0]) + lfilter([0, 0, 0, 0.3], a, u[:, 1])
    y += lfilter([1, 0.5], [1, -0.9], 0.3 * rng.standard_normal(3000))
    return riv(u, y, 0.01, (1, 0), 2, delay=(0, 3), noise_order=(1, 1))


def test_polynomials_have_the_highest_power_first():
    assert polynomial_text([1, 2.8, -4], True) == "p² + 2.8 p - 4"
    assert polynomial_text([1, -0.8, 0, 1], False) == "1 - 0.8 z⁻¹ + z⁻³"
    assert polynomial_text([-1.0, 0, 0], True) == "-p²"
    assert polynomial_text([0.0], True) == "0"


def test_values_have_the_digits_of_their_deviation():
    assert with_standard_error(-0.80003, 0.0021) == "-0.8000 ± 0.0021"
    assert with_standard_error(6406.3, 42.1) == "6406 ± 42"
    assert with_standard_error(1.5e9, 2.5e6) == "1.5000e+09 ± 2.5e+06"
    assert with_standard_error(0.25, 0.0) == "0.25"


def test_text_holds_everything(model):
    text = printed(model)
    assert text == str(model)
    for part in (
        "RIV",
        "u2(t - 0.03 s)",
        "z⁻²",
        "a1",
        "b0_u2",
        "poles",
        "gain of u2",
        "ξ = ",
        "R²",
    ):
        assert part in text
    assert len({line.index("±") for line in text.splitlines() if line.startswith("  a")}) == 1
    assert max(map(len, text.splitlines())) < 100


def test_continuous_model_and_integrator():
    text = printed(from_scipy(TransferFunction([2.0], [0.5, 1.0, 0.0]), 0.01))
    assert "p² + 2 p" in text
    assert "time constant 0.5 s" in text
    assert "infinite (integrator)" in text


def test_gradient_of_the_response(model):
    at = np.exp(1j * np.array([0.1, 1.0, 2.0]))
    for which in range(2):
        response, gradient = response_and_gradient(model, at, which)
        for i in range(model.theta.size):
            theta = model.theta.copy()
            theta[i] += 1e-7
            b, a = polynomials(model, theta, which)
            numeric = (np.polyval(b, at) / np.polyval(a, at) - response) / 1e-7
            assert np.allclose(gradient[i], numeric, rtol=1e-4, atol=1e-4)


def test_gain_is_where_the_step_response_ends(model):
    figure = model.step()
    ends = [trace.y[-1] for trace in figure.data if "±" not in trace.name]
    assert np.allclose(ends, [gain(model, 0)[0], gain(model, 1)[0]], rtol=0.01)


def test_bands_cover_the_curves(model):
    for figure in (model.bode(), model.step()):
        for band, curve in zip(figure.data[::2], figure.data[1::2], strict=True):
            upper, lower = np.split(np.asarray(band.y), 2)
            assert np.all(upper >= curve.y) and np.all(lower[::-1] <= curve.y)


def test_bode_of_a_known_system_has_no_band_and_the_right_numbers():
    model = from_scipy(TransferFunction([1.0], [1.0, 1.0]), 0.01)
    magnitude, phase = model.bode().data
    corner = np.argmin(np.abs(magnitude.x - 1 / (2 * np.pi)))
    assert magnitude.y[corner] == pytest.approx(-3.01, abs=0.1)
    assert phase.y[corner] == pytest.approx(-45, abs=1)
    assert model.step().data[0].y[-1] == pytest.approx(1 - np.exp(-6), abs=1e-3)


def test_separate_denominators():
    model = known_model([[1.0], [2.0]], [[1.0, 1.0], [1.0, 3.0]], 0.01, True)
    assert "poles of u2" in printed(model)
    assert len(model.bode().data) == 4
