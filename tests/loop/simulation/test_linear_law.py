"""The general law against the particular ones, and transfer laws against both."""

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.linear.free_law import TransferLaw, split_integrator
from pivident.loop.simulation.controllers import PID, Cascade
from pivident.loop.simulation.linear_law import LinearLaw, differentiated

RATE = 1000.0


def motion(rng, joints=2, samples=400):
    return np.cumsum(rng.normal(size=(samples, joints)), axis=0) * 1e-3


def general(joints=2, **gains):
    zero = np.zeros(joints)
    names = (
        "kp", "kd", "ki", "speed_reference", "acceleration_reference", "offset", "derivative_time",
    )  # fmt: skip
    return LinearLaw(**{name: gains.pop(name, zero) for name in names}, **gains)


@pytest.mark.parametrize("time", [0.0, 3e-3])
def test_a_pid_is_a_linear_law_with_equal_speed_gains(time):
    kp, kd, ki = np.array([100.0, 50.0]), np.array([3.0, 2.0]), np.array([20.0, 0.0])
    q_ref = motion(np.random.default_rng(0))
    q_ref -= q_ref[0]
    ours = general(kp=kp, kd=kd, ki=ki, speed_reference=kd, derivative_time=np.full(2, time)).law(
        RATE, q_ref, None
    )
    theirs = PID(kp, kd, ki, time).law(RATE, q_ref, None)
    for field in ("feedback", "pole", "integrand", "integral_gain", "integrand_reference"):
        np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), rtol=1e-12)
    # both differentiate the reference from rest, the first sample apart
    np.testing.assert_allclose(ours.reference[1:], theirs.reference[1:], rtol=1e-9, atol=1e-9)


def test_a_cascade_is_one_with_averaged_speed_and_no_speed_of_the_reference():
    kp, kv = np.array([160.0, 10.0]), np.array([243.0, 5.0])
    q_ref = motion(np.random.default_rng(1))
    ours = general(kp=kp * kv, kd=kv, averaged=np.ones(2, bool)).law(RATE, q_ref, None)
    theirs = Cascade(kp, kv, averaged=True).law(RATE, q_ref, None)
    np.testing.assert_allclose(ours.feedback, theirs.feedback, rtol=1e-12)
    np.testing.assert_allclose(ours.reference, theirs.reference, rtol=1e-12)


def test_the_differentiator_of_a_ramp_is_its_slope():
    ramp = 3.0 * np.arange(500)[:, None] / RATE
    for time, averaged in ((0.0, False), (0.0, True), (5e-3, False)):
        assert differentiated(ramp, time, averaged, RATE)[-1, 0] == pytest.approx(3.0, rel=1e-6)


def test_a_law_that_pushes_away_is_refused():
    law = general(kp=np.array([1.0, -2.0]))
    with pytest.raises(ExperimentError, match="kp of joint 2 is -2"):
        law.check(2)
    with pytest.raises(ExperimentError, match="2 joints, but the robot has 3"):
        general(kp=np.ones(2)).check(3)


def test_an_integrator_splits_off_as_its_residue():
    b, a = np.array([5.0, -8.0, 3.5]), np.array([1.0, -0.4])
    rest, residue = split_integrator(b, a)
    z = np.exp(-1j * np.array([0.1, 0.7, 2.0]))  # z⁻¹ on the unit circle

    def at(p):
        return np.polyval(p[::-1], z)

    np.testing.assert_allclose(at(b) / (at(a) * (1 - z)), at(rest) / at(a) + residue / (1 - z))


def test_a_transfer_law_runs_at_its_own_rate_only():
    law = TransferLaw(np.array([[1.0, 0, 0]]), np.array([[1.0, 0, 0]]), np.zeros(1), 1000.0)
    with pytest.raises(ExperimentError, match="1000 Hz and cannot run at 500 Hz"):
        law.law(500.0, np.zeros((4, 1)), None)
    with pytest.raises(ExperimentError, match="1 joints, but the robot has 2"):
        law.check(2)
