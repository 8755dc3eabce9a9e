import math

import numpy as np
import pytest

from pivident.estimation.parameter_rows import (
    ParameterRow,
    aligned_rows,
    largest_difference,
    method_labels,
    parameter_rows,
)
from pivident.foundation.text.numbers import (
    format_exact,
    format_significant,
    percent,
    plus_minus,
    with_spread,
)
from tests.synthetic_identification import synthetic_identification, true_parameters


def row(value: float, std: float, truth: float = math.nan) -> ParameterRow:
    return ParameterRow("zz1r", value, std, std, "kg m²", "zz1", truth)


@pytest.mark.parametrize(
    ("value", "spread", "text"),
    [
        (1.23456, 0.0123, ("1.235", "0.012")),
        (-0.00034, 0.00012, ("-0.00034", "0.00012")),
        (123456.7, 230.0, ("123457", "230")),
        (1.2345678912, 1.2e-9, ("1.2345678912", "0.0000000012")),
        (1.234e-8, 3.2e-10, ("1.234e-08", "0.032e-08")),
        (4.5e7, 1.2e5, ("4.500e+07", "0.012e+07")),
        (1.5, 0.0, ("1.5000", "0")),
        (1.5, math.nan, ("1.5000", "–")),
        (math.nan, 1.0, ("–", "1.0")),
    ],
)
def test_values_end_at_the_second_digit_of_their_spread(value, spread, text):
    assert with_spread(value, spread) == text


@pytest.mark.parametrize(
    ("value", "spread", "text"),
    [
        (1000.056, 0.0912, "+1000.056 ± 0.091"),
        (1.00002, 0.0003, "+1.00002 ± 0.00030"),
        (-49.9991, 0.0151, "-49.999 ± 0.015"),
        (1.5, 0.0, "+1.5000"),
        (1.5, math.nan, "+1.5000"),
        (1.5, math.inf, "+1.5000 ± ∞"),
    ],
)
def test_value_and_spread_are_written_together(value, spread, text):
    assert plus_minus(value, spread, sign=True) == text
    assert plus_minus(value, spread) == text.removeprefix("+")


@pytest.mark.parametrize(
    ("x", "text"),
    [
        (0.0123456, "0.0123"),
        (-1234.5, "-1234"),
        (2.4e-5, "2.40e-05"),
        (0.0, "0"),
        (math.inf, "∞"),
        (-math.inf, "-∞"),
        (math.nan, "–"),
    ],
)
def test_significant_digits(x, text):
    assert format_significant(x) == text


def test_exact_values_and_percentages():
    assert format_exact(0.000785) == "0.000785"
    assert format_exact(4.0) == "4"
    assert format_exact(math.nan) == percent(math.nan) == "–"
    assert percent(1.234) == "1.2 %"


def test_errors_against_a_truth():
    assert row(1.1, 0.05, truth=1.0).error_percent == pytest.approx(10.0)
    assert row(-0.9, 0.05, truth=-1.0).error_sigmas == pytest.approx(2.0)
    assert math.isnan(row(1.0, 0.1).error_percent)
    assert math.isnan(row(1.0, 0.0).error_sigmas)
    assert math.isnan(row(1.0, 0.1, truth=0.0).error_percent)
    assert row(1.0, 0.0, truth=0.5).error_sigmas == math.inf


def test_truth_is_found_with_and_without_r():
    identification = synthetic_identification()
    rows = {r.name: r for r in parameter_rows(identification, {"ZZ1": 1.0, "mx1r": 2.0})}
    assert rows["zz1r"].truth == 1.0
    assert rows["mx1r"].truth == 2.0
    assert math.isnan(rows["fv1"].truth)


def test_rows_carry_the_numbers_of_the_identification():
    identification = synthetic_identification()
    rows = parameter_rows(identification, true_parameters())
    np.testing.assert_array_equal([r.value for r in rows], identification.theta)
    np.testing.assert_array_equal([r.std for r in rows], identification.robust_std)
    np.testing.assert_array_equal([r.method_std for r in rows], identification.method_std)
    assert [r.unit for r in rows] == list(identification.units)
    assert not any(math.isnan(r.truth) for r in rows)


def test_repeated_methods_are_numbered():
    results = [synthetic_identification(m) for m in ("IDIM-LS", "IDIM-PIV", "IDIM-LS")]
    assert method_labels(results) == ("IDIM-LS (1)", "IDIM-PIV", "IDIM-LS (2)")


def test_rows_of_different_parameter_sets_are_aligned():
    from dataclasses import replace

    full = synthetic_identification()
    part = replace(
        full,
        parameters=full.parameters[1:],
        names=full.names[1:],
        expressions=full.expressions[1:],
        judged=None,
        theta=full.theta[1:],
        covariance=full.covariance[1:, 1:],
        robust_covariance=full.robust_covariance[1:, 1:],
    )
    table = aligned_rows([part, full])
    assert set(table) == set(full.names)
    assert table["zz1r"][0] is None
    assert table["mx1r"][0].value == table["mx1r"][1].value


def test_largest_difference_in_combined_deviations():
    rows = [row(1.0, 0.03), None, row(1.1, 0.04), row(1.5, 0.3)]
    assert largest_difference(rows) == (pytest.approx(2.0), 0, 2)
    assert largest_difference(rows[:2]) == (0.0, 0, 0)
