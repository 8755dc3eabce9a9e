"""Symbolic models agree with the compiled kernels, and cost what they should."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import mass_matrix as numeric_mass_matrix
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import RobotDescriptionError
from pivident.models.symbolic.composite_bodies import gravity_vector, mass_matrix
from pivident.models.symbolic.newton_euler import coriolis_vector, inverse_model, observation_matrix
from pivident.models.symbolic.robot_models import base_parameter_program
from pivident.robot.friction import FrictionLaw, coulomb, dahl, load_dependent, viscous
from pivident.robot.gallery import load_robot
from tests.dynamics.friction_laws import LAWS, law
from tests.models.symbolic.evaluation import evaluated
from tests.models.symbolic.robots import random_robot, scara, seven_axes, states

ROBOTS = {
    "tx40": lambda: load_robot("staubli_tx40"),
    "rv2sq": lambda: load_robot("mitsubishi_rv2sq"),
    "emps": lambda: load_robot("emps"),
    "planar": lambda: load_robot("planar_2r"),
    "seven axes": seven_axes,
    "scara": scara,
}
SEEDS = st.integers(0, 2**32 - 1)


def assert_close(ours, theirs):
    scale = max(1.0, np.abs(theirs).max(initial=0.0))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-11 * scale)


def assert_all_models_agree(robot, parameters, seed, count=8):
    """Every model of a robot with random values, against regressor and mass matrix."""
    q, dq, ddq = states(robot, count, seed)
    theta = np.random.default_rng(seed).uniform(-1.0, 1.0, len(parameters))
    regressor = Regressor.build(robot, parameters)
    still = np.zeros_like(q)
    (tau,) = evaluated(inverse_model(robot, parameters), q, dq, ddq, theta)
    assert_close(tau, regressor.torque(q, dq, ddq, theta))
    (folded,) = evaluated(inverse_model(robot, parameters, theta), q, dq, ddq)
    assert_close(folded, tau)
    (phi,) = evaluated(observation_matrix(robot, parameters), q, dq, ddq)
    assert_close(phi, regressor.matrix(q, dq, ddq))
    (mass,) = evaluated(mass_matrix(robot, parameters), q, theta)
    assert_close(mass, numeric_mass_matrix(robot, parameters, theta, q))
    links = np.where([p.is_inertial for p in parameters], theta, 0.0)
    weight = regressor.torque(q, still, still, links)
    (g,) = evaluated(gravity_vector(robot, parameters), q, theta)
    assert_close(g, weight)
    (c,) = evaluated(coriolis_vector(robot, parameters), q, dq, theta)
    assert_close(c, regressor.torque(q, dq, still, links) - weight)


@pytest.mark.parametrize("columns", ["base", "standard"])
@pytest.mark.parametrize("name", ROBOTS)
def test_models_of_known_robots_agree(name, columns):
    robot = ROBOTS[name]()
    base = base_parameters(robot).parameters
    assert_all_models_agree(robot, base if columns == "base" else standard_parameters(robot), 7)


def test_models_of_a_robot_on_a_floating_base():
    """Its six joints are those of a tree; groups are found from the observation matrix."""
    robot = load_robot("quadruped")
    base = base_parameters(robot)
    assert_all_models_agree(robot, base.parameters, 7, 3)
    standard = np.random.default_rng(8).uniform(-1.0, 1.0, len(base.standard))
    theta = base_parameter_program(robot).function()(standard)
    np.testing.assert_allclose(theta, base.values(standard), rtol=0, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(SEEDS)
def test_models_of_random_robots_agree(seed):
    robot = random_robot(seed)
    assert_all_models_agree(robot, standard_parameters(robot), seed, 3)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_base_parameters_are_enough(seed):
    robot = random_robot(seed, 5)
    base = base_parameters(robot)
    q, dq, ddq = states(robot, 4, seed)
    standard = np.random.default_rng(seed).uniform(-1.0, 1.0, len(base.standard))
    (tau,) = evaluated(inverse_model(robot, "standard"), q, dq, ddq, standard)
    (again,) = evaluated(inverse_model(robot, base), q, dq, ddq, base.values(standard))
    np.testing.assert_allclose(again, tau, rtol=0, atol=1e-8 * max(1.0, np.abs(tau).max()))


@pytest.mark.parametrize("name", LAWS)
def test_friction_laws_agree(name):
    robot = load_robot("planar_2r").with_friction(law(name))
    parameters = standard_parameters(robot)
    regressor = Regressor.build(robot, parameters)
    q, dq, ddq = states(robot, 40, 5)
    dq[::7] = 0.0
    theta = np.random.default_rng(5).uniform(0.1, 1.0, len(parameters))
    inner = regressor.inner(q.T, dq.T, ddq.T, theta)
    program = observation_matrix(robot, parameters)
    given = (q, dq, ddq, inner.T) if len(inner) else (q, dq, ddq)
    # what the regressor hands over for load is |load| s(dq), as a column
    (phi,) = evaluated(program, *given)
    assert_close(phi, regressor.matrix(q, dq, ddq, inner=inner))
    torque = inverse_model(robot, parameters)
    memory = [
        k
        for k, e in enumerate(regressor.inner_entries)
        if parameters[regressor.column[e]].friction.has_memory
    ]
    given = (q, dq, ddq, inner[memory].T) if memory else (q, dq, ddq)
    (tau,) = evaluated(torque, *given, theta)
    assert_close(tau, regressor.torque(q, dq, ddq, theta))
    np.testing.assert_allclose(torque.function()(*given, theta), tau, rtol=1e-12, atol=1e-12)


def test_friction_with_memory_is_an_input_and_named():
    law = FrictionLaw((viscous(), dahl(2e-3), load_dependent("tanh", 50.0)))
    program = inverse_model(load_robot("planar_2r").with_friction(law))
    names = [argument.name for argument in program.inputs]
    assert names == ["q", "dq", "ddq", "inner"]
    assert any(note.startswith("fc1: its friction has a memory") for note in program.notes)
    inner = observation_matrix(load_robot("planar_2r").with_friction(law)).inputs[-1]
    assert [s.name for s in inner.symbols] == ["z_fc1", "load_fl1", "z_fc2", "load_fl2"]


def test_parts_can_be_left_out():
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    q, dq, ddq = states(robot, 5)
    theta = np.random.default_rng(1).uniform(-1.0, 1.0, len(base))
    full = Regressor.build(robot, base.parameters)
    links = np.where([p.is_inertial for p in base.parameters], theta, 0.0)
    rotors = np.where([p.is_inertial or p.stem in ("ia", "iam") for p in base.parameters], theta, 0)
    (bare,) = evaluated(inverse_model(robot, base, rotors=False, friction=False), q, dq, ddq, theta)
    assert_close(bare, full.torque(q, dq, ddq, links))
    (smooth,) = evaluated(inverse_model(robot, base, friction=False), q, dq, ddq, theta)
    assert_close(smooth, full.torque(q, dq, ddq, rotors))


def test_tx40_costs_what_a_customised_model_costs():
    robot = load_robot("staubli_tx40")
    whole = inverse_model(robot).operation_count
    assert whole.multiplications <= 290 and whole.additions <= 270
    links = inverse_model(robot, rotors=False, friction=False).operation_count
    assert links.multiplications <= 255 and links.additions <= 240
    with_atan = inverse_model(robot).operation_count
    assert with_atan.functions == 7  # six joints and the coupled motor


def test_parallel_axes_turn_together():
    """In a plane gravity sees q1 + q2 and not q2 alone; the TX40's third axis needs both."""
    text = gravity_vector(load_robot("planar_2r")).to_python()
    assert "q1 + q2" in text and "(q2)" not in text
    program = gravity_vector(load_robot("planar_2r")).operation_count
    assert program.sines == 4 and program.multiplications <= 8


