import math

import pytest

from pivident.estimation.parameter_rows import ParameterRow
from pivident.foundation.document.plot import METHOD_COLOURS
from pivident.judgement.report.intervals import MARKERS, ConsistentValue, interval_drawing, marker


def row(value, std, truth=math.nan):
    return ParameterRow("zz1r", value, std, std, "kg m²", "zz1", truth)


def test_intervals_keep_their_proportions():
    drawing = interval_drawing([row(1.0, 0.1), row(1.5, 0.05)], ["LS", "PIV"], with_zero=False)
    first, second = drawing.intervals
    assert first.left < first.middle < first.right
    assert (first.middle - first.left) == pytest.approx(2 * (second.middle - second.left), abs=0.05)
    assert drawing.zero is None
    assert (drawing.low, drawing.high) == ("0.800", "1.600")


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


def test_methods_have_markers_of_their_own():
    assert len(set(MARKERS)) == len(MARKERS) == len(METHOD_COLOURS)
    assert marker(len(MARKERS) + 1) == marker(1) != marker(0)


def test_consistent_estimates_have_rows_of_their_own():
    own = ConsistentValue(1, "PC-PIV", 1.05, 0.98, math.inf)
    drawing = interval_drawing(
        [row(1.0, 0.1), row(1.0, 0.05)], ["LS", "PIV"], with_zero=False, consistent=[own]
    )
    last = drawing.intervals[-1]
    assert (last.method, last.consistent) == (1, True)
    assert drawing.intervals[1].left < last.left < last.middle < last.right == 100.0
    assert last.words == "PC-PIV 1.05 (95 %: 0.98 to open) kg m²"
    assert drawing.label.endswith(last.words)
    assert [i.words for i in drawing.intervals[:2]] == [
        "LS 1.00 ± 0.20 kg m²",
        "PIV 1.00 ± 0.10 kg m²",
    ]


@pytest.mark.parametrize(("nominal", "beyond"), [(1.1, 0), (1.6, 0), (4.0, 1), (-3.0, -1)])
def test_nominal_values_are_marked_or_pointed_at(nominal, beyond):
    drawing = interval_drawing([row(1.0, 0.1)], ["PIV"], with_zero=False, nominal=nominal)
    assert drawing.beyond == beyond
    assert 0.0 <= drawing.nominal <= 100.0
    assert f"nominal {nominal:g} kg m²" in drawing.label
    if beyond:
        assert drawing.nominal == (100.0 if beyond > 0 else 0.0)
        assert drawing.intervals[0].right - drawing.intervals[0].left > 80.0
    else:
        assert (drawing.nominal > drawing.intervals[0].middle) == (nominal > 1.0)
