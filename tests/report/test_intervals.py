import math

import pytest

from pivident.estimation.parameter_rows import ParameterRow
from pivident.report.intervals import interval_drawing


def row(value, std, robust_std=math.nan, truth=math.nan):
    return ParameterRow("zz1r", value, std, robust_std, 0.0, "kg m²", "zz1", truth)


def test_intervals_keep_their_proportions():
    drawing = interval_drawing([row(1.0, 0.1, 0.2), row(1.5, 0.05)], ["LS", "PIV"], with_zero=False)
    first, second = drawing.intervals
    assert first.robust_left < first.left < first.middle < first.right < first.robust_right
    assert (first.middle - first.left) == pytest.approx(2 * (second.middle - second.left), abs=0.05)
    assert drawing.zero is None
    assert (drawing.low, drawing.high) == ("0.60", "1.60")


def test_zero_and_truth_have_their_places():
    drawing = interval_drawing([row(1.0, 0.1, truth=1.1)], ["PIV"], with_zero=True)
    assert drawing.zero < drawing.intervals[0].left < drawing.intervals[0].middle < drawing.truth


def test_methods_keep_their_colour_where_one_lacks_the_parameter():
    drawing = interval_drawing([None, row(1.0, 0.1)], ["LS", "PIV"], with_zero=False)
    assert [i.method for i in drawing.intervals] == [1]
    assert drawing.label == "zz1r: PIV 1.00 ± 0.20 kg m²"


@pytest.mark.parametrize("std", [0.0, math.nan, math.inf])
@pytest.mark.parametrize("value", [0.0, 1.0])
def test_degenerate_intervals_stay_on_the_drawing(value, std):
    drawing = interval_drawing([row(value, std)], ["PIV"], with_zero=True)
    assert 0.0 <= drawing.intervals[0].left <= drawing.intervals[0].right <= 100.0
