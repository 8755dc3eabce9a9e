import sys

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial import ConvexHull

from pivident.experiment.excite_keys import BodyEntry, RoomEntry
from pivident.foundation.errors import ExperimentError, RobotDescriptionError
from pivident.foundation.extras import MissingExtra
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf, read_urdf
from pivident.studies.collision.bodies import Body
from pivident.studies.collision.outlines import GALLERY, outline_of, skeleton
from pivident.studies.collision.room import bodies_of_entries, clearances_of_room
from pivident.studies.collision.urdf import (
    MAX_CAPSULES,
    Balls,
    divided,
    enclosing_capsule,
    link_capsules,
)
from tests.robot.kinematics import link_poses
from tests.studies.collision.shaped_arm import ARM, CORNERS, stl_text, write_arm


def outside(points, start, end, radius):
    """How far points are outside of a capsule: nearest points of its segment by projection [m]."""
    way = end - start
    share = np.clip((points - start) @ way / max(way @ way, 1e-30), 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * way, axis=1) - radius


def volume(capsule):
    length = np.linalg.norm(capsule.end - capsule.start)
    return np.pi * capsule.radius**2 * length + 4 / 3 * np.pi * capsule.radius**3


@pytest.mark.parametrize("seed", range(12))
def test_a_capsule_encloses_its_points(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(1, 60)), 3)) * rng.uniform(0.01, 0.5, 3)
    for searched in (True, False):
        capsule = enclosing_capsule(Balls.points(points), searched=searched)
        assert outside(points, capsule.start, capsule.end, capsule.radius).max() < 1e-7


@pytest.mark.parametrize("seed", range(6))
def test_points_of_a_capsule_give_it_back(seed):
    rng = np.random.default_rng(seed)
    turn, centre = rotation_from_rpy(*rng.uniform(-3, 3, 3)), rng.normal(size=3)
    radius, length = rng.uniform(0.03, 0.1), rng.uniform(0.0, 0.5)
    directions = rng.normal(size=(3000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    caps = directions * radius
    caps[:, 2] += 0.5 * length * np.sign(caps[:, 2])
    found = enclosing_capsule(Balls.points(caps @ turn.T + centre))
    assert found.radius == pytest.approx(radius, rel=0.02)
    assert volume(found) == pytest.approx(np.pi * radius**2 * (length + 4 / 3 * radius), rel=0.04)


def test_points_in_a_plane_and_a_single_one_have_capsules_too():
    flat = np.column_stack([np.random.default_rng(1).normal(size=(30, 2)), np.zeros(30)])
    found = enclosing_capsule(Balls.points(flat))
    assert outside(flat, found.start, found.end, found.radius).max() < 1e-7
    point = enclosing_capsule(Balls.points(np.array([[1.0, 2.0, 3.0]])))
    np.testing.assert_array_equal(point.start, [1.0, 2.0, 3.0])
    assert 0.0 < point.radius < 1e-6


def test_the_capsule_of_a_cylinder_is_not_larger_than_the_best_along_its_axis():
    radius, length = 0.05, 0.3
    found = enclosing_capsule(Balls.cylinder(radius, length))
    best = min(
        np.pi * r**2 * 2 * max(length / 2 - np.sqrt(r**2 - radius**2), 0.0) + 4 / 3 * np.pi * r**3
        for r in np.linspace(radius, 0.2, 4000)
    )
    assert volume(found) < 1.01 * best
    angle = np.linspace(0.0, 2 * np.pi, 997)
    rim = radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    for side in (-0.5, 0.5):
        ring = rim + np.array([0.0, 0.0, side * length])
        assert outside(ring, found.start, found.end, found.radius).max() < 1e-7


def test_the_balls_of_a_cylinder_span_all_of_it_and_little_more():
    hull = ConvexHull(Balls.cylinder(0.05, 0.3).centres)
    angle = np.linspace(0.0, 2 * np.pi, 997)
    rim = np.column_stack([0.05 * np.cos(angle), 0.05 * np.sin(angle), np.full(997, 0.15)])
    beyond = hull.equations[:, :3] @ rim.T + hull.equations[:, 3:]
    assert beyond.max() < 1e-9
    assert hull.volume < 1.005 * np.pi * 0.05**2 * 0.3


def bent_bar():
    """Two bars at a right angle as one closed mesh: vertices and triangles."""
    outline = np.array([[0, 0], [0.6, 0], [0.6, 0.1], [0.1, 0.1], [0.1, 0.5], [0, 0.5]])
    vertices = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 0.1)])
    floor = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    sides = [(k, (k + 1) % 6, 6 + k) for k in range(6)]
    sides += [((k + 1) % 6, 6 + (k + 1) % 6, 6 + k) for k in range(6)]
    return vertices, np.array([*floor, *((a + 6, b + 6, c + 6) for a, b, c in floor), *sides])


