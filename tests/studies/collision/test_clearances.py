import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError, RobotDescriptionError
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf, read_urdf
from pivident.studies.collision.bodies import Body, LinkPoses, Obstacle, ToolBox
from pivident.studies.collision.clearances import Clearances
from pivident.studies.collision.outlines import outline_of
from pivident.studies.collision.pairs import random_postures, swept_ball
from pivident.studies.collision.room import built_apart, exact_distances
from tests.robot.kinematics import link_poses
from tests.robot.random_robots import random_robot
from tests.studies.collision.shaped_arm import write_arm


def some_bodies(robot, rng, size=0.1):
    """A capsule on each link and on the base."""
    return [
        Body(
            f"body {link}",
            link,
            *(0.3 * rng.normal(size=(2, 3))),
            float(rng.uniform(0.2, 1) * size),
        )
        for link in range(-1, robot.size)
    ]


def some_obstacles(rng):
    poses = [(rotation_from_rpy(*rng.uniform(-3, 3, 3)), rng.normal(size=3)) for _ in range(3)]
    return [
        Obstacle("table", "box", *poses[0], size=rng.uniform(0.2, 1.0, 3)),
        Obstacle("post", "cylinder", *poses[1], radius=0.2, length=0.9),
        Obstacle("pipe", "capsule", *poses[2], radius=0.1, length=0.8),
    ]


def postures(robot, rng, count):
    limits = [j.position_limits or (-2.0, 2.0) for j in robot.joints]
    return rng.uniform(*np.array(limits).T, (count, robot.size))


def tree_with_slides(seed):
    """A random tree of five or six joints, some of them prismatic."""
    candidates = (random_robot(s) for s in range(100 * seed, 100 * seed + 100))
    return next(
        r
        for r in candidates
        if r.size >= 5 and len({j.kind for j in r.joints}) == 2 and not r.is_chain
    )


@pytest.mark.parametrize("seed", range(3))
def test_poses_are_those_of_the_second_kinematics(seed):
    robot, rng = tree_with_slides(seed), np.random.default_rng(seed)
    q = postures(robot, rng, 7)
    found = LinkPoses.of(robot, q)
    for k in range(len(q)):
        expected = link_poses(robot, q[k])
        np.testing.assert_allclose(found.rotation[:-1, k], expected[:, :3, :3], atol=1e-12)
        np.testing.assert_allclose(found.origin[:-1, k], expected[:, :3, 3], atol=1e-12)
    np.testing.assert_array_equal(found.rotation[-1], np.broadcast_to(np.eye(3), (7, 3, 3)))


def pinocchio_distances(pin, coal, path, robot, bodies, obstacles, q):
    """Distances of capsules and obstacles by Pinocchio's geometry model, by pair of names."""
    model = pin.buildModelFromUrdf(str(path))
    geometry = pin.GeometryModel()
    index = {}
    # where the robot's link frames are in Pinocchio's joint frames, from their poses at q = 0
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    at_zero = link_poses(robot, np.zeros(robot.size))
    for body in bodies:
        joint, place = 0, pin.SE3.Identity()
        if body.link >= 0:
            joint = model.getJointId(robot.joints[body.link].name)
            place = data.oMi[joint].actInv(pin.SE3(at_zero[body.link]))
        way = body.end - body.start
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
        own = pin.SE3(turn, 0.5 * (body.start + body.end))
        shape = coal.Capsule(body.radius, float(np.linalg.norm(way)))
        index[body.name] = geometry.addGeometryObject(
            pin.GeometryObject(body.name, joint, 0, place * own, shape)
        )
    for obstacle in obstacles:
        shape = {
            "box": lambda o: coal.Box(*o.size),
            "cylinder": lambda o: coal.Cylinder(o.radius, o.length),
            "capsule": lambda o: coal.Capsule(o.radius, o.length),
        }[obstacle.shape](obstacle)
        place = pin.SE3(obstacle.rotation, obstacle.translation)
        index[obstacle.name] = geometry.addGeometryObject(
            pin.GeometryObject(obstacle.name, 0, 0, place, shape)
        )
    names = list(index)
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    for a, b in pairs:
        geometry.addCollisionPair(pin.CollisionPair(index[a], index[b]))
    placed = geometry.createData()
    found = np.empty((len(pairs), len(q)))
    order = [robot.joint_names.index(model.names[i]) for i in range(1, model.njoints)]
    for k in range(len(q)):
        pin.computeDistances(model, data, geometry, placed, q[k][order])
        found[:, k] = [result.min_distance for result in placed.distanceResults]
    return {frozenset(pair): row for pair, row in zip(pairs, found, strict=True)}


