"""Each fault is made, the check finds it, the fix is applied, and the check finds it no more."""

import json

import numpy as np
import pytest

from pivident.app.studio.fixes import Fix, fixes
from pivident.data.logs.log import factors_of
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.check.geometry_check import FEED_FORWARD, candidates
from pivident.experiment.check.remark import of_finding
from pivident.experiment.edited_file import edited
from pivident.experiment.experiment import load_experiment
from pivident.experiment.recording_tables import log_of
from pivident.foundation.codec import decode
from pivident.foundation.errors import ExperimentError, UnusableValue
from pivident.foundation.text.plain_values import plain
from pivident.foundation.text.repair import Edit, Repair, Reversed
from pivident.foundation.text.toml import parse_toml
from tests.app.studio.faulty_logs import FAULTS, TAU
from tests.other_arms import random_arm
from tests.planar_log import EXPERIMENT, HEADER, planar_log

JOINTS = ["shoulder", "elbow"]


def checked(experiment):
    """Remarks of a check as a page has them."""
    content = json.loads(json.dumps(check_experiment(experiment).as_json()))
    return [remark | {"joints": JOINTS} for remark in content["remarks"]]


def of_kind(remarks, kind):
    return [r for r in remarks if (r["topic"], r["kind"]) == kind]


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_gone_after_its_fix(name, tmp_path):
    fault = FAULTS[name]
    experiment = fault.write(tmp_path)
    remarks = checked(experiment)
    found = of_kind(remarks, fault.kind)
    assert found, [(r["topic"], r["kind"], r["message"]) for r in remarks]
    text = experiment.read_text("utf-8")
    for _ in range(3):  # a remark about several joints may need a fix for each
        ways = fixes(found[0], text)
        assert ways, found[0]
        assert decode(Fix, json.loads(json.dumps(plain(ways[0])))) == ways[0]
        text = edited(text, ways[0].edits)
        experiment.write_text(text, encoding="utf-8")
        left = checked(experiment)
        found = of_kind(left, fault.kind)
        if not found:
            break
    assert not found
    assert sum(r["refused"] for r in left) <= sum(r["refused"] for r in remarks)


def written(folder, rows, text=EXPERIMENT, header=HEADER):
    np.savetxt(folder / "log.csv", rows, fmt="%.9g", delimiter=",", header=header, comments="")
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return folder / "experiment.toml"


def cut_off(rows):
    rows[:, TAU] = np.clip(rows[:, TAU], -30.0, 30.0)
    return rows


def standing(rows):
    rows[:, [2, 4]] = 10.0
    return rows


@pytest.mark.parametrize(
    ("kind", "change", "setting"),
    [(("channels", "clipped"), cut_off, 'saturation = "allow"'),
     (("channels", "constant"), standing, "allow_constant = true")],
)  # fmt: skip
def test_what_is_accepted_is_refused_no_longer(tmp_path, kind, change, setting):
    experiment = written(tmp_path, change(planar_log().copy()))
    (remark, *_) = (r for r in of_kind(checked(experiment), kind) if r["refused"])
    (fix,) = fixes(remark, EXPERIMENT)
    assert setting in fix.words
    experiment.write_text(edited(EXPERIMENT, fix.edits), encoding="utf-8")
    left = checked(experiment)
    assert not any(r["refused"] for r in of_kind(left, kind))
    assert setting in experiment.read_text("utf-8")


@pytest.mark.parametrize("trembling", [0.0, 3e-4])
def test_a_joint_that_stands_still_is_left_out(tmp_path, trembling):
    """Of a URDF, it is frozen where it stands."""
    arm = random_arm(np.random.default_rng(4), joints=3)
    (tmp_path / "arm.urdf").write_text(arm.urdf, encoding="utf-8")
    t, rng = np.arange(4000) / 500.0, np.random.default_rng(1)
    q = np.column_stack([np.sin(2 * t + k) + 0.4 * np.sin(5.3 * t) for k in range(3)])
    q[:, 1] = 0.25 + trembling * rng.standard_normal(len(t))
    header = "t,a1,a2,a3,u1,u2,u3"
    text = """[robot]
model = "arm.urdf"
[recording]
files = "log.csv"
columns = {t = "t", q = ["a1", "a2", "a3"], tau = ["u1", "u2", "u3"]}
units = {q = ["rad", "rad", "rad"]}
"""
    tau = 5.0 * np.gradient(q, axis=0) * 500.0 + rng.standard_normal(q.shape)
    experiment = written(tmp_path, np.column_stack([t, q, tau]), text, header)
    kind = ("motion", "standstill") if trembling else ("channels", "constant")
    (remark,) = of_kind(checked(experiment), kind)
    remark["joints"] = ["axis_1", "axis_2", "axis_3"]
    fix = fixes(remark, text)[0]
    assert fix.words.startswith(f"Leave {remark['joints'][1]} out")
    experiment.write_text(edited(text, fix.edits), encoding="utf-8")
    assert not of_kind(checked(experiment), kind)
    (recording,) = load_experiment(experiment).recordings()
    np.testing.assert_allclose(recording.q, q[:, [0, 2]], rtol=1e-7)


