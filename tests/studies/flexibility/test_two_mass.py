"""Both inertias, stiffness and damping are recovered, and the intervals hold."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import IdentificationError
from pivident.studies.flexibility.simulated_joint import TwoMassJoint
from pivident.studies.flexibility.two_mass import identify_two_mass
from tests.studies.flexibility.flexible_joint import COARSE, JOINT, record


def truth(estimate, joint=JOINT):
    return np.array([getattr(joint, name) for name in estimate.names])


def test_intervals_cover_the_truth_on_many_records():
    """Standard errors a quarter too small would cover 0.86; a mean has one of 1/√25."""
    scores = []
    for seed in range(25):
        found = identify_two_mass(record(seed))
        assert found.converged and found.instrumented
        scores.append((found.theta - truth(found)) / found.std)
    covered = np.abs(scores) < 1.96
    names = list(found.names)
    wanted = [names.index(n) for n in ("stiffness", "damping", "motor_inertia", "load_inertia")]
    assert 0.90 <= covered[:, wanted].mean() <= 0.99
    assert 0.90 <= covered.mean() <= 0.99
    assert np.abs(np.mean(scores, axis=0)).max() < 3 / np.sqrt(25)


def test_instruments_keep_rough_encoders_from_spoiling_it():
    rough = replace(COARSE, motor_noise=1e-4, link_noise=2e-4, motor_step=1e-4)
    recorded = record(1, sensors=rough)
    found = identify_two_mass(recorded)
    assert np.abs((found.theta - truth(found)) / found.std).max() < 4
    assert found.measured("load_inertia").value == pytest.approx(90.0, rel=0.01)
    without = identify_two_mass(replace(recorded, q_ref=None))
    assert not without.instrumented and "encoder noise biases" in without.notes[0]
    assert abs(without.measured("load_inertia").value - 90.0) > 9.0


def test_a_smooth_motion_is_enough_for_stiffness():
    found = identify_two_mass(record(1, top=0.0))
    stiffness = found.measured("stiffness")
    assert stiffness.low < JOINT.stiffness < stiffness.high
    assert stiffness.high - stiffness.low < 0.15 * JOINT.stiffness


def test_weight_of_the_load_is_found_with_it():
    joint = TwoMassJoint(60.0, 90.0, 2e5, 150.0, 40.0, 60.0, gravity_sin=400.0, gravity_cos=300.0)
    found = identify_two_mass(record(2, joint=joint), gravity=True)
    score = (found.theta - truth(found, joint)) / found.std
    assert np.abs(score).max() < 4
    assert found.measured("gravity_cos").high - found.measured("gravity_cos").low < 30


def test_the_antiresonance_has_its_interval():
    found = identify_two_mass(record(3))
    frequency = found.antiresonance
    assert abs(frequency.value - JOINT.antiresonance) < 3 * (frequency.high - frequency.value)
    assert frequency.high - frequency.low < 0.01 * frequency.value


def test_a_record_without_link_encoder_is_refused():
    with pytest.raises(IdentificationError, match="name its columns as q_link"):
        identify_two_mass(replace(record(0), q_link=None))
