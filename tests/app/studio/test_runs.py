"""Runs of projects: their order, their end, and what is left of them."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from pivident.app.studio.run_folder import RunError
from pivident.app.studio.step_arguments import StepError
from tests.app.studio.projects import (
    EXPERIMENT,
    WAITS,
    WRITES,
    ended,
    entry,
    make_project,
    wait_for,
)
from tests.planar_log import EXPERIMENT as PLANAR, write_experiment

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals and locks of POSIX")


@pytest.fixture
def project(tmp_path, quick):
    return make_project(tmp_path / "elbow_1")


def processes_in(folder: Path) -> list[psutil.Process]:
    """Processes whose working folder it is."""
    return [p for p in psutil.process_iter(["cwd"]) if p.info["cwd"] == str(folder)]


def names(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def test_a_run_is_listed_with_all_that_it_left(project, runs):
    run = runs.add(project, "identify", {"method": ["ls", "piv"], "folds": 3})
    assert run == "001"
    found = ended(runs, project, run)
    assert found["state"] == "done" and found["code"] == 0 and found["message"] == ""
    assert found["step"] == "identify" and found["title"] == "Identify"
    command = "identify experiment.toml --method ls,piv --folds 3 --out results/001-identify"
    assert found["command"] == f"pivident {command}"
    assert found["created"] <= found["started"] <= found["ended"]
    assert found["results"] == "results/001-identify" and found["methods"] == ["ls", "piv"]
    sizes = {file["path"]: file["bytes"] for file in found["files"]}
    assert sizes.keys() == {"identification.json", "experiment.toml", "output.txt", "run.json"}
    kept = (project / "results" / "001-identify" / "experiment.toml").read_bytes()
    assert kept == EXPERIMENT.encode() and sizes["experiment.toml"] == len(kept)
    # What was run is a copy beside the experiment file, which is gone now.
    assert (project / "ran").read_text().startswith("identify .experiment-001.toml --method ls,piv")
    assert not list(project.glob(".experiment-*"))


def test_the_experiment_is_that_of_the_time_when_the_run_was_added(project, runs):
    (project / "script.py").write_text(
        WRITES + WAITS + "print(open(argv[1]).read(), argv[1])\nsys.stdout.flush()\n"
    )
    first = runs.add(project, "identify", {})
    second = runs.add(project, "identify", {})
    (project / "experiment.toml").write_text('robot = "changed"\n')
    third = runs.add(project, "identify", {})
    (project / "go").touch()
    outputs = [ended(runs, project, run)["output"] for run in (first, second, third)]
    assert ["planar_2r" in text for text in outputs] == [True, True, False]
    assert ["changed" in text for text in outputs] == [False, False, True]
    # The title of pages is the project's with the run; the name of the copy is nobody's concern.
    for k, text in enumerate(outputs, 1):
        assert f'title = "elbow 1, run 00{k}"' in text and text.endswith("experiment.toml\n")
    assert not any(".experiment-" in text for text in outputs)
    shas = [entry(runs, project, run)["experiment"] for run in (first, second, third)]
    assert shas[0] == shas[1] != shas[2]


def test_runs_take_turns_in_the_order_in_which_they_were_added(tmp_path, quick, runs):
    folders = [make_project(tmp_path / name, WRITES + WAITS) for name in ("b", "a")]
    order = [folders[0], folders[1], folders[0]]
    numbers = [runs.add(folder, "identify", {}) for folder in order]
    assert numbers == ["001", "001", "002"]
    wait_for((folders[0] / "begun").exists)
    assert not (folders[1] / "ran").exists()
    for folder in folders:
        (folder / "go").touch()
    found = [ended(runs, f, n) for f, n in zip(order, numbers, strict=True)]
    starts = [one["started"] for one in found]
    ends = [one["ended"] for one in found]
    assert starts == sorted(starts) and all(e <= s for e, s in zip(ends, starts[1:], strict=False))
    assert [e["id"] for e in runs.listed(folders[0])] == ["002", "001"]


def test_as_many_as_allowed_run_at_once_in_ten_projects(tmp_path, quick, make_runs):
    runs = make_runs(3)
    folders = [make_project(tmp_path / f"p{k}", WRITES + WAITS) for k in range(10)]
    for folder in folders:
        runs.add(folder, "identify", {})

    def states():
        return [runs.listed(folder)[0]["state"] for folder in folders]

    wait_for(lambda: states().count("running") == 3)
    wait_for(lambda: sum((f / "begun").exists() for f in folders) == 3)
    assert states().count("waiting") == 7
    most = 3
    for folder in folders:
        (folder / "go").touch()
    while (now := states()).count("done") < 10:
        most = max(most, now.count("running"))
        time.sleep(0.02)
    assert most == 3


def test_a_waiting_run_that_is_cancelled_never_runs(project, runs):
    (project / "script.py").write_text(WRITES + WAITS)
    first, second = runs.add(project, "identify", {}), runs.add(project, "identify", {})
    runs.cancel(project, second)
    assert entry(runs, project, second)["state"] == "cancelled"
    (project / "go").touch()
    ended(runs, project, first)
    assert len((project / "ran").read_text().splitlines()) == 1
    assert not (project / "results" / "002-identify").exists()


def test_a_command_that_does_not_listen_is_killed(project, runs):
    stubborn = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    forks = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; "
    forks += "time.sleep(1000)', 'child of pivident'])\n"
    (project / "script.py").write_text(stubborn + forks + "import os\n" + WAITS)
    (project / "hurry").touch()
    run = runs.add(project, "identify", {})
    wait_for((project / "begun").exists)
    begin = time.monotonic()
    runs.cancel(project, run)
    found = ended(runs, project, run)
    assert found["state"] == "cancelled" and "killed" in found["message"]
    # it had its ten seconds, by a clock that is ten times as fast
    assert time.monotonic() - begin >= 1.0
    wait_for(lambda: processes_in(project) == [])


def test_what_is_best_so_far_counts_as_done(project, runs):
    """As `excite` does it: interrupted, it writes what it has and ends with 0."""
    text = WAITS.replace("while", "try:\n  while").replace("    time", "      time")
    text = "import os\n" + text + "\nexcept KeyboardInterrupt:\n    pass\n" + WRITES
    (project / "script.py").write_text(text)
    run = runs.add(project, "excite", {"seconds": 600})
    wait_for((project / "begun").exists)
    runs.cancel(project, run)
    found = ended(runs, project, run)
    assert found["state"] == "done" and found["results"] == "results/001-excite"


def test_a_failure_has_its_message_and_no_results(project, runs):
    bad = "import sys; print('error: \\x1b[1m.experiment-001.toml: no such log', file=sys.stderr)"
    (project / "script.py").write_text(bad + "; print('bye', file=sys.stderr); sys.exit(1)")
    found = ended(runs, project, runs.add(project, "identify", {}))
    assert found["state"] == "failed" and found["code"] == 1
    assert found["message"] == "error: experiment.toml: no such log"
    assert found["results"] == "" and not (project / "results").exists()


def test_results_of_other_methods_are_kept_where_one_fails(project, runs):
    (project / "script.py").write_text(
        WRITES + "print('error: piv failed', file=sys.stderr); sys.exit(1)"
    )
    found = ended(runs, project, runs.add(project, "identify", {}))
    assert found["state"] == "done" and found["code"] == 1 and found["message"]
    assert found["results"] == "results/001-identify"


def test_a_step_that_only_prints_has_its_output_as_result(project, runs):
    (project / "script.py").write_text("print('Known: the gains')")
    found = ended(runs, project, runs.add(project, "gains", {}))
    text = (project / "results" / "001-gains" / "output.txt").read_text()
    assert text == found["output"] == "Known: the gains\n"


def test_a_run_killed_from_outside_says_what_may_be_the_cause(project, runs):
    (project / "script.py").write_text("import os; os.kill(os.getpid(), 9)")
    found = ended(runs, project, runs.add(project, "identify", {}))
    assert found["state"] == "failed" and found["code"] == -9 and "memory" in found["message"]


def test_nothing_in_the_project_is_imported_in_place_of_a_library(tmp_path, runs):
    project = make_project(tmp_path / "p", "")
    (project / "script.py").unlink()
    for name in ("pivident", "numpy", "json", "sitecustomize"):
        (project / f"{name}.py").write_text("open('taken', 'w').close()\nraise SystemExit(0)\n")
    found = ended(runs, project, runs.add(project, "identify", {}))
    assert not (project / "taken").exists() and "experiment.toml: [recording]" in found["message"]


def test_removed_with_its_results_and_its_number_is_not_used_again(project, runs):
    run = runs.add(project, "identify", {})
    ended(runs, project, run)
    runs.remove(project, run)
    assert runs.listed(project) == [] and not (project / "results" / "001-identify").exists()
    assert runs.add(project, "identify", {}) == "002"


def test_a_run_that_goes_on_cannot_be_removed(project, runs):
    (project / "script.py").write_text(WRITES + WAITS)
    run = runs.add(project, "identify", {})
    with pytest.raises(RunError, match="cancel it first"):
        runs.remove(project, run)
    (project / "go").touch()


@pytest.mark.parametrize("run", ["", "1", "../001", "001/..", "999", "-01", "last"])
def test_only_numbers_of_runs_name_runs(project, runs, run):
    ended(runs, project, runs.add(project, "identify", {}))
    for use in (runs.cancel, runs.remove):
        with pytest.raises(RunError, match="has no run"):
            use(project, run)


def test_results_speak_for_themselves_once_the_derived_state_is_gone(project, make_runs):
    runs = make_runs()
    before = ended(runs, project, runs.add(project, "identify", {"method": "ls"}))
    shutil.rmtree(project / ".pivident-studio")
    found = make_runs().listed(project)[0]
    same = ("id", "step", "title", "command", "state", "code", "created", "started", "experiment")
    assert {key: found[key] for key in same} == {key: before[key] for key in same}
    assert found["files"] == before["files"] and found["arguments"] == {"method": "ls"}
    assert runs.add(project, "identify", {}) == "002"


def test_results_from_elsewhere_are_listed(project, runs):
    """An archive of a project holds results and no derived state."""
    folder = project / "results" / "007-identify" / "piv"
    folder.mkdir(parents=True)
    (folder / "identification.json").write_text("{}")
    (folder / "drives.html").touch()
    (folder.parent / "report.html").touch()
    (project / "results" / "mine").mkdir()
    (found,) = runs.listed(project)
    assert found["id"] == "007" and found["state"] == "done" and found["methods"] == ["piv"]
    assert found["pages"] == [
        {"title": "Report", "path": "report.html"},
        {"title": "Drives of piv", "path": "piv/drives.html"},
    ]
    assert runs.add(project, "identify", {}) == "008"


def test_methods_are_in_the_order_in_which_they_were_asked_for(project, runs):
    (project / "script.py").write_text(
        WRITES + "for name in ('iv', 'ls', 'piv'):\n    (out / name).mkdir()\n"
        "    (out / name / 'identification.json').touch()\n"
    )
    run = runs.add(project, "identify", {"method": ["piv", "ls", "iv", "pc-ls"]})
    assert ended(runs, project, run)["methods"] == ["piv", "ls", "iv"]


def test_refused_runs_leave_nothing(project, runs):
    for step, arguments in (("rm", {}), ("identify", {"method": "--out=/"})):
        with pytest.raises(StepError):
            runs.add(project, step, arguments)
    assert runs.listed(project) == [] and not (project / ".pivident-studio").exists()


#: A server of its own process, which adds a run and waits.
SERVER = """
import sys, time
from pathlib import Path
from pivident.app.studio.runs import Runs
if __name__ == "__main__":
    runs, project = Runs(), Path(sys.argv[1])
    for _ in range(2):
        runs.add(project, "identify", {})
    print("added", flush=True)
    time.sleep(1000)
