"""Columns are recognised by their names as robots, recorders and people write them."""

import pytest

from pivident.data.logs.recognition.channel_words import read_words, words_of
from pivident.data.logs.recognition.log_clock import column_series

UR = [f"{p}_joint" for p in ("shoulder_pan", "shoulder_lift", "elbow")]

HABITS = [
    ("actual_q_0", (), "q", "0", None),
    ("actual_qd_3", (), "dq", "3", None),
    ("target_q_5", (), "q_ref", "5", None),
    ("target_qd_5", (), "dq_ref", "5", None),
    ("actual_current_2", (), "current", "2", None),
    ("target_moment_1", (), "tau_ref", "1", None),
    ("joint1_pos", (), "q", "1", None),
    ("q_1", (), "q", "1", None),
    ("pos[0]", (), "q", "0", None),
    ("q[:, 4]", (), "q", "4", None),
    ("J1 (deg)", (), "q", "1", "deg"),
    ("J2 [°/s]", (), "dq", "2", "deg/s"),
    ("I_3 [A]", (), "current", "3", "A"),
    ("A1_torque (Nm)", (), "tau", "1", "N m"),
    ("axis_1.actPos", (), "q", "1", None),
    ("axis_1.setPos", (), "q_ref", "1", None),
    ("tau_J[6]", (), "tau", "6", None),
    ("tau_J_d[6]", (), "tau_ref", "6", None),
    ("dq_d[1]", (), "dq_ref", "1", None),
    ("current_position_4", (), "q", "4", None),
    ("q_dot_2", (), "dq", "2", None),
    ("/joint_states/position.shoulder_pan_joint", UR, "q", UR[0], None),
    ("/joint_states/elbow_joint/effort", UR, "tau", UR[2], None),
    ("/arm_controller/state/desired.positions[1]", UR, "q_ref", "1", None),
    ("shoulder_lift_vel", UR, "dq", UR[1], None),
    ("- arm_3_joint_effort", ["arm_3_joint", "arm_1_joint"], "tau", "arm_3_joint", None),
    ("wrist_1_pos", ["ur_wrist_1_joint", "ur_wrist_2_joint"], "q", "ur_wrist_1_joint", None),
    ("actual_TCP_pose_0", (), None, "0", None),
    ("joint_temperatures_0", (), None, "0", None),
    ("tau_ext_hat[0]", (), None, "0", None),
    ("A1", (), None, "1", None),
]


@pytest.mark.parametrize(("name", "joints", "channel", "joint", "unit"), HABITS)
def test_a_column_is_read_as_its_writer_meant_it(name, joints, channel, joint, unit):
    (series,) = column_series([name], joints)
    assert series.channel == channel
    assert dict(series.columns) == {joint: name}
    assert series.reading.unit == unit
    assert series.named == (joint in joints)


def test_columns_that_differ_in_the_joint_are_one_series():
    names = [f"{kind}{j}" for kind in ("actual_q_", "robot2_pos_") for j in range(6)]
    series = column_series(names)
    assert [len(s.columns) for s in series] == [6, 6]
    assert list(series[1].columns) == list("012345")


def test_a_longer_joint_name_wins_over_a_shorter_one_in_it():
    (series,) = column_series(["hand_arm_1_pos"], ["arm_1", "hand_arm_1"])
    assert list(series.columns) == ["hand_arm_1"]


def test_words_break_at_humps_digits_and_signs():
    assert words_of("axis_1.actPos") == ["axis", "1", "act", "pos"]
    assert words_of("TCPPose2") == ["tcp", "pose", "2"]


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("qref1", "q_ref"), ("desq_2", "q_ref"), ("poscmd3", "q_ref"), ("dqref1", "dq_ref"),
        ("qdref1", "dq_ref"), ("qsoll1", "q_ref"), ("taumeas2", "tau"), ("iact1", "current"),
        ("qoffset1", None), ("torques1", "tau"), ("demand1", "q_ref"),
    ],
)  # fmt: skip
def test_words_in_one_are_taken_apart_where_both_are_known(name, channel):
    assert read_words(words_of(name)).channel == channel