def test_numbers_prune_the_model():
    """Nominal values with zeros: a SCARA of point masses needs a fraction of the operations."""
    robot = scara()
    parameters = standard_parameters(robot)
    values = np.array([1.0 if p.stem in ("m", "ia") else 0.0 for p in parameters])
    symbols = inverse_model(robot, parameters).operation_count
    numbers = inverse_model(robot, parameters, values).operation_count
    assert 0 < numbers.multiplications < symbols.multiplications / 2


def test_same_text_each_time():
    robot = load_robot("mitsubishi_rv2sq")
    first = inverse_model(robot).to_c()
    observation_matrix(robot)
    assert inverse_model(robot).to_c() == first


def test_wrong_number_of_values_is_refused():
    with pytest.raises(RobotDescriptionError, match=r"have shape \(3,\); give 13 numbers"):
        inverse_model(load_robot("planar_2r"), "base", np.zeros(3))


def test_coulomb_friction_of_a_hard_sign():
    robot = load_robot("planar_2r").with_friction(FrictionLaw((coulomb("sign"),)))
    q, dq, ddq = states(robot, 20)
    parameters = standard_parameters(robot)
    theta = np.arange(1.0, 1.0 + len(parameters))
    (tau,) = evaluated(inverse_model(robot, parameters), q, dq, ddq, theta)
    assert_close(tau, Regressor.build(robot, parameters).torque(q, dq, ddq, theta))
