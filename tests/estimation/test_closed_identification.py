"""A five-bar with friction in a passive joint, identified, judged, stored and drawn."""

from dataclasses import replace

import numpy as np
import pytest

import pivident as pv
from pivident.app.notebook.displays import robot_html
from pivident.estimation.identification_file import save_identification
from pivident.foundation.errors import RobotDescriptionError
from pivident.judgement.diagnostics.estimate_statements import wanted_motions
from pivident.judgement.report.motion import motion_values
from pivident.loop import virtual_pd
from pivident.models.model_json import read_model, to_json
from pivident.models.runnable_model import runnable_model
from pivident.robot import FrictionLaw, Link, closed_robot, viscous
from pivident.robot.closed_chains import CLOSED, equations
from pivident.studies.comparison.groups import difference_of_geometry
from pivident.studies.tables.identifications import identification_parameters
from pivident.studies.tables.inputs import robot_joints, robot_parameters

PASSIVE = {"left_elbow", "right_elbow"}

METHODS = ("ls", "iv", "piv", "didim")


@pytest.fixture(scope="module")
def robot():
    plain = pv.load_robot("five_bar").with_friction({"left_elbow": FrictionLaw((viscous(),))})
    return replace(plain, friction_nominal=plain.friction_nominal | {"fv[left_elbow]": 0.2})


@pytest.fixture(scope="module")
def made(robot):
    rest = robot.constraints.posture[list(robot.places)]
    t = np.arange(0.0, 8.0, 0.001)[:, None]
    rise = np.clip(t, 0.0, 1.0)
    rise = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    waves = np.sin(np.array([5.1, 7.3]) * t) + 0.6 * np.sin(np.array([11.9, 9.7]) * t)
    loop = pv.Loop(virtual_pd(robot, rest))
    return loop, pv.simulate(
        robot, loop, rest + 0.3 * rise * waves, encoder=2e-6, torque=0.2, seed=5
    )


@pytest.fixture(scope="module")
def problem(robot, made):
    loop, record = made
    return pv.Problem(robot, (record.recording,), loop)


@pytest.fixture(scope="module")
def results(problem):
    return {name: pv.identify(problem, name) for name in METHODS}


@pytest.mark.parametrize("name", METHODS)
def test_the_truth_lies_within_the_standard_errors(results, made, name):
    found, truth = results[name], made[1].truth
    assert set(found.names) == set(truth)
    off = np.array([v - truth[n] for n, v in zip(found.names, found.theta, strict=True)])
    assert np.all(np.abs(off) < 4.0 * np.maximum(found.method_std, found.robust_std))


@pytest.mark.parametrize(
    "name", ["ls", "irls", "ridge", "map", "tls", "ml-ls", "iv-full-rate", "ekf"]
)
def test_other_methods_take_closed_loops(problem, made, name):
    found, truth = pv.identify(problem, name), made[1].truth
    heaviest = found.names.index("mxr[left_elbow]")
    assert found.theta[heaviest] == pytest.approx(truth["mxr[left_elbow]"], rel=0.05)


def test_passive_joints_have_parameters_but_no_motor(robot, results):
    found = results["piv"]
    assert "fv[left_elbow]" in found.names
    assert not any(name.startswith(f"ia[{joint}") for joint in PASSIVE for name in found.names)
    assert [fit.name for fit in found.joints] == ["left", "right"]
    text = found.summary()
    assert "fv[left_elbow]" in text
    assert "left: fv dq" not in text
    assert "left, right: fv dq + fc" in text and "left_elbow: fv dq" in text
    assert "fv[left_elbow]" in found._repr_html_()
    shown = robot_html(robot)
    assert shown.count(", passive</td>") == 2
    assert "and 2 passive ones" in shown


def test_tables_give_parameters_their_own_joint(robot, results):
    columns = identification_parameters(results["piv"]).columns
    own = dict(zip(columns["parameter"], columns["joint"], strict=True))
    assert own["fv[left_elbow]"] == "left_elbow"
    assert own["zzr[right]"] == "right"
    assert all(f"[{joint}]" in name for name, joint in own.items())
    nominal = robot_parameters(robot).columns
    assert all(f"[{j}]" in n for n, j in zip(nominal["parameter"], nominal["joint"], strict=True))
    joints = robot_joints(robot).columns
    rotors = dict(zip(joints["joint"], joints["rotor_inertia"], strict=True))
    assert rotors["left"] == 0.03
    assert {name for name, rotor in rotors.items() if np.isnan(rotor)} == PASSIVE
    assert dict(zip(joints["joint"], joints["hangs_on"], strict=True)) == {
        "left": "base", "left_elbow": "left_crank", "right": "base", "right_elbow": "right_crank"
    }  # fmt: skip


