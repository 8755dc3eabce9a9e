"""A result says what has changed since it was made, and leads to the lines that it rests on."""

import json
import os

from pivident.app.studio.looks import named_files
from pivident.app.studio.projects import Project
from pivident.app.studio.results_list import result_context
from pivident.app.studio.rows import experiment_rows
from pivident.foundation.text.toml import parse_toml

TEXT = 'robot = "arm.urdf"\n[recording]\nfiles = "log.csv"\n'
CREATED = "2026-01-01T00:00:00.000Z"
BEFORE, AFTER = 1.7e9, 1.8e9  # [s since 1970]


def entry(number, step, **arguments):
    results = f"results/{number}-{step}"
    nothing = {"pages": [], "files": [], "methods": [], "progress": {}, "started": "", "ended": ""}
    return nothing | {
        "id": number, "step": step, "state": "done", "results": results, "created": CREATED,
        "arguments": arguments, "in_spite_of": [], "output": "",
    }  # fmt: skip


def outdated(folder, text):
    runs = [entry("002", "consistent", result="results/001-identify/piv"), entry("001", "identify")]
    content = parse_toml(text)
    named = {
        path.relative_to(folder).as_posix(): path.stat().st_mtime
        for path in named_files(folder, content)
    }
    (shown,) = result_context(Project(folder, "arm"), runs, "/p/arm", content, named, ())["runs"]
    assert shown["follow_ups"][0]["outdated"] == shown["outdated"]
    return shown["outdated"]


def test_results_that_are_older_than_what_they_were_made_from(tmp_path):
    for name in ("arm.urdf", "log.csv", "other.csv"):
        (tmp_path / name).write_text("x", encoding="utf-8")
        os.utime(tmp_path / name, (BEFORE, BEFORE))
    for step in ("001-identify", "002-consistent"):
        (tmp_path / "results" / step).mkdir(parents=True)
    (tmp_path / "results" / "001-identify" / "experiment.toml").write_text(TEXT, encoding="utf-8")
    assert outdated(tmp_path, TEXT) == ""
    assert outdated(tmp_path, f"# a comment\n{TEXT}") == ""
    assert outdated(tmp_path, TEXT + "delay = 0.01\n") == "The experiment file has changed since."
    os.utime(tmp_path / "other.csv", (AFTER, AFTER))  # which no line names
    assert outdated(tmp_path, TEXT) == ""
    os.utime(tmp_path / "log.csv", (AFTER, AFTER))
    assert outdated(tmp_path, TEXT) == "log.csv has changed since."


def test_a_reservation_leads_to_the_line_that_it_rests_on(tmp_path):
    folder = tmp_path / "results" / "001-identify"
    folder.mkdir(parents=True)
    statements = [
        {"severity": "warning", "topic": topic, "message": "…", "next_step": "", "basis": ""}
        for topic in ("torque scale", "law", "parameters")
    ]
    verdict = {"name": "piv", "headline": "Take it.", "severity": "warning"}
    (folder / "verdict.json").write_text(json.dumps(verdict | {"statements": statements}))
    text = f'{TEXT}units = {{tau = "A"}}\n[controller]\ntype = "identify"\n'
    for shown, gains in ((text, "row-controller.type"), (TEXT, "")):
        runs, rows = [entry("001", "identify")], experiment_rows(shown)
        (run,) = result_context(Project(tmp_path, "arm"), runs, "", {}, {}, rows)["runs"]
        scale, law, parameters = (statement["row"] for statement in run["against"])
        assert scale.startswith("row-recording") and scale.endswith("units.tau" if gains else "")
        assert (law, parameters) == (gains, "")


def test_a_comparison_answers_in_a_sentence(tmp_path):
    folder = tmp_path / "results" / "002-compare"
    folder.mkdir(parents=True)
    runs = [entry("002", "compare", results=["results/001-identify/ls"])]

    def answers():
        (run,) = result_context(Project(tmp_path, "arm"), runs, "", {}, {}, ())["runs"]
        return run["answers"]

    assert answers() == []
    (folder / "comparison.json").write_text('{"findings": ["piv: none of 13 differs."]}')
    assert answers() == ["piv: none of 13 differs."]


def test_the_verdict_stays_above_what_follows_from_it(tmp_path):
    """By the result that a run is about, also by way of another; else below the last one."""
    runs = [
        entry("009", "identify") | {"results": "", "state": "running"},
        entry("008", "export", result="results/004-consistent"),
        entry("007", "predict", result="results/002-identify/piv"),
        entry("006", "laws"),
        entry("005", "identify"),
        entry("004", "consistent", result="results/002-identify"),
        entry("003", "compare", results=["results/002-identify"]),
        entry("002", "identify"),
        entry("001", "friction"),
    ]
    for run in runs:
        if run["results"]:
            (tmp_path / run["results"]).mkdir(parents=True)
    shown = result_context(Project(tmp_path, "arm"), runs, "/p/arm", {}, {}, ())["runs"]
    below = {run["id"]: [follow_up["id"] for follow_up in run["follow_ups"]] for run in shown}
    assert list(below) == ["009", "005", "002", "001"]
    assert below == {"009": [], "005": ["006"], "002": ["008", "007", "004", "003"], "001": []}
