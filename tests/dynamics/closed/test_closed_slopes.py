"""Slopes of N, γ, M_a and h_a along the independent motion, against differences."""

import numpy as np
import pytest

from pivident.dynamics.closed_chains.closed_dynamics import closed_bias, closed_mass, closed_run
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.closed_chains.closed_slopes import (
    bias_slopes,
    closed_slopes,
    mass_matrix_slopes,
)
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.rigid_body_slopes import slope_scratch
from pivident.foundation.compiled import kernel
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from tests.dynamics.closed.mechanisms import MECHANISMS, VISCOUS, delta, five_bar, states

SMOOTH = FrictionLaw((viscous(), coulomb(gamma=2.0)))

ROBOTS = {
    **MECHANISMS,
    "smooth delta": lambda: delta(law=VISCOUS, passive=SMOOTH),
    "five bar with a hinge": lambda: five_bar(kind="axis", law=VISCOUS),
}

STEP = 1e-3


@kernel
def slopes_at(run, slopes, rotor, q, dq, links, body, mass, bias, by_position, by_speed, of_mass):
    status = closed_bias(run, q, dq, bias)
    closed_mass(run, rotor, mass)
    bias_slopes(run, slopes, links, body, by_position, by_speed)
    mass_matrix_slopes(run, slopes, links, body, of_mass)
    return status


class Mechanism:
    """M_a and h_a of a mechanism, the slopes of the kernels, and N and γ."""

    def __init__(self, robot):
        self.chains = ClosedChains(robot)
        parameters = standard_parameters(robot)
        values = nominal_values(robot, parameters)
        for k, p in enumerate(parameters):
            if p.friction is not None:
                values[k] = 0.3
        self.model = make_model(robot, parameters, values)
        self.size, self.tree = robot.size, robot.tree.size

    def at(self, q, dq):
        n, m = self.tree, self.size
        run = closed_run(self.model.closed, self.chains.start(q))
        slopes = closed_slopes(self.model.closed)
        square, cube = (m, m), (m, m, m)
        found = [np.zeros(s) for s in (square, m, square, square, cube)]
        status = slopes_at(run, slopes, self.model.rotor, q, dq, *slope_scratch(n), *found)
        assert status == 0
        place = run.place
        closure = slopes.closure
        return (*found, place.gain, place.drift, closure.gain, closure.drift, place.dq)


def differences(function, x):
    """Derivatives of arrays along each entry of x, by five points, the entries last."""

    def along(e):
        ahead, behind = (function(x + h * e) for h in (STEP, -STEP))
        far_ahead, far_behind = (function(x + 2.0 * h * e) for h in (STEP, -STEP))
        return [
            (8.0 * (a - b) - (c - d)) / (12.0 * STEP)
            for a, b, c, d in zip(ahead, behind, far_ahead, far_behind, strict=True)
        ]

    return [np.stack(x, axis=-1) for x in zip(*map(along, np.eye(x.size)), strict=True)]


@pytest.mark.parametrize("name", ROBOTS)
def test_slopes_are_differences(name):
    robot = ROBOTS[name]()
    mechanism = Mechanism(robot)
    for q, dq, _ in zip(*states(robot, 3, 21, speed=2.0), strict=True):
        found = mechanism.at(q, dq)
        by_position, by_speed, of_mass, of_gain, of_drift = (found[k] for k in (2, 3, 4, 7, 8))
        at_q = differences(lambda x, dq=dq: [mechanism.at(x, dq)[k] for k in (0, 1, 5, 6)], q)
        mass, bias, gain, drift = at_q
        (bias_by_speed,) = differences(lambda x, q=q: [mechanism.at(q, x)[1]], dq)
        below = np.tril_indices(robot.size)
        for ours, theirs in (
            (of_gain, gain),
            (of_drift, drift),
            (of_mass[below], mass[below]),
            (by_position, bias),
            (by_speed, bias_by_speed),
        ):
            size = max(1.0, np.abs(theirs).max())
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=2e-8 * size)


def test_speeds_are_left_as_they_were():
    robot = delta(law=VISCOUS)
    mechanism = Mechanism(robot)
    q, dq, _ = (x[0] for x in states(robot, 1, 5))
    found = mechanism.at(q, dq)
    np.testing.assert_allclose(found[-1], found[5] @ dq, rtol=0, atol=1e-14)
