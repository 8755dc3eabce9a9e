"""Logs with empty cells, too few rows or odd units end with words or with a draft."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.recognition.position_units import position_unit
from pivident.experiment.init.assumption import DraftError
from pivident.experiment.init.draft import draft_experiment
from pivident.experiment.init.torque_unit import compare
from pivident.robot.gallery import load_robot

T = np.arange(600) / 500.0
MOTION = {"t": T, "q1": np.sin(3 * T), "q2": np.cos(2 * T), "tau1": np.sin(T), "tau2": np.cos(T)}


def log(folder, rows=600, **columns):
    table = MOTION | columns
    lines = np.column_stack(list(table.values())).tolist()
    text = [",".join(table), *(",".join(map(repr, line)) for line in lines)]
    path = folder / "log.csv"
    path.write_text("\n".join(text[: rows + 1]) + "\n")
    return path


EVEN = np.arange(600) % 2 == 0


@pytest.mark.parametrize(
    ("change", "rows"),
    [
        ({"q2": np.full(600, np.nan)}, 600),
        ({"q1": np.where(EVEN, T, np.nan), "q2": np.where(EVEN, np.nan, T)}, 600),
        ({}, 2),
    ],
    ids=["a joint without positions", "joints in turns", "two rows"],
)
def test_rows_that_hold_no_whole_position_are_refused(tmp_path, change, rows):
    with pytest.raises(DraftError, match=r"rows of log\.csv have a position of every joint"):
        draft_experiment([log(tmp_path, rows, **change)], "planar_2r", out=tmp_path / "e.toml")


def test_torques_without_a_number_leave_the_scale_open():
    robot, nothing = load_robot("planar_2r"), np.empty((0, 2))
    found = compare(robot, nothing, nothing, np.empty(0))
    assert np.isnan(found.factors).all() and "0 rows" in found.trouble


def test_a_joint_that_is_not_logged_says_nothing_about_the_unit():
    robot = load_robot("planar_2r")
    q = np.column_stack([np.linspace(-90.0, 90.0, 50), np.full(50, np.nan)])
    assert position_unit(robot, q, {}, None).units == ("deg", "deg")


def test_millimetres_in_the_names_are_believed():
    robot = load_robot("emps")
    assert robot.joints[0].kind == "prismatic"
    bare = replace(robot, joints=(replace(robot.joints[0], position_limits=None),))
    q = np.linspace(0.0, 5.0, 50)[:, None]
    found = position_unit(bare, q, {bare.joints[0].name: "mm"}, None)
    assert found.units == ("mm",) and found.sure == "certain"
    assert position_unit(bare, q, {}, None).units == ("m",)


def test_a_pause_of_the_logger_leaves_what_is_on_both_sides(tmp_path):
    t = np.where(T > 0.5, T + 3.0, T)
    q = {f"q{j}": np.sin((2 + j) * T) for j in (1, 2)}
    path = log(tmp_path, t=t, **q)
    draft = draft_experiment([path], "planar_2r", out=tmp_path / "e.toml")
    found = {g.key: g for g in draft.assumptions if g.table == "recording"}
    assert "part" not in found and "resample" not in found and not draft.troubles
    assert "are used, in 1 stretch(es)" in found["files"].seen  # 0.5 s are too short
