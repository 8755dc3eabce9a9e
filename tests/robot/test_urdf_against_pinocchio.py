"""The URDF reader against Pinocchio: frames, inertias and gravity of random and real robots."""

import gzip

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.robot.frames import rotation_from_z_to
from pivident.robot.inertia import moved
from pivident.robot.urdf import parse_urdf, read_urdf
from pivident.robot.urdf_xml import parse_model
from tests.robot.kinematics import gravity_torque, link_poses

pin = pytest.importorskip("pinocchio")

KINDS = ("revolute", "prismatic", "continuous", "fixed")
AXES = ("1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 -1 0", None)


def triple(rng, scale=1.0):
    return " ".join(repr(float(x)) for x in rng.uniform(-scale, scale, 3))


def random_urdf(rng, size):
    """A random tree with all joint types, arbitrary axes and bodies of positive inertia."""
    parts = ['<robot name="random"><link name="l0"/>']
    for i in range(1, size + 1):
        half = rng.normal(size=(3, 3))
        j = half @ half.T + np.eye(3)
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="{triple(rng)}" rpy="{triple(rng, 3)}"/>'
            f'<mass value="{rng.uniform(0.1, 5)}"/><inertia ixx="{j[0, 0]}" ixy="{j[0, 1]}" '
            f'ixz="{j[0, 2]}" iyy="{j[1, 1]}" iyz="{j[1, 2]}" izz="{j[2, 2]}"/></inertial></link>'
        )
        kind = KINDS[0] if i == 1 else str(rng.choice(KINDS))
        axis = AXES[rng.integers(len(AXES))] or triple(rng)
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{rng.integers(0, i)}"/>'
            f'<child link="l{i}"/><origin xyz="{triple(rng)}" rpy="{triple(rng, 3)}"/>'
            f'<axis xyz="{axis}"/><limit lower="-9" upper="9" velocity="1" effort="1"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def pinocchio_configuration(model, positions):
    """Pinocchio's q of joint positions by name (continuous joints hold cosine and sine)."""
    q = pin.neutral(model)
    for name, position in positions.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
        else:
            q[joint.idx_q] = position
    return q


def ten_parameters(inertia):
    """Pinocchio's dynamic parameters m, mc, Ixx Ixy Iyy Ixz Iyz Izz in our order."""
    m, mx, my, mz, xx, xy, yy, xz, yz, zz = inertia.toDynamicParameters()
    return np.array([xx, xy, xz, yy, yz, zz, mx, my, mz, m])


def assert_same_robot(text, robot, model, rng, atol):
    """Frames, merged inertias and gravity torques agree at a random configuration."""
    axes = {joint.name: joint.axis for joint in parse_model(text).joints}
    positions = {name: rng.uniform(-2, 2) for name in robot.joint_names}
    data = model.createData()
    q = pinocchio_configuration(model, positions)
    pin.forwardKinematics(model, data, q)
    gravity = pin.computeGeneralizedGravity(model, data, q)
    ours = gravity_torque(robot, list(positions.values()))
    poses = link_poses(robot, list(positions.values()))
    for i, name in enumerate(robot.joint_names):
        index = model.getJointId(name)
        turn = rotation_from_z_to(axes[name])
        theirs = data.oMi[index]
        np.testing.assert_allclose(poses[i][:3, 3], theirs.translation, atol=atol)
        np.testing.assert_allclose(poses[i][:3, :3], theirs.rotation @ turn, atol=atol)
        np.testing.assert_allclose(
            moved(robot.links[i].inertia, turn, np.zeros(3)),
            ten_parameters(model.inertias[index]),
            atol=atol,
        )
        assert ours[i] == pytest.approx(gravity[model.joints[index].idx_v], abs=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_have_the_same_frames_and_inertias(seed):
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, int(rng.integers(1, 10)))
    assert_same_robot(text, parse_urdf(text), pin.buildModelFromXML(text), rng, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_with_frozen_joints_are_the_same_as_reduced_models(seed):
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, 8)
    names = parse_urdf(text).joint_names
    kept = [name for name in names if rng.random() < 0.6] or [names[0]]
    frozen = {name: float(rng.uniform(-2, 2)) for name in names if name not in kept}
    whole = pin.buildModelFromXML(text)
    locked = [whole.getJointId(name) for name in frozen]
    model = pin.buildReducedModel(whole, locked, pinocchio_configuration(whole, frozen))
    robot = parse_urdf(text, joints=kept, frozen=frozen)
    assert robot.joint_names == tuple(kept)
    assert_same_robot(text, robot, model, rng, atol=1e-8)


@pytest.mark.record
def test_the_tx40_urdf_is_the_robot_pinocchio_reads(data_dir):
    path = data_dir / "staubli_tx40" / "tx40_mdh_modified.urdf"
    model = pin.buildModelFromUrdf(str(path))
    assert_same_robot(
        path.read_bytes(), read_urdf(path), model, np.random.default_rng(1), atol=1e-9
    )


@pytest.mark.record
def test_the_arm_of_tiago_is_the_model_pinocchio_reduces_to_it(data_dir):
    path = data_dir / "tiago" / "tiago_48_hey5.urdf.gz"
    kept = ["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8))]
    text = gzip.decompress(path.read_bytes()).decode()
    whole = pin.buildModelFromXML(text)
    locked = [i for i in range(1, whole.njoints) if whole.names[i] not in kept]
    model = pin.buildReducedModel(whole, locked, pin.neutral(whole))
    robot = read_urdf(path, joints=kept)
    assert robot.joint_names == tuple(kept)
    assert robot.is_chain
    assert robot.joints[0].kind == "prismatic"
    assert_same_robot(text, robot, model, np.random.default_rng(2), atol=1e-9)


@pytest.mark.record
def test_the_whole_of_tiago_is_read_as_a_tree(data_dir):
    path = data_dir / "tiago" / "tiago_48_hey5.urdf.gz"
    text = gzip.decompress(path.read_bytes()).decode()
    robot = read_urdf(path)
    assert not robot.is_chain
    assert_same_robot(text, robot, pin.buildModelFromXML(text), np.random.default_rng(3), 1e-9)