def test_distances_are_those_of_pinocchio(tmp_path):
    pin, coal = pytest.importorskip("pinocchio"), pytest.importorskip("coal")
    path, rng = write_arm(tmp_path), np.random.default_rng(2)
    robot = read_urdf(path)
    bodies, obstacles = some_bodies(robot, rng), some_obstacles(rng)
    q = postures(robot, rng, 60)
    clearances = Clearances.of(robot, bodies, obstacles)
    expected = pinocchio_distances(pin, coal, path, robot, bodies, obstacles, q)
    found = clearances.distances(q)
    assert len(clearances.names) >= 10
    compared = 0
    for name, distance in zip(clearances.names, found, strict=True):
        reference = expected[frozenset(name.split(" and "))]
        np.testing.assert_array_equal(distance < 0.0, reference < 0.0)
        apart = reference > 0.0
        compared += apart.sum()
        np.testing.assert_allclose(distance[apart], reference[apart], atol=2e-5)
    assert compared > 400


def central_differences(clearances, q, step=1e-6):
    slopes = np.empty((2, len(clearances.names), *q.shape))
    here = clearances.distances(q)
    for joint in range(q.shape[1]):
        for side, sign in enumerate((1.0, -1.0)):
            moved = q.copy()
            moved[:, joint] += sign * step
            slopes[side, :, :, joint] = sign * (clearances.distances(moved) - here) / step
    return slopes


@pytest.mark.parametrize("seed", range(4))
def test_gradients_are_those_of_finite_differences(seed):
    robot, rng = tree_with_slides(seed), np.random.default_rng(seed)
    bodies = [*some_bodies(robot, rng), Body("ball", 2, *(2 * [0.2 * rng.normal(size=3)]), 0.1)]
    clearances = Clearances.of(
        robot,
        bodies,
        some_obstacles(rng),
        floor=-1.5,
        tool_box=ToolBox(rng.normal(size=3), np.full(3, -2.0), np.full(3, 2.0)),
        clearance=0.0,
    )
    q = postures(robot, rng, 40)
    distance, gradient = clearances.with_gradients(q)
    np.testing.assert_array_equal(distance, clearances.distances(q))
    slopes = central_differences(clearances, q)
    # at kinks, where the nearest points jump, the two one-sided slopes differ
    smooth = np.abs(slopes[0] - slopes[1]).max(axis=2) < 1e-3
    outside = distance > -0.05  # axes through the middle of an obstacle are another test's
    assert (smooth & outside).mean() > 0.8
    chosen = smooth & outside
    np.testing.assert_allclose(gradient[chosen], slopes.mean(axis=0)[chosen], atol=2e-3)
    assert {name.rpartition(" ")[2] for name in clearances.names} >= {"floor", "box", "table"}


def test_no_distance_changes_faster_than_its_bound():
    """|∂d/∂q| ≤ r in random postures, and not by orders of magnitude less."""
    rng = np.random.default_rng(4)
    robot = load_robot("staubli_tx40")
    clearances = Clearances.of(
        robot,
        outline_of(robot).bodies,
        some_obstacles(rng),
        floor=-1.5,
        tool_box=ToolBox(np.array([0, 0, 0.1]), np.full(3, -2.0), np.full(3, 2.0)),
    )
    _, gradients = clearances.with_gradients(postures(robot, rng, 500))
    largest = np.abs(gradients).max(axis=1)
    assert clearances.steepest.shape == largest.shape
    assert (largest <= clearances.steepest + 1e-9).all()
    moving = clearances.steepest > 0.0
    assert np.median((largest / np.where(moving, clearances.steepest, 1.0))[moving]) > 0.2
    assert not largest[~moving].any()


