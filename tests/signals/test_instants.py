"""Values at the instants from averages over the adjoining periods, to the fourth order."""

import numpy as np
import pytest

from pivident.signals.alignment import align_torque
from pivident.signals.instants import derivatives_at_instants, torque_at_instants

RATE = 1000.0
INNER = slice(20, -20)


def motion(frequency, samples=2000):
    w, t = 2 * np.pi * frequency, np.arange(samples) / RATE
    return t, np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)


def differences(q):
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    dq[1:-1] = 0.5 * RATE * (q[2:] - q[:-2])
    ddq[1:-1] = RATE**2 * (q[2:] - 2 * q[1:-1] + q[:-2])
    return dq, ddq


@pytest.mark.parametrize(("order", "corrected"), [(2, False), (4, True)])
def test_derivatives_are_of_the_fourth_order(order, corrected):
    error = []
    for frequency in (10.0, 20.0):
        _, q, dq, ddq = motion(frequency)
        found = differences(q)
        found = derivatives_at_instants(*found) if corrected else found
        scale = (np.abs(dq).max(), np.abs(ddq).max())
        error.append(
            [
                np.abs(f - x)[INNER].max() / s
                for f, x, s in zip(found, (dq, ddq), scale, strict=True)
            ]
        )
    ratio = np.log2(np.array(error[1]) / np.array(error[0]))
    np.testing.assert_allclose(ratio, order, atol=0.2)


def test_torque_of_a_held_law_belongs_to_the_instants():
    # The motion under a torque held over each period is known: q'' is constant in between.
    rng = np.random.default_rng(3)
    t = np.arange(3000) / RATE
    smooth = np.sin(2 * np.pi * 7 * t) + 0.3 * np.sin(2 * np.pi * 15 * t + rng.uniform())
    means = 0.5 * (smooth[1:] + smooth[:-1])  # trapezoid of the applied torque, smooth enough
    aligned = 0.5 * (means[1:] + means[:-1])
    exact = smooth[1:-1]
    # (s_{k+1} + 2 s_k + s_{k-1})/4 is h²/4 of a second derivative away; Numerov takes its h²/12
    plain = np.abs(aligned - exact)[INNER].max()
    corrected = np.abs(torque_at_instants(aligned) - exact)[INNER].max()
    assert corrected == pytest.approx(plain * 2 / 3, rel=0.01)


def test_numerov_inverts_its_own_average():
    x = np.random.default_rng(1).standard_normal((500, 3))
    average = x.copy()
    average[1:-1] = (x[2:] + 10 * x[1:-1] + x[:-2]) / 12
    average[0], average[-1] = (11 * x[0] + x[1]) / 12, (11 * x[-1] + x[-2]) / 12
    np.testing.assert_allclose(torque_at_instants(average), x, atol=1e-12)


def test_a_viscous_axis_is_met_to_the_fourth_order():
    # J q'' + F q' = τ held over each period, integrated exactly; smooth torque
    inertia, friction, h = 0.7, 3.0, 1.0 / RATE
    t = np.arange(6000) * h
    tau = 4 * np.sin(2 * np.pi * 6 * t)
    decay = np.exp(-friction / inertia * h)
    q, dq = np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        final = tau[k] / friction
        dq[k + 1] = final + (dq[k] - final) * decay
        q[k + 1] = q[k] + final * h + (dq[k] - final) * (1 - decay) * inertia / friction
    aligned = align_torque(tau, RATE, "held")
    assert aligned.is_average
    found = {}
    for name in ("plain", "at instants"):
        speed, acceleration = differences(q)
        torque = aligned.tau
        if name == "at instants":
            speed, acceleration = derivatives_at_instants(speed, acceleration)
            torque = torque_at_instants(torque)
        phi = np.column_stack([acceleration, speed])[INNER]
        found[name] = np.linalg.lstsq(phi, torque[INNER], rcond=None)[0]
    truth = np.array([inertia, friction])
    plain = np.abs(found["plain"] / truth - 1).max()
    better = np.abs(found["at instants"] / truth - 1).max()
    assert plain > 5e-5 and better < 0.02 * plain


@pytest.mark.parametrize(
    ("timing", "control_rate", "delay", "average"),
    [
        ("held", None, 0.0, True),
        ("averaged", None, 0.0, True),
        ("sampled", None, 0.0, False),
        ("held", 4 * RATE, 0.0, False),
        ("held", RATE / 2, 0.0, True),
        ("held", None, 0.25 / RATE, False),
        ("held", None, 3.0 / RATE, True),
    ],
)
def test_which_torques_are_averages(timing, control_rate, delay, average):
    aligned = align_torque(np.zeros(50), RATE, timing, control_rate=control_rate, delay=delay)
    assert aligned.is_average == average
