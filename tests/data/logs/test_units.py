import math

import pytest

from pivident.data.logs.units import check_kind, factor_to_si
from pivident.foundation.errors import RecordingError


@pytest.mark.parametrize(
    ("channel", "unit", "factor"),
    [
        ("q", "rad", 1.0),
        ("q", "deg", math.pi / 180.0),
        ("q_ref", "rev", 2.0 * math.pi),
        ("q", "mm", 1e-3),
        ("q", {"unit": "counts", "per_revolution": 4096}, 2.0 * math.pi / 4096),
        ("q", {"unit": "counts", "per_metre": 2e7}, 5e-8),
        ("dq_ref", "deg/s", math.pi / 180.0),
        ("dq_ref", "rpm", 2.0 * math.pi / 60.0),
        ("ddq_ref", "deg/s²", math.pi / 180.0),
        ("ddq_ref", "mm/s^2", 1e-3),
        ("tau", "N m", 1.0),
        ("tau", "N·m", 1.0),
        ("tau", "kN", 1e3),
        ("tau", {"unit": "V", "gain": 35.15}, 35.15),
        ("tau", {"unit": "mA", "gain": 2.0}, 2e-3),
        ("tau", -0.5, -0.5),
        ("t", "ns", 1e-9),
        ("inputs", "mV", 1e-3),
        ("inputs", 1.014, 1.014),
    ],
)
def test_a_unit_has_its_factor(channel, unit, factor):
    value, is_command = factor_to_si(channel, unit)
    assert value == pytest.approx(factor, rel=1e-15)
    assert not is_command


@pytest.mark.parametrize(("unit", "factor"), [("A", 1.0), ("mV", 1e-3), ("command", 1.0)])
def test_a_drive_command_without_gain_waits_for_the_transmissions(unit, factor):
    assert factor_to_si("tau", unit) == (factor, True)


@pytest.mark.parametrize(
    ("channel", "unit", "message"),
    [
        ("q", "degree", "did you mean 'deg'"),
        ("q", "N m", "not known here"),
        ("tau", "rad", "not known here"),
        ("q", "counts", "per_revolution"),
        ("q", {"unit": "counts"}, "per_revolution"),
        ("q", {"unit": "counts", "per_turn": 3}, "per_revolution"),
        ("q", {"unit": "counts", "per_revolution": 0}, "other than 0"),
        ("q", {"unit": "V", "gain": 2.0}, "gain"),
        ("tau", {"gain": 2.0}, "gain"),
        ("tau", {"unit": "V", "gain": "big"}, "number other than 0"),
        ("tau", {"unit": "W", "gain": 2.0}, "not known here"),
        ("tau", float("nan"), "number other than 0"),
        ("tau", True, "not known here"),
        ("tau", None, "not known here"),
    ],
)
def test_a_unit_that_does_not_fit_is_refused(channel, unit, message):
    with pytest.raises(RecordingError, match=message):
        factor_to_si(channel, unit)


def test_the_unit_has_to_suit_the_kind_of_joint():
    check_kind("q", "deg", "elbow", "revolute")
    check_kind("q", "mm", "slide", "prismatic")
    check_kind("q", 0.5, "slide", "prismatic")
    with pytest.raises(RecordingError, match="'slide'"):
        check_kind("q", "deg", "slide", "prismatic")
    with pytest.raises(RecordingError, match="'elbow'"):
        check_kind("q", "m", "elbow", "revolute")
