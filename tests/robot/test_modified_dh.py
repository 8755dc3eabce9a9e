import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.robot.inertia import from_center_of_mass, moved, tensor
from pivident.robot.modified_dh import parse_modified_dh, read_modified_dh
from tests.robot.kinematics import link_poses, shift, turn

PENDULUM = """
name = "pendulum"
[[joints]]
name = "shoulder"
"""

ANGLES_AND_LENGTHS = ("gamma", "b", "alpha", "d", "theta", "r")


def random_rows(rng, size):
    """Rows of a random tree: geometry, kind and parent (an earlier row or the base)."""
    rows = []
    for i in range(size):
        row = {key: float(rng.uniform(-2, 2)) for key in ANGLES_AND_LENGTHS}
        row["kind"] = str(rng.choice(["revolute", "prismatic", "fixed"]))
        row["parent"] = int(rng.integers(-1, i))
        rows.append(row)
    rows[0]["kind"] = "revolute"
    return rows


def as_toml(rows):
    lines = ['name = "random tree"']
    for i, row in enumerate(rows):
        parent = "base" if row["parent"] < 0 else f"j{row['parent']}"
        lines += ["[[joints]]", f'name = "j{i}"', f'kind = "{row["kind"]}"', f'parent = "{parent}"']
        lines += [f"{key} = {row[key]!r}" for key in ANGLES_AND_LENGTHS]
        lines.append(f"link = {{mass = {i + 1}, first_moments = [0.1, {i}, -0.3]}}")
    return "\n".join(lines)


def table_poses(rows, positions):
    """Frames of all rows, the product Rz Tz Rx Tx Rz Tz written out."""
    poses = []
    for row, q in zip(rows, positions, strict=True):
        parent = poses[row["parent"]] if row["parent"] >= 0 else np.eye(4)
        theta = row["theta"] + (q if row["kind"] == "revolute" else 0.0)
        r = row["r"] + (q if row["kind"] == "prismatic" else 0.0)
        frame = turn("z", row["gamma"]) @ shift("z", row["b"]) @ turn("x", row["alpha"])
        poses.append(parent @ frame @ shift("x", row["d"]) @ turn("z", theta) @ shift("z", r))
    return np.array(poses)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_frames_of_a_random_tree_follow_the_table(seed):
    rng = np.random.default_rng(seed)
    rows = random_rows(rng, int(rng.integers(1, 8)))
    robot = parse_modified_dh(as_toml(rows))
    positions = rng.uniform(-2, 2, len(rows))
    moving = [i for i, row in enumerate(rows) if row["kind"] != "fixed"]
    np.testing.assert_allclose(
        link_poses(robot, positions[moving]), table_poses(rows, positions)[moving], atol=1e-9
    )


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_bodies_behind_fixed_joints_move_with_their_carrier(seed):
    rng = np.random.default_rng(seed)
    rows = random_rows(rng, 6)
    robot = parse_modified_dh(as_toml(rows))
    poses = table_poses(rows, np.zeros(len(rows)))
    carriers = []
    for i, row in enumerate(rows):
        behind = carriers[row["parent"]] if row["parent"] >= 0 else -1
        carriers.append(i if row["kind"] != "fixed" else behind)
    moving = [i for i, row in enumerate(rows) if row["kind"] != "fixed"]
    for link, carrier in zip(robot.links, moving, strict=True):
        expected = np.zeros(10)
        for i in np.flatnonzero(np.array(carriers) == carrier):
            relative = np.linalg.inv(poses[carrier]) @ poses[i]
            body = np.array([0, 0, 0, 0, 0, 0, 0.1, i, -0.3, i + 1.0])
            expected += moved(body, relative[:3, :3], relative[:3, 3])
        np.testing.assert_allclose(link.inertia, expected, atol=1e-9)