def test_a_step_along_the_gradient_leads_out_of_a_collision():
    robot, rng = load_robot("staubli_tx40"), np.random.default_rng(5)
    post = Obstacle("post", "cylinder", np.eye(3), np.array([0.25, 0, 0]), radius=0.12, length=1.0)
    table = Obstacle("table", "box", np.eye(3), np.array([0.3, 0, 0.1]), np.array([0.4, 0.4, 0.2]))
    clearances = Clearances.of(robot, outline_of(robot).bodies, [post, table])
    q = postures(robot, rng, 2000)
    distance, gradient = clearances.with_gradients(q)
    for row in range(len(clearances.names)):
        hit = (distance[row] < -1e-3) & (np.abs(gradient[row]).max(axis=1) > 1e-3)
        if not hit.any():
            continue
        steepest = gradient[row, hit] / np.linalg.norm(gradient[row, hit], axis=1)[:, None]
        after = clearances.distances(q[hit] + 1e-3 * steepest)[row]
        # not where the axis runs through the middle of an obstacle, see geometry_distances
        assert np.mean(after > distance[row, hit]) > 0.95, clearances.names[row]
    assert (distance < -0.05).any()


def test_neighbours_are_not_checked_and_built_in_contact_is_remarked():
    robot = load_robot("staubli_tx40")
    clearances = Clearances.of(robot, outline_of(robot).bodies)
    pairs = {frozenset(name.split(" and ")) for name in clearances.names}
    assert frozenset(("upper arm", "shoulder")) not in pairs  # joint 2
    assert frozenset(("flange", "base")) in pairs
    # the wrist's origin lies on the forearm's axis: the flange never leaves the forearm
    assert frozenset(("flange", "forearm")) not in pairs
    assert "flange and forearm" in clearances.remarks[0]


def test_a_tight_joint_does_not_hide_a_pair_that_touches_only_sometimes():
    robot = load_robot("planar_2r")
    bodies = [
        Body("post", -1, np.array([0.45, 0, -1.0]), np.array([0.45, 0, 1.0]), 0.05),
        Body("upper arm", 0, np.zeros(3), np.array([0.4, 0, 0]), 0.02),
        Body("forearm", 1, np.zeros(3), np.array([0.4, 0, 0]), 0.02),
    ]
    clearances = Clearances.of(robot, bodies)
    assert clearances.names == ("forearm and post",)
    # at q1 = 90 degrees and q2 = 0 the arm is stretched along y
    found = clearances.distances(np.array([[np.pi / 2, 0.0]]))
    assert found[0, 0] == pytest.approx(np.hypot(0.45, 0.4) - 0.07, abs=1e-9)


def test_only_pairs_that_touch_in_nearly_every_posture_are_taken_for_built_so():
    robot = load_robot("planar_2r")
    forearm = Body("forearm", 1, np.zeros(3), np.array([0.4, 0, 0]), 0.02)
    # the elbow is on a circle of 0.4 m; a post of this radius catches it in a share of postures
    for radius, share, checked in ((0.6, 0.8, True), (0.72, 1.0, False)):
        up = np.array([0.0, 0.0, 1.0])
        post = Body("post", -1, np.array([0.3, 0, 0]) - up, np.array([0.3, 0, 0]) + up, radius)
        q = postures(robot, np.random.default_rng(8), 4000)
        elbow = 0.4 * np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0])])
        hand = elbow + 0.4 * np.column_stack([np.cos(q.sum(axis=1)), np.sin(q.sum(axis=1))])
        points = elbow + np.linspace(0.0, 1.0, 200)[:, None, None] * (hand - elbow)
        nearest = np.linalg.norm(points - [0.3, 0.0], axis=2).min(axis=0)
        assert np.mean(nearest < radius + 0.04) == pytest.approx(share, abs=0.1)
        clearances = Clearances.of(robot, [forearm, post])
        assert clearances.names == (("forearm and post",) if checked else ())
        assert bool(clearances.remarks) is not checked