def test_a_bent_mesh_is_cut_in_two_and_a_straight_one_is_not():
    vertices, triangles = bent_bar()
    parts = divided(vertices, triangles)
    assert len(parts) == 2
    capsules = [enclosing_capsule(part) for part in parts]
    one = enclosing_capsule(Balls.points(vertices))
    assert sum(map(volume, capsules)) < 0.8 * volume(one)
    # all of the surface is in one of the two, the triangles across the cut too
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 400)
    surface = (weights @ vertices[triangles]).reshape(-1, 3)
    beyond = [outside(surface, c.start, c.end, c.radius) for c in capsules]
    assert np.min(beyond, axis=0).max() < 1e-7
    straight = vertices * [0.1, 1.0, 1.0]
    assert len(divided(straight, triangles)) == 1


def test_many_shapes_of_a_link_are_merged_and_all_stay_inside():
    rng = np.random.default_rng(3)
    shapes = [
        Balls.points(np.array([0.1 * k, 0.3 * (k % 3), 0.0]) + 0.03 * rng.normal(size=(12, 3)))
        for k in range(9)
    ]
    capsules = link_capsules(shapes)
    assert len(capsules) <= MAX_CAPSULES
    for shape in shapes:
        least = min(outside(shape.centres, c.start, c.end, c.radius).max() for c in capsules)
        assert least < 1e-7


def test_shapes_inside_one_another_are_one_capsule():
    inner, outer = Balls.capsule(0.02, 0.1), Balls.capsule(0.05, 0.2)
    (found,) = link_capsules([inner, outer])
    assert found.radius == pytest.approx(0.05, rel=1e-3)


def local_vertices():
    """Points on the shapes of the arm in their own frames; Pinocchio's reader knows no capsules."""
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    angle = np.linspace(0, 2 * np.pi, 100)
    rim = 0.1 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    half, up = np.array([0.05, 0.07, 0.25]), np.array([0.0, 0.0, 0.1])
    return {
        "stand_0": np.vstack([rim + up, rim - up]),
        "upper_0": half * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T,
        "lower_0": CORNERS * [0.001, -0.001, 0.0012],
        "hand_0": 0.06 * ball,
    }


@pytest.mark.parametrize("frozen", [{}, {"quill": 0.07}, {"shoulder": 0.6, "wrist": -0.4}])
def test_the_bodies_of_a_urdf_enclose_its_shapes_where_pinocchio_places_them(tmp_path, frozen):
    pin = pytest.importorskip("pinocchio")
    path = write_arm(tmp_path)
    robot = read_urdf(path, frozen=frozen)
    outline = outline_of(robot)
    assert (outline.source, outline.remarks) == ("urdf", ())
    model = pin.buildModelFromUrdf(str(path))
    shapes = pin.buildGeomFromUrdf(model, str(path), pin.COLLISION, package_dirs=[str(tmp_path)])
    data, placed, rng = model.createData(), shapes.createData(), np.random.default_rng(5)
    vertices = local_vertices()
    assert {shape.name for shape in shapes.geometryObjects} == set(vertices)
    for _ in range(5):
        position = {j.name: rng.uniform(*j.position_limits) for j in robot.joints} | frozen
        q = np.array([position[model.names[i]] for i in range(1, model.njoints)])
        pin.updateGeometryPlacements(model, data, shapes, placed, q)
        poses = link_poses(robot, [position[name] for name in robot.joint_names])
        capsules = []
        for body in outline.bodies:
            pose = np.eye(4) if body.link < 0 else poses[body.link]
            ends = [pose[:3, :3] @ end + pose[:3, 3] for end in (body.start, body.end)]
            capsules.append((*ends, body.radius))
        for shape, place in zip(shapes.geometryObjects, placed.oMg, strict=True):
            points = vertices[shape.name] @ place.rotation.T + place.translation
            assert min(outside(points, *capsule).max() for capsule in capsules) < 1e-6


