"""Packed and dense observation matrix: sizes, blocks, friction, couplings, gravity."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import BLOCK, Regressor
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    coulomb,
    offset,
    stribeck,
    viscous,
)
from pivident.robot.friction_column import SignFunction
from pivident.robot.gallery import load_robot
from tests.friction_columns import friction_columns
from tests.robot.kinematics import gravity_torque

ESSENTIAL = (
    "zz1 fv1 fc1 xx2 xz2 zz2 mx2 fv2 fc2 xx3 zz3 my3 ia3 fv3 fc3 mx4 ia4 fv4 fc4 my5 ia5 fv5 fc5 "
    "ia6 fv6 fc6 fvm6 fcm6"
).split()


def motion(samples, joints, seed=0):
    """Random ``q dq ddq``, each (samples, joints)."""
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (3, samples, joints))


def essential_regressor(robot):
    base = base_parameters(robot)
    wanted = [base.index(name) for name in ESSENTIAL]
    wanted += [base.index(f"off{j}") for j in range(1, 7)]
    return Regressor.build(robot, [base.parameters[k] for k in sorted(wanted)])


def column(regressor, name):
    return [p.name for p in regressor.parameters].index(name)


def test_fifty_entries_remain_of_the_essential_set(tx40):
    regressor = essential_regressor(tx40)
    assert len(regressor.parameters) == 34
    assert regressor.entries == 50
    assert tuple(np.diff(regressor.offsets)) == (10, 12, 9, 6, 7, 6)
    names = [regressor.parameters[c].name for c in regressor.columns_of(5)]
    assert names == ["ia6", "fv6", "fc6", "off6", "fvm6", "fcm6"]


def test_packed_entries_are_the_non_zero_ones_of_the_dense_matrix(tx40):
    regressor = Regressor.build(tx40, standard_parameters(tx40))
    q, dq, ddq = motion(200, 6)
    dense = regressor.matrix(q, dq, ddq)
    packed = regressor.packed(q.T, dq.T, ddq.T)
    np.testing.assert_array_equal(dense[:, regressor.row, regressor.column], packed.T)
    dense[:, regressor.row, regressor.column] = 0.0
    assert not dense.any()


def test_entries_are_sorted_by_joint_and_grouped(tx40):
    regressor = Regressor.build(tx40, standard_parameters(tx40))
    assert (np.diff(regressor.row) >= 0).all()
    for j in range(6):
        assert (regressor.row[regressor.offsets[j] : regressor.offsets[j + 1]] == j).all()
        assert (np.diff(regressor.columns_of(j)) > 0).all()


@pytest.mark.parametrize("samples", [1, 2, 63, 64, 65, 127, 129, BLOCK - 1, BLOCK + 1, 3 * BLOCK])
def test_every_number_of_samples_gives_the_same_rows(tx40, samples):
    regressor = essential_regressor(tx40)
    q, dq, ddq = motion(3 * BLOCK, 6)
    whole = regressor.packed(q.T, dq.T, ddq.T)
    part = regressor.packed(q[:samples].T, dq[:samples].T, ddq[:samples].T)
    np.testing.assert_array_equal(part, whole[:, :samples])
    dense = regressor.matrix(q[:samples], dq[:samples], ddq[:samples])
    np.testing.assert_array_equal(dense[:, regressor.row, regressor.column], part.T)
    theta = np.random.default_rng(1).normal(size=34)
    tau = regressor.torque(q[:samples], dq[:samples], ddq[:samples], theta)
    np.testing.assert_allclose(tau, dense @ theta, rtol=1e-13, atol=1e-12)


def test_a_single_joint_and_no_samples_at_all():
    robot = load_robot("emps")
    regressor = Regressor.build(robot, base_parameters(robot).parameters)
    empty = np.zeros((0, 1))
    assert regressor.matrix(empty, empty, empty).shape == (0, 1, 4)
    assert regressor.packed(empty.T, empty.T, empty.T).shape == (4, 0)
    assert regressor.torque(empty, empty, empty, np.ones(4)).shape == (0, 1)


def test_a_buffer_is_written_into_and_its_zeros_are_left_alone(tx40):
    regressor = essential_regressor(tx40)
    first, second = motion(300, 6, 1), motion(300, 6, 2)
    buffer = regressor.matrix(*first)
    assert regressor.matrix(*second, out=buffer) is buffer
    np.testing.assert_array_equal(buffer, regressor.matrix(*second))
    packed = np.empty((regressor.entries, 300))
    assert regressor.packed(*second.transpose(0, 2, 1), out=packed) is packed
    np.testing.assert_array_equal(buffer[:, regressor.row, regressor.column], packed.T)


def test_entries_are_written_to_the_rows_asked_for(tx40):
    regressor = essential_regressor(tx40)
    signals = motion(100, 6).transpose(0, 2, 1)
    place = np.random.default_rng(0).permutation(2 * regressor.entries)[: regressor.entries]
    out = np.full((2 * regressor.entries, 100), np.nan)
    assert regressor.packed(*signals, out=out, place=place) is out
    np.testing.assert_array_equal(out[place], regressor.packed(*signals))
    assert np.isnan(np.delete(out, place, axis=0)).all()


def test_a_buffer_that_does_not_fit_is_refused(tx40):
    regressor = essential_regressor(tx40)
    with pytest.raises(ValueError, match=r"\(10, 6, 34\) in C order"):
        regressor.matrix(*motion(10, 6), out=np.zeros((10, 34, 6)).transpose(0, 2, 1))
    with pytest.raises(ValueError, match=r"\(50, 10\) or more rows"):
        regressor.packed(*motion(6, 10), out=np.zeros((50, 9)))


def test_signals_of_another_length_or_robot_are_refused(tx40):
    regressor = essential_regressor(tx40)
    q, dq, ddq = motion(10, 6)
    for wrong in ((q, dq[:9], ddq), (q[:, :5], dq[:, :5], ddq[:, :5])):
        with pytest.raises(ValueError, match="all must be"):
            regressor.matrix(*wrong)
        with pytest.raises(ValueError, match="all must be"):
            regressor.torque(*wrong, np.zeros(34))
        with pytest.raises(ValueError, match="all must be"):
            regressor.packed(*(x.T for x in wrong))


def test_a_sample_that_is_not_a_number_spoils_only_itself(tx40):
    regressor = essential_regressor(tx40)
    q, dq, ddq = motion(200, 6)
    clean = regressor.matrix(q, dq, ddq)
    for k, value in ((17, np.nan), (99, np.inf)):
        q[k, 1] = value
    spoilt = regressor.matrix(q, dq, ddq)
    others = np.delete(np.arange(200), (17, 99))
    np.testing.assert_array_equal(spoilt[others], clean[others])
    assert np.isnan(spoilt[17]).any() and np.isnan(spoilt[99]).any()


def test_turns_of_a_joint_do_not_matter(tx40):
    regressor = essential_regressor(tx40)
    q, dq, ddq = motion(100, 6)
    turned = q + 2.0 * np.pi * np.array([1, -3, 40, 1000, -1000, 0])
    np.testing.assert_allclose(
        regressor.matrix(turned, dq, ddq), regressor.matrix(q, dq, ddq), rtol=0, atol=1e-10
    )


def test_rotor_inertia_and_friction_columns_are_functions_of_their_own_joint(tx40):
    regressor = Regressor.build(tx40, standard_parameters(tx40))
    q, dq, ddq = motion(100, 6)
    phi = regressor.matrix(q, dq, ddq)
    for j in range(6):
        own = {
            stem: phi[:, :, column(regressor, f"{stem}{j + 1}")]
            for stem in ("ia", "fv", "fc", "off")
        }
        np.testing.assert_array_equal(own["ia"][:, j], ddq[:, j])
        np.testing.assert_array_equal(own["fv"][:, j], dq[:, j])
        smooth = 2.0 / np.pi * np.arctan(150.0 * dq[:, j])
        np.testing.assert_allclose(own["fc"][:, j], smooth, rtol=4e-16)
        np.testing.assert_array_equal(own["off"][:, j], 1.0)
        for stem in own:
            assert not np.delete(own[stem], j, axis=1).any()


@pytest.mark.parametrize("smoothing", ["sign", "atan", "tanh"])
def test_columns_of_every_friction_law_are_those_of_the_law(tx40, smoothing):
    gamma = 40.0
    laws = (
        FrictionLaw(
            (viscous(), coulomb(smoothing, gamma), offset(), stribeck(0.1, 1.5, smoothing, gamma))
        ),
        FrictionLaw((viscous(), *asymmetric_coulomb(smoothing, gamma))),
    )
    q, dq, ddq = motion(257, 6)
    dq[3] = 0.0
    for law in laws:
        robot = replace(tx40, couplings=()).with_friction(law)
        regressor = Regressor.build(robot, standard_parameters(robot))
        phi = regressor.matrix(q, dq, ddq)
        expected = friction_columns(law, dq)
        for k, term in enumerate(law.terms):
            for j in range(6):
                np.testing.assert_allclose(
                    phi[:, j, column(regressor, f"{term.stem}{j + 1}")],
                    expected[:, j, k],
                    rtol=1e-14,
                    atol=1e-16,
                )


@pytest.mark.parametrize("ratio", [1.0, -0.7])
def test_columns_of_a_coupling(tx40, ratio):
    robot = replace(tx40, couplings=tuple(replace(c, ratio=ratio) for c in tx40.couplings))
    regressor = Regressor.build(robot, standard_parameters(robot))
    q, dq, ddq = motion(100, 6)
    phi = regressor.matrix(q, dq, ddq)
    motor, joint = 5, 4
    sign = 2.0 / np.pi * np.arctan(150.0 * (dq[:, motor] + ratio * dq[:, joint]))
    expected = {
        "iam6": (ratio * ddq[:, motor], ratio * ddq[:, joint]),
        "fvm6": (ratio * dq[:, motor], ratio * dq[:, joint]),
        "fcm6": (ratio * sign, sign),
    }
    for name, (on_joint, on_motor) in expected.items():
        columns = phi[:, :, column(regressor, name)]
        np.testing.assert_allclose(columns[:, joint], on_joint, rtol=1e-15, atol=1e-15)
        np.testing.assert_allclose(columns[:, motor], on_motor, rtol=1e-15, atol=1e-15)
        assert not columns[:, :4].any()


def test_a_coupling_has_the_sign_function_of_its_motor(tx40):
    robot = tx40.with_friction(FrictionLaw((viscous(), coulomb("sign"))))
    assert coupling_sign(robot, 5)[0] == SignFunction.SIGN
    assert coupling_sign(robot, 5, simulated=True)[0] == SignFunction.ATAN
    regressor = Regressor.build(robot, standard_parameters(robot))
    q, dq, ddq = motion(50, 6)
    columns = regressor.matrix(q, dq, ddq)[:, :, column(regressor, "fcm6")]
    np.testing.assert_array_equal(columns[:, 5], np.sign(dq[:, 5] + dq[:, 4]))

    bare = tx40.with_friction(FrictionLaw((viscous(),)))
    assert coupling_sign(bare, 5) == (SignFunction.ATAN, bare.joints[5].default_gamma)


def test_torque_at_rest_is_the_slope_of_the_potential_energy(tx40):
    regressor = Regressor.build(tx40, standard_parameters(tx40))
    theta = np.array(
        [tx40.links[p.joint].inertia["xx xy xz yy yz zz mx my mz m".split().index(p.stem)]
         if p.is_inertial else 0.0 for p in regressor.parameters]
    )  # fmt: skip
    q, still, _ = motion(4, 6)
    still[:] = 0.0
    tau = regressor.torque(q, still, still, theta)
    for k in range(4):
        np.testing.assert_allclose(tau[k], gravity_torque(tx40, q[k]), atol=1e-7)


def test_without_gravity_a_robot_at_rest_feels_nothing(tx40):
    robot = tx40.with_gravity([0.0, 0.0, 0.0])
    regressor = Regressor.build(robot, standard_parameters(robot))
    q, still, _ = motion(10, 6)
    still[:] = 0.0
    phi = regressor.matrix(q, still, still)
    inertial = [k for k, p in enumerate(regressor.parameters) if p.is_inertial]
    assert not phi[:, :, inertial].any()


def test_gravity_enters_linearly(tx40):
    q, dq, ddq = motion(10, 6)
    phi = [
        Regressor.build(robot, standard_parameters(robot)).matrix(q, dq, ddq)
        for robot in (tx40.with_gravity([0, 0, g]) for g in (-9.81, 0.0, 9.81))
    ]
    np.testing.assert_allclose(phi[0] + phi[2], 2.0 * phi[1], atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_choice_of_columns_gives_the_columns_of_the_whole(seed):
    rng = np.random.default_rng(seed)
    robot = load_robot("staubli_tx40")
    parameters = standard_parameters(robot)
    chosen = np.sort(rng.choice(len(parameters), rng.integers(1, 30), replace=False))
    q, dq, ddq = motion(70, 6, seed)
    whole = Regressor.build(robot, parameters).matrix(q, dq, ddq)
    part = Regressor.build(robot, [parameters[k] for k in chosen]).matrix(q, dq, ddq)
    np.testing.assert_array_equal(part, whole[:, :, chosen])


def test_no_parameters_at_all_give_no_torque(tx40):
    """The first moments that an axis about the vertical has among its base parameters."""
    regressor = Regressor.build(tx40, ())
    q = np.ones((5, tx40.size))
    assert regressor.entries == 0
    assert not regressor.torque(q, q, q, np.zeros(0)).any()