def test_an_obstacle_around_the_robot_is_remarked_and_one_out_of_reach_left_out():
    robot = load_robot("planar_2r")
    bodies = [
        Body("upper arm", 0, np.zeros(3), np.array([0.4, 0, 0]), 0.02),
        Body("forearm", 1, np.zeros(3), np.array([0.4, 0, 0]), 0.02),
    ]
    plinth = Obstacle("plinth", "sphere", np.eye(3), np.zeros(3), radius=0.1)
    far = Obstacle("far", "sphere", np.eye(3), np.array([2.0, 0, 0]), radius=0.1)
    near = Obstacle("near", "sphere", np.eye(3), np.array([0.8, 0, 0]), radius=0.1)
    clearances = Clearances.of(robot, bodies, [plinth, far, near])
    assert clearances.names == ("forearm and plinth", "forearm and near")
    assert "upper arm and plinth" in clearances.remarks[0]


def test_no_posture_leaves_the_swept_ball():
    for seed in range(3):
        robot, rng = tree_with_slides(seed), np.random.default_rng(seed)
        q = np.where(
            [j.position_limits is None and j.kind == "prismatic" for j in robot.joints],
            0.0,
            postures(robot, rng, 500),
        )
        poses = LinkPoses.of(robot, q)
        for body in some_bodies(robot, rng)[1:]:
            centre, radius = swept_ball(robot, body)
            for end in (body.start, body.end):
                away = np.linalg.norm(poses.points(body.link, end) - centre, axis=1)
                assert away.max() + body.radius <= radius + 1e-12


def test_the_floor_is_below_the_base_along_gravity():
    robot = load_robot("staubli_tx40")
    bodies = outline_of(robot).bodies
    clearances = Clearances.of(robot, bodies, floor=-0.32)
    # base and shoulder cannot come nearer to the floor
    rows = [name for name in clearances.names if name.endswith("above the floor")]
    assert "forearm above the floor" in rows
    assert not {"base above the floor", "shoulder above the floor"} & set(rows)
    q = np.radians([[0.0, 90.0, 0.0, 0.0, 0.0, 0.0]])
    pose = link_poses(robot, q[0])
    forearm = next(body for body in bodies if body.name == "forearm")
    heights = [pose[3][2, :3] @ end + pose[3][2, 3] for end in (forearm.start, forearm.end)]
    found = clearances.distances(q)[clearances.names.index("forearm above the floor"), 0]
    assert found == pytest.approx(min(heights) + 0.32 - forearm.radius)
    # the same robot on the ceiling
    hanging = Clearances.of(robot.with_gravity(np.array([0, 0, 9.81])), bodies, floor=-0.32)
    upside = hanging.distances(q)[hanging.names.index("forearm above the floor"), 0]
    assert upside == pytest.approx(-max(heights) + 0.32 - forearm.radius)


def test_the_tool_stays_inside_its_box():
    robot = load_robot("planar_2r")
    box = ToolBox(np.array([0.4, 0.0, 0.0]), np.array([-0.1, -0.5, -1]), np.array([0.9, 0.6, 1]))
    clearances = Clearances.of(robot, [], tool_box=box)
    assert clearances.names == ("tool inside its box",)
    q = np.array([[0.3, 0.4], [2.0, 1.0], [-1.0, 0.2]])
    x = 0.4 * np.cos(q[:, 0]) + 0.4 * np.cos(q.sum(axis=1))
    y = 0.4 * np.sin(q[:, 0]) + 0.4 * np.sin(q.sum(axis=1))
    expected = np.min([x + 0.1, 0.9 - x, y + 0.5, 0.6 - y, 1 + 0 * x], axis=0)
    np.testing.assert_allclose(clearances.distances(q)[0], expected, atol=1e-12)
    assert clearances.needed.tolist() == [0.0]


