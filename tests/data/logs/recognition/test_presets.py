"""A preset is recognised by names; every entry has a source and means something."""

import re

import numpy as np
import pytest

from pivident.data.logs.recognition.channel_words import PLAIN_QUANTITIES
from pivident.data.logs.recognition.log_clock import column_series
from pivident.data.logs.recognition.log_file import CHANNELS, read_log_file
from pivident.data.logs.recognition.position_units import AssumedUnits, counts_in
from pivident.data.logs.recognition.presets import presets, recognised, with_meanings
from pivident.data.logs.units import COMMAND, POSITION, SPEED, TORQUE
from tests.conftest import REPOSITORY


def numbered(*names, count=2):
    """Columns of names in which # is the number of the joint."""
    return [name.replace("#", str(k)) for name in names for k in range(count)]


@pytest.mark.parametrize("preset", presets(), ids=lambda preset: preset.name)
def test_every_preset_has_sources_units_and_channels_that_are_known(preset):
    assert preset.sources and all("://" in s or "(" in s for s in preset.sources)
    assert preset.text and preset.columns
    assert preset.side in ("", "motor", "link")
    assert not preset.unit or preset.unit in TORQUE | COMMAND
    for meant in preset.channels.values():
        channel, unit = meant["channel"], meant.get("unit")
        assert channel in (*CHANNELS, *PLAIN_QUANTITIES, "", "temperature")
        assert unit is None or unit in POSITION | SPEED | TORQUE | COMMAND or counts_in(unit)
    for gains in preset.gains:
        assert gains["source"] and min(gains["values"]) > 0.0


def test_the_page_of_recipes_has_every_preset():
    page = (REPOSITORY / "docs" / "how_to" / "loggers.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (.+)$", page, flags=re.MULTILINE) == [p.name for p in presets()]


@pytest.mark.parametrize(
    ("name", "columns", "joints", "channels"),
    [
        ("UR RTDE", numbered("actual_q_#", "actual_qd_#", "actual_current_#", "target_q_#",
                             "actual_current_window_#"), (), {"q", "dq", "current", "q_ref"}),
        ("UR ROS driver", ["/joint_states/effort/elbow_joint"], ["shoulder_pan_joint"], {"tau"}),
        ("libfranka", numbered("q[#]", "dq[#]", "tau_J[#]", "tau_J_d[#]", "q_d[#]"),
         ["fer_joint1"], {"q", "dq", "tau", "q_ref"}),
        ("KUKA FRI", numbered("joint_position_measured_#", "joint_torque_measured_#",
                              "joint_torque_external_#"), (), {"q", "tau"}),
        ("KUKA RSI", numbered("AIPos.A#", "ASPos.A#", "MACur.A#"), (), {"q", "q_ref", "current"}),
        ("ABB EGM", numbered("feedBack.joints.joints[#]", "planned.joints.joints[#]"), (),
         {"q", "q_ref"}),
        ("Kinova Kortex", numbered("actuators[#].position", "actuators[#].velocity",
                                   "actuators[#].torque", "actuators[#].current_motor",
                                   "actuators[#].temperature_motor"), (),
         {"q", "dq", "tau", "temperature"}),
        ("xArm ROS driver", numbered("/xarm/joint_states/effort/joint#"), (), {"tau"}),
        ("Dynamixel X", numbered("present_position_#", "present_current_#",
                                 "present_temperature_#"), (), {"q", "current", "temperature"}),
        ("LeRobot", numbered("observation.state[#]", "action[#]"), (), {"q", "q_ref"}),
        ("Unitree", numbered("motor_state[#].q", "motor_state[#].dq", "motor_state[#].tau_est"),
         (), {"q", "dq", "tau"}),
    ],
)  # fmt: skip
def test_a_preset_is_recognised_and_says_what_the_columns_hold(name, columns, joints, channels):
    found = recognised(columns, joints)
    assert found is not None and found.name == name
    assert {s.channel for s in with_meanings(found, column_series(columns, joints))} - {
        None
    } == channels


def test_no_preset_is_seen_in_names_of_ones_own():
    assert recognised(numbered("q_#", "tau_#"), ()) is None
    assert recognised(["effort_1"], ["joint_1"]) is None
    assert recognised(numbered("tau_J_#"), ["shoulder_pan_joint"]) is None


def test_counts_per_revolution_are_a_unit_of_the_file():
    units = AssumedUnits(("counts/4096", "counts/4096"), "certain", "")
    assert units.value == {"unit": "counts", "per_revolution": 4096}
    np.testing.assert_allclose(units.factors(POSITION), 2.0 * np.pi / 4096)


def test_an_audit_reads_counts_as_counts(tmp_path):
    from pivident.data.logs.described_log import bare_log

    t = np.arange(200) / 50.0
    counts = np.round(2048 * np.sin(t))
    rows = np.column_stack([t, counts, counts, np.cos(t), np.cos(t)])
    head = ",".join(["t", *numbered("present_position_#", "present_current_#")])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=head, comments="")
    log = bare_log(tmp_path / "log.csv")
    np.testing.assert_allclose(log.channels["q"][:, 0], counts * 2.0 * np.pi / 4096)


def test_an_audit_knows_the_names_of_a_preset_too(tmp_path):
    from pivident.data.logs.described_log import bare_log

    t = np.arange(100) / 50.0
    rows = np.column_stack([t, np.sin(t), np.cos(t), np.sin(t + 0.1), np.cos(t + 0.1)])
    head = ",".join(["timestamp", *numbered("observation.state[#]", "action[#]")])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=head, comments="")
    assert read_log_file(tmp_path / "log.csv").preset.name == "LeRobot"
    assert set(bare_log(tmp_path / "log.csv").channels) == {"q", "q_ref"}


@pytest.mark.parametrize(
    "head", ["t,q_hip,q_knee,tau_hip,tau_knee", "t,pos_a,pos_b,trq_a,trq_b"]
)  # fmt: skip
def test_an_audit_without_a_robot_knows_joints_that_have_words(tmp_path, head):
    from pivident.data.logs.described_log import bare_log

    t = np.arange(200) / 50.0
    rows = np.column_stack([t, np.sin(t), np.cos(t), np.cos(t), np.sin(t)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=head, comments="")
    log = bare_log(tmp_path / "log.csv")
    assert {k: v.shape[1] for k, v in log.channels.items()} == {"q": 2, "tau": 2}
