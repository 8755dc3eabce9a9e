"""From a folder of logs to alarms: wear found, nothing computed twice, nothing lost."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import polars as pl
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.studies.many.fleet import identify_fleet as module
from pivident.studies.many.fleet.conclusion import ALARMS, PARAMETERS, conclude_fleet
from pivident.studies.many.fleet.identify_fleet import (
    FleetError,
    OtherFleet,
    identify_fleet,
    identify_log,
)
from pivident.studies.many.fleet.judgement import judge
from tests.studies.many.fleet.planar_fleet import TEMPLATE, WARMTH, write_fleet

ROBOTS, WORN = 6, {"arm_2": 1.1}


pytestmark = pytest.mark.usefixtures("without_plotly")


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Logs, and in ``out`` what was identified from them."""
    folder = tmp_path_factory.mktemp("fleet") / "arms"
    write_fleet(folder, robots=ROBOTS, worn=WORN)
    identified(folder)
    return folder.parent


@pytest.fixture
def folder(original, tmp_path):
    """Logs that have been identified."""
    shutil.copytree(original, tmp_path, dirs_exist_ok=True)
    return tmp_path / "arms"


@pytest.fixture
def fresh(original, tmp_path):
    """Logs that have not been identified."""
    return shutil.copytree(original / "arms", tmp_path / "arms")


@pytest.fixture
def computed(monkeypatch):
    """Names of the logs that are identified."""
    names = []

    def counting(task, log):
        names.append(log.name)
        return identify_log(task, log)

    monkeypatch.setattr(module, "identify_log", counting)
    return names


def identified(folder, **options):
    with ThreadPoolExecutor(1) as executor:
        return identify_fleet(
            folder, out=folder.parent / "out", executor=executor, workers=1, **options
        )


def test_wear_is_found_apart_from_warmth_and_nothing_else_is(folder):
    fleet = identified(folder)
    judgement = conclude_fleet(fleet)
    assert {a.robot for a in judgement.alarms} == {"arm_2"}
    assert {a.time for a in judgement.alarms} == {"2026-03-04"}
    assert {a.parameter for a in judgement.alarms} == {"fv1", "fc1", "fv2", "fc2"}
    for alarm in judgement.alarms:
        low, high = alarm.relative[1:]
        assert low < 0.11 and high > 0.09 and alarm.joint in ("shoulder", "elbow")
    wear = {w.parameter: w for w in judgement.wear}
    for name in ("fv1", "fv2"):
        assert wear[name].temperature.value / wear[name].level == pytest.approx(WARMTH, rel=0.1)
        assert wear[name].temperature.high < 0
    content = json.loads((folder.parent / "out" / ALARMS).read_text())
    assert [a["robot"] for a in content["alarms"]] == ["arm_2"] * 4
    assert "at most 5 %" in content["promise"] and content["level"] == 0.05
    assert content["tests"] == 2 * 2 * 4 * ROBOTS


def test_the_table_has_a_row_for_each_log_and_parameter(folder):
    fleet = identified(folder)
    conclude_fleet(fleet)
    table = pl.read_parquet(folder.parent / "out" / PARAMETERS)
    assert table.columns[:6] == ["task", "robot", "day", "time", "position", "log"]
    parameters = table["parameter"].n_unique()
    assert len(table) == 5 * ROBOTS * parameters
    first = table.row(0, named=True)
    assert (first["robot"], first["time"], first["log"]) == (
        "arm_1",
        "2026-03-01",
        "2026-03-01.npz",
    )
    assert len(first["sha256"]) == 64 and first["method"] == "ls" and first["std"] > 0
    assert 10 < first["temperature"] < 50


