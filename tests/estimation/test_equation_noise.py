import numpy as np
import pytest

from pivident.estimation.solved_equations import EquationNoise
from tests.planar_results import planar_results


def test_noise_is_read_back_bit_for_bit():
    (result,) = planar_results("piv")
    noise = result.equation_noise
    again = EquationNoise.from_values(noise.to_values(), 2)
    assert again.rate == noise.rate
    np.testing.assert_array_equal(again.standstill, noise.standstill)
    for own, other in zip(again.filters, noise.filters, strict=True):
        frequency = np.linspace(0.0, 100.0, 50)
        np.testing.assert_array_equal(
            own.response(frequency, noise.rate), other.response(frequency, noise.rate)
        )


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("rate", -1.0, "rate and standstill must be finite"),
        ("filters", [], "one filter for each of 2 joints"),
        ("standstill", None, "not a number|one filter"),
    ],
)
def test_damaged_noise_is_refused(key, value, message):
    (result,) = planar_results("piv")
    values = result.equation_noise.to_values() | {key: value}
    with pytest.raises(ValueError, match=message):
        EquationNoise.from_values(values, 2)