def test_the_verdict_moves_motors_only(problem, results):
    diagnostics = pv.diagnose(problem, results, folds=0)
    found = pv.verdict(diagnostics)
    text = str(found)
    assert "fv[left_elbow]" in text
    law = next(s for s in found.statements if s.kind == "assumed law")
    assert "fv dq + fc" in law.message and ", fv dq" in law.message
    sentences = wanted_motions(results["piv"], results["piv"].names)
    assert sentences
    for sentence in sentences:
        asked = sentence.split(": ", 1)[1]
        assert not any(joint in asked for joint in PASSIVE)
        assert "left" in asked or "right" in asked


def test_an_identification_comes_back_from_its_file(results, tmp_path):
    found = results["piv"]
    save_identification(found, tmp_path / "piv")
    loaded = pv.load_identification(tmp_path / "piv")
    np.testing.assert_array_equal(loaded.theta, found.theta)
    assert loaded.expressions == found.expressions
    assert [j.name for j in loaded.robot.passive_joints] == ["left_elbow", "right_elbow"]
    q, still = np.radians([[140.0, 40.0], [150.0, 30.0]]), np.zeros((2, 2))
    expected = found.predict(q, still + 1.0, still + 2.0)
    np.testing.assert_allclose(loaded.predict(q, still + 1.0, still + 2.0), expected, rtol=1e-9)


def test_a_runnable_model_has_the_torques_of_the_estimate(results, tmp_path):
    model = runnable_model(results["piv"])
    q, still = np.radians([[140.0, 40.0], [150.0, 30.0]]), np.zeros((2, 2))
    expected = results["piv"].predict(q, still + 1.0, still + 2.0)
    np.testing.assert_allclose(model.torque(q, still + 1.0, still + 2.0), expected, atol=1e-9)
    (tmp_path / "model.json").write_bytes(to_json(model).content)
    again = read_model(tmp_path / "model.json")
    np.testing.assert_array_equal(again.values, model.values)
    np.testing.assert_allclose(again.torque(q, still, still), model.torque(q, still, still))


def test_the_moving_picture_closes_the_loop(results):
    found = results["piv"]
    values = motion_values(found.robot, found.recordings)
    assert [joint["name"] for joint in values["joints"]] == [
        "left", "left_elbow", "right", "right_elbow"
    ]  # fmt: skip
    q = np.array(values["recordings"][0]["q"])
    for k in range(0, q.shape[1], 100):
        gap, _ = equations(found.robot.tree, found.robot.constraints, q[:, k])
        assert np.abs(gap).max() < 1e-3  # positions of four digits
    assert CLOSED < 1e-3


def test_the_report_is_written(results, tmp_path):
    page = tmp_path / "report.html"
    pv.write_report([results["ls"], results["piv"]], page)
    assert "fv[left_elbow]" in page.read_text(encoding="utf-8")


def test_results_of_the_same_mechanism_are_compared(results):
    compared = pv.compare([results["ls"], results["piv"]])
    assert "fv[left_elbow]" in str(compared)


def test_other_loops_are_another_geometry(robot):
    assert difference_of_geometry(robot, robot) == ""
    assert difference_of_geometry(robot, robot.tree) == "2 and 4 joints"
    closure = robot.constraints.closures[0]
    first, second = closure.frames
    moved = replace(closure, frames=(first, replace(second, translation=second.translation * 1.01)))
    other = closed_robot(robot.tree, robot.joint_names, [moved], posture=robot.constraints.posture)
    assert difference_of_geometry(robot, other) == "the loop tip closes elsewhere"


def test_torques_of_the_other_sign_are_found(robot, made):
    recording = made[1].recording
    turned = replace(recording, tau=-recording.tau)
    problem = pv.Problem(robot, (turned,))
    found = pv.identify(problem, "ls")
    assert any(w.kind == "all reversed" for w in found.warnings)


def test_friction_of_a_joint_that_is_not_there_is_refused(robot):
    with pytest.raises(RobotDescriptionError, match="elbow"):
        robot.with_friction({"elbow": FrictionLaw((viscous(),))})


def test_links_without_a_body_have_no_parameters_but_a_place_in_models():
    delta = pv.load_robot("delta")
    model = runnable_model(delta)
    bare = [i for i, link in enumerate(delta.tree.links) if not link.is_body]
    assert bare
    assert all(np.all(model.inertial(i) == 0.0) for i in bare)
    assert isinstance(delta.tree.links[bare[0]], Link)