def test_the_smallest_file_has_the_defaults():
    robot = parse_modified_dh(PENDULUM)
    assert robot.joint_names == ("shoulder",)
    assert robot.joints[0].kind == "revolute"
    assert [term.stem for term in robot.joints[0].friction.terms] == ["fv", "fc", "off"]
    np.testing.assert_array_equal(robot.gravity, [0, 0, -9.81])
    np.testing.assert_array_equal(robot.links[0].inertia, np.zeros(10))
    np.testing.assert_array_equal(robot.transmission.reduction, np.eye(1))
    assert robot.friction_nominal == {}


def test_degrees_hold_for_every_angle_of_revolute_joints_and_for_no_length():
    robot = parse_modified_dh(
        """
        name = "mixed"
        units = "degrees"
        [transmission]
        position_offset = [90, 0.5]
        [[joints]]
        name = "turn"
        alpha = 90
        theta = -90
        position_limits = [-180, 90]
        rated_speed = 180
        [[joints]]
        name = "slide"
        kind = "prismatic"
        gamma = 90
        position_limits = [0, 2]
        rated_speed = 3
        """
    )
    turning, slide = robot.joints
    assert turning.position_limits == (-np.pi, np.pi / 2)
    assert turning.rated_speed == np.pi
    np.testing.assert_allclose(turning.rotation, [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], atol=1e-15)
    assert slide.position_limits == (0.0, 2.0)
    assert slide.rated_speed == 3.0
    np.testing.assert_allclose(slide.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(robot.transmission.position_offset, [np.pi / 2, 0.5])


@pytest.mark.parametrize(
    ("written", "gravity"),
    [
        ('"-z"', [0, 0, -9.81]),
        ('"+x"', [9.81, 0, 0]),
        ('"none"', [0, 0, 0]),
        ("[0, -9.8, 1]", [0, -9.8, 1]),
    ],
)
def test_gravity_is_a_direction_or_a_vector(written, gravity):
    robot = parse_modified_dh(f"gravity = {written}\n{PENDULUM}")
    np.testing.assert_array_equal(robot.gravity, gravity)


def test_a_body_at_its_centre_of_mass_is_moved_to_the_frames_origin():
    robot = parse_modified_dh(
        PENDULUM
        + """
        [joints.link]
        name = "bob"
        mass = 2
        center_of_mass = [0.3, 0.1, -0.2]
        inertia_at_center_of_mass = [0.1, 0.01, 0.02, 0.2, 0.03, 0.3]
        """
    )
    at_center = tensor([0.1, 0.01, 0.02, 0.2, 0.03, 0.3])
    assert robot.links[0].name == "bob"
    np.testing.assert_allclose(
        robot.links[0].inertia, from_center_of_mass(2.0, np.array([0.3, 0.1, -0.2]), at_center)
    )


def test_a_body_at_the_frames_origin_is_taken_as_it_is():
    robot = parse_modified_dh(
        PENDULUM
        + """
        [joints.link]
        mass = 2
        first_moments = [0.3, 0.1, -0.2]
        inertia_at_origin = [0.1, 0.01, 0.02, 0.2, 0.03, 0.3]
        """
    )
    np.testing.assert_array_equal(
        robot.links[0].inertia, [0.1, 0.01, 0.02, 0.2, 0.03, 0.3, 0.3, 0.1, -0.2, 2]
    )


def test_each_joint_may_have_a_friction_law_of_its_own():
    robot = parse_modified_dh(
        """
        name = "two laws"
        friction = [{term = "viscous"}, {term = "coulomb", smoothing = "tanh", gamma = 40}]
        [[joints]]
        name = "a"
        rated_speed = 7.5
        friction = [
            {term = "asymmetric"},
            {term = "viscous"},
            {term = "stribeck", speed = 0.1, exponent = 1},
        ]
        [[joints]]
        name = "b"
        """
    )
    first, second = (joint.friction.terms for joint in robot.joints)
    assert [term.stem for term in first] == ["fcp", "fcn", "fv", "fs"]
    assert [shape.value for shape in first[3].shapes] == [0.1, 1.0]
    assert {term.gamma for term in first} == {100.0}
    assert [(term.stem, term.smoothing) for term in second] == [("fv", "atan"), ("fc", "tanh")]
    assert second[1].gamma == 40


def test_an_empty_friction_law_is_no_friction():
    assert parse_modified_dh("friction = []\n" + PENDULUM).joints[0].friction.terms == ()


def test_nominal_friction_is_keyed_by_parameter_name():
    chain = parse_modified_dh(
        PENDULUM + 'nominal_friction = {fv = 2}\n[[joints]]\nname = "b"\nnominal_friction={off=1}'
    )
    tree = parse_modified_dh(
        PENDULUM + '[[joints]]\nname = "b"\nparent = "base"\nnominal_friction = {off = 1}'
    )
    assert chain.friction_nominal == {"fv1": 2.0, "off2": 1.0}
    assert tree.friction_nominal == {"off[b]": 1.0}


COUPLED = """
name = "wrist"
[transmission]
reduction = [10, -20]
[[joints]]
name = "a"
rotor_inertia = 0.2
[[joints]]
name = "b"
[[couplings]]
motor = 2
joint = "a"
"""


def test_a_coupling_fills_the_reduction_and_implies_its_ratio():
    robot = parse_modified_dh(COUPLED + "reduction = 5\nnominal = {fvm = 0.8}")
    np.testing.assert_array_equal(robot.transmission.reduction, [[10, 0], [5, -20]])
    (coupling,) = robot.couplings
    assert (coupling.motor, coupling.joint, coupling.ratio) == (1, 0, -0.25)
    assert (coupling.inertia, coupling.viscous, coupling.coulomb) == (True, True, True)
    assert robot.friction_nominal == {"fvm2": 0.8}
    np.testing.assert_array_equal(robot.rotor_inertia, [0.2, 0.0])


def test_a_coupling_may_state_its_ratio_and_its_parameters():
    robot = parse_modified_dh(COUPLED + 'ratio = 3\nparameters = ["fcm"]')
    (coupling,) = robot.couplings
    assert coupling.ratio == 3
    assert (coupling.inertia, coupling.viscous, coupling.coulomb) == (False, False, True)
    np.testing.assert_array_equal(robot.transmission.reduction, np.diag([10.0, -20.0]))


def test_the_whole_reduction_matrix_may_be_written():
    robot = parse_modified_dh(
        COUPLED.replace("reduction = [10, -20]", "reduction_matrix = [[10, 0], [4, 8]]")
    )
    np.testing.assert_array_equal(robot.transmission.reduction, [[10, 0], [4, 8]])
    assert robot.couplings[0].ratio == 0.5


def test_a_file_is_read_like_its_text(tmp_path):
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM, encoding="utf-8")
    assert read_modified_dh(path).name == "pendulum"


FRICTION = """
    "viscous",
    {term = "power", exponent = 3, name = "c"},
    {term = "lugre", distance = 1e-3, excess = 0.3, speed = 0.1, damped = false},
    {term = "load", gamma = 200},
    {term = "ripple", order = 51, name = "_g"},
    {term = "counterbalance", ratio = 0.4, angle = -1.2},
    {term = "maxwell_slip", distances = [1e-4, 1e-3], excess = 0.3, speed = 0.1},
    "spring",
    "offset",
"""


def test_every_kind_of_term_has_its_key():
    robot = parse_modified_dh(
        f'name = "one"\nfriction = [{FRICTION}]\n[[joints]]\nname = "a"\nrated_speed = 2\n'
    )
    law = robot.joints[0].friction
    assert [t.stem for t in law.terms] == ("fv fvxc fc fl rc_g rs_g cbf cbk fma fmb ks off".split())
    constants = {s.name: s.value for s in law.shapes}
    assert constants["presliding_distance"] == 1e-3 and constants["stribeck_excess"] == 0.3
    assert (constants["strut_ratio"], constants["strut_angle"]) == (0.4, -1.2)
    assert law.terms[3].gamma == 200.0
