"""Closed mechanisms against MuJoCo's masses, bias forces and constraint Jacobians."""

import numpy as np
import pytest

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from tests.dynamics.closed.mechanisms import MECHANISMS, energy, states
from tests.forward_dynamics import acceleration

pytest.importorskip("mujoco")
from tests.dynamics.closed.mujoco_twin import Twin

RANK = 1e-9


class Case:
    """A mechanism of either side at random states."""

    def __init__(self, name, count=12):
        self.robot = MECHANISMS[name]()
        self.tree = self.robot.tree
        self.parameters = standard_parameters(self.robot)
        self.theta = nominal_values(self.robot, self.parameters)
        damping = np.zeros(self.tree.size)
        for p, value in zip(self.parameters, self.theta, strict=True):
            if p.stem == "fv":
                damping[p.joint] = value
        self.twin = Twin(self.robot, damping)
        self.q, self.dq, self.ddq = states(self.robot, count, 7, speed=2.0)
        chains = ClosedChains(self.robot)
        self.whole = np.array([chains.start(x).q for x in self.q])
        self.gains = [self.gain(x) for x in self.whole]
        self.speeds = np.array([n @ x for n, x in zip(self.gains, self.dq, strict=True)])

    def gain(self, whole):
        """N from the null space of MuJoCo's Jacobian, the independent joints with unit rows."""
        slope, gap = self.twin.jacobian(whole, np.zeros(self.tree.size))
        np.testing.assert_allclose(gap, 0.0, atol=1e-10)
        _, sizes, directions = np.linalg.svd(slope)
        rank = int((sizes > RANK * sizes[0]).sum())
        assert rank == self.tree.size - self.robot.size
        basis = directions[rank:].T
        return basis @ np.linalg.inv(basis[list(self.robot.places)])


@pytest.fixture(scope="module", params=MECHANISMS)
def case(request):
    return Case(request.param)


def test_gain_and_accelerations_are_those_of_its_jacobian(case):
    for q, dq, ddq, whole, gain, speed in zip(
        case.q, case.dq, case.ddq, case.whole, case.gains, case.speeds, strict=True
    ):
        motion = ClosedChains(case.robot).motion(q[:, None], dq[:, None], ddq[:, None])
        np.testing.assert_allclose(motion.gain[:, :, 0], gain, rtol=0, atol=1e-10)
        slope, _ = case.twin.jacobian(whole, speed)
        left = slope @ motion.ddq[:, 0] + case.twin.drift(whole, speed)
        np.testing.assert_allclose(left, 0.0, atol=1e-7)


def test_torques_are_those_of_virtual_work(case):
    regressor = regressor_of(case.robot, case.parameters)
    for q, dq, ddq, whole, gain, speed in zip(
        case.q, case.dq, case.ddq, case.whole, case.gains, case.speeds, strict=True
    ):
        slope, _ = case.twin.jacobian(whole, speed)
        drift = np.linalg.lstsq(slope, -case.twin.drift(whole, speed), rcond=RANK)[0]
        # any particular solution will do: what it lacks lies in the range of N
        drift -= gain @ drift[list(case.robot.places)]
        mass, bias = case.twin.mass_and_bias(whole, speed)
        theirs = gain.T @ (mass @ (gain @ ddq + drift) + bias)
        ours = regressor.torque(q[None], dq[None], ddq[None], case.theta)[0]
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * np.abs(theirs).max())


def test_accelerations_are_those_of_its_equations_of_motion_with_multipliers(case):
    tau = np.random.default_rng(8).uniform(-10.0, 10.0, case.q.shape)
    ours = acceleration(case.robot, case.parameters, case.theta, case.q, case.dq, tau)
    size = case.tree.size
    for own, t, whole, speed in zip(ours, tau, case.whole, case.speeds, strict=True):
        slope, _ = case.twin.jacobian(whole, speed)
        mass, bias = case.twin.mass_and_bias(whole, speed)
        rows = len(slope)
        system = np.block([[mass, slope.T], [slope, np.zeros((rows, rows))]])
        force = -bias
        force[list(case.robot.places)] += t
        right = np.concatenate([force, -case.twin.drift(whole, speed)])
        theirs = np.linalg.lstsq(system, right, rcond=1e-12)[0][:size]
        expected = theirs[list(case.robot.places)]
        np.testing.assert_allclose(own, expected, rtol=0, atol=1e-7 * np.abs(theirs).max())


def test_the_mass_matrix_is_that_of_the_tree_between_its_gains(case):
    ours = mass_matrix(case.robot, case.parameters, case.theta, case.q)
    for own, whole, gain in zip(ours, case.whole, case.gains, strict=True):
        mass, _ = case.twin.mass_and_bias(whole, np.zeros(case.tree.size))
        np.testing.assert_allclose(own, gain.T @ mass @ gain, rtol=0, atol=1e-10)


def test_the_energy_written_for_the_tests_is_its_energy(case):
    for whole, speed in zip(case.whole, case.speeds, strict=True):
        potential, kinetic = case.twin.energy(whole, speed)
        ours = energy(case.tree, whole, speed)
        np.testing.assert_allclose(ours, (kinetic, potential), rtol=0, atol=1e-11)
