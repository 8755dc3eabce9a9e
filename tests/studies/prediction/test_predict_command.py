"""`pivident predict`: results from their files, new logs as the result's own logs were read."""

import csv
import json
import os

import numpy as np
import pytest

import pivident as pv
from pivident.app.cli import main
from pivident.dynamics.regressor import Regressor
from pivident.judgement.validation.held_out.held_out_errors import ALL_JOINTS
from pivident.models.model_json import to_json
from pivident.studies.prediction.new_logs import new_logs, stored_result
from tests import bags
from tests.planar_arm import nominal_parameters
from tests.planar_log import EXPERIMENT, HEADER, RATE, planar_log, write_experiment
from tests.questions.material import URDF


def run(*tokens: object) -> int:
    return main([str(token) for token in tokens])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of two methods, and a log of another motion in the units of the first one."""
    folder = tmp_path_factory.mktemp("predict")
    experiment = write_experiment(folder, EXPERIMENT + "[validation]\nfolds = 3\n")
    assert run("identify", experiment, "-m", "ls,piv", "--out", folder / "out") == 0
    write_new_log(folder / "new.csv")
    return folder


def new_motion():
    """Time, positions [rad], torques [N m] of a motion that was not identified from."""
    table = planar_log(5000, seed=11)
    return table[:, 0], np.deg2rad(table[:, 1:3]), table[:, 5:7]


def write_new_log(path, columns=("time", "q1", "q2", "tau1", "tau2")):
    known = dict(zip(HEADER.split(","), planar_log(5000, seed=11).T, strict=True))
    table = np.column_stack([known[name.removeprefix("x_")] for name in columns])
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
    return path


def truth_of(q, dq, ddq):
    base, values = nominal_parameters()
    return Regressor.build(base.robot, base.parameters).torque(q, dq, ddq, values)


def test_a_new_log_is_read_as_those_of_the_result(folder, capsys):
    """Degrees and columns come from the result; the errors follow from log and truth."""
    out = folder / "new_out.csv"
    assert run("predict", folder / "out" / "piv", folder / "new.csv", "--csv", out) == 0
    printed = capsys.readouterr().out
    assert "new.csv was read as the logs of the result were" in printed
    with out.open() as file:
        head = next(csv.reader(file))
    assert head == [
        "t [s]", "q_shoulder [rad]", "tau_shoulder [N m]", "tau_model_shoulder [N m]",
        "q_elbow [rad]", "tau_elbow [N m]", "tau_model_elbow [N m]",
    ]  # fmt: skip
    table = np.loadtxt(out, delimiter=",", skiprows=1)
    _, q, tau = new_motion()
    rows = np.round(table[:, 0] * RATE).astype(int)
    np.testing.assert_allclose(table[:, [1, 4]], q[rows], atol=2e-5)
    # an applied torque is logged at the beginning of its interval; it is compared at instants
    middle = 0.5 * (tau[rows] + tau[rows - 1])
    assert np.abs(table[:, [2, 5]] - middle).max() < 0.02 * np.abs(tau).max()
    new = next(iter(new_logs(folder / "new.csv", stored_result(folder / "out" / "piv"))))
    found = stored_result(folder / "out" / "piv").predict(new.recording)
    exact = truth_of(found.q, found.dq, found.ddq)
    np.testing.assert_allclose(found.tau_model, exact, atol=0.02 * np.abs(exact).max())
    assert f"{found.error.errors.total_in_band:.2g} %" in printed


def test_held_out_errors_of_the_verdict_stand_beside(folder, capsys):
    stored = stored_result(folder / "out")  # the method that the verdict recommends
    assert stored.file.parent.name == json.loads((folder / "out/verdict.json").read_text())["name"]
    assert run("predict", folder / "out", folder / "new.csv") == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert stored.held_out.where == "3 held-out blocks" in printed
    then = stored.held_out.moving[ALL_JOINTS]
    assert "held out %" in printed and f"it was {then.value:.2g} % on 3 held-out" in printed
    content = json.loads((folder / "out/verdict.json").read_text("utf-8"))["held_out"]
    assert set(content) == {"ls", "piv"} and set(content["ls"]["joints"]) == {"shoulder", "elbow"}


def test_result_files_of_every_kind(folder, tmp_path, capsys):
    consistent = tmp_path / "c"
    assert run("consistent", folder / "out" / "piv", "--out", consistent) == 0
    model = tmp_path / "model.json"
    model.write_bytes(to_json(pv.models.runnable_model(pv.load_robot("planar_2r"))).content)
    free = pv.load_identification(folder / "out" / "piv")
    assert free.readings[0]["units"]["q"] == "deg" and free.fitted_range.speed.shape == (2,)
    capsys.readouterr()
    for result in (consistent / "consistent.json", model, "planar_2r"):
        assert (
            run("predict", result, folder / "new.csv", "--experiment", folder / "experiment.toml")
            == 0
        )
        printed = capsys.readouterr().out
        assert "new.csv was read as experiment.toml says" in printed
        # the gallery's values are the simulated truth
        share = float(printed.split("below 20 Hz is ")[1].split(" %")[0])
        assert share < 0.2
    assert "by nominal values" in printed


def test_a_log_without_torque_is_predicted(folder, tmp_path, capsys):
    log = write_new_log(tmp_path / "q.csv", ("time", "q1", "q2"))
    out, page = tmp_path / "p.csv", tmp_path / "p.html"
    assert run("predict", folder / "out", log, "--csv", out, "--html", page) == 0
    assert "It has no torque (no tau1): nothing is compared." in capsys.readouterr().out
    assert out.read_text().startswith("t [s],q_shoulder [rad],tau_model_shoulder [N m],q_elbow")
    with_torque = tmp_path / "w.csv"
    assert run("predict", folder / "out", folder / "new.csv", "--csv", with_torque) == 0
    columns = np.loadtxt(with_torque, delimiter=",", skiprows=1)
    alone = np.loadtxt(out, delimiter=",", skiprows=1)
    rows = np.isin(np.round(columns[:, 0], 6), np.round(alone[:, 0], 6))
    near = np.isin(np.round(alone[:, 0], 6), np.round(columns[:, 0], 6))
    np.testing.assert_allclose(alone[near][:, [2, 4]], columns[rows][:, [3, 6]], atol=1e-6)
    assert "nothing is compared" in page.read_text("utf-8")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (("time", "q1", "tau1", "tau2"), "no column or array 'q2'"),
        (("q1", "q2", "tau1", "tau2"), "no column or array 'time'"),
        (("time", "q1", "q2", "tau1", "x_tau2"), "no column or array 'tau2'; did you mean x_tau2"),
    ],
)
def test_missing_columns_are_named(folder, tmp_path, capsys, columns, message):
    log = write_new_log(tmp_path / "log.csv", columns)
    assert run("predict", folder / "out", log) == 1
    assert message in capsys.readouterr().err


def test_another_robot_or_a_misuse_is_refused(folder, tmp_path, capsys):
    other = tmp_path / "other.toml"
    other.write_text('robot = "emps"\n[recording]\ndataset = "emps"\n')
    assert run("predict", folder / "out", other) == 1
    assert "other.toml has the joints carriage, the result those" in capsys.readouterr().err
    assert run("predict", folder / "out", other, "--experiment", other) == 1
    assert "other.toml is an experiment file itself" in capsys.readouterr().err
    assert run("predict", tmp_path, folder / "new.csv") == 1
    assert "holds no identification.json and no verdict.json" in capsys.readouterr().err
    assert run("predict", folder / "out", tmp_path / "none.csv") == 1
    assert "none.csv" in capsys.readouterr().err
    assert run("predict", "emps", folder / "new.csv") == 1
    assert "no positions of carriage were recognised" in capsys.readouterr().err


def test_an_experiment_file_of_several_logs(folder, tmp_path, capsys):
    path = folder / "two.toml"
    runs = EXPERIMENT.split("[controller]")[0].split("[recording]")
    body = runs[1].replace('"log.csv"', '"new.csv"')
    once = body.replace(', q_ref = ["r1", "r2"]', "").replace(', q_ref = "deg"', "")
    path.write_text(f"{runs[0]}[[recording]]{runs[1]}[[recording]]{once}part = [1.0, 4.0]\n")
    page = tmp_path / "two.html"
    assert run("predict", folder / "out" / "ls", path, "--html", page) == 0
    printed = capsys.readouterr().out
    assert "Torques of log by IDIM-WLS" in printed and "Torques of new by IDIM-WLS" in printed
    assert "2.9 s of motion" in printed or "2.90 s of motion" in printed
    text = page.read_text("utf-8")
    assert 'id="errors-2"' in text and "new: Torques" in text
    assert run("predict", folder / "out" / "ls", path, "--csv", tmp_path / "x.csv") == 1
    assert "gives 2 recordings, and --csv takes one" in capsys.readouterr().err


def test_bags_with_and_without_efforts(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    store = bags.typestore("sqlite3")
    for name, seed, with_torque in (("run1", 2, True), ("run2", 11, True), ("run3", 11, False)):
        rows = planar_log(3000, seed=seed)[::2]
        torque = rows[:, 5:7] if with_torque else np.zeros((len(rows), 0))
        q = np.deg2rad(rows[:, 1:3])
        states = bags.joint_states(store, False, ["shoulder", "elbow"], rows[:, 0], q, torque)
        os.replace(bags.write_bag(tmp_path, "sqlite3", store, [states]), name)
    (tmp_path / "bag.toml").write_text(
        'robot = "planar_2r"\n[recording]\nfiles = "run1"\nresample = true\n'
        'columns = {q = "position", tau = "effort"}\n[identify]\nmethods = ["ls"]\n'
    )
    assert run("identify", "bag.toml", "--folds", 0, "--out", "out") == 0
    capsys.readouterr()
    assert run("predict", "out", "run2") == 0
    printed = capsys.readouterr().out
    assert float(printed.split("below 20 Hz is ")[1].split(" %")[0]) < 3.0
    assert run("predict", "out", "run3") == 0
    assert "It has no torque (no effort): nothing is compared." in capsys.readouterr().out
    assert run("predict", "planar_2r", "run2") == 0  # by the types of the messages
    assert "Columns were recognised by the types of the messages" in capsys.readouterr().out


def test_stamps_since_1970_keep_their_microseconds(folder, tmp_path):
    lines = (folder / "new.csv").read_text().splitlines()
    start, rows = 1763884800.25, [line.split(",") for line in lines[1:]]
    moved = [",".join([f"{start + float(row[0]):.6f}", *row[1:]]) for row in rows]
    (tmp_path / "epoch.csv").write_text("\n".join([lines[0], *moved]))
    out = tmp_path / "out.csv"
    assert run("predict", folder / "out", tmp_path / "epoch.csv", "--csv", out) == 0
    t = np.loadtxt(out, delimiter=",", skiprows=1, usecols=0)
    np.testing.assert_allclose(np.diff(t), 1.0 / RATE, atol=2e-6)
    assert t[0] > start


def test_the_folder_of_results_stands_for_what_its_verdict_recommends(folder, tmp_path, capsys):
    best = stored_result(folder / "out").file.parent
    for result, out in ((folder / "out", tmp_path / "a"), (best, tmp_path / "b")):
        assert run("consistent", result, "--out", out) == 0
        assert run("export", result, "--to", "json", "--out", out / "model.json") == 0
    for file in ("consistent.json", "model.json"):
        one, other = (json.loads((tmp_path / k / file).read_text("utf-8")) for k in "ab")
        assert {key for key in one if one[key] != other[key]} <= {"seconds"}, file
    (tmp_path / "none").mkdir()
    assert run("consistent", tmp_path / "none") == 1
    assert "holds no identification.json" in capsys.readouterr().err


def test_a_robot_without_rotors_and_friction_is_said_to_have_none(folder, tmp_path, capsys):
    urdf = tmp_path / "arm.urdf"
    assert run("export", folder / "out" / "piv", "--to", "urdf", "--out", urdf) == 0
    words = ["predict", urdf, folder / "new.csv", "--experiment", folder / "experiment.toml"]
    capsys.readouterr()
    assert run(*words) == 0
    assert "The model has no rotor inertias: the torque of the drives" in capsys.readouterr().out
    assert run("predict", "planar_2r", *words[2:]) == 0
    assert "no rotor inertias" not in capsys.readouterr().out


def test_a_band_that_is_named_bounds_the_compared_errors(folder, capsys):
    assert run("predict", folder / "out" / "piv", folder / "new.csv", "--band", 5) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "< 5 Hz %" in printed and "The torque error below 5 Hz is" in printed
    assert "held out %" not in printed  # those are below another frequency
    assert run("predict", folder / "out" / "piv", folder / "new.csv", "--band", 1e4) == 1
    assert "a band of 10000 Hz is not below" in capsys.readouterr().err


def test_a_robot_is_mounted_as_the_experiment_of_the_log_has_it(folder, tmp_path, capsys):
    """The planar arm's gravity is -y: with that of a floor, its torques are those of friction."""
    (tmp_path / "arm.urdf").write_text(URDF)
    write_new_log(tmp_path / "log.csv")
    text = write_experiment(tmp_path, EXPERIMENT).read_text()
    robot = 'robot = {model = "arm.urdf", gravity = [0, -9.81, 0], rotor_inertia = [0.25, 0.1]}'
    assert 'robot = "planar_2r"' in text
    errors = []
    for own in (robot, robot.replace("-9.81, 0]", "0, -9.81]")):
        file = tmp_path / "e.toml"
        file.write_text(text.replace('robot = "planar_2r"', own))
        stored = stored_result(tmp_path / "arm.urdf", file)
        new = next(iter(new_logs(tmp_path / "log.csv", stored, file)))
        errors.append(stored.predict(new.recording).error.errors.total_in_band)
        assert (
            run("predict", tmp_path / "arm.urdf", tmp_path / "log.csv", "--experiment", file) == 0
        )
        assert f"below 20 Hz is {errors[-1]:.2g} %" in capsys.readouterr().out
    assert errors[0] < 0.5 * errors[1]


