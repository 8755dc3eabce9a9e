"""A number and its interval are written to the same digit."""

import math

import pytest

from pivident.studies.flexibility.measured import Measured


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((60.008, 59.9984, 60.0176), "60.0080 N m (95 %: 59.9984 to 60.0176)"),
        ((200006.0, 198100.0, 201900.0), "200000 N m (95 %: 198100 to 201900)"),
        ((-0.0231, -0.522, 0.476), "-0.023 N m (95 %: -0.522 to 0.476)"),
        ((-0.0001, -0.5, 0.5), "0.000 N m (95 %: -0.500 to 0.500)"),
        ((2.5e-5, 2e-5, 3e-5), "2.5e-05 N m (95 %: 2e-05 to 3e-05)"),
        ((3.0, 2.0, math.inf), "3.00 N m (95 %: 2.00 to inf)"),
        ((math.inf, 1.48e6, math.inf), "above 1.48e+06 N m"),
        ((math.nan, -math.inf, math.inf), "not determined"),
    ],
)
def test_value_and_ends_end_at_the_same_digit(numbers, words):
    assert str(Measured(*numbers, "N m")) == words


def test_an_unknown_quantity_has_neither_value_nor_ends():
    assert not Measured.unknown("N m").is_known
    assert (
        Measured(math.inf, 1.48e6, math.inf, "N m").is_known
        and Measured.around(1, 2, "N m").is_known
    )