def test_exact_distances_are_those_of_pinocchio_and_capsules_are_never_further_apart(tmp_path):
    pin = pytest.importorskip("pinocchio")
    path, rng = write_arm(tmp_path), np.random.default_rng(3)
    text = path.read_text().replace("capsule", "cylinder")  # Pinocchio's reader knows no capsules
    path.write_text(text)
    robot = read_urdf(path)
    q = postures(robot, rng, 80)
    links = [(2, 0), (3, 0), (1, -1), (2, -1), (3, -1), (3, 1)]
    exact = exact_distances(robot, links, q)
    clearances = Clearances.of(robot, outline_of(robot).bodies)
    rows = [(pair.body.link, pair.other.link) for pair in clearances.pairs]
    capsules = clearances.distances(q)
    model = pin.buildModelFromUrdf(str(path))
    shapes = pin.buildGeomFromUrdf(model, str(path), pin.COLLISION, package_dirs=[str(tmp_path)])
    names = {-1: "stand_0", 0: "upper_0", 1: "lower_0", 2: "slide_0", 3: "hand_0"}
    for a, b in links:
        ids = [shapes.getGeometryId(names[link]) for link in (a, b)]
        shapes.addCollisionPair(pin.CollisionPair(*ids))
    data, placed = model.createData(), shapes.createData()
    for k in range(len(q)):
        pin.computeDistances(model, data, shapes, placed, q[k])
        reference = np.array([result.min_distance for result in placed.distanceResults])
        np.testing.assert_allclose(exact[:, k], reference, atol=1e-5)
    compared = 0
    for row, pair in enumerate(links):
        if pair in rows:
            compared += 1
            apart = exact[row] > 0.0
            nearest = capsules[[other == pair for other in rows]].min(axis=0)
            margin = (exact[row] - nearest)[apart]
            assert margin.min() > -1e-5
            assert margin.min() < 0.1  # tight somewhere
    assert compared >= 4


PLATES = """<robot name="plates">
  <link name="plate"><collision><geometry><box size="0.3 0.3 0.04"/></geometry></collision></link>
  <link name="post"/>
  <link name="arm"><collision><origin xyz="0.2 0 0"/>
    <geometry><box size="0.4 0.1 0.08"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="plate"/><child link="post"/>
    <origin xyz="0 0 {height}"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="nod" type="revolute"><parent link="post"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-0.2" upper="{nod}" velocity="1" effort="1"/></joint>
</robot>"""


@pytest.mark.parametrize(
    ("height", "nod", "given", "free"),
    [(0.13, 0.1, False, True), (0.13, 0.6, False, False), (0.13, 0.1, True, False)],
)
def test_links_built_close_to_each_other_are_told_from_those_that_touch(
    tmp_path, height, nod, given, free
):
    pytest.importorskip("coal")
    path = tmp_path / "plates.urdf"
    path.write_text(PLATES.format(height=height, nod=nod))
    robot = read_urdf(path)
    by_hand = [Body("arm", 1, np.zeros(3), np.array([0.4, 0, 0]), 0.06)] if given else []
    outline = outline_of(robot, by_hand)
    apart, remarks = built_apart(robot, outline)
    assert apart == (frozenset([frozenset(("arm", "plate"))]) if free else frozenset())
    assert len(remarks) == free
    clearances = Clearances.of(robot, outline.bodies, apart=apart)
    assert not (free and clearances.names)
    # lowest corner of the arm above the plate: the height less the nod and half its thickness
    if free:
        lowest = height - 0.04 * np.cos(nod) - 0.04 / 2 - 0.15 * np.tan(nod)
        assert remarks[0].startswith("Not checked: arm and base.")
        words = float(remarks[0].split(" stay ")[1].split(" mm")[0])
        assert words == pytest.approx(1e3 * lowest, abs=15)


def test_exact_distances_need_shapes():
    with pytest.raises(RobotDescriptionError, match="no <collision>"):
        exact_distances(load_robot("planar_2r"), [(1, -1)], np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("q", "words"),
    [
        (np.zeros((3, 5)), r"shape \(3, 5\)"),
        (np.zeros(6), r"\(samples, 6\)"),
        (np.array([[0, 0, np.nan, 0, 0, 0]]), "'joint_3' is nan at sample 0"),
    ],
)
def test_positions_are_checked(q, words):
    robot = load_robot("staubli_tx40")
    clearances = Clearances.of(robot, outline_of(robot).bodies)
    with pytest.raises(ExperimentError, match=words):
        clearances.distances(q)
    with pytest.raises(ExperimentError, match=words):
        clearances.with_gradients(q)