def test_the_bodies_of_a_urdf_are_named_after_links_and_fit_tightly(tmp_path):
    bodies = outline_of(read_urdf(write_arm(tmp_path))).bodies
    assert [(b.name, b.link) for b in bodies] == [
        ("stand", -1), ("upper", 0), ("lower", 1), ("slide", 2), ("hand", 3),
    ]  # fmt: skip
    slide, hand = bodies[3:]
    assert (slide.radius, hand.radius) == (pytest.approx(0.04), pytest.approx(0.06))
    assert np.linalg.norm(slide.end - slide.start) == pytest.approx(0.2)
    # the quill moves along -z, so its frame is turned by the half turn about x
    turned = np.diag([1.0, -1.0, -1.0]) @ [0.1 * np.sin(0.7), 0.0, 0.1 * np.cos(0.7)]
    np.testing.assert_allclose(slide.end, turned, atol=1e-9)


def test_a_body_by_hand_replaces_those_of_its_link_and_its_mesh_may_be_missing(tmp_path):
    path = write_arm(tmp_path, mesh="package://arm_parts/meshes/gone.stl")
    robot = read_urdf(path)
    given = Body("forearm", 1, np.zeros(3), np.array([0.0, 0.0, 0.3]), 0.1)
    names = [body.name for body in outline_of(robot, [given]).bodies]
    assert names == ["stand", "upper", "forearm", "slide", "hand"]


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        ("package://arm_parts/../../secret.stl", "leads out of its package"),
        ("package://arm_parts//etc/secret.stl", "leads out of its package"),
        ("package://../secret.stl", "leads out of its package"),
        ("../../../../../../secret.stl", "looked for"),
        ("/etc/secret.stl", "looked for"),
        ("http://example.org/mesh.stl", "is not read"),
        ("../meshes/lower.exe", "convert it"),
        ("../meshes", "without ending"),
        ("folder.stl", "cannot be read"),
        ("empty.stl", "no mesh"),
        ("short.stl", "no mesh|no vertices"),
    ],
)
def test_a_mesh_that_cannot_be_used_is_named(tmp_path, mesh, words):
    path = write_arm(tmp_path, mesh=mesh)
    (path.parent / "folder.stl").mkdir()
    (path.parent / "empty.stl").write_text("")
    (path.parent / "short.stl").write_text("solid nothing\nendsolid nothing\n")
    with pytest.raises(RobotDescriptionError, match=words) as caught:
        outline_of(read_urdf(path))
    assert mesh.rpartition("/")[2] in str(caught.value)


@pytest.mark.parametrize("mesh", ["package://elsewhere/meshes/gone.stl", "../meshes/gone.stl"])
def test_a_missing_mesh_gives_way_to_a_capsule_from_joint_to_joint_and_is_named(tmp_path, mesh):
    robot = read_urdf(write_arm(tmp_path, mesh=mesh))
    found = outline_of(robot)
    stand_in = {body.name: body for body in skeleton(robot).bodies}
    lower = next(body for body in found.bodies if body.link == 1)
    np.testing.assert_array_equal(lower.end, stand_in["lower"].end)
    assert lower.radius == stand_in["lower"].radius and found.given == (1,)
    (said,) = (text for text in found.remarks if mesh in text)
    assert said.startswith("Meshes are missing") and "of lower: capsules" in said
    others = [body.name for body in found.bodies if body.link != 1]
    assert others == ["stand", "upper", "slide", "hand"]


@pytest.mark.parametrize("mesh", ["../meshes/lower.stl", "package://old_name/meshes/lower.stl"])
def test_meshes_are_found_by_other_paths(tmp_path, mesh):
    expected = outline_of(read_urdf(write_arm(tmp_path / "a"))).bodies[2]
    found = outline_of(read_urdf(write_arm(tmp_path / "b", mesh=mesh))).bodies[2]
    np.testing.assert_array_equal(found.start, expected.start)


def test_a_nearer_package_is_not_left_for_one_further_away(tmp_path):
    path = write_arm(tmp_path)
    other = tmp_path.parent / "arm_parts" / "meshes"
    other.mkdir(parents=True, exist_ok=True)
    (other / "lower.stl").write_text(stl_text(CORNERS * [1.0, 1.0, 3.0]))
    bodies = outline_of(read_urdf(path)).bodies
    assert np.linalg.norm(bodies[2].end - bodies[2].start) < 0.5


def test_primitive_shapes_need_no_coal_and_meshes_say_that_they_do(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "coal", None)
    robot = read_urdf(write_arm(tmp_path))
    with pytest.raises(MissingExtra, match=r"pivident\[collision\]"):
        outline_of(robot)
    given = Body("forearm", 1, np.zeros(3), np.ones(3), 0.1)
    assert len(outline_of(robot, [given]).bodies) == 5


