"""What the friction of EMPS and of the TX40 looks like."""

import numpy as np
import pytest

from pivident.data.recording.public_records import load_emps, load_staubli_tx40
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.robot.gallery import load_robot
from pivident.studies.friction.friction_study import joint_friction
from pivident.studies.friction.friction_torque import friction_torques
from pivident.studies.friction.state_dependent import common_speeds, offset

pytestmark = pytest.mark.record

FULL_RATE = LeastSquares(signals=RandomWalk())


@pytest.fixture(scope="module")
def emps(public_data):
    problem = Problem(load_robot("emps"), (load_emps(),))
    (torque,) = friction_torques(problem, identify(problem, FULL_RATE))
    return joint_friction(torque)


def test_emps_is_asymmetric_and_degressive(emps):
    found = {f.kind: f for f in emps.findings}
    # Published: Fc 20.4 N, Fv 203.5 N s/m, offset -3.2 N, a mean over all speeds.
    low, high = common_speeds(emps.fit)
    middle, std = emps.fit.contrast(offset(emps.fit, 0.5 * (low + high)))
    assert middle == pytest.approx(-3.2, abs=0.6) and std < 0.3
    # The offset is none: it grows with the speed.
    assert emps.fit.contrast(offset(emps.fit, 0.9 * high))[0] < middle - 1.0
    assert found["asymmetry"].clear and "each direction" in found["asymmetry"].terms
    assert found["bend"].clear and -100 < found["bend"].quantity.value < -50
    assert found["level"].quantity.value == pytest.approx(20.4 + 203.5 * high, rel=0.05)
    assert not found["stribeck"].clear and not found["drift"].clear
    gain, deviation = emps.held_out.speed.gain(emps.held_out.constant)
    assert gain > 40 and gain > 10 * deviation


def test_tx40_joint_4_has_a_ripple(public_data):
    names = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    record = load_staubli_tx40().slice(0.05, 7.5)
    problem = Problem(load_robot("staubli_tx40"), (record,), None, names)
    fourth = joint_friction(friction_torques(problem, identify(problem, FULL_RATE))[3])
    found = {f.kind: f for f in fourth.findings}
    assert found["position"].clear and found["position"].terms == "position ripple"
    turns = float(found["position"].message.split(" times per turn")[0].split()[-1])
    assert turns == pytest.approx(30.7, abs=1.0)
    gain, std = fourth.held_out.full.gain(fourth.held_out.by_term["position"])
    assert gain > 30 and gain > 3 * std
    assert found["bend"].clear and found["bend"].quantity.value < 0
    assert np.all(np.isfinite(fourth.fit.covariance))
