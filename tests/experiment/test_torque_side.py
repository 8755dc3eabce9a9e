"""The key torque_side: one word that takes rotors and drives out of the model."""

import numpy as np
import pytest

from pivident.app.cli.workflow import run_experiment
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError
from tests.planar_log import EXPERIMENT, write_experiment

LINK = EXPERIMENT.replace("[recording]", '[recording]\ntorque_side = "link"')
WITHOUT_LOOP = LINK.partition("[controller]")[0] + "\n[identify]\nmethods = ['ls']\n"


def load(folder, text):
    return load_experiment(write_experiment(folder, text))


def message(folder, text) -> str:
    with pytest.raises(ExperimentError) as caught:
        load(folder, text)
    return str(caught.value)


def with_robot(more: str) -> str:
    return WITHOUT_LOOP.replace('robot = "planar_2r"', f'robot = {{model = "planar_2r", {more}}}')


def test_rotors_and_drives_of_the_description_are_left_out(tmp_path):
    motors = load(tmp_path, EXPERIMENT).problem()
    experiment = load(tmp_path, WITHOUT_LOOP)
    links = experiment.problem()
    assert [n for n in motors.base.standard if n.stem == "ia"]
    assert not [n for n in links.base.standard if n.stem == "ia"]
    assert not links.robot.rotor_inertia.any() and links.robot.friction_nominal == {}
    assert links.recordings[0].torque_side == "link" and experiment.has_open_friction


def test_friction_of_the_file_is_the_users_choice(tmp_path):
    chosen = load(tmp_path, with_robot('friction = ["viscous"]'))
    assert {str(j.friction) for j in chosen.robot.joints} == {"fv dq"}
    assert not chosen.has_open_friction
    none = load(tmp_path, with_robot("friction = []"))
    assert {str(j.friction) for j in none.robot.joints} == {"none"}
    single = load(tmp_path, with_robot('joint_friction = {2 = ["offset"]}'))
    assert [str(j.friction) for j in single.robot.joints][1] == "off"


def test_rotors_of_the_file_are_left_out_too(tmp_path):
    robot = load(tmp_path, with_robot("rotor_inertia = [0.4, 0.1]")).robot
    assert np.array_equal(robot.rotor_inertia, [0.0, 0.0])


def test_a_law_of_the_motors_is_refused(tmp_path):
    said = message(tmp_path, LINK)
    assert "a pd law drives the motors" in said and "from the record itself" in said
    declared = LINK.replace('type = "pd"\nkp = [6000, 2500]\nkd = [180, 60]', 'type = "virtual_pd"')
    assert load(tmp_path, declared).problem().loop is not None


def test_all_runs_measure_the_same(tmp_path):
    run = EXPERIMENT.partition("[recording]")[2].partition("[controller]")[0]
    said = message(tmp_path, f"{WITHOUT_LOOP}\n[[validation.recording]]\n{run}")
    assert "torque_side of the first recording is 'link'" in said
    assert "[[validation.recording]] 'motor'" in said
    whole = f'{WITHOUT_LOOP}\n[[validation.recording]]\ntorque_side = "link"\n{run}'
    assert load(tmp_path, whole).unseen_recordings()[0].torque_side == "link"


def test_an_unknown_side_is_refused(tmp_path):
    assert "'torque_side' = 'joint'" in message(tmp_path, LINK.replace('"link"', '"joint"'))


def test_identify_prints_and_writes_what_was_decided(tmp_path, capsys):
    path = write_experiment(tmp_path, WITHOUT_LOOP)
    outcome = run_experiment(path, ["ls"], tmp_path / "results", folds=0, details=True)
    (result,) = outcome.identifications.values()
    kinds = [w.kind for w in result.warnings if w.topic == "torque side"]
    assert kinds == ["link", "bearings"]
    printed = capsys.readouterr().out
    assert "sensors behind the gears" in printed and "Friction of the bearings" in printed
    report = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "sensors behind the gears" in report and "Friction of the bearings" in report
    assert "torque side" in (tmp_path / "results" / "verdict.json").read_text(encoding="utf-8")
