"""Symbolic models of mechanisms with closed loops against the kernels and against differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.foundation.errors import RobotDescriptionError
from pivident.models import (
    closure_equations,
    inverse_model,
    joint_motion,
    observation_matrix,
    symbolic_models,
)
from pivident.models.symbolic.robot_models import LOOP_MODELS, MODELS, base_parameter_program
from pivident.robot import lugre, viscous
from pivident.robot.closed_chains import assembled, equations
from pivident.robot.description import Coupling
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import load_robot
from tests.dynamics.closed.mechanisms import spatial_loop
from tests.models.symbolic.mechanisms import (
    GALLERY,
    MADE,
    base_of,
    closed_states,
    mechanism,
    motion_of_all,
    observation,
)

EVERY = (*GALLERY, *MADE)


def assert_close(ours, theirs, accuracy=1e-9):
    scale = max(1.0, np.abs(theirs).max(initial=0.0))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=accuracy * scale)


@pytest.mark.parametrize("columns", ["base", "standard"])
@pytest.mark.parametrize("name", EVERY)
def test_inverse_model_and_observation_matrix(name, columns):
    """What the text of the Python module computes, at postures at random."""
    robot, base = mechanism(name), base_of(name)
    parameters = base.parameters if columns == "base" else base.standard
    q, dq, ddq = closed_states(robot, 12, 1)
    phi = observation(robot, parameters, q, dq, ddq)
    theta = np.random.default_rng(2).uniform(-1.0, 1.0, len(parameters))
    assert_close(observation_matrix(robot, parameters).function()(q, dq, ddq), phi)
    assert_close(inverse_model(robot, parameters).function()(q, dq, ddq, theta), phi @ theta)
    folded = inverse_model(robot, parameters, theta).function()(q, dq, ddq)
    assert_close(folded, phi @ theta)


@pytest.mark.parametrize("name", EVERY)
def test_mass_gravity_and_coriolis_add_up(name):
    robot, base = mechanism(name), base_of(name)
    q, dq, ddq = closed_states(robot, 6, 3)
    theta = np.random.default_rng(4).uniform(-1.0, 1.0, len(base))
    mass, gravity, coriolis = symbolic_models(robot, ["mass", "gravity", "coriolis"], base)
    matrix = mass.function()(q, theta)
    np.testing.assert_array_equal(matrix, matrix.swapaxes(1, 2))
    bodies = [p.is_inertial or p.stem == "ia" for p in base.parameters]
    links = [p.is_inertial for p in base.parameters]
    still = np.zeros_like(dq)
    weight = observation(robot, base.parameters, q, still, still)[:, :, links] @ theta[links]
    assert_close(gravity.function()(q, theta), weight)
    total = observation(robot, base.parameters, q, dq, ddq)[:, :, bodies] @ theta[bodies]
    parts = np.einsum("sij,sj->si", matrix, ddq) + gravity.function()(q, theta)
    assert_close(parts + coriolis.function()(q, dq, theta), total)


@pytest.mark.parametrize("name", EVERY)
def test_motion_of_all_joints(name):
    robot = mechanism(name)
    q, dq, ddq = closed_states(robot, 12, 5)
    found = joint_motion(robot).function()(q, dq, ddq)
    for ours, theirs in zip(found, motion_of_all(robot, q, dq, ddq), strict=True):
        assert_close(ours, theirs)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**16), st.sampled_from(["point", "axis", "full"]), st.booleans())
def test_motion_of_loops_at_random(seed, kind, on_base):
    """Loops of revolute and sliding joints in general directions, all by Newton's method."""
    robot = spatial_loop(seed, kind, 2, on_base)
    q, dq, ddq = closed_states(robot, 4, seed)
    found = joint_motion(robot).function()(q, dq, ddq)
    for ours, theirs in zip(found, motion_of_all(robot, q, dq, ddq), strict=True):
        assert_close(ours, theirs, 1e-8)


