"""MJCF files, compiled by MuJoCo: torques, coupled shafts, springs, names, refusals."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.foundation.errors import ExportError
from pivident.models.export.joint_side import joint_side
from pivident.models.export.load_back import verify_with_mujoco
from pivident.models.export.mjcf import SUPPORTED, to_mjcf
from pivident.models.export.mjcf_bodies import quaternion
from pivident.models.runnable_model import runnable_model
from pivident.robot.description import Coupling
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    load_dependent,
    lugre,
    maxwell_slip,
    power_viscous,
    spring,
    viscous,
)
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf
from tests.models.export.robots import random_tree, with_values

TX40 = load_robot("staubli_tx40")


def value_of(model):
    return {p.name: float(v) for p, v in zip(model.parameters, model.values, strict=True)}


def with_named(model, **values):
    changed = [values.get(p.name, v) for p, v in zip(model.parameters, model.values, strict=True)]
    return replace(model, values=np.array(changed))


@pytest.mark.parametrize("name", ["staubli_tx40", "mitsubishi_rv2sq", "planar_2r", "emps"])
def test_mujoco_has_the_models_torques(name):
    model = with_values(load_robot(name))
    verified = verify_with_mujoco(to_mjcf(model), model)
    assert verified.agrees, verified


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_with_random_couplings_have_the_models_torques(seed):
    rng = np.random.default_rng(seed)
    robot = parse_urdf(random_tree(rng, int(rng.integers(3, 8))))
    if robot.size > 1:
        m, j = rng.choice(robot.size, 2, replace=False)
        coupling = Coupling(int(m), int(j), float(rng.uniform(-2, 2)))
        robot = replace(robot, couplings=(coupling,))
    model = with_values(robot, seed % 1000)
    verified = verify_with_mujoco(to_mjcf(model), model)
    assert verified.agrees, verified


def test_a_file_needs_no_compiler_fixes_and_says_what_the_model_says():
    model = with_values(TX40)
    file = to_mjcf(model)
    assert "balance" not in file.text and "bound" not in file.text
    loaded = mujoco.MjModel.from_xml_string(file.text)
    value, side = value_of(model), joint_side(model, SUPPORTED)
    np.testing.assert_array_equal(loaded.jnt_range, [j.position_limits for j in TX40.joints])
    limits = [j.torque_limit for j in TX40.joints]
    np.testing.assert_array_equal(loaded.actuator_ctrlrange[:, 1], limits)
    np.testing.assert_array_equal(loaded.dof_frictionloss, [value[f"fc{i}"] for i in range(1, 7)])
    np.testing.assert_array_equal(loaded.opt.gravity, TX40.gravity)
    assert loaded.dof_armature[0] == value["ia1"]
    assert side.left_out == {}
    assert (loaded.geom_contype == 0).all() and loaded.ngeom > 6
    np.testing.assert_allclose(
        loaded.body_mass[2:], [value[f"m{i}"] for i in range(1, 7)], rtol=1e-15
    )


def test_what_turns_on_a_shaft_is_taken_out_of_its_joints():
    model = with_named(with_values(TX40), ia5=0.05, ia6=0.03, iam6=0.02, fv5=1.0, fv6=0.7, fvm6=0.5)
    loaded = mujoco.MjModel.from_xml_string(to_mjcf(model).text)
    assert loaded.ntendon == 1
    assert loaded.tendon_armature[0] == 0.02 and loaded.tendon_damping[0] == 0.5
    np.testing.assert_allclose(loaded.dof_armature[4:], [0.03, 0.01], rtol=1e-14)
    np.testing.assert_allclose(loaded.dof_damping[4:], [0.5, 0.2], rtol=1e-14)


def test_a_shaft_that_leaves_a_joint_nothing_gets_another_ratio():
    # fvm6 above fv6, as for the nominal robot: no shaft of ratio one fits, the torques do
    model = with_named(with_values(TX40), fv5=1.6, fv6=0.6894, fvm6=0.8)
    file = to_mjcf(model)
    loaded = mujoco.MjModel.from_xml_string(file.text)
    assert (loaded.dof_damping >= 0.0).all()
    assert file.left_out == {}
    assert verify_with_mujoco(file, model).agrees


def test_a_coupling_that_would_feed_energy_in_is_left_out_and_named():
    model = with_named(with_values(TX40), fv5=0.1, fv6=0.1, fvm6=0.8)
    file = to_mjcf(model)
    assert file.left_out == {"fvm6": 0.8}
    assert any("fvm6 0.8" in sentence for sentence in file.differences)
    assert verify_with_mujoco(file, model).agrees


def test_a_rotor_that_couples_two_branches_is_left_out_and_named():
    robot = load_robot("planar_2r")
    joints = (robot.joints[0], replace(robot.joints[1], parent=-1))
    model = with_values(replace(robot, joints=joints, couplings=(Coupling(1, 0, 0.5),)))
    model = with_named(model, **{"ia[shoulder]": 2.0, "ia[elbow]": 2.0, "iam[elbow]": 0.3})
    file = to_mjcf(model)
    assert file.left_out["iam[elbow]"] == 0.3
    assert verify_with_mujoco(file, model).agrees


def test_springs_offsets_and_both_directions_are_in_the_file():
    law = FrictionLaw((*asymmetric_viscous(), *asymmetric_coulomb(), spring()))
    model = with_values(TX40.with_friction(law))
    file, value = to_mjcf(model), value_of(model)
    loaded = mujoco.MjModel.from_xml_string(file.text)
    np.testing.assert_array_equal(loaded.jnt_stiffness, [value[f"ks{i}"] for i in range(1, 7)])
    half = [(value[f"fcp{i}"] - value[f"fcn{i}"]) / 2 for i in range(1, 7)]
    np.testing.assert_allclose(loaded.actuator_biasprm[:, 0], np.negative(half), rtol=1e-14)
    assert {name[:3] for name in file.left_out} == {"fvp", "fvn"}
    assert verify_with_mujoco(file, model).agrees


def test_friction_of_other_forms_completes_the_torque():
    law = FrictionLaw((*asymmetric_coulomb(), power_viscous(1.5), load_dependent()))
    model = with_named(with_values(TX40.with_friction(law)), fvm6=0.0)
    file = to_mjcf(model)
    assert set(file.left_out) == {f"{s}{i}" for s in ("fvx", "fl") for i in range(1, 7)}
    assert verify_with_mujoco(file, model).agrees


@pytest.mark.parametrize("terms", [lugre(0.01, 0.3, 0.1), maxwell_slip((0.01, 0.03))])
def test_friction_with_a_state_becomes_dry_friction_of_its_level(terms):
    model = with_values(TX40.with_friction(FrictionLaw((viscous(), *terms))))
    model = with_named(model, iam6=0.0, fvm6=0.0)
    file, value = to_mjcf(model), value_of(model)
    loaded = mujoco.MjModel.from_xml_string(file.text)
    stems = [term.stem for term in terms if term.stem != "fd"]
    levels = [sum(value[f"{stem}{i}"] for stem in stems) for i in range(1, 7)]
    np.testing.assert_allclose(loaded.dof_frictionloss, levels, rtol=1e-15)
    assert any("no elastic displacement" in sentence for sentence in file.differences)
    stems = {name[:2] for name in file.left_out if not name.endswith("6")}
    assert stems == ({"fd"} if len(terms) == 2 and terms[1].stem == "fd" else set())
    assert verify_with_mujoco(file, model).agrees


def test_negative_friction_of_a_free_estimate_is_left_out_and_named():
    model = with_named(with_values(TX40), fc3=-0.2, fv2=-0.1)
    file = to_mjcf(model)
    assert {"fc3": -0.2, "fv2": -0.1}.items() <= file.left_out.items()
    assert any("negative" in s and "fc3" in s for s in file.differences)
    assert verify_with_mujoco(file, model).agrees


def test_a_motor_holds_the_arm_with_the_models_torque():
    model = with_values(TX40)
    loaded = mujoco.MjModel.from_xml_string(to_mjcf(model).text)
    loaded.dof_frictionloss[:] = 0.0
    loaded.tendon_frictionloss[:] = 0.0
    loaded.actuator_ctrllimited[:] = 0
    data = mujoco.MjData(loaded)
    q = np.array([[0.3, -0.4, 0.5, 0.2, 0.7, -0.1]])
    data.qpos[:] = q[0]
    data.ctrl[:] = model.torque(q, np.zeros((1, 6)), np.zeros((1, 6)))[0]
    mujoco.mj_forward(loaded, data)
    np.testing.assert_allclose(data.qacc, 0.0, atol=1e-9)


def test_links_that_no_body_can_be_are_refused():
    model = with_values(TX40)
    with pytest.raises(ExportError, match=r"link 'link_3', and MuJoCo refuses it; export the phys"):
        to_mjcf(with_named(model, xx3=-0.01))
    with pytest.raises(ExportError, match="no body"):
        to_mjcf(runnable_model(load_robot("emps")))


def test_names_are_escaped_and_repeated_ones_made_distinct():
    model = with_values(load_robot("planar_2r"))
    links = tuple(replace(link, name='a<b>&"c"') for link in model.robot.links)
    joints = (replace(model.robot.joints[0], name="größe & 'co'"), model.robot.joints[1])
    model = replace(model, robot=replace(model.robot, links=links, joints=joints))
    loaded = mujoco.MjModel.from_xml_string(to_mjcf(model).text)
    assert loaded.joint(0).name == "größe & 'co'"
    assert len({loaded.body(i).name for i in range(loaded.nbody)}) == 4
    named = replace(model.robot, links=(links[0], replace(links[1], name="base")))
    loaded = mujoco.MjModel.from_xml_string(to_mjcf(replace(model, robot=named)).text)
    assert loaded.body("base").id == 3 and loaded.body("base_").id == 1
    named = replace(model.robot, links=(replace(links[0], name="world"), links[1]))
    loaded = mujoco.MjModel.from_xml_string(to_mjcf(replace(model, robot=named)).text)
    assert loaded.body("world_").id == 2


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.floats(-3.2, 3.2)] * 3))
def test_quaternions_give_the_rotation_back(angles):
    rotation = rotation_from_rpy(*angles)
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quaternion(rotation))
    np.testing.assert_allclose(out.reshape(3, 3), rotation, atol=2e-15)
