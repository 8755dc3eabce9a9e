import numpy as np
import pytest

from pivident.estimation.solved_equations import EquationNoise
from pivident.foundation.codec import decode
from pivident.foundation.text.plain_values import plain
from tests.planar_results import planar_results


def test_noise_is_read_back_bit_for_bit():
    (result,) = planar_results("piv")
    noise = result.equation_noise
    again = decode(EquationNoise, plain(noise), joints=2)
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
        ("rate", -1.0, "rate = -1.0: must be greater than 0"),
        ("filters", [], "filters = .*2 joints need"),
        ("standstill", None, "standstill = None: must be a valid list"),
    ],
)
def test_damaged_noise_is_refused(key, value, message):
    (result,) = planar_results("piv")
    values = plain(result.equation_noise) | {key: value}
    with pytest.raises(ValueError, match=message):
        decode(EquationNoise, values, joints=2)
