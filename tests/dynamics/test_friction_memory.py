"""Friction with a state beside its differential equation, at several sampling rates."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pivident.robot.friction import FrictionLaw, dahl, lugre, maxwell_slip
from tests.friction_columns import friction_columns

DURATION, AMPLITUDE, OMEGA = 3.0, 0.02, 4.0


def path(t):
    """A growing oscillation with a slow drift: reversals inside and outside the stick zone."""
    q = AMPLITUDE * (t * np.sin(OMEGA * t) + 0.1 * np.sin(3 * OMEGA * t))
    dq = AMPLITUDE * (
        np.sin(OMEGA * t) + t * OMEGA * np.cos(OMEGA * t) + 0.3 * OMEGA * np.cos(3 * OMEGA * t)
    )
    return q, dq


def sampled(rate):
    return np.arange(round(rate * DURATION) + 1) / rate


def presliding(t, distance, excess=0.0, speed=1.0, exponent=2.0):
    """z and d dz/dt by fine integration of the differential equation."""

    def rate_of(time, z):
        dq = path(time)[1]
        level = 1.0 + excess * np.exp(-(np.abs(dq / speed) ** exponent))
        return (dq - np.abs(dq) * z / level) / distance

    found = solve_ivp(rate_of, (0, DURATION), [0.0], t_eval=t, rtol=1e-9, atol=1e-11, max_step=1e-3)
    z = found.y[0]
    return z, distance * rate_of(t, z)


@pytest.mark.parametrize("distance", [5e-4, 3e-3, 5e-2])
def test_dahl_follows_its_differential_equation(distance):
    t = sampled(4000.0)
    q, dq = path(t)
    (z,) = friction_columns(FrictionLaw((dahl(distance),)), dq, q).T
    np.testing.assert_allclose(z, presliding(t, distance)[0], atol=2e-6)


def test_dahl_is_exact_on_a_way_without_reversal():
    q = np.array([0.0, 0.1, 0.5, 2.0]) * 1e-3
    (z,) = friction_columns(FrictionLaw((dahl(1e-3),)), np.ones(4), q).T
    np.testing.assert_allclose(z, 1.0 - np.exp(-q / 1e-3), rtol=1e-14)


@pytest.mark.parametrize(("speed", "exponent"), [(0.05, 2.0), (0.3, 1.0)])
def test_lugre_follows_its_differential_equation(speed, exponent):
    t = sampled(4000.0)
    q, dq = path(t)
    z, rate = friction_columns(FrictionLaw(lugre(2e-3, 0.5, speed, exponent)), dq, q).T
    fine_z, fine_rate = presliding(t, 2e-3, 0.5, speed, exponent)
    np.testing.assert_allclose(z, fine_z, atol=5e-6)
    np.testing.assert_allclose(rate, fine_rate, atol=5e-6 * np.abs(dq).max())


def test_the_error_of_a_coarse_sampling_falls_with_its_square():
    law = FrictionLaw(lugre(2e-3, 0.5, 0.1))
    fine_z, _ = presliding(sampled(500.0), 2e-3, 0.5, 0.1)
    errors = []
    for rate in (500.0, 1000.0, 2000.0):
        q, dq = path(sampled(rate))
        z = friction_columns(law, dq, q)[:: round(rate / 500.0), 0]
        errors.append(np.sqrt(np.mean((z - fine_z) ** 2)))
    assert errors[0] < 1e-5 and errors[2] < errors[0] / 12.0


def test_presliding_at_a_constant_speed_reaches_the_stribeck_curve():
    for dq in (0.02, -0.3):
        q = dq * np.linspace(0.0, 5.0, 200)
        z, rate = friction_columns(FrictionLaw(lugre(1e-3, 0.6, 0.1)), np.full(200, dq), q).T
        level = 1.0 + 0.6 * np.exp(-((dq / 0.1) ** 2))
        assert z[-1] == pytest.approx(np.sign(dq) * level, rel=1e-12)
        assert rate[-1] == pytest.approx(0.0, abs=1e-12)


def test_slip_elements_follow_their_differential_equation():
    """dz/dt = dq/d while |z| < 1 or turning back, by many small steps."""
    distances = (3e-3, 2e-2)
    fine_t = sampled(400_000.0)
    fine_q, _ = path(fine_t)
    q, dq = path(fine_t[::400])
    columns = friction_columns(FrictionLaw(maxwell_slip(distances)), dq, q).T
    for own, distance in zip(columns, distances, strict=True):
        z, states = 0.0, []
        for step in np.diff(fine_q, prepend=fine_q[0]) / distance:
            z += step
            z = 1.0 if z > 1.0 else -1.0 if z < -1.0 else z
            states.append(z)
        np.testing.assert_allclose(own, np.array(states)[::400], atol=1e-4)


def test_slip_remembers_where_it_turned():
    """Forth by 1.5 d, back by d: the element hangs at the level it had, less what it went."""
    q = np.array([0.0, 1.5, 0.5]) * 1e-3
    (z,) = friction_columns(FrictionLaw(maxwell_slip([1e-3])), np.ones(3), q).T
    np.testing.assert_allclose(z, [0.0, 1.0, 0.0], atol=1e-15)


def test_a_weakening_element_falls_with_its_level():
    dq = np.array([0.0, 0.01, 0.1, 1.0])
    (z,) = friction_columns(FrictionLaw(maxwell_slip([1e-6], 0.5, 0.1)), dq, np.cumsum(dq)).T
    level = 1.0 + 0.5 * np.exp(-((dq / 0.1) ** 2))
    np.testing.assert_allclose(z, [0.0, *level[1:]], rtol=1e-13)


def test_a_joint_at_rest_keeps_its_state():
    q = np.r_[np.linspace(0.0, 1e-3, 50), np.full(200, 1e-3)]
    dq = np.r_[np.full(50, 0.02), np.zeros(200)]
    z, rate, slip = friction_columns(
        FrictionLaw((*lugre(1e-3, 0.0, 0.1), *maxwell_slip([2e-3]))), dq, q
    ).T
    assert np.ptp(z[50:]) == 0.0 and np.ptp(slip[50:]) == 0.0 and not rate[50:].any()


def test_a_turn_between_two_samples_is_gone_out_and_back():
    """Thrown up and fallen back to where it was: Δq = 0, yet the state has changed."""
    t = np.linspace(-0.975, 0.975, 40)  # the turn at zero lies between two samples
    q, dq = -0.01 * t**2, -0.02 * t
    (z,) = friction_columns(FrictionLaw((dahl(5e-6),)), dq, q).T
    ahead = 0.01 * 0.025**2 / 5e-6
    before = z[19]
    top = 1.0 + (before - 1.0) * np.exp(-ahead)
    assert q[19] == pytest.approx(q[20], abs=1e-15)
    assert z[20] == pytest.approx(-1.0 + (top + 1.0) * np.exp(-ahead), rel=1e-6)


def test_two_elements_alike_are_refused():
    with pytest.raises(ValueError, match="must differ"):
        maxwell_slip([1e-3, 1e-3])