def test_a_urdf_that_has_changed_is_refused(tmp_path):
    path = write_arm(tmp_path)
    robot = read_urdf(path)
    path.write_text(path.read_text().replace("0.06", "0.05"))
    with pytest.raises(RobotDescriptionError, match="has changed"):
        outline_of(robot)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('box size="0.1 0.14 0.5"', 'box size="0.1 0 0.5"', "link 'upper': collision: box size"),
        ('box size="0.1 0.14 0.5"', 'box size="0.1 0.5"', "3 numbers"),
        ('sphere radius="0.06"', 'sphere radius="nan"', "not finite"),
        ('sphere radius="0.06"', 'sphere radius="-1"', "must be positive"),
        ('sphere radius="0.06"', "sphere", "'radius' is missing"),
        ('scale="0.001 -0.001 0.0012"', 'scale="1 0 1"', "flattens"),
        ('sphere radius="0.06"/>', 'sphere radius="1"/><sphere radius="1"/>', "needs one of"),
        ('<sphere radius="0.06"/>', "", "needs one of box, sphere"),
    ],
)
def test_shapes_that_cannot_be_used_are_named_and_do_not_hinder_the_reader(
    tmp_path, old, new, words
):
    path = write_arm(tmp_path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    robot = read_urdf(path)
    with pytest.raises(RobotDescriptionError, match=words) as caught:
        outline_of(robot)
    assert "arm.urdf" in str(caught.value)


def test_a_link_without_shapes_is_remarked(tmp_path):
    path = write_arm(tmp_path)
    before, hand, after = path.read_text().partition('<link name="hand">')
    path.write_text(before + hand + after[after.index("</link>") :])
    outline = outline_of(read_urdf(path))
    assert [body.name for body in outline.bodies] == ["stand", "upper", "lower", "slide"]
    assert "hand" in outline.remarks[0]


def test_a_urdf_without_shapes_or_without_a_file_gives_a_skeleton_from_joint_to_joint():
    robot = parse_urdf(ARM.format(mesh="lower.stl"))
    outline = outline_of(robot)
    assert outline.source == "skeleton"
    assert "assumption" in outline.remarks[0]
    by_link = {body.link: body for body in outline.bodies}
    np.testing.assert_allclose(by_link[0].end, robot.joints[1].translation)
    lengths = [np.linalg.norm(j.translation) for j in robot.joints[1:]]
    assert by_link[0].radius == pytest.approx(0.08 * sum(lengths))
    np.testing.assert_array_equal(by_link[3].start, by_link[3].end)


def test_a_robot_without_reach_has_no_bodies_and_says_so():
    outline = outline_of(load_robot("emps"))
    assert outline.bodies == ()
    assert "Give bodies by hand" in outline.remarks[0]


def test_the_outline_of_the_tx40_reaches_from_the_floor_to_the_flange():
    robot = load_robot("staubli_tx40")
    outline = outline_of(robot)
    assert outline.source == "gallery" and "approximate" in outline.remarks[0]
    assert {body.link for body in outline.bodies} == {-1, 0, 1, 2, 3, 4, 5}
    base, flange = outline.bodies[0], outline.bodies[-1]
    # the shoulder is 320 mm above the floor, the flange 65 mm from the wrist
    assert min(base.start[2], base.end[2]) - base.radius == pytest.approx(-0.32, abs=0.02)
    assert max(flange.start[2], flange.end[2]) + flange.radius == pytest.approx(0.065, abs=0.01)
    # upper arm: from the shoulder's axis to that of the elbow, 225 mm along x
    np.testing.assert_allclose((outline.bodies[2].end - outline.bodies[2].start)[0], 0.225)


def test_every_gallery_outline_belongs_to_a_robot():
    names = {load_robot(name).name for name in ("staubli_tx40",)}
    assert set(GALLERY) == names


def entry(**changes):
    row = {"name": "gripper", "link": "link_6", "from": [0.0, 0.0, 0.0], "to": [0.0, 0.0, 0.1]}
    return BodyEntry.model_validate(row | {"radius": 0.05} | changes)


def test_bodies_of_a_file_name_links_joints_numbers_or_the_base():
    robot = load_robot("staubli_tx40")
    entries = [
        entry(), entry(name="b", link="joint_3"), entry(name="c", link=2),
        entry(name="d", link="base"),
    ]  # fmt: skip
    bodies = bodies_of_entries(robot, entries)
    assert [body.link for body in bodies] == [5, 2, 1, -1]
    np.testing.assert_array_equal(bodies[0].end, [0.0, 0.0, 0.1])
    assert bodies[0].radius == 0.05
    names = [body.name for body in outline_of(robot, bodies).bodies]
    assert names == ["d", "shoulder", "c", "b", "forearm", "wrist", "gripper"]


def test_an_unknown_link_of_a_body_is_answered_with_the_nearest():
    with pytest.raises(RobotDescriptionError, match="did you mean 'link_6'") as caught:
        bodies_of_entries(load_robot("staubli_tx40"), [entry(link="lnk_6")])
    assert caught.value.place == ("body", "0")


@pytest.mark.parametrize(
    "changes",
    [
        {"radius": 0.0},
        {"radius": float("nan")},
        {"to": [0.0, 0.0]},
        {"colour": "red"},
        {"name": ""},
    ],
)
def test_entries_of_bodies_are_checked(changes):
    with pytest.raises(ValidationError):
        entry(**changes)


def test_bodies_are_checked():
    with pytest.raises(RobotDescriptionError, match="'arm': start"):
        Body("arm", 0, np.array([np.nan, 0, 0]), np.zeros(3), 0.1)
    with pytest.raises(RobotDescriptionError, match="radius = 0"):
        Body("arm", 0, np.zeros(3), np.zeros(3), 0.0)
    robot = load_robot("planar_2r")
    with pytest.raises(RobotDescriptionError, match="link 7 does not exist"):
        outline_of(robot, [Body("arm", 7, np.zeros(3), np.zeros(3), 0.1)])
    twice = [Body("arm", k, np.zeros(3), np.zeros(3), 0.1) for k in range(2)]
    with pytest.raises(RobotDescriptionError, match="used twice: arm"):
        outline_of(robot, twice)


def test_the_last_link_of_a_skeleton_is_a_rod_about_its_centre_of_mass():
    """The forearm of the planar arm, centre of mass at 0.15 m of 0.3 m: it was a ball once."""
    outline = outline_of(load_robot("planar_2r"))
    forearm = next(body for body in outline.bodies if body.link == 1)
    np.testing.assert_allclose(forearm.start, 0.0)
    np.testing.assert_allclose(forearm.end, [0.3, 0.0, 0.0], atol=1e-12)
    assert "How far forearm and a tool reach is assumed" in outline.remarks[0]


SOME_SHAPES = """<robot name="some"><link name="foot"><collision><geometry>
    <box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="upper"><inertial><mass value="2"/><origin xyz="0.2 0 0"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"><inertial><mass value="1"/><origin xyz="0.15 0 0"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="flange"/>
  {joints}
</robot>"""


def some_shapes():
    """A URDF that gives only its foot a shape; the flange has neither shape nor mass."""
    limit = '<limit lower="-2" upper="2" effort="9" velocity="2"/>'
    rows = (("foot", "upper", "0 0 0.3"), ("upper", "fore", "0.4 0 0"), ("fore", "flange", "0 0 0"))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="{a}"/><child link="{b}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="0 0 1"/>{limit}</joint>'
        for k, (a, b, xyz) in enumerate(rows)
    )
    return SOME_SHAPES.format(joints=joints)


