"""``pivident study`` from the command line: results, errors in one line, interruption."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from pivident.app.cli import main
from pivident.studies.many.batch import runner
from tests.interrupts import heed_ctrl_c
from tests.studies.many.study.small import TEXT


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs without worker processes: the command is tested here, not the pool."""
    from concurrent.futures import ThreadPoolExecutor

    class Pool(runner.GivenExecutor):
        def __init__(self, workers=None):
            super().__init__(ThreadPoolExecutor(1), 1)

    monkeypatch.setattr(runner, "Processes", Pool)


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_a_study_ends_with_summary_and_report(scenario, tmp_path, capsys, in_this_process):
    out = tmp_path / "out"
    assert main(["study", str(scenario), "--runs", "4", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "iv-full-rate" in said.out and str(out / "report.html") in said.out
    assert "4 of 4 runs" in said.err and "4 of 4" not in said.out
    summary = json.loads((out / "summary.json").read_text())
    assert summary["methods"]["ls"]["runs"] == 4
    assert (out / "report.html").read_text().startswith("<!doctype html>")
    before = (out / "summary.json").read_text()
    assert main(["study", str(scenario), "--runs", "4", "--out", str(out)]) == 0
    assert (out / "summary.json").read_text() == before


def test_conditions_have_folders_of_their_own(tmp_path, capsys, in_this_process):
    varied = (
        TEXT + "\n[vary.noise]\nlow = {noise = {torque = 0.01}}\nhigh = {noise = {torque = 1.0}}\n"
    )
    (tmp_path / "arm.toml").write_text(varied, encoding="utf-8")
    out = tmp_path / "out"
    assert main(["study", str(tmp_path / "arm.toml"), "--runs", "3", "--out", str(out)]) == 0
    conditions = json.loads((out / "summary.json").read_text())["conditions"]
    low, high = (conditions[name]["methods"]["iv-full-rate"] for name in ("low", "high"))
    assert low["median_relative_error"] < 0.2 * high["median_relative_error"]
    assert (out / "high" / "report.html").is_file()
    only = tmp_path / "only"
    command = ["study", str(tmp_path / "arm.toml"), "--runs", "2", "--out", str(only)]
    assert main([*command, "--condition", "lo*"]) == 0
    assert sorted(p.name for p in only.iterdir()) == ["low", "report.html", "summary.json"]


def test_an_optimised_motion_is_kept_with_the_results(tmp_path, in_this_process, monkeypatch):
    from pivident.loop.simulation import excitation

    search = excitation.optimised_series
    monkeypatch.setattr(
        excitation, "optimised_series", lambda *a, **k: search(*a, **k, evaluations=150)
    )
    old = "duration = 2.0\nseed = 2\nreach = 1.5"
    new = 'type = "fourier"\nduration = 2.0\nfrequency = 0.5\nharmonics = 3\nacceleration = 40.0'
    assert old in TEXT
    (tmp_path / "arm.toml").write_text(TEXT.replace(old, new), encoding="utf-8")
    out = tmp_path / "out"
    command = ["study", str(tmp_path / "arm.toml"), "--out", str(out), "--runs"]
    assert main([*command, "2"]) == 0
    kept = json.loads((out / "trajectory.json").read_text())
    assert kept["cost"] > 0 and len(kept["a"]) == 2
    monkeypatch.setattr(excitation, "optimised_series", None)  # not searched for again
    from pivident.studies.many.study import scenario_tables

    monkeypatch.setattr(scenario_tables, "_found", {})
    assert main([*command, "3"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fin"], "there is no scenario 'fin'; did you mean 'fine'"),
        (["nowhere.toml"], "nowhere.toml: cannot be read"),
        (["fine", "--runs", "0"], "--runs is 0; at least 1"),
        (["fine", "--out", "/dev/null/x"], "is a file; choose another --out"),
        (["fine", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "leave --workers out"),
        (["birdy", "--condition", "tx40"], "no condition 'tx40'"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_one(arguments, message, capsys):
    assert main(["study", *arguments]) == 1
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def test_an_unreachable_scheduler_is_one_line(scenario, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    from pivident.studies.many.batch import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    out = tmp_path / "out"
    command = ["study", str(scenario), "--out", str(out), "--scheduler", "tcp://127.0.0.1:1"]
    assert main(command) == 1
    assert "there is no Dask scheduler at tcp://127.0.0.1:1" in capsys.readouterr().err
    assert not list(out.glob("runs/*"))


def test_the_folder_of_another_scenario_is_refused(scenario, tmp_path, capsys, in_this_process):
    out = tmp_path / "out"
    assert main(["study", str(scenario), "--runs", "2", "--out", str(out)]) == 0
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    scenario.write_text(TEXT.replace("torque = 0.05", "torque = 0.5"), encoding="utf-8")
    assert main(["study", str(scenario), "--runs", "2", "--out", str(out)]) == 1
    error = capsys.readouterr().err
    assert "runs of another scenario (noise.torque: 0.5 here, 0.05 there)" in error
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before


def test_ctrl_c_keeps_finished_runs_and_says_how_to_go_on(scenario, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "pivident", "study", str(scenario), "--workers", "1"]
    process = subprocess.Popen(
        [*command, "--runs", "100000", "--out", str(out)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PIVIDENT_DEBUG": ""},
        start_new_session=True,
        preexec_fn=heed_ctrl_c,
    )
    limit = time.monotonic() + 120
    while not list(out.glob("runs/*.parquet")) and time.monotonic() < limit:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: workers get it too
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "the same command continues there" in error and "Traceback" not in error
    from pivident.studies.many.study.run import Store

    assert Store(out).rows()["error"].null_count() == len(Store(out).rows()) > 0


def test_a_study_without_any_estimate_says_so(scenario, tmp_path, capsys, in_this_process):
    backwards = "kd = [180, 60]\ndrive_gain = [-1, 1]"
    scenario.write_text(TEXT.replace("kd = [180, 60]", backwards), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["study", str(scenario), "--runs", "2", "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert "ls: 2 run(s) ended with SimulationDiverged" in said.out
    assert "no run gave an estimate" in said.err
    assert json.loads((out / "summary.json").read_text())["methods"]["ls"]["failed"] == 2
