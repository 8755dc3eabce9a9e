import numpy as np
import pytest
from pydantic import ValidationError

from pivident.experiment.excite_keys import ObstacleEntry, RoomEntry
from pivident.foundation.errors import ExperimentError
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.gallery import load_robot
from pivident.studies.collision.bodies import (
    Body,
    Obstacle,
    ToolBox,
    upward,
)
from pivident.studies.collision.clearances import Clearances
from pivident.studies.collision.distances import axis_distances
from pivident.studies.collision.room import (
    clearances_of_room,
    obstacles_of_entries,
    tool_box_of_entry,
)


def solids(rng):
    """One obstacle of each shape at a random pose."""
    pose = [(rotation_from_rpy(*rng.uniform(-3, 3, 3)), rng.normal(size=3)) for _ in range(4)]
    return [
        Obstacle("table", "box", *pose[0], size=rng.uniform(0.1, 1.0, 3)),
        Obstacle("ball", "sphere", *pose[1], radius=rng.uniform(0.1, 0.5)),
        Obstacle("post", "cylinder", *pose[2], radius=rng.uniform(0.1, 0.4), length=0.7),
        Obstacle("pipe", "capsule", *pose[3], radius=rng.uniform(0.1, 0.4), length=0.6),
    ]


def measured(obstacle, start, end, radius):
    """Distances by the kernel, with normals in the base frame."""
    if obstacle.shape in ("box", "cylinder"):
        start, end = (
            (points - obstacle.translation) @ obstacle.rotation for points in (start, end)
        )
    distance, normal, point = np.empty(len(start)), np.empty_like(start), np.empty_like(start)
    axis_distances(obstacle.kind, start, end, obstacle.solid, distance, normal, point)
    if obstacle.shape in ("box", "cylinder"):
        normal = normal @ obstacle.rotation.T
    return distance - radius - obstacle.skin, normal


def in_coal(coal, obstacle):
    if obstacle.shape == "box":
        return coal.Box(*obstacle.size)
    if obstacle.shape == "sphere":
        return coal.Sphere(obstacle.radius)
    kind = {"cylinder": coal.Cylinder, "capsule": coal.Capsule}[obstacle.shape]
    return kind(obstacle.radius, obstacle.length)


@pytest.mark.parametrize("seed", range(6))
def test_distances_of_capsules_from_obstacles_are_those_of_coal(seed):
    coal = pytest.importorskip("coal")
    rng = np.random.default_rng(seed)
    radius, length, count = 0.07, 0.3, 150
    turns = [rotation_from_rpy(*rng.uniform(-3, 3, 3)) for _ in range(count)]
    for obstacle in solids(rng):
        centres = obstacle.translation + 0.6 * rng.normal(size=(count, 3))
        half = 0.5 * length * np.array([turn[:, 2] for turn in turns])
        distance, normal = measured(obstacle, centres - half, centres + half, radius)
        shape = in_coal(coal, obstacle)
        at = coal.Transform3s(obstacle.rotation, obstacle.translation)
        request = coal.DistanceRequest()
        request.gjk_tolerance = 1e-8
        for k in range(count):
            result = coal.DistanceResult()
            capsule = coal.Transform3s(turns[k], centres[k])
            expected = coal.distance(
                coal.Capsule(radius, length), capsule, shape, at, request, result
            )
            assert (distance[k] < 0.0) == (expected < 0.0)
            if expected > -radius + 1e-3:  # the capsule's axis is outside
                assert distance[k] == pytest.approx(expected, abs=1e-5)
            if expected > 1e-2:
                # coal's normal leads from the first body to the second
                np.testing.assert_allclose(normal[k], -result.normal, atol=0.02)


def test_an_axis_inside_a_solid_is_led_out_by_its_normal():
    rng = np.random.default_rng(11)
    for obstacle in solids(rng):
        centres = obstacle.translation + 0.05 * rng.normal(size=(40, 3))
        half = 0.02 * rng.normal(size=(40, 3))
        start, end = centres - half, centres + half
        for _ in range(100):
            distance, normal = measured(obstacle, start, end, 0.05)
            assert (np.linalg.norm(normal, axis=1) > 0.09).all()
            if (distance > 0.0).all():
                break
            start, end = (points + 0.02 * normal for points in (start, end))
        assert (distance > 0.0).all()