def test_what_is_asked_for_is_checked():
    robot = load_robot("planar_2r")
    body = Body("arm", 1, np.zeros(3), np.array([0.4, 0, 0]), 0.05)
    thing = Obstacle("arm", "sphere", np.eye(3), np.ones(3), radius=0.1)
    with pytest.raises(ExperimentError, match="'arm' are used by several"):
        Clearances.of(robot, [body], [thing])
    with pytest.raises(ExperimentError, match="link 5 does not exist"):
        Clearances.of(robot, [Body("far", 5, np.zeros(3), np.zeros(3), 0.1)])
    with pytest.raises(ExperimentError, match="floor = nan"):
        Clearances.of(robot, [body], floor=np.nan)
    with pytest.raises(ExperimentError, match="clearance = -1"):
        Clearances.of(robot, [body], clearance=-1.0)
    with pytest.raises(ExperimentError, match="tool: link 4"):
        box = ToolBox(np.zeros(3), -np.ones(3), np.ones(3), link=4)
        Clearances.of(robot, [body], tool_box=box)


def test_a_robot_without_bodies_has_no_clearances():
    robot = parse_urdf(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/></joint></robot>'
    )
    clearances = Clearances.of(robot, outline_of(robot).bodies)
    distance, gradient = clearances.with_gradients(np.zeros((4, 1)))
    assert (distance.shape, gradient.shape) == ((0, 4), (0, 4, 1))


def test_a_larger_clearance_checks_no_less():
    """Bodies that are built closer than it keep what they can; they are not left out."""
    robot = load_robot("staubli_tx40")
    bodies = outline_of(robot).bodies
    usual, wide = (Clearances.of(robot, bodies, clearance=c) for c in (0.02, 0.3))
    assert set(usual.names) <= set(wide.names)
    lowered = [p for p in wide.pairs if p.needed < 0.3]
    assert lowered and all(0.0 <= p.needed < 0.3 and p.spare == p.needed for p in lowered)
    assert max(p.needed for p in lowered) > 0.015
    assert all(p.name in " ".join(wide.remarks) for p in lowered)
    assert "built closer than the clearance" in " ".join(wide.remarks)


def test_an_obstacle_that_only_the_first_link_cannot_leave_is_what_the_robot_stands_on():
    robot = load_robot("staubli_tx40")
    bodies = outline_of(robot).bodies
    table = Obstacle("table", "box", np.eye(3), np.array([0, 0, -0.3]), np.array([4.0, 4.0, 0.6]))
    standing = Clearances.of(robot, bodies, [table])
    inside = Obstacle("hall", "box", np.eye(3), np.zeros(3), np.array([9.0, 9.0, 9.0]))
    buried = Clearances.of(robot, bodies, [inside])
    first = {b.name for b in bodies if b.link == 0}
    assert {n for n in buried.names if "hall" in n} == {
        f"{b.name} and hall" for b in bodies if b.link > 0
    }
    assert all(f"{name} and hall" in " ".join(buried.remarks) for name in first)
    assert sum("table" in n for n in standing.names) >= 4


def test_a_pair_that_is_built_near_leaves_room_to_plan_with():
    """A forearm whose root is at most 8 mm beyond the clearance of the base."""
    urdf = """<robot name="arm"><link name="base"/>
      <link name="turret"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
        ixz="0" iyz="0"/></inertial></link>
      <link name="forearm"><inertial><origin xyz="0.2 0 0"/><mass value="1"/><inertia ixx="1"
        iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="a" type="revolute"><parent link="base"/><child link="turret"/><axis xyz="0 0 1"/>
        <limit lower="-2" upper="2" velocity="3" effort="80"/></joint>
      <joint name="b" type="revolute"><parent link="turret"/><child link="forearm"/>
        <origin xyz="0.05 0 0.1"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2" velocity="3" effort="80"/></joint></robot>"""
    root = np.zeros(3)
    bodies = [
        Body("base", -1, root, root, 0.0418),
        Body("forearm", 1, root, np.array([0.4, 0.0, 0.0]), 0.0418),
    ]
    made = Clearances.of(parse_urdf(urdf), bodies, clearance=0.02)
    near = made.distances(random_postures(made.robot))
    assert (near.max(axis=1) < 0.04).all()  # twice the clearance is nowhere
    room = made.with_more(0.02).needed[:, None]
    assert 0.3 < np.mean(near >= room)
