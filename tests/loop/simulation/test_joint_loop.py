"""One joint's sampled loop over frequency, against closed forms, python-control and scipy."""

import control
import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from pivident.foundation.errors import ExperimentError
from pivident.linear.free_law import TransferLaw
from pivident.loop.simulation.controllers import PD, PID, Cascade, PythonController
from pivident.loop.simulation.joint_loop import JointLoop, joint_feedbacks
from pivident.loop.simulation.linear_law import LinearLaw

RATE = 5000.0
F = np.geomspace(0.1, 2400.0, 60)
LAWS = {
    "pd": PD([4934.0], [133.0]),
    "lag": PD([4934.0], [133.0], 8e-4),
    "pid": PID([4934.0], [133.0], [9870.0], 8e-4),
    "cascade": Cascade([37.0], [133.0], [2.0], averaged=True),
    "identified": LinearLaw(
        *(np.array([x]) for x in (4934.0, 133.0, 50.0, 133.0, 1.2, 0.3, 0.0)), np.array([True])
    ),
}


def loop_of(law, inertia=1.25, viscous=7.6, gain=1.0, delay=0.0, rate=RATE):
    return JointLoop(inertia, viscous, joint_feedbacks(law, rate, 1)[0], gain, delay)


@pytest.mark.parametrize("damping", [0.4, np.sqrt(0.5), 1.3])
def test_bandwidths_of_a_fast_pd_loop_are_those_of_the_textbook(damping):
    inertia, omega = 0.8, 2 * np.pi * 10.0
    law = PD([inertia * omega**2], [2 * damping * inertia * omega])
    loop = loop_of(law, inertia, 0.0, rate=2e6)
    x, y = 2 * damping**2 - 1, 2 * damping**2 + 1
    assert loop.bandwidth == pytest.approx(10 * np.sqrt(x + np.sqrt(x**2 + 1)), rel=1e-4)
    assert loop.noise_bandwidth == pytest.approx(10 * np.sqrt(y + np.sqrt(y**2 + 1)), rel=1e-4)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("late", [0, 3])
def test_sensitivity_agrees_with_python_control(name, late):
    law, gain = LAWS[name], 0.9
    loop = loop_of(law, gain=gain, delay=late / RATE)
    plant = control.c2d(control.tf([1.0], [1.25, 7.6, 0.0]), 1 / RATE, "zoh")
    numerator, denominator = loop.feedback.fraction()
    size = max(len(numerator), len(denominator))
    padded = [np.r_[p, np.zeros(size - len(p))] for p in (numerator, denominator)]
    feedback = control.tf(*padded, 1 / RATE)
    waiting = control.tf([1.0], [1.0] + [0.0] * late, 1 / RATE)
    closed = control.feedback(1, gain * plant * waiting * feedback)
    above = F[F > 1.0]  # below, the polynomials of python-control lose digits
    expected = closed(np.exp(2j * np.pi * above / RATE))
    np.testing.assert_allclose(loop.sensitivity(above), expected, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(loop.sensitivity(F) + loop.complementary(F), 1.0, atol=1e-12)
    assert loop.is_stable == bool((np.abs(closed.poles()) < 1 + 1e-6).all())


def test_feedback_is_the_law_that_is_written_down():
    h, z = 1 / RATE, np.exp(-2j * np.pi * F / RATE)
    mean = 0.5 * (1 - z**2) * RATE
    integral = h / (1 - z)
    cascade = 133.0 * (37.0 + mean) * (1 + 2.0 * integral)
    np.testing.assert_allclose(
        joint_feedbacks(LAWS["cascade"], RATE, 1)[0].response(F), cascade, rtol=1e-9
    )
    lagged = (1 - z) / (8e-4 + h - 8e-4 * z)
    pid = 4934.0 + 133.0 * lagged + 9870.0 * integral
    np.testing.assert_allclose(joint_feedbacks(LAWS["pid"], RATE, 1)[0].response(F), pid, rtol=1e-9)
    identified = 4934.0 + 133.0 * mean + 50.0 * integral
    np.testing.assert_allclose(
        joint_feedbacks(LAWS["identified"], RATE, 1)[0].response(F), identified, rtol=1e-9
    )


def test_a_transfer_function_runs_at_its_own_rate_only():
    b, a = np.array([[900.0, -850.0, 0.0]]), np.array([[1.0, -0.3, 0.0]])
    law = TransferLaw(b, a, np.zeros(1), RATE)
    found = joint_feedbacks(law, RATE, 1)[0].response(F)
    np.testing.assert_allclose(found, freqz(b[0], a[0], F, fs=RATE)[1], rtol=1e-9)
    with pytest.raises(ExperimentError, match="cannot run at 1000 Hz"):
        joint_feedbacks(law, 1000.0, 1)


@pytest.mark.parametrize("viscous", [0.0, 1e-6, 7.6])
@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.6])
def test_a_held_torque_pushes_the_joint_as_in_closed_form(viscous, delay):
    inertia, h = 1.25, 1e-2
    loop = loop_of(LAWS["pd"], inertia, viscous, delay=delay * h, rate=1 / h)
    decay = np.exp(-viscous * h / inertia)
    impulse = np.zeros(40)
    impulse[0] = 1.0
    denominator = np.convolve([1.0, -1.0], [1.0, -decay])
    made = lfilter(loop._plant_numerator, denominator, impulse)

    def position(t):
        t = np.maximum(t, 0.0)
        if viscous < 1e-3:
            return 0.5 * t**2 / inertia
        time = inertia / viscous
        return (t - time * (1 - np.exp(-t / time))) / viscous

    t = h * np.arange(40) - delay * h
    np.testing.assert_allclose(made, position(t) - position(t - h), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(
        loop.plant(F[F < 49]), freqz(loop._plant_numerator, denominator, F[F < 49], fs=1 / h)[1],
        rtol=1e-6,
    )  # fmt: skip


def test_slopes_of_the_bandwidth_are_its_differences():
    slopes = loop_of(LAWS["pid"]).bandwidth_slopes()
    inertia = loop_of(LAWS["pid"], 1.26).bandwidth - loop_of(LAWS["pid"], 1.24).bandwidth
    low, high = (loop_of(LAWS["pid"], viscous=fv).bandwidth for fv in (7.1, 8.1))
    viscous = high - low
    np.testing.assert_allclose(slopes, [inertia / 0.02, viscous], rtol=1e-3)


def test_loops_that_do_not_hold_a_joint_say_so():
    assert not loop_of(LAWS["pd"], delay=2e-2).is_stable
    assert loop_of(LAWS["pd"], delay=8e-3).peak > 1.5 * loop_of(LAWS["pd"]).peak
    assert np.isnan(loop_of(PD([0.0], [0.0])).bandwidth)


def test_a_python_law_has_its_linear_one_or_none():
    with pytest.raises(ExperimentError, match="Python function"):
        joint_feedbacks(PythonController(lambda *x: x[1]), RATE, 1)
    beside = PythonController(lambda *x: x[1], linear=LAWS["pd"])
    found = joint_feedbacks(beside, RATE, 1)[0].response(F)
    np.testing.assert_array_equal(found, joint_feedbacks(LAWS["pd"], RATE, 1)[0].response(F))
