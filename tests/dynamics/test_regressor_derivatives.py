import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.column_slopes import column_slopes
from pivident.dynamics.friction import friction_column
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import load_robot
from tests.dynamics.newton_euler import torques
from tests.dynamics.trees import RandomTree

STEP = 1e-30


def states(robot, samples, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2.0, 2.0, (3, samples, robot.size)), rng


def rigid(robot):
    """The robot without friction, rotors and couplings."""
    from dataclasses import replace

    bare = replace(robot, couplings=(), friction_nominal={})
    return bare.with_friction(FrictionLaw(()))


@pytest.mark.parametrize("seed", range(6))
def test_against_complex_steps_through_another_newton_euler(seed):
    robot = rigid(RandomTree(seed).robot)
    columns = standard_parameters(robot)
    derivatives = RegressorDerivatives.of(Regressor.build(robot, columns))
    (q, dq, ddq), rng = states(robot, 2, seed)
    weights = rng.standard_normal((2, robot.size, len(columns)))
    found = derivatives.weighted(q, dq, ddq, weights)
    for t in range(2):
        for k in range(robot.size):
            for quantity in range(3):
                state = [x[t].astype(complex) for x in (q, dq, ddq)]
                state[quantity][k] += 1j * STEP
                inertial = np.where([p.is_inertial for p in columns], weights[t], 0.0)
                expected = torques(robot, columns, *state, inertial).imag / STEP
                rotor = [weights[t, k, c] for c, p in enumerate(columns) if p.stem == "ia"
                         and p.joint == k]  # fmt: skip
                if quantity == 2 and rotor:
                    expected[k] += rotor[0]
                scale = np.abs(found[t]).max()
                np.testing.assert_allclose(found[t, :, k, quantity], expected, atol=1e-12 * scale)


def test_against_pinocchio():
    pin = pytest.importorskip("pinocchio")
    tree = RandomTree(11)
    robot, columns = rigid(tree.robot), standard_parameters(tree.robot)
    columns = tuple(p for p in columns if p.is_inertial)
    derivatives = RegressorDerivatives.of(Regressor.build(robot, columns))
    q, dq, ddq = tree.states(5)
    weights = np.broadcast_to(tree.inertia.ravel(), (5, robot.size, tree.inertia.size))
    found = derivatives.weighted(q, dq, ddq, weights)
    own = np.ix_(tree._order, tree._order)
    for t in range(5):
        state = tree.configuration(q[t]), tree.theirs(dq[t]), tree.theirs(ddq[t])
        by_q, by_dq, mass = pin.computeRNEADerivatives(tree.model, tree.data, *state)
        mass = np.triu(mass) + np.triu(mass, 1).T
        for quantity, expected in enumerate((by_q, by_dq, mass)):
            scale = np.abs(found[t]).max()
            np.testing.assert_allclose(found[t, ..., quantity], expected[own], atol=1e-11 * scale)


@pytest.mark.parametrize("name", ["staubli_tx40", "emps", "mitsubishi_rv2sq"])
def test_whole_columns_with_friction_and_couplings_by_differences(name):
    robot = load_robot(name)
    base = base_parameters(robot)
    regressor = Regressor.build(robot, base.parameters)
    derivatives = RegressorDerivatives.of(regressor)
    (q, dq, ddq), rng = states(robot, 6)
    dq *= 0.05  # where smoothed signs are steep
    weights = rng.standard_normal((6, robot.size, len(base)))
    found = derivatives.weighted(q, dq, ddq, weights)
    step = 1e-6
    for k in range(robot.size):
        for quantity in range(3):
            ends = []
            for sign in (1.0, -1.0):
                moved = [q.copy(), dq.copy(), ddq.copy()]
                moved[quantity][:, k] += sign * step
                phi = regressor.matrix(*moved, inner=regressor.levels(moved[1].T))
                ends.append(np.einsum("tjp,tjp->tj", phi, weights))
            expected = (ends[0] - ends[1]) / (2.0 * step)
            scale = np.abs(found).max()
            np.testing.assert_allclose(found[:, :, k, quantity], expected, atol=1e-6 * scale)


LAWS = [
    ["viscous", "coulomb", "offset"],
    [{"term": "coulomb", "smoothing": "tanh", "gamma": 30.0}],
    [{"term": "stribeck", "speed": 0.2, "exponent": 1.5}],
    [{"term": "power", "exponent": 0.5}, {"term": "power", "exponent": 1.7, "name": "fp_b"}],
    ["asymmetric", "asymmetric_viscous"],
    [{"term": "ripple", "order": 3.0}, "spring"],
    [{"term": "counterbalance", "ratio": 0.4, "angle": 0.3}],
]


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_slopes_of_every_friction_term(law):
    from pivident.robot.mdh_keys import FrictionEntry
    from pivident.robot.modified_dh import friction_law

    entries = [FrictionEntry.model_validate({"term": t} if isinstance(t, str) else t) for t in law]
    robot = load_robot("planar_2r").with_friction(friction_law(entries))
    regressor = Regressor.build(robot, standard_parameters(robot))
    rng = np.random.default_rng(3)
    q, dq = rng.uniform(-1.0, 1.0, (2, 50))
    step = 1e-7
    tested = 0
    for slope in column_slopes(regressor):
        term = regressor.parameters[slope.column].friction
        if term is None:
            continue
        if slope.quantity == 0:
            ends = [friction_column(term, dq, q + s * step) for s in (1, -1)]
        else:
            ends = [friction_column(term, dq + s * step, q) for s in (1, -1)]
        expected = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(
            slope.value(q, dq, dq), expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max()
        )
        tested += 1
    with_slope = {c for c in regressor.column if law_term(regressor.parameters[c])}
    assert tested == len(with_slope) > 0


def law_term(parameter):
    """Whether a parameter belongs to a friction term that depends on the motion."""
    return parameter.friction is not None and parameter.stem != "off"


def test_weights_of_another_shape_are_refused():
    robot = load_robot("planar_2r")
    derivatives = RegressorDerivatives.of(Regressor.build(robot, base_parameters(robot).parameters))
    with pytest.raises(ValueError, match="weights have shape"):
        derivatives.weighted(*np.zeros((3, 4, 2)), np.zeros((4, 2, 1)))
