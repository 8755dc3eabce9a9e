"""The bound of counted positions against closed forms."""

import numpy as np
import pytest
from benchmarks.bound_of_counts import driven, information_of_counts, least_errors, triangle
from scipy.integrate import quad
from scipy.stats import norm

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.loop.simulation.closed_loop import Trajectory


def test_a_count_tells_most_at_the_end_of_its_interval():
    """P = Φ(u) and 1 - Φ(u) on either side: i = φ²/(Φ(1 - Φ))/σ², 2/(πσ²) at the end itself."""
    count, sigma = 1e-3, 1e-6
    ends = np.array([0.5, -1.5]) * count
    np.testing.assert_allclose(
        information_of_counts(ends, count, sigma), 2 / (np.pi * sigma**2), rtol=1e-9
    )
    assert information_of_counts(np.zeros(1), count, sigma)[0] == 0.0
    inside = np.linspace(-0.5, 0.5, 2_000_001)[1:] * count
    mean = information_of_counts(inside, count, sigma).mean()
    whole = quad(lambda u: norm.pdf(u) ** 2 / (norm.cdf(u) * norm.sf(u)), -8, 8)[0]
    assert mean == pytest.approx(whole / (sigma * count), rel=1e-3)
    assert whole == pytest.approx(1.81, abs=0.005)


def test_where_noise_passes_over_counts_rounding_is_white_noise_of_its_variance():
    q = np.linspace(-1, 1, 50)
    expected = 1 / (0.4**2 + 1 / 12)
    np.testing.assert_allclose(information_of_counts(q, 1.0, 0.4), expected, rtol=0.06)


def test_the_bound_of_a_mass_under_a_constant_force():
    """q = q₀ + v₀ t + F t²/2m: the errors of a parabola through independent positions."""
    robot = pv.load_robot("emps")
    (mass,) = (p for p in base_parameters(robot).parameters if p.stem in ("m", "ia"))
    t, m, force, sigma = np.arange(500) / 1000.0, 95.0, 40.0, 1e-5
    q = (0.3 + 0.2 * t + force / (2 * m) * t**2)[:, None]
    dq = (0.2 + force / m * t)[:, None]
    tau = np.full_like(q, force)
    motion = Trajectory(1000.0, q, dq, 0 * q, tau, tau, q[:, :0])
    halves = [slice(0, 250), slice(250, 500)]
    for runs in ([slice(0, 500)], halves):  # a run of its own has a start of its own
        found = least_errors(
            [
                triangle(
                    driven(robot, (mass,), np.array([m]), motion, run),
                    np.full_like(q[run], 1 / sigma**2),
                )
                for run in runs
            ]
        )
        information = 0.0
        for run in runs:
            own = t[run] - t[run.start]
            parabola = np.column_stack([np.ones_like(own), own, -force / (2 * m**2) * own**2])
            information += 1 / np.linalg.inv(parabola.T @ parabola)[2, 2]
        np.testing.assert_allclose(found, sigma / np.sqrt(information), rtol=1e-6)