@pytest.mark.parametrize("name", EVERY)
def test_equations_and_their_jacobian(name):
    """Where loops are open: those of the description, and A is the slope of c."""
    robot = mechanism(name)
    kept, size = list(robot.constraints.kept), robot.tree.size
    q = robot.constraints.posture + np.random.default_rng(6).uniform(-0.5, 0.5, (5, size))
    function = closure_equations(robot).function()
    gap, slope = function(q)
    for k, posture in enumerate(q):
        value, jacobian = equations(robot.tree, robot.constraints, posture)
        assert_close(gap[k], value[kept], 1e-12)
        assert_close(slope[k], jacobian[kept], 1e-12)
    step = 1e-6 * np.eye(size)
    ahead, behind = function(q[:, None] + step)[0], function(q[:, None] - step)[0]
    assert_close(slope, np.moveaxis(ahead - behind, 1, 2) / 2e-6, 1e-7)


@pytest.mark.parametrize("name", EVERY)
def test_gain_annuls_the_jacobian(name):
    """A N = 0 and A ddq + dA/dt dq = 0, by differences of A along the motion."""
    robot = mechanism(name)
    q, dq, ddq = closed_states(robot, 4, 7)
    positions, speeds, accelerations, gain = joint_motion(robot).function()(q, dq, ddq)
    function = closure_equations(robot).function()
    gap, slope = function(positions)
    assert_close(gap, np.zeros_like(gap), 1e-11)
    product = slope @ gain
    assert_close(product, np.zeros_like(product), 1e-9)
    h = 1e-6
    turned = (function(positions + h * speeds)[1] - function(positions - h * speeds)[1]) / (2 * h)
    left = np.einsum("sij,sj->si", turned, speeds) + np.einsum("sij,sj->si", slope, accelerations)
    assert_close(left, np.zeros_like(left), 1e-5 * max(1.0, np.abs(accelerations).max()))


@pytest.mark.parametrize("name", ["five_bar", "parallelogram_palletizer", "delta"])
def test_base_parameters_with_groups_over_the_loops(name):
    """Torques of groups are those of all standard parameters, by the two generated functions."""
    robot, base = mechanism(name), base_of(name)
    q, dq, ddq = closed_states(robot, 6, 8)
    standard = np.random.default_rng(9).uniform(-1.0, 1.0, len(base.standard))
    theta = base_parameter_program(robot).function()(standard)
    np.testing.assert_allclose(theta, base.values(standard), rtol=1e-12, atol=1e-12)
    whole = inverse_model(robot, "standard").function()(q, dq, ddq, standard)
    assert_close(inverse_model(robot, base).function()(q, dq, ddq, theta), whole, 1e-8)


def test_closed_forms_and_what_is_left_to_newton():
    closed = {name: inverse_model(mechanism(name), base_of(name)).closing for name in EVERY}
    newton = {name for name, closing in closed.items() if closing is not None}
    assert newton == {
        "delta", "orthoglide", "ball", "hinge", "weld on the base", "geared ball",
        "geared five bar",
    }  # fmt: skip
    assert len(closed["delta"].unknown) == 9


def test_a_parallelogram_moves_in_whole_proportions():
    """No sine of a passive joint is left in the palletizer, and its wrist stays level."""
    motion = joint_motion(load_robot("parallelogram_palletizer"))
    assert motion.operation_count.sines == motion.operation_count.functions == 0
    q, dq, ddq = closed_states(mechanism("parallelogram_palletizer"), 3)
    gain = motion.function()(q, dq, ddq)[3]
    np.testing.assert_array_equal(gain, np.round(gain))
    lower_arm, upper_arm, wrist = 1, 4, 8
    np.testing.assert_array_equal(gain[:, [lower_arm, upper_arm, wrist]].sum(axis=1), 0.0)


def test_loops_make_few_operations():
    """Gears cost next to nothing, and a loop not much more than its tree."""
    scara = inverse_model(load_robot("scara")).operation_count
    assert scara.multiplications <= 63 and scara.additions <= 47
    five = inverse_model(load_robot("five_bar")).operation_count
    assert five.multiplications <= 134 and five.additions <= 94


