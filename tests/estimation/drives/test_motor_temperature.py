"""The motor constant's temperature coefficient: found where it is, not found where it is not."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.drives.drive_equations import motor_coupling
from pivident.estimation.drives.motor_temperature import (
    at_reference_temperature,
    identify_motor_temperature,
)
from pivident.foundation.errors import ExperimentError, IdentificationError
from tests.payload_scenario import tx40_in_amperes

COEFFICIENT = -0.0015


@pytest.fixture(scope="module")
def problem():
    return replace(tx40_in_amperes(2, samples=12000).problem, loop=None)


@pytest.fixture(scope="module")
def warmth(problem):
    return 20.0 + 40.0 * (1.0 - np.exp(-problem.recordings[0].t / 4.0))


def warmed(problem, warmth):
    """The record of motors that lose strength: the same torque needs more current."""
    recording = problem.recordings[0]
    coupling = motor_coupling(problem.robot.transmission)
    commands = np.linalg.solve(coupling, recording.tau.T) / (1.0 + COEFFICIENT * (warmth - 20.0))
    return replace(problem, recordings=(replace(recording, tau=(coupling @ commands).T),))


def test_the_coefficient_is_found_beside_a_drift_of_friction(problem, warmth):
    found = identify_motor_temperature(warmed(problem, warmth), [warmth], 20.0)
    error = np.array([(t.coefficient - COEFFICIENT) / t.std for t in found])
    assert np.abs(error).max() < 4.0
    assert all(t.is_significant and t.std < 5e-4 for t in found[:3])
    assert {t.unit for t in found} == {"1/K"} and found[0].reference == 20.0


def test_without_drift_of_friction_the_interval_is_narrower(problem, warmth):
    made = warmed(problem, warmth)
    free = identify_motor_temperature(made, [warmth], 20.0)
    fixed = identify_motor_temperature(made, [warmth], 20.0, friction_drift=False)
    assert all(b.std < 0.7 * a.std for a, b in zip(free, fixed, strict=True))
    error = [(t.coefficient - COEFFICIENT) / t.std for t in fixed]
    assert np.abs(error).max() < 4.0


def test_a_drift_of_friction_is_not_taken_for_a_motor_constant(problem, warmth):
    # currents grow by what 30 % more viscous and Coulomb friction of joint 1 would need
    recording = problem.recordings[0]
    dq = np.gradient(recording.q[:, 0]) * recording.rate
    share = 0.3 * (warmth - 20.0) / 40.0
    more = share * (7.9379 * dq + 6.9822 * (2 / np.pi) * np.arctan(150 * dq)) / 35.24
    tau = recording.tau.copy()
    tau[:, 0] += more
    changed = replace(problem, recordings=(replace(recording, tau=tau),))
    free = identify_motor_temperature(changed, [warmth], 20.0)[0]
    fixed = identify_motor_temperature(changed, [warmth], 20.0, friction_drift=False)[0]
    assert abs(free.coefficient) < 4.0 * free.std
    assert abs(fixed.coefficient) > 10.0 * fixed.std


def test_nothing_is_found_where_nothing_is(problem, warmth):
    found = identify_motor_temperature(problem, [warmth], 20.0)
    assert sum(t.is_significant for t in found) <= 1
    assert all(abs(t.coefficient) < 4.0 * t.std for t in found)


def test_time_stands_for_temperature(problem):
    t = problem.recordings[0].t
    drift = warmed(problem, 20.0 + 5.0 * t)
    found = identify_motor_temperature(drift, None, 0.0)
    error = [(m.coefficient - 5.0 * COEFFICIENT) / m.std for m in found]
    assert np.abs(error).max() < 4.0 and found[0].unit == "1/s"


def test_correction_undoes_the_warming(problem, warmth):
    cold = at_reference_temperature(
        warmed(problem, warmth).recordings[0],
        problem.robot.transmission,
        [COEFFICIENT] * 6,
        warmth,
        [20.0] * 6,
    )
    np.testing.assert_allclose(cold.tau, problem.recordings[0].tau, atol=1e-12)


def test_temperatures_that_tell_nothing_are_refused(problem):
    samples = problem.recordings[0].samples
    with pytest.raises(IdentificationError, match="same throughout"):
        identify_motor_temperature(problem, [np.full(samples, 20.0)])
    with pytest.raises(ExperimentError, match="shape"):
        identify_motor_temperature(problem, [np.zeros(7)])
