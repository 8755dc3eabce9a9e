"""Measured wrenches and poses of a base become part of a recording."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pivident as pv
from pivident.data import with_wrenches
from pivident.foundation.errors import PividentError, RecordingError
from pivident.robot import with_floating_base, with_held_base, with_wrench_sensors
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.measured_base import wrench_torques
from pivident.robot.wrench_sensor import WrenchSensor

SAMPLES, RATE = 400, 500.0
FRAME = Pose(rotation_from_rpy(0.1, 0.2, 0.3), np.array([0.0, 0.1, -0.2]))
FLOOR, TOOL = (
    WrenchSensor("floor", "base", FRAME),
    WrenchSensor("tool", "2", FRAME, "by_robot"),
)
ARM = pv.load_robot("planar_2r")
HELD = with_wrench_sensors(ARM, [FLOOR, TOOL])
FLOATING = with_wrench_sensors(with_floating_base(ARM), [FLOOR])

rng = np.random.default_rng(1)
T = np.arange(SAMPLES) / RATE
Q = np.column_stack([np.sin(7.0 * T), np.cos(5.0 * T)])
TAU, REFERENCE = rng.normal(size=Q.shape), Q + 0.01
VALUES = {name: rng.normal(size=(SAMPLES, 6)) for name in ("floor", "tool")}
TURNS = Rotation.from_euler("XYZ", np.column_stack([3.0 * T, 0.3 * np.sin(4 * T), 0.5 * T]))
PLACE = np.column_stack([T, 0.1 * np.sin(T), 0 * T])
POSE = PLACE, TURNS.as_matrix()


def driven(**options):
    return pv.Recording("run", ARM.joint_names, Q, TAU, RATE, q_ref=REFERENCE, **options)


def test_a_held_base_stands_still_and_its_rows_are_the_wrenches():
    made = with_wrenches(driven(dq_ref=0.1 * Q), HELD, VALUES)
    assert made.joint_names == HELD.joint_names
    for channel, own in (("q", Q), ("tau", TAU), ("q_ref", REFERENCE), ("dq_ref", 0.1 * Q)):
        values = getattr(made, channel)
        assert not values[:, :6].any()
        np.testing.assert_array_equal(values[:, 6:], own)
    expected = sum(wrench_torques(HELD, s, made.q, VALUES[s.name]) for s in HELD.sensors)
    np.testing.assert_array_equal(made.wrench_torque, expected)
    assert np.abs(expected[:, 6:]).min(axis=0).max() > 0.0
    assert [w.sensor.name for w in made.wrenches] == ["floor", "tool"]


def test_a_floating_base_has_its_pose_and_neither_speed_nor_command():
    made = with_wrenches(driven(dq_ref=0.1 * Q), FLOATING, {"floor": VALUES["floor"]}, POSE)
    np.testing.assert_allclose(made.q[:, :3], PLACE)
    np.testing.assert_allclose(
        made.q[:, 3:6], np.column_stack([3.0 * T, 0.3 * np.sin(4 * T), 0.5 * T]), atol=1e-12
    )
    assert made.dq_ref is None and not made.tau[:, :6].any()


def test_parts_keep_their_wrenches():
    made = with_wrenches(driven(), HELD, VALUES)
    for part in (made.part(100, 250), made.slice(100 / RATE, 250 / RATE)):
        assert part.samples == 150
        np.testing.assert_array_equal(part.wrench_torque, made.wrench_torque[100:250])
        for own, whole in zip(part.wrenches, made.wrenches, strict=True):
            assert own.sensor is whole.sensor
            np.testing.assert_array_equal(own.values, whole.values[100:250])


def test_the_joints_behind_the_base_are_the_log():
    made = with_wrenches(driven(), HELD, VALUES)
    arm = made.behind(6)
    assert arm.joint_names == ARM.joint_names
    np.testing.assert_array_equal(arm.q, Q)
    np.testing.assert_array_equal(arm.wrench_torque, made.wrench_torque[:, 6:])
    other = made.with_reference_of(driven(dq_ref=Q))
    np.testing.assert_array_equal(other.q_ref[:, 6:], REFERENCE)
    np.testing.assert_array_equal(other.dq_ref[:, 6:], Q)


def spoiled(values, sample, column, value=np.nan):
    own = values.copy()
    own[sample, column] = value
    return own


ERRORS = {
    "no values": (
        HELD, {"tool": VALUES["tool"]}, None, r"no columns for the wrench sensor 'floor'",
    ),
    "no sensor": (
        HELD, VALUES | {"hand": VALUES["tool"]}, None,
        r"columns for a wrench 'hand', and no sensor",
    ),
    "no pose": (FLOATING, {"floor": VALUES["floor"]}, None, r"does not hold its pose; map base"),
    "no force": (with_floating_base(ARM), {}, POSE, r"has a floating base, and nothing holds it"),
    "not held": (with_held_base(ARM), {}, None, r'is not described; add it by \[\[wrench\]\]'),
    "a pose": (HELD, VALUES, POSE, r"does not move; write floating_base = true"),
    "constant": (
        HELD, VALUES | {"floor": np.ones((SAMPLES, 6))}, None,
        r"wrench of sensor 'floor' is the same at every sample",
    ),
    "not finite": (
        HELD, VALUES | {"floor": spoiled(VALUES["floor"], 123, 4)}, None,
        r"wrench\.floor.*my.*123|wrench\.floor.*123.*my",
    ),
    "shape": (HELD, VALUES | {"floor": np.ones((SAMPLES, 5))}, None, r"wrench\.floor"),
    "length": (HELD, VALUES | {"floor": np.ones((SAMPLES - 1, 6))}, None, r"wrench\.floor"),
    "pose not finite": (
        FLOATING, {"floor": VALUES["floor"]}, (spoiled(PLACE, 7, 1), POSE[1]),
        r"position of the base is not finite at sample 7, one of 1; cut the record",
    ),
    "pose too short": (
        FLOATING, {"floor": VALUES["floor"]}, (PLACE[1:], POSE[1]),
        r"position of the base has shape \(.*, 3\); \(.*, 3\) is needed",
    ),
    "pitched": (
        FLOATING, {"floor": VALUES["floor"]},
        (PLACE, Rotation.from_euler("y", np.linspace(0, 1.6, SAMPLES)[:, None]).as_matrix()),
        r"recording 'run': sample 36\d: the base is pitched by 84°",
    ),
    "angles in place of axes": (
        FLOATING, {"floor": VALUES["floor"]}, (PLACE, PLACE),
        r"rotation of the base has shape \(.*, 3\); \(.*, 3, 3\) is needed",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ERRORS)
def test_errors(case):
    robot, values, pose, message = ERRORS[case]
    with pytest.raises(PividentError, match=message):
        with_wrenches(driven(), robot, values, pose)


def test_encoders_behind_the_gears_are_refused():
    with pytest.raises(RecordingError, match="leave out their columns"):
        with_wrenches(driven(q_link=Q), HELD, VALUES)


def test_a_twist_is_the_speed_of_the_base():
    floor = {"floor": VALUES["floor"]}
    step = 1.0 / RATE
    turning = (TURNS[2:] * TURNS[:-2].inv()).as_rotvec() / (2.0 * step)
    twist = np.zeros((SAMPLES, 6))
    twist[1:-1] = np.hstack([(PLACE[2:] - PLACE[:-2]) / (2.0 * step), turning])
    made = with_wrenches(driven(dq=0.1 * Q), FLOATING, floor, POSE, twist)
    slope = (made.q[2:, :6] - made.q[:-2, :6]) / (2.0 * step)
    np.testing.assert_allclose(made.dq[1:-1, :6], slope, atol=2e-4)
    np.testing.assert_array_equal(made.dq[:, 6:], 0.1 * Q)
    alone = with_wrenches(driven(), FLOATING, floor, POSE, twist)
    assert alone.dq is None and "those of the joints are missing" in alone.notes[-1]
    without = with_wrenches(driven(dq=0.1 * Q), FLOATING, floor, POSE)
    assert without.dq is None and "those of the base (twist)" in without.notes[-1]