def test_where_a_loop_does_not_close_there_is_no_number():
    """A five-bar whose cranks point apart, an Orthoglide with a slider too far; others stay."""
    far = np.array([[np.pi, 0.0], *closed_states(mechanism("five_bar"), 1)[0]])
    with np.errstate(invalid="ignore"):
        found = joint_motion(mechanism("five_bar")).function()(far, 0.0 * far, 0.0 * far)[0]
    assert np.isnan(found[0, [1, 3]]).all() and not np.isnan(found[1]).any()
    q = closed_states(mechanism("orthoglide"), 2)[0]
    q[0, 0] = 2.0
    found = joint_motion(mechanism("orthoglide")).function()(q, 0.0 * q, 0.0 * q)[0]
    assert np.isnan(found[0]).any() and not np.isnan(found[1]).any()


def test_newton_starts_where_it_is_told():
    robot = mechanism("delta")
    program = joint_motion(robot)
    q, dq, ddq = closed_states(robot, 5, 10)
    function = program.function()
    positions = function(q, dq, ddq)[0]
    order = [
        int(s.name[1:]) - 1 for s in (*program.inputs[0].symbols, *program.closing.unknown.symbols)
    ]
    again = function(q, dq, ddq, positions[:, order])
    np.testing.assert_allclose(again[0], positions, rtol=0, atol=1e-13)
    # the platform above the motors is the other assembly of the same arms
    above = positions[:, order].copy()
    above[:, -1] *= -1.0
    mirrored = function(q[:1], dq[:1], ddq[:1], closed_above(robot, positions[0])[order])[0]
    assert mirrored[0, -1] > 0.0 > positions[0, -1]
    with pytest.raises(ValueError, match=r"posture has shape \(3,\); its last axis must be 12"):
        function(q, dq, ddq, np.zeros(3))


def closed_above(robot, positions):
    """The assembly with the platform above, near the mirrored one."""
    start = positions.copy()
    start[-1] = abs(start[-1])
    start[[1, 4, 7]] *= -1.0
    return assembled(robot.tree, robot.constraints, start)


def test_every_model_there_is():
    robot = mechanism("five_bar")
    assert len(symbolic_models(robot)) == len(MODELS) + len(LOOP_MODELS)
    with pytest.raises(RobotDescriptionError, match=r"has no closed loops.*leave out closure"):
        symbolic_models(load_robot("planar_2r"), ["closure"])
    with pytest.raises(RobotDescriptionError, match="has no closed loops"):
        joint_motion(load_robot("planar_2r"))


def test_coupled_motors():
    """A motor on a crank that turns along with another one."""
    robot = replace(mechanism("five_bar"), couplings=(Coupling(1, 0, 0.6),))
    parameters = standard_parameters(robot)
    assert {"iam", "fvm", "fcm"} <= {p.stem for p in parameters}
    q, dq, ddq = closed_states(robot, 5, 11)
    phi = observation(robot, parameters, q, dq, ddq)
    assert_close(observation_matrix(robot, parameters).function()(q, dq, ddq), phi)
    theta = np.random.default_rng(12).uniform(-1.0, 1.0, len(parameters))
    assert_close(inverse_model(robot, parameters).function()(q, dq, ddq, theta), phi @ theta)
    bodies = [p.is_inertial or p.stem in ("ia", "iam") for p in parameters]
    (mass,) = symbolic_models(robot, ["mass"], parameters)
    still = np.zeros_like(dq)
    free = replace(robot, gravity=np.zeros(3))
    pushed = observation(free, parameters, q, still, ddq)[:, :, bodies] @ theta[bodies]
    assert_close(np.einsum("sij,sj->si", mass.function()(q, theta), ddq), pushed)


def test_friction_with_a_memory_is_refused():
    robot = load_robot("five_bar").with_friction(FrictionLaw((viscous(), *lugre(1e-3, 0.3, 0.1))))
    with pytest.raises(RobotDescriptionError, match=r"friction with a memory.*closed loops"):
        inverse_model(robot, "standard")


def test_nominal_values_fold_the_model():
    robot = mechanism("delta")
    parameters = standard_parameters(robot)
    values = nominal_values(robot, parameters)
    symbols = inverse_model(robot, parameters).operation_count
    numbers = inverse_model(robot, parameters, values).operation_count
    assert numbers.multiplications < symbols.multiplications