@pytest.mark.parametrize("seed", range(4))
def test_normals_are_the_gradient_by_the_place_of_the_axis_inside_and_outside(seed):
    rng = np.random.default_rng(seed)
    step, checked = 1e-6, 0
    for obstacle in solids(rng):
        centres = obstacle.translation + 0.3 * rng.normal(size=(200, 3))
        half = 0.2 * rng.normal(size=(200, 3))
        distance, normal = measured(obstacle, centres - half, centres + half, 0.05)
        slopes = np.empty((2, 200, 3))
        for axis in range(3):
            for side, sign in enumerate((1.0, -1.0)):
                moved = centres + sign * step * np.eye(3)[axis]
                there, _ = measured(obstacle, moved - half, moved + half, 0.05)
                slopes[side, :, axis] = sign * (there - distance) / step
        smooth = np.abs(slopes[0] - slopes[1]).max(axis=1) < 1e-3
        smooth &= np.linalg.norm(slopes[0], axis=1) > 0.15  # not through the middle of a solid
        checked += smooth.sum()
        np.testing.assert_allclose(normal[smooth], slopes.mean(axis=0)[smooth], atol=2e-3)
    assert checked > 500


def test_an_axis_through_the_middle_of_a_plate_leaves_on_the_side_of_its_nearer_end():
    plate = Obstacle("plate", "box", np.eye(3), np.zeros(3), size=np.array([2.0, 2.0, 1.0]))
    start, end = np.array([[0.0, 0.0, -0.1]]), np.array([[0.0, 0.0, 0.3]])
    distance, normal = measured(plate, start, end, 0.05)
    assert distance[0] == pytest.approx(-0.55)
    np.testing.assert_allclose(normal[0], [0.0, 0.0, 1.0])


def test_the_depth_of_an_axis_in_a_box_is_that_of_its_deepest_point():
    box = Obstacle("box", "box", np.eye(3), np.zeros(3), size=np.array([2.0, 2.0, 1.0]))
    start, end = np.array([[0.0, 0.0, 0.1]]), np.array([[0.9, 0.0, 0.4]])
    distance, normal = measured(box, start, end, 0.05)
    assert distance[0] == pytest.approx(-0.4 - 0.05)
    np.testing.assert_allclose(normal[0], [0.0, 0.0, 1.0])


def test_crossing_axes_have_a_normal_across_both():
    pipe = Obstacle.capsule("pipe", np.array([-1.0, 0, 0]), np.array([1.0, 0, 0]), 0.1)
    start, end = np.array([[0.0, -1.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    distance, normal = measured(pipe, start, end, 0.05)
    assert distance[0] == pytest.approx(-0.15, abs=1e-9)
    assert abs(normal[0, 2]) == pytest.approx(1.0, abs=1e-6)


def test_a_capsule_by_its_ends_lies_between_them():
    start, end = np.array([0.1, 0.2, 0.3]), np.array([-0.4, 0.5, 0.9])
    pipe = Obstacle.capsule("pipe", start, end, 0.1)
    np.testing.assert_allclose(pipe.solid[0], [*start, *end], atol=1e-12)
    point = Obstacle.capsule("point", start, start, 0.1)
    np.testing.assert_allclose(point.solid[0], [*start, *start])


def test_obstacles_of_a_file():
    rows = [
        {"name": "table", "shape": "box", "size": [1, 2, 0.1], "at": [0.5, 0, -0.1],
         "rpy_degrees": [0, 0, 90]},
        {"name": "ball", "shape": "sphere", "radius": 0.2, "at": [0, 1, 0]},
        {"name": "post", "shape": "cylinder", "radius": 0.1, "length": 2, "at": [1, 1, 1]},
        {"name": "pipe", "shape": "capsule", "radius": 0.1, "from": [0, 0, 1], "to": [0, 0, 3]},
    ]  # fmt: skip
    table, ball, post, pipe = obstacles_of_entries(
        [ObstacleEntry.model_validate(row) for row in rows]
    )
    np.testing.assert_allclose(table.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(table.solid[0, :3], [0.5, 1.0, 0.05])
    assert (ball.radius, ball.skin) == (0.2, 0.2)
    np.testing.assert_allclose(post.solid[0, :2], [0.1, 1.0])
    np.testing.assert_allclose(pipe.translation, [0, 0, 2])
    assert pipe.length == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ({"shape": "bx", "size": [1, 1, 1], "at": [0, 0, 0]}, "did you mean 'box'"),
        ({"shape": "box", "size": [1, 0, 1], "at": [0, 0, 0]}, "greater than 0"),
        ({"shape": "box", "size": [1, 1], "at": [0, 0, 0]}, "at least 3"),
        ({"shape": "box", "size": [1, 1, float("nan")], "at": [0, 0, 0]}, "finite"),
        ({"shape": "box", "size": [1, 1, 1]}, "needs its centre in the base frame"),
        ({"shape": "box", "size": [1, 1, 1], "at": [0, 0, 0], "radius": 1}, "a box has no radius"),
        ({"shape": "sphere", "radius": 0, "at": [0, 0, 0]}, "greater than 0"),
        ({"shape": "sphere", "radius": 1, "at": [0, 0, 0], "rpy_degrees": [0, 0, 1]}, "has no rpy"),
        ({"shape": "capsule", "radius": 1, "from": [0, 0, 0]}, r"the other end .*\(to\)"),
        ({"shape": "capsule", "radius": 1, "from": [0, 0, 0], "to": [0, 0, 1], "at": [0, 0, 0]},
         "a capsule has no at"),
        ({"shape": "sphere", "radius": 1, "at": [0, 0, 0], "colour": 1}, "colour"),
    ],
)  # fmt: skip
def test_entries_of_obstacles_are_checked(row, words):
    with pytest.raises(ValidationError, match=words):
        ObstacleEntry.model_validate({"name": "thing"} | row)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"shape": "cone"}, "shape 'cone'"),
        ({"shape": "box"}, "three positive edges"),
        ({"shape": "box", "size": np.array([1.0, 0.0, 1.0])}, "three positive edges"),
        ({"radius": 0.0}, "radius = 0.0 must be positive"),
        ({"radius": np.nan}, "radius = nan"),
        ({"shape": "cylinder"}, "length = 0.0 must be positive"),
        ({"translation": np.array([0.0, np.nan, 0.0])}, "at = "),
        ({"rotation": 2.0 * np.eye(3)}, "no rotation matrix"),
        ({"rotation": np.full((3, 3), np.nan)}, "no rotation matrix"),
    ],
)
def test_obstacles_are_checked(changes, words):
    known = {"shape": "sphere", "rotation": np.eye(3), "translation": np.zeros(3), "radius": 0.1}
    with pytest.raises(ExperimentError, match=words) as caught:
        Obstacle("thing", **(known | changes))
    assert "'thing'" in str(caught.value)