def test_fixes_of_the_geometry_are_what_the_check_has_tried(tmp_path):
    """The log that its file then describes is the one with the geometry that the check found."""
    experiment = written(tmp_path, planar_log())
    given = load_experiment(experiment)
    entry = given.content.recording[0]
    log = log_of(entry, given.robot, tmp_path)
    for geometry in candidates(given.robot):
        remark = of_finding(geometry.finding, ("recording", 0))
        (fix,) = fixes(json.loads(json.dumps(remark.as_json())) | {"joints": JOINTS}, EXPERIMENT)
        experiment.write_text(edited(EXPERIMENT, fix.edits), encoding="utf-8")
        made = load_experiment(experiment)
        found = log_of(made.content.recording[0], made.robot, tmp_path)
        np.testing.assert_allclose(made.robot.gravity, geometry.robot.gravity, atol=1e-9)
        turned = {
            "q": geometry.scale * log.channels["q"] + geometry.shift,
            "tau": geometry.scale * log.channels["tau"],
        }
        for channel, values in turned.items():
            np.testing.assert_allclose(found.channels[channel], values, rtol=1e-9, atol=1e-4)


def remark_of(*edits):
    return {"repairs": [Repair(edits).below(("recording", 0)).as_json()], "joints": JOINTS}


def test_a_sign_is_reversed_in_whatever_unit():
    reversed_elbow = remark_of(Reversed(channel="tau", joints=("elbow",)))
    for unit, expected in (
        ('"N m"', "[1.0, -1.0]"),
        ('["kN m", "kN m"]', "[1000.0, -1000.0]"),
        ('{unit = "A", gain = 2.0}', None),
        ("-2.0", "[-2.0, 2.0]"),
        ('"A"', "none"),
    ):
        text = EXPERIMENT.replace('tau = "N m"', f"tau = {unit}")
        found = fixes(reversed_elbow, text)
        if expected == "none":
            assert found == ()  # the drive gain of the robot has to be reversed
            continue
        value = parse_toml(edited(text, found[0].edits))["recording"]["units"]["tau"]
        given = parse_toml(f"x = {unit}")["x"]
        given = given if isinstance(given, list) else [given, given]
        assert factors_of("tau", value)[0] == pytest.approx(
            factors_of("tau", given)[0] * [1.0, -1.0]
        )


def test_gravity_of_the_controller_and_energy():
    edit = Edit((*FEED_FORWARD.place, "feed_forward"), "gravity_measured")
    (fix,) = fixes(remark_of(edit), EXPERIMENT)
    assert fix.edits == ((("controller", "feed_forward"), '"gravity_measured"'),)
    (fix,) = fixes(remark_of(Reversed(channel="tau", joints=("shoulder",))), EXPERIMENT)
    assert fix.words == "Reverse the sign of the torque of shoulder."


def test_several_stretches_between_gaps(tmp_path):
    rows = np.delete(planar_log(), [*range(2000, 2600), *range(5000, 5003)], axis=0)
    experiment = written(tmp_path, rows)
    (remark,) = of_kind(checked(experiment), ("timing", "gap"))
    first, *others = fixes(remark, EXPERIMENT)
    places = [place[-1] for place, _ in first.edits]
    assert places[0] == "part" and len(others) >= 1
    experiment.write_text(edited(EXPERIMENT, first.edits), encoding="utf-8")
    assert not of_kind(checked(experiment), ("timing", "gap"))
    load_experiment(experiment).recordings()


def test_what_has_no_fix():
    assert fixes(remark_of(Edit(("recording", "delay"), 1.0)), "x = ") == ()
    assert fixes({}, EXPERIMENT) == ()
    assert fixes({"repairs": [{"edits": [{"edit": "Exec"}], "words": ""}]}, EXPERIMENT) == ()


def test_a_fix_of_another_text_is_refused():
    gone = Fix("Remove x.", ((("recording", 0, "rate"), None),))
    with pytest.raises(ExperimentError, match="reload the page"):
        edited(EXPERIMENT, gone.edits)
    for bad in ({}, {"words": "x", "edits": 3}, {"words": "x", "edits": [["a", "b"]]}):
        with pytest.raises(UnusableValue, match=r"words|edits"):
            decode(Fix, bad)