"""


def test_a_run_survives_the_server_and_the_next_one_finds_its_outcome(project, make_runs, tmp_path):
    (project / "script.py").write_text(WRITES + WAITS)
    (tmp_path / "server.py").write_text(SERVER)
    server = subprocess.Popen(
        [sys.executable, str(tmp_path / "server.py"), str(project)], stdout=subprocess.PIPE
    )
    wait_for((project / "begun").exists)
    server.send_signal(signal.SIGKILL)
    server.communicate()
    runs = make_runs()
    runs.resume([project])
    assert [e["state"] for e in runs.listed(project)] == ["waiting", "running"]
    time.sleep(0.5)  # time to make the mistake
    assert len((project / "ran").read_text().splitlines()) == 1
    (project / "go").touch()
    for run in ("001", "002"):
        assert ended(runs, project, run)["state"] == "done"
    assert len((project / "ran").read_text().splitlines()) == 2


def test_two_queues_on_one_folder_run_nothing_twice(project, make_runs):
    (project / "script.py").write_text(WRITES + "import time; time.sleep(0.05)")
    both = make_runs(), make_runs()
    for runs in both:
        runs.resume([project])
    numbers = [both[k % 2].add(project, "identify", {}) for k in range(6)]
    assert numbers == [f"{k:03d}" for k in range(1, 7)]
    for run in numbers:
        assert ended(both[0], project, run)["state"] == "done"
        assert ended(both[1], project, run)["state"] == "done"
    ran = (project / "ran").read_text().splitlines()
    assert sorted(line.split()[1] for line in ran) == [f".experiment-{n}.toml" for n in numbers]


def test_the_other_server_cancels_what_it_did_not_start(project, make_runs):
    (project / "script.py").write_text(WRITES + WAITS)
    one, other = make_runs(), make_runs()
    run = one.add(project, "identify", {})
    wait_for((project / "begun").exists)
    other.cancel(project, run)
    assert ended(one, project, run)["state"] == "cancelled"


def test_a_closed_queue_starts_nothing_and_ends_nothing(project, make_runs):
    (project / "script.py").write_text(WRITES + WAITS)
    runs = make_runs()
    runs.add(project, "identify", {})
    runs.add(project, "identify", {})
    wait_for((project / "begun").exists)
    runs.close()
    (project / "go").touch()
    wait_for(lambda: entry(runs, project, "001")["state"] == "done")
    time.sleep(0.5)
    assert entry(runs, project, "002")["state"] == "waiting"


def test_identification_is_cancelled_and_then_done(tmp_path, runs):
    """The real command: interrupted, it leaves nothing half-written; undisturbed, its results."""
    project = (tmp_path / "planar").resolve()
    project.mkdir()
    write_experiment(project, PLANAR + "[output]\nreport = false\n")
    before = names(project)
    first = runs.add(project, "identify", {})
    wait_for(lambda: entry(runs, project, first)["progress"]["line"])
    runs.cancel(project, first)
    found = ended(runs, project, first)
    assert found["state"] == "cancelled" and found["code"] == 130
    left = {name for name in names(project) if not name.startswith(".pivident-studio/")}
    assert left == before
    second = runs.add(project, "identify", {"folds": 0})
    found = ended(runs, project, second)
    assert found["state"] == "done" and "fitted" in found["output"]
    assert found["methods"] == ["ls"] and found["progress"]["of"] == 3
    assert found["progress"]["kept"][-1].startswith("IDIM-WLS: 1 solution")
    results = names(project / "results" / "002-identify")
    assert results >= {"identification.json", "verdict.json", "experiment.toml", "output.txt"}
    kept = json.loads((project / "results" / "002-identify" / "run.json").read_text())
    assert kept["argv"][:2] == ["identify", "experiment.toml"] and kept["state"] == "done"