def test_links_without_shapes_are_capsules_from_joint_to_joint(tmp_path):
    """A wall is seen by an arm whose URDF has a shape for its foot alone."""
    (tmp_path / "some.urdf").write_text(some_shapes())
    robot = read_urdf(tmp_path / "some.urdf")
    outline = outline_of(robot)
    assert [(body.name, body.link) for body in outline.bodies] == [
        ("foot", -1),
        ("upper", 0),
        ("fore", 1),
    ]
    np.testing.assert_allclose(outline.bodies[1].end, [0.4, 0, 0], atol=1e-12)
    np.testing.assert_allclose(outline.bodies[2].end, [0.3, 0, 0], atol=1e-12)
    words = " ".join(outline.remarks)
    assert "no <collision> element of upper, fore:" in words
    assert "Not checked: flange, of which the URDF gives neither shape nor mass." in words


def test_obstacles_need_bodies(tmp_path):
    text = (
        '<robot name="rail"><link name="bed"/><link name="car"/><joint name="slide" '
        'type="prismatic"><parent link="bed"/><child link="car"/><axis xyz="1 0 0"/>'
        '<limit lower="0" upper="0.5" effort="9" velocity="1"/></joint></robot>'
    )
    wall = {"name": "wall", "shape": "box", "size": [0.1, 1, 1], "at": [0.3, 0, 0]}
    room = RoomEntry.model_validate({"obstacle": [wall]})
    with pytest.raises(ExperimentError, match=r"no body of 'rail' is known.*obstacle 'wall'"):
        clearances_of_room(parse_urdf(text), room)
