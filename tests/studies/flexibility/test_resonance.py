"""Stiffness from the motor's encoder alone, and honesty where the record cannot tell it."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import IdentificationError
from pivident.studies.flexibility.resonance import find_resonance
from tests.studies.flexibility.flexible_joint import JOINT, record


def one_encoder(seed, **options):
    return replace(record(seed, **options), q_link=None)


def test_stiffness_and_inertias_lie_within_their_intervals():
    inside = []
    for seed in range(4):
        found = find_resonance(one_encoder(seed))
        assert found.seen, found.conclusion
        for name in ("stiffness", "damping", "antiresonance", "load_inertia"):
            value = getattr(found, name)
            inside.append(value.covers(getattr(JOINT, name)))
            assert value.high < 1.1 * value.low
        assert found.damping.value == pytest.approx(JOINT.damping, rel=0.03)
        assert found.misfit < 2
    assert np.mean(inside) >= 0.8  # sixteen intervals of 95 %: fewer hold in 1 of 200 cases


def test_a_known_motor_inertia_is_held():
    found = find_resonance(one_encoder(1), motor_inertia=60.0)
    assert found.motor_inertia.value == pytest.approx(60.0)
    assert found.motor_inertia.high == pytest.approx(found.motor_inertia.low)
    assert found.stiffness.covers(JOINT.stiffness)


def test_without_excitation_it_says_so():
    found = find_resonance(one_encoder(2, top=0.0), load_inertia=90.0)
    assert not found.seen and found.stiffness is None
    assert "too few to detect a resonance" in found.conclusion


def test_a_resonance_above_the_excitation_is_bounded_not_invented():
    stiff = replace(JOINT, stiffness=3.2e8, damping=6000.0)  # antiresonance at 300 Hz
    found = find_resonance(one_encoder(3, top=12.0, joint=stiff, steps=40), load_inertia=90.0)
    assert not found.seen
    top = found.excited[1]
    assert 8 < top < 14
    assert f"no resonance below {top:.3g} Hz" in found.conclusion
    assert found.total_inertia.value == pytest.approx(150.0, rel=0.05)
    assert found.stiffness is not None and np.isinf(found.stiffness.high)
    assert found.stiffness.low == pytest.approx((2 * np.pi * top) ** 2 * 90.0)
    assert found.stiffness.low < stiff.stiffness


def test_a_resonance_somewhat_above_it_is_noticed_without_a_number():
    stiff = replace(JOINT, stiffness=2e7, damping=1500.0)  # antiresonance at 75 Hz
    found = find_resonance(one_encoder(3, top=12.0, joint=stiff), load_inertia=90.0)
    assert not found.seen and found.stiffness is None
    assert "not rigid" in found.conclusion and "cannot be located" in found.conclusion


def test_a_record_without_reference_is_refused():
    with pytest.raises(IdentificationError, match="record q_ref"):
        find_resonance(replace(one_encoder(0), q_ref=None))
