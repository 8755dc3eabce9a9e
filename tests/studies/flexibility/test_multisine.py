"""Flexible joints from multisines: intervals over many runs, friction, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import IdentificationError
from pivident.studies.flexibility.impedance_fit import periodic_load_speed
from pivident.studies.flexibility.multisine import identify_multisine
from pivident.studies.flexibility.resonance import find_resonance
from pivident.studies.flexibility.simulated_joint import MotorLoop, loop_motion, simulate_joint
from tests.studies.flexibility.flexible_joint import COARSE, JOINT, LOOP, RATE, record
from tests.studies.flexibility.multisine_joint import LOADS, PERIOD, periodic_reference, posture

#: 60 scores: standard errors a third too small would cover 0.81 of them, not 0.95.
SEEDS = 12


def scores(estimate, loads):
    """Errors of the logarithms in standard errors."""
    pairs = [
        (estimate.motor_inertia, JOINT.motor_inertia),
        (estimate.stiffness, JOINT.stiffness),
        (estimate.damping, JOINT.damping),
        *zip(estimate.load_inertia, loads, strict=True),
    ]
    return [np.log(v.value / true) / (np.log(v.high / v.low) / 3.92) for v, true in pairs]


@pytest.fixture(scope="module")
def two_postures():
    """Estimates from two postures, one for each seed."""
    made = []
    for seed in range(SEEDS):
        runs = [posture(load, 10 * seed + i) for i, load in enumerate(LOADS[:2])]
        made.append(identify_multisine(runs))
    return made


def test_intervals_hold_the_constants(two_postures):
    z = np.array([scores(own, LOADS[:2]) for own in two_postures])
    assert 0.90 <= np.mean(np.abs(z) < 1.96) <= 0.99
    assert np.abs(z.mean(axis=0)).max() < 0.6


def test_constants_are_known_to_a_few_thousandths(two_postures):
    for own in two_postures[:3]:
        for value, bound in ((own.stiffness, 1e-3), (own.motor_inertia, 1e-3), (own.damping, 0.02)):
            assert np.log(value.high / value.low) < bound
        assert own.misfit < 1.5 and own.gain > 1e4 and own.periods == (4, 4)
        for value, load in zip(own.antiresonance, LOADS, strict=False):
            true = np.sqrt(JOINT.stiffness / load) / (2 * np.pi)
            assert value.value == pytest.approx(true, rel=1e-3)


def test_it_beats_one_run_without_periods():
    """The same run, its spectra from the local polynomial method instead of whole periods."""
    own = identify_multisine([posture(90.0, 3)])
    other = find_resonance(posture(90.0, 3))
    width = [np.log(v.high / v.low) for v in (own.stiffness, other.stiffness)]
    assert width[0] < 0.5 * width[1]


def test_runs_of_one_posture_share_its_load():
    runs = [posture(90.0, seed, periods=3) for seed in (1, 2)]
    own = identify_multisine([*runs, posture(60.0, 3, periods=3)], postures=["a", "a", "b"])
    assert own.load_inertia[0] == own.load_inertia[1] != own.load_inertia[2]
    assert own.load_inertia[0].value == pytest.approx(90.0, rel=5e-3)


def test_load_speed_contains_the_loads_own_friction():
    """Against the simulation, at its third period: dry friction of the load bends its speed."""
    t = np.arange(round(PERIOD * RATE)) / RATE
    q_ref = np.tile(0.1 * np.sin(2 * np.pi * t), 3)
    motion = loop_motion(JOINT, MotorLoop(6e4, 4e3), q_ref, RATE, steps=10)
    motor, load = (np.gradient(x, 1 / RATE)[-t.size :] for x in motion[:2])
    omega = np.sqrt(JOINT.stiffness / JOINT.load_inertia)
    zeta = JOINT.damping / (2 * omega * JOINT.load_inertia)
    theta = np.array(
        [np.log(60.0), np.log(90.0), np.log(omega), np.log(zeta), 40.0, 20.0, 60.0, 30.0]
    )
    found = periodic_load_speed(motor, RATE, theta, JOINT.gamma)
    without = periodic_load_speed(motor, RATE, np.append(theta[:7], 0.0), JOINT.gamma)
    errors = [np.std(own - load) for own in (found, without)]
    assert errors[0] < 0.15 * errors[1]


def test_what_cannot_be_found_is_refused_with_the_next_step():
    with pytest.raises(IdentificationError, match="has no whole periods"):
        identify_multisine([replace(record(0), q_link=None)])
    with pytest.raises(IdentificationError, match=r"lines above its noise.*more lines"):
        identify_multisine([posture(90.0, 0, top=3.0)], lowest=5.0)
    stiff = replace(JOINT, stiffness=3.2e8, damping=6000.0)
    q_ref = periodic_reference(top=15.0, periods=3)
    made = simulate_joint(stiff, LOOP, q_ref, RATE, sensors=COARSE, steps=40)
    with pytest.raises(IdentificationError, match=r"is rigid up to 1\d.*more lines above that"):
        identify_multisine([made])
    with pytest.raises(IdentificationError, match="2 postures for 1 recordings"):
        identify_multisine([posture(90.0, 0, periods=3)], postures=["a", "b"])