def test_only_new_and_changed_logs_are_identified(folder, computed):
    before = identified(folder)
    assert computed == []
    shutil.copy(folder / "arm_1/2026-03-02.npz", folder / "arm_1/2026-03-06.npz")
    shutil.copy(folder / "arm_4/2026-03-01.npz", folder / "arm_3/2026-03-01.npz")
    after = identified(folder)
    assert sorted(computed) == ["arm_1/2026-03-06", "arm_3/2026-03-01"]

    def value(fleet, task):
        rows = fleet.rows.filter(pl.col("task") == task)
        assert rows["parameter"].is_unique().all()
        return rows["value"].to_list()

    assert value(after, "arm_3/2026-03-01") == value(before, "arm_4/2026-03-01")
    assert value(after, "arm_5/2026-03-01") == value(before, "arm_5/2026-03-01")


def test_a_log_that_was_moved_away_is_in_no_table_and_comes_back_as_it_was(folder, computed):
    (folder / "arm_2/2026-03-05.npz").rename(folder.parent / "kept")
    assert "arm_2/2026-03-05" not in identified(folder).rows["task"]
    (folder.parent / "kept").rename(folder / "arm_2/2026-03-05.npz")
    assert "arm_2/2026-03-05" in identified(folder).rows["task"] and computed == []


def test_logs_that_fail_are_rows_and_the_others_go_on(folder):
    (folder / "arm_1/2026-03-05.npz").write_bytes(b"no archive")
    np.savez(folder / "arm_3/2026-03-05.npz", q=np.zeros((1000, 2)), tau=np.zeros((1000, 2)))
    fleet = identified(folder)
    failures = {row["task"]: row for row in fleet.failures.iter_rows(named=True)}
    assert set(failures) == {"arm_1/2026-03-05", "arm_3/2026-03-05"}
    assert "2026-03-05.npz" in failures["arm_1/2026-03-05"]["message"]
    assert failures["arm_3/2026-03-05"]["error"] == "UnknownColumn"
    assert "fleet.toml: [recording]" in failures["arm_3/2026-03-05"]["message"]
    judgement = judge(fleet)
    assert {a.robot for a in judgement.alarms} == {"arm_2"}
    assert judgement.notes[0].startswith("2 of 30 logs gave no estimate")


def test_several_runs_of_a_day_are_one_problem(fresh):
    folder = fresh
    for day in ("01", "02"):
        place = folder / "arm_1" / day
        place.mkdir()
        for run in ("1", "2"):
            shutil.copy(folder / f"arm_1/2026-03-{day}.npz", place / f"{run}.npz")
    text = TEMPLATE.replace('"{robot}/{day}.npz"', '"{robot}/{day}/{run}.npz"')
    text += 'together = ["robot", "day"]\n'
    (folder / "fleet.toml").write_text(text, encoding="utf-8")
    fleet = identified(folder)
    assert fleet.rows["error"].null_count() == len(fleet.rows)
    assert set(fleet.rows["samples"]) == {2000} and fleet.rows["task"].n_unique() == 2


def test_a_killed_fleet_goes_on_where_it_was(folder, tmp_path):
    """SIGKILL of the process in the middle: what is on disk stays, the rest is computed."""
    whole = identified(folder).rows
    out = tmp_path / "killed"
    script = tmp_path / "fleet.py"
    script.write_text(
        f"""
from pivident.studies.many.batch import runner
from pivident.studies.many.fleet.identify_fleet import identify_fleet
runner.PORTION = 1
if __name__ == "__main__":
    identify_fleet({str(folder)!r}, out={str(out)!r}, workers=1)
"""
    )
    process = subprocess.Popen([sys.executable, str(script)], stderr=subprocess.PIPE)
    limit = time.monotonic() + 120
    while len(list(out.glob("logs/*.parquet"))) < 2 and time.monotonic() < limit:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    with ThreadPoolExecutor(1) as executor:
        again = identify_fleet(folder, out=out, executor=executor, workers=1)
    columns = ["task", "parameter", "value", "std", "sha256", "error"]
    order = ["task", "parameter"]
    assert again.rows.select(columns).sort(order).equals(whole.select(columns).sort(order))
    shards = pl.concat([pl.read_parquet(f) for f in out.glob("logs/*.parquet")])
    assert shards.select(order).is_unique().all()