def test_positions_and_torques_in_two_files(tmp_path, capsys):
    """Both have columns of the same names, as of the log that was identified."""
    write_new_log(tmp_path / "log.csv")
    table = np.loadtxt(tmp_path / "log.csv", delimiter=",", skiprows=1)
    for name, columns in (("q.csv", table[:, [0, 1, 2]]), ("tau.csv", table[:, [0, 3, 4]])):
        np.savetxt(tmp_path / name, columns, "%.9g", ",", header="time,j1,j2", comments="")
    (tmp_path / "e.toml").write_text(
        'robot = "planar_2r"\n[recording]\nfiles = {q = "q.csv", tau = "tau.csv"}\n'
        'columns = {t = {file = "q", columns = "time"}, q = ["j1", "j2"], tau = ["j1", "j2"]}\n'
        'units = {q = "deg"}\n'
    )
    assert run("identify", tmp_path / "e.toml", "-m", "ls", "--out", tmp_path / "out") == 0
    capsys.readouterr()
    both = f"q={tmp_path / 'q.csv'}", f"tau={tmp_path / 'tau.csv'}"
    assert run("predict", tmp_path / "out", *both) == 0
    printed = capsys.readouterr().out
    assert "q.csv, tau.csv were read as the logs of the result were" in printed
    assert float(printed.split("below 20 Hz is ")[1].split(" %")[0]) < 5.0
    assert run("predict", tmp_path / "out", tmp_path / "q.csv") == 1
    assert "name both files: q=q.csv" in capsys.readouterr().err
    assert run("predict", tmp_path / "out", tmp_path / "q.csv", tmp_path / "tau.csv") == 1
    assert "which channel is in which file?" in capsys.readouterr().err