def test_the_room_of_a_file():
    robot = load_robot("staubli_tx40")
    room = RoomEntry.model_validate(
        {
            "body": [{"name": "gripper", "link": "joint_6", "from": [0, 0, 0.03],
                      "to": [0, 0, 0.15], "radius": 0.03}],
            "obstacle": [{"name": "table", "shape": "box", "size": [0.4, 0.4, 0.1],
                          "at": [0.5, 0, -0.1]}],
            "floor": -0.32,
            "tool": [0, 0, 0.18],
            "tool_box": {"low": [-0.5, -0.5, -0.2], "high": [0.5, 0.5, 0.5]},
        }
    )  # fmt: skip
    found = clearances_of_room(robot, room)
    assert {"gripper and base", "gripper and table", "gripper above the floor",
            "tool inside its box"} <= set(found.names)  # fmt: skip
    assert not [name for name in found.names if "flange" in name]
    needed = dict(zip(found.names, found.needed, strict=True))
    assert (needed["gripper and table"], needed["tool inside its box"]) == (0.02, 0.0)
    assert any("approximate outline" in remark for remark in found.remarks)
    assert tool_box_of_entry(RoomEntry()) is None


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"tool_box": {"low": [0, 0, 0], "high": [1, 1, 1]}}, "tool_box needs tool"),
        ({"tool": [0, 0, 0], "tool_box": {"low": [0, 2, 0], "high": [1, 1, 1]}}, "is empty"),
        ({"clearance": -0.1}, "greater than or equal to 0"),
        ({"floor": float("inf")}, "finite"),
        ({"obstacles": []}, "obstacles"),
    ],
)
def test_the_room_is_checked(keys, words):
    with pytest.raises(ValidationError, match=words):
        RoomEntry.model_validate(keys)


def test_tool_boxes_are_checked():
    with pytest.raises(ExperimentError, match="empty"):
        ToolBox(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 1.0]))
    with pytest.raises(ExperimentError, match="empty"):
        ToolBox(np.zeros(3), np.array([0.0, np.nan, 0.0]), np.ones(3))
    with pytest.raises(ExperimentError, match="tool ="):
        ToolBox(np.array([0.0, np.nan, 0.0]), np.zeros(3), np.ones(3))


def test_up_is_against_gravity_and_a_floor_needs_gravity():
    robot = load_robot("staubli_tx40")
    np.testing.assert_allclose(upward(robot.with_gravity([0.0, 3.0, 0.0])), [0.0, -1.0, 0.0])
    weightless = robot.with_gravity(np.zeros(3))
    with pytest.raises(ExperimentError, match="no gravity"):
        Clearances.of(weightless, [Body("a", 1, np.zeros(3), np.ones(3), 0.1)], floor=0.0)