def test_a_worker_that_dies_each_time_is_a_row_and_tried_again(folder, computed):
    from contextlib import contextmanager

    victim = folder / "arm_1/2026-03-01.npz"
    shutil.copy(folder / "arm_3/2026-03-01.npz", victim)

    class Fragile:
        workers = 1

        @contextmanager
        def __call__(self):
            from concurrent.futures import Future
            from concurrent.futures.process import BrokenProcessPool

            class Pool:
                def submit(pool, work, task, log):
                    future = Future()
                    if log.name == "arm_1/2026-03-01":
                        future.set_exception(BrokenProcessPool("a worker died"))
                    else:
                        future.set_result(identify_log(task, log))
                    return future

            yield Pool()

    fleet = identify_fleet(folder, out=folder.parent / "out", pool=Fragile())
    assert fleet.failures["task"].to_list() == ["arm_1/2026-03-01"]
    assert fleet.failures["error"].to_list() == ["WorkerLost"]
    assert fleet.rows["task"].n_unique() == 5 * ROBOTS
    assert len(identified(folder).failures) == 0
    assert computed == ["arm_1/2026-03-01"]


def test_another_template_does_not_write_into_the_folder(folder):
    path = folder / "fleet.toml"
    path.write_text(TEMPLATE.replace("kp = [6000, 2500]", "kp = [6000, 2400]"))
    with pytest.raises(OtherFleet, match=r"results of another fleet \(controller\.kp"):
        identified(folder)


def test_what_is_watched_and_tolerated_may_change(folder, computed):
    text = TEMPLATE + 'watch = ["fc1", "zz1r"]\nlevel = 0.01\nbaseline_records = 2\n'
    (folder / "fleet.toml").write_text(text)
    judgement = judge(identified(folder))
    assert computed == []
    assert [b.series[0].parameter for b in judgement.baselines] == ["zz1r", "fc1"]
    assert judgement.tests == 2 * 3 * 2 * ROBOTS


def test_robots_can_be_compared_with_each_other(folder):
    text = TEMPLATE + 'baseline = "fleet"\nbaseline_records = 1\n'
    (folder / "fleet.toml").write_text(text)
    judgement = judge(identified(folder))
    assert len(judgement.charts) == ROBOTS * 4 and judgement.charts[0].first == 0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'method = "ls"',
            'method = "lss"',
            r"fleet\.toml: \[fleet\] there is no method 'lss'.*'ls'",
        ),
        ('method = "ls"', "levl = 0.1", r"fleet\.toml: \[fleet\] unknown key 'levl'.*'level'"),
        ('method = "ls"', "level = 2", r"fleet\.toml: \[fleet\] key 'level' = 2"),
        ('method = "ls"', "baseline_records = 1", r"baseline_records = 1 does not give"),
        ("[recording]", '[recording]\ndataset = "emps"', "dataset"),
        ("{robot}/{day}.npz", "{robot}_{day}.npz", r"fleet\.toml: .*arm_1/2026-03-01\.npz"),
        ('"celsius"', '["a", "b"]\ntogether = ["day"]', "different robots"),
        ("rate = 500", 'rate = 500\nfiles = "{robot}.npz"', "both given and differ"),
        ("[controller]", "[contrller]", r"fleet\.toml: unknown table 'contrller'"),
    ],
)
def test_templates_that_cannot_work_name_file_and_key(fresh, old, new, said):
    assert old in TEMPLATE
    (fresh / "fleet.toml").write_text(TEMPLATE.replace(old, new))
    with pytest.raises(ExperimentError, match=said):
        identified(fresh)


def test_a_parameter_that_is_none_is_named(folder):
    (folder / "fleet.toml").write_text(TEMPLATE + 'watch = ["fv9"]\n')
    with pytest.raises(FleetError, match="no parameter 'fv9'"):
        judge(identified(folder))


def test_a_folder_without_template_says_what_to_write(tmp_path):
    with pytest.raises(ExperimentError, match=r"no fleet\.toml.*--experiment"):
        identify_fleet(tmp_path)
    with pytest.raises(ExperimentError, match="is not a folder"):
        identify_fleet(tmp_path / "none")
