"""What a preset of the logger says is held against the data, which decide."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.recognition.presets import presets
from pivident.experiment.init.draft import draft_experiment
from pivident.experiment.init.torque_unit import Comparison, torque_unit
from pivident.foundation.text.toml import parse_toml
from pivident.robot.gallery import load_robot
from tests.planar_log import planar_log

BY_NAME = {preset.name: preset for preset in presets()}


def lines_of(folder, names, q, tau, q_ref=None):
    """Assumptions of the draft of a log of the planar arm whose columns have other names."""
    rows = planar_log()
    columns = [rows[:, 0], *q.T, *tau.T, *(() if q_ref is None else q_ref.T)]
    head = ",".join(["time", *(name.replace("#", str(k + 1)) for name in names for k in range(2))])
    path = folder / "log.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="")
    draft = draft_experiment([path], "planar_2r", out=folder / "experiment.toml")
    return parse_toml(draft.text), {(a.table, a.key): a for a in draft.assumptions}


@pytest.fixture(scope="module")
def measured():
    """Positions [deg] and torques [N m] of the planar arm."""
    rows = planar_log()
    return rows[:, 1:3], rows[:, 5:7]


def test_counts_of_a_servo_are_read_as_counts(tmp_path, measured):
    q, tau = measured
    names = ("present_position_#", "present_current_#", "goal_position_#")
    counts = np.round(q / 360.0 * 4096)
    said, lines = lines_of(tmp_path, names, counts, tau / 3.0, (q + 0.05) / 360.0 * 4096)
    units = said["recording"]["units"]
    assert units["q"] == units["q_ref"] == {"unit": "counts", "per_revolution": 4096}
    assert [unit["unit"] for unit in units["tau"]] == ["command"] * 2
    assert "Dynamixel" in lines["recording", "files"].seen
    assert "https://emanual.robotis.com" in lines["recording", "files"].seen


def test_the_unit_of_a_preset_is_confirmed_by_the_data(tmp_path, measured):
    q, tau = measured
    names = ("actuators_#_position", "actuators_#_torque")
    said, lines = lines_of(tmp_path, names, q, tau)
    assert said["recording"]["units"]["q"] == "deg" and said["recording"]["units"]["tau"] == "N m"
    assert lines["recording.units", "q"].sure == "likely"
    assert "as the preset Kinova Kortex says" in lines["recording.units", "tau"].seen


def test_data_that_contradict_a_preset_decide(tmp_path, measured):
    q, tau = measured
    names = ("motor_state_#_q", "motor_state_#_tau_est")
    said, lines = lines_of(tmp_path, names, q, tau / 30.0)  # degrees, and a thirtieth of N m
    assert said["recording"]["units"]["q"] == "deg"
    assert "although the preset Unitree says rad" in lines["recording.units", "q"].seen
    gains = [unit["gain"] for unit in said["recording"]["units"]["tau"]]
    assert gains == pytest.approx([30.0, 30.0], rel=0.2)
    assert "although the preset Unitree says N m" in lines["recording.units", "tau"].seen


def torque_of(preset, factors):
    robot = load_robot("planar_2r")
    found = Comparison(np.array(factors), 0.02 * np.abs(factors))
    return torque_unit(robot, found, None, False, None, None, preset)


def test_published_gains_are_taken_where_the_masses_do_not_contradict_them():
    entry = {"robots": ["planar 2r"], "values": [12.0, 9.0], "source": "a paper"}
    preset = replace(BY_NAME["UR ROS driver"], gains=(entry,))
    near = torque_of(preset, [1 / 13.0, 1 / 8.5])
    assert [unit["gain"] for unit in near.value] == [12.0, 9.0] and near.sure == "likely"
    assert "scale" not in near.value[0] and "a paper" in near.seen
    reversed_ = torque_of(preset, [1 / 13.0, -1 / 8.5])
    assert [unit["gain"] for unit in reversed_.value] == [12.0, -9.0]
    far = torque_of(preset, [1 / 130.0, 1 / 85.0])
    assert far.value[0]["scale"] == "masses" and "the data decide" in far.seen
    nothing = torque_of(preset, [np.nan, np.nan])
    assert [unit["gain"] for unit in nothing.value] == [12.0, 9.0]


def test_newton_metres_beside_a_preset_of_currents_are_newton_metres():
    found = torque_of(BY_NAME["UR ROS driver"], [0.98, 1.01])
    assert found.value == "N m"
    assert "although the preset UR ROS driver says A: the data decide" in found.seen
    assert torque_of(BY_NAME["Franka ROS driver"], [np.nan, np.nan]).value == "N m"
