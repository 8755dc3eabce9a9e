"""Columns of every friction law in the observation matrix, beside its formula."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.own_friction import OwnColumn
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.robot.friction import (
    FrictionLaw,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.friction_column import SignFunction
from pivident.robot.friction_terms import friction_columns as declared_columns
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission
from tests.dynamics.friction_laws import LAWS, law, smooth_motion
from tests.friction_columns import friction_columns

RATE = 500.0


def arm(name="planar_2r"):
    return load_robot(name)


def column(regressor, name):
    return [p.name for p in regressor.parameters].index(name)


def test_functions_of_speed_and_position():
    q, dq = np.random.default_rng(0).uniform(-3.0, 3.0, (2, 500))

    def only(*terms):
        return friction_columns(FrictionLaw(terms), dq, q).T

    cube, root = only(power_viscous(3.0), power_viscous(0.3, "b", "tanh", 9.0))
    np.testing.assert_allclose(cube, dq**3)
    np.testing.assert_allclose(root, np.tanh(9.0 * dq) * np.abs(dq) ** 0.3)
    np.testing.assert_allclose(only(power_viscous(2.0))[0], np.abs(dq) * dq)
    ahead, back = friction_columns(FrictionLaw(LAWS["directions"][:2]), dq).T
    np.testing.assert_array_equal(ahead + back, dq)
    assert (ahead >= 0).all() and (back <= 0).all()
    np.testing.assert_allclose(only(*ripple(12.0)), [np.cos(12 * q), np.sin(12 * q)])
    np.testing.assert_array_equal(only(spring())[0], q)


def test_a_strut_pushes_with_the_derivative_of_its_length():
    ratio, angle, base = 0.35, -0.6, 1.4  # a/b, φ, b [m]
    force, stiffness = 900.0, 4e3
    q, step = np.linspace(-2.0, 2.0, 101), 1e-6

    def length(q):
        return base * np.sqrt(1 + ratio**2 - 2 * ratio * np.cos(q - angle))

    slope = (length(q + step) - length(q - step)) / (2 * step)
    columns = friction_columns(FrictionLaw(counterbalance(ratio, angle)), 0 * q, q)
    own = columns @ [force * ratio * base, stiffness * ratio * base**2]
    np.testing.assert_allclose(own, (force + stiffness * length(q)) * slope, atol=1e-5)


@pytest.mark.parametrize("name", LAWS)
def test_matrix_packed_and_torque_have_the_columns_of_the_law(name):
    robot = arm().with_friction(law(name))
    parameters = standard_parameters(robot)
    regressor = Regressor.build(robot, parameters)
    q, dq, ddq = smooth_motion(RATE, 4.0, 2)
    theta = np.random.default_rng(7).uniform(0.5, 2.0, len(parameters))
    bare = arm().with_friction(FrictionLaw())
    rigid = Regressor.build(bare, standard_parameters(bare))
    own = np.array([p.friction is None for p in parameters])
    springs = np.array([p.carries_load and p.friction is not None for p in parameters])
    load = rigid.torque(q, dq, ddq, theta[own])
    inner = regressor.inner(q.T, dq.T, ddq.T, theta)
    phi = regressor.matrix(q, dq, ddq, inner=inner)
    expected = load.copy()
    load = load + phi[:, :, springs] @ theta[springs]
    for j, joint in enumerate(robot.joints):
        columns = friction_columns(joint.friction, dq[:, j], q[:, j], load[:, j])
        for k, term in enumerate(joint.friction.terms):
            c = column(regressor, f"{term.stem}{j + 1}")
            np.testing.assert_allclose(phi[:, j, c], columns[:, k], rtol=2e-13, atol=1e-14)
            assert not phi[:, 1 - j, c].any()
            expected[:, j] += theta[c] * columns[:, k]
    packed = regressor.packed(q.T, dq.T, ddq.T, inner=inner)
    np.testing.assert_array_equal(packed.T, phi[:, regressor.row, regressor.column])
    np.testing.assert_allclose(
        regressor.torque(q, dq, ddq, theta), expected, rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("name", ["lugre", "slip", "load and memory"])
def test_blocks_with_inner_signals_make_the_whole(name):
    robot = arm().with_friction(law(name))
    regressor = Regressor.build(robot, standard_parameters(robot))
    q, dq, ddq = (x.T for x in smooth_motion(RATE, 10.0, 2))
    inner = regressor.inner(q, dq, ddq, np.ones(len(regressor.parameters)))
    whole = regressor.packed(q, dq, ddq, inner=inner)
    for start in range(0, q.shape[1], 611):
        part = slice(start, start + 611)
        block = regressor.packed(q[:, part], dq[:, part], ddq[:, part], inner=inner[:, part])
        np.testing.assert_array_equal(block, whole[:, part])
    with pytest.raises(ValueError, match=r"inner has shape .*is needed"):
        regressor.packed(q[:, :10], dq[:, :10], ddq[:, :10], inner=inner)


def test_usual_laws_have_no_inner_signals():
    regressor = Regressor.build(arm(), standard_parameters(arm()))
    assert regressor.inner_entries.size == 0 and not regressor.depends_on_load
    q, dq, ddq = (x.T for x in smooth_motion(RATE, 1.0, 2))
    assert regressor.inner(q, dq, ddq).shape == (0, q.shape[1])


def test_a_column_without_its_argument_is_refused():
    dq = np.zeros(5)
    with pytest.raises(ValueError, match="COSINE needs the positions"):
        friction_columns(FrictionLaw(ripple(3.0)), dq)
    with pytest.raises(ValueError, match="along one path"):
        friction_columns(FrictionLaw((dahl(1e-3),)), np.zeros((5, 2)), np.zeros((5, 2)))
    with pytest.raises(ValueError, match="torque that the joint carries"):
        friction_columns(FrictionLaw((load_dependent(),)), dq)


def test_units_follow_from_the_function():
    terms = (
        viscous(), power_viscous(0.5), coulomb(), stribeck(0.1), load_dependent(), spring(),
        *ripple(4.0, "_t"), *counterbalance(0.5, 0.0),
    )  # fmt: skip
    robot = arm().with_friction(FrictionLaw(terms))
    units = {p.stem: p.unit for p in standard_parameters(robot) if p.joint == 0}
    assert (units["fv"], units["fvx"]) == ("N m s/rad", "N m (s/rad)^0.5")
    assert (units["fc"], units["fs"], units["fl"], units["ks"]) == (
        "N m",
        "N m",
        "N m/N m",
        "N m/rad",
    )
    assert {units[s] for s in ("rc_t", "rs_t", "cbf", "cbk")} == {"N m"}
    slide = load_robot("emps").with_friction(FrictionLaw((*lugre(1e-5, 0.3, 0.01), spring())))
    units = {p.stem: p.unit for p in standard_parameters(slide)}
    assert (units["fc"], units["fd"], units["ks"]) == ("N", "N s/m", "N/m")


def test_only_friction_that_takes_energy_must_not_be_negative():
    terms = (
        power_viscous(2.0), stribeck(0.1), load_dependent(), *lugre(1e-3, 0.2, 0.1), spring(),
        *ripple(4.0, "_t"), *maxwell_slip([1e-4]), viscous(), offset(),
    )  # fmt: skip
    robot = arm().with_friction(FrictionLaw(terms))
    positive = {p.stem for p in standard_parameters(robot) if p.is_dissipative and p.joint == 0}
    assert positive == {"ia", "fl", "fc", "fd", "fma", "fv"}


def test_base_parameters_do_not_depend_on_the_constants_of_a_law():
    def names(speed, distance):
        terms = (viscous(), *lugre(distance, 0.1, speed), stribeck(speed), *maxwell_slip(
            [distance, 2 * distance]), load_dependent(), power_viscous(distance + 0.5))  # fmt: skip
        return base_parameters(arm("staubli_tx40").with_friction(FrictionLaw(terms))).names

    assert names(0.002, 1e-6) == names(3.0, 2.0)
    assert {"fs3", "fl3", "fc3", "fd3", "fma3", "fmb3", "fvx3"} <= set(names(0.002, 1e-6))


def test_ripple_of_one_period_cannot_be_told_from_the_weight_of_a_pendulum():
    one = load_robot("planar_2r")
    pendulum = replace(
        one, joints=one.joints[:1], links=one.links[:1], rotor_inertia=one.rotor_inertia[:1],
        transmission=Transmission(np.eye(1), np.ones(1), np.zeros(1)),
    ).with_gravity(np.array([0.0, -9.81, 0.0]))  # fmt: skip
    terms = (viscous(), *ripple(1.0, "_p"), *ripple(2.0, "_d"))
    base = base_parameters(pendulum.with_friction(FrictionLaw(terms)))
    heads = {p.name for p in base.parameters}
    assert {"mx1", "my1", "rc_d1", "rs_d1"} <= heads and not {"rc_p1", "rs_p1"} & heads
    groups = " ".join(base.expressions)
    assert "mx1 + 0.101937 rc_p1" in groups and "my1 - 0.101937 rs_p1" in groups
    flat = base_parameters(pendulum.with_gravity(np.zeros(3)).with_friction(FrictionLaw(terms)))
    assert {"rc_p1", "rs_p1"} <= {p.name for p in flat.parameters}


def test_parameters_on_a_tree_carry_the_joint_name():
    one = load_robot("planar_2r")
    side = replace(one.joints[1], name="wing", parent=-1)
    tree = replace(one, joints=(one.joints[0], side)).with_friction(FrictionLaw(ripple(4.0)))
    assert "rc_4_[wing]" in [p.name for p in standard_parameters(tree)]


def test_a_coupled_motor_without_sign_function_takes_the_default_one(tx40):
    robot = tx40.with_friction(FrictionLaw((viscous(), dahl(1e-3))))
    motor = robot.couplings[0].motor
    assert coupling_sign(robot, motor) == (
        int(SignFunction.ATAN),
        pytest.approx(robot.joints[motor].default_gamma),
    )


def test_every_function_has_a_formula():
    shown = [str(term) for terms in LAWS.values() for term in terms]
    codes = {t.column for terms in LAWS.values() for t in terms}
    codes |= {t.column for t in counterbalance(0.4, 0.0)}
    own = {column for column in declared_columns().values() if isinstance(column, OwnColumn)}
    assert codes == set(declared_columns().values()) - own and all(shown)


def test_levels_stand_for_memory_and_load_in_steady_motion():
    robot = arm().with_friction(law("load and memory"))
    regressor = Regressor.build(robot, standard_parameters(robot))
    dq = np.array([[0.3, -2.0, 0.0], [-1.0, 1.0, 5.0]])
    names = [regressor.parameters[regressor.column[e]].name for e in regressor.inner_entries]
    levels = dict(zip(names, regressor.levels(dq), strict=True))
    assert names == ["fc1", "fl1", "fc2", "fl2"]
    np.testing.assert_array_equal(levels["fc1"], [1.0, -1.0, 0.0])
    np.testing.assert_array_equal(levels["fl2"], [-1.0, 1.0, 1.0])
