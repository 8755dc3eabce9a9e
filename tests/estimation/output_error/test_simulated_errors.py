"""Errors and their derivatives against simulations of their own."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.output_error.loop_unknowns import Unknown, values_of, with_values
from pivident.estimation.output_error.record_stretches import OpenLoop
from pivident.estimation.output_error.simulated_errors import simulated_errors
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES, means_at
from pivident.loop.simulation.closed_loop import simulate
from pivident.loop.simulation.direction import Direction
from tests.estimation.output_error.arms import all_columns, loop, stretch, unknowns
from tests.planar_arm import nominal_parameters

OTHERS = [
    Unknown("delay", "s", Direction("delay"), 0.0),
    Unknown("kp1", "output/rad", Direction("law", "kp", 0)),
    Unknown("encoder_offset2", "rad", Direction("encoder_offset", joint=1)),
    Unknown("drive_gain1", "N m per output", Direction("drive_gain", joint=0)),
]


@pytest.mark.parametrize("factor", [1, 5])
def test_errors_are_what_a_simulation_leaves(factor):
    _, theta = nominal_parameters()
    own = stretch(loop(1.05 * theta), noise=1e-6)
    (made,) = simulated_errors([own], unknowns("fv1"), (POSITIONS, TORQUES), [factor])
    plain = simulate(own.loop.model, own.loop.controller, own.loop.signals, ("a", "b"))
    for channel, measured, simulated in ((0, own.q, plain.q), (1, own.tau, plain.tau)):
        expected = means_at(measured - simulated, factor).T
        np.testing.assert_allclose(made.errors[channel], expected, atol=1e-12)
        rms = np.mean((measured - simulated) ** 2, axis=0)
        np.testing.assert_allclose(made.mean_square[channel], rms, rtol=1e-9)
    assert made.rate == 1000.0 / factor


@pytest.mark.parametrize("late", [0.0, 0.0025])
def test_derivatives_are_differences_of_errors(late):
    _, theta = nominal_parameters()
    start_std = np.full(4, 0.01)
    own = stretch(loop(1.02 * theta, samples=600, drive_delay=late), start_std=start_std)
    # friction of joint 2 too: columns that are zero elsewhere
    sought = [*unknowns("zz1", "fv2", "my2"), *OTHERS]
    channels = (POSITIONS, TORQUES)
    (made,) = simulated_errors([own], sought, channels, [5])
    columns = all_columns(made)
    values = values_of(own.loop, sought)
    for k, unknown in enumerate(sought):
        step = 1e-5 * (abs(values[k]) or 1e-3)
        # no delay is less than none, and a difference of one side is less exact
        one_sided = unknown.name == "delay" and late == 0.0
        if unknown.name == "delay":
            step = 2e-5 if one_sided else 1e-7
        sides = []
        for sign in (1.0, 0.0 if one_sided else -1.0):
            moved = values.copy()
            moved[k] += sign * step
            other = own.with_loop(with_values(own.loop, sought, moved))
            sides.append(simulated_errors([other], [], channels, [5])[0].errors)
        width = step if one_sided else 2.0 * step
        numeric = (sides[1] - sides[0]) / width
        # with a delay, the torque that acts at a sample is that of the sample before
        for c in range(1 if one_sided else 2):
            size = np.abs(numeric[c]).max()
            error = np.sqrt(np.mean((columns[c, :, k] - numeric[c]) ** 2))
            # friction's reversals are passed at other instants: in the mean
            within = 0.02 if one_sided else 2e-4
            assert error < within * size, (unknown.name, c, error / size)


def test_derivatives_along_the_start_end_where_it_is_forgotten():
    own = stretch(loop(samples=2000), start_std=np.full(4, 0.01))
    (made,) = simulated_errors([own], unknowns("fv1"), (POSITIONS,), [5])
    starts = np.abs(all_columns(made)[0, :, 1:]).max(axis=(0, 1))
    assert starts[:20].max() > 0.1
    assert (starts[-50:] <= 1e-5 * starts.max()).all()


def test_samples_before_the_first_and_at_standstill_do_not_count():
    own = stretch(loop(samples=600), first=101)
    own.moving[200:400, 1] = False
    (made,) = simulated_errors([own], unknowns("fv1"), (POSITIONS, TORQUES), [5])
    assert not made.used[:, :, :21].any() and made.used[:, :, 21:38].all()
    assert not made.used[:, 1, 40:76].any() and made.used[:, 0, 40:76].all()


def test_positions_at_standstill_count_in_an_open_loop():
    own = stretch(replace(loop(samples=200), controller=OpenLoop()))
    own.moving[50:150, 1] = False
    (made,) = simulated_errors([own], unknowns("fv1"), (POSITIONS,), [5])
    assert made.used.all()
