"""Every key of a file is a row with its reason and its meaning; so is what it could have."""

import pytest

from pivident.app.studio.rows import addable, experiment_rows
from pivident.experiment.edited_file import edited
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.toml import parse_toml
from tests.conftest import REPOSITORY
from tests.planar_log import EXPERIMENT, write_log


def by_place(rows):
    return {row.place: row for row in rows}


@pytest.fixture(scope="module")
def draft(tmp_path_factory):
    folder = tmp_path_factory.mktemp("draft")
    log = write_log(folder / "log.csv")
    return draft_experiment([log], "planar_2r", out=folder / "experiment.toml")


def test_rows_of_a_draft_are_its_assumptions(draft):
    """Read back from the text alone."""
    rows = {(row.table, row.key): row for row in experiment_rows(draft.text)}
    assert len(rows) == len(draft.assumptions)
    for line in draft.assumptions:
        row = rows[line.table, line.key]
        assert (row.value is None) == (line.value is None)
        if line.value is None:
            assert (row.sure, row.example) == ("", line.example)
            continue
        assert parse_toml(f"x = {row.value}")["x"] == line.value
        assert (row.sure, row.correct) == (line.sure, line.correct)
        assert row.reason == f"{line.seen.rstrip('.')}."


def test_corrections_of_init_are_told_from_its_reasons():
    """Every correction in the sources begins as `file_lines.CORRECTIONS` says."""
    text = """\
[recording]
# likely: the log runs from 0 to 9 s. It stands at first. Times on the log's clock.
part = [1.0, 2.0]
# ASSUMED, please check: seen. Torque beyond a limit is not what the model says; cut it out.
saturation = "allow"
"""
    part, saturation = experiment_rows(text)
    assert part.reason == "the log runs from 0 to 9 s. It stands at first."
    assert part.correct == "Times on the log's clock."
    assert saturation.sure == "assumed" and saturation.correct.startswith("Torque beyond")


def test_inline_tables_have_a_row_for_each_key():
    rows = by_place(experiment_rows(EXPERIMENT))
    assert rows["robot", "model"].value == '"planar_2r"'
    assert rows["recording", 0, "columns", "q"].value == '["q1", "q2"]'
    unit = rows["recording", 0, "units", "q"]
    assert (unit.value, unit.channel, unit.sure) == ('"deg"', "q", "given")
    assert '"rad"' in unit.choices and "counts" in unit.meaning
    assert rows["controller", "kp"].channel == "q_ref"
    assert rows["controller", "kp"].unit.startswith("u per rad")


def test_values_that_are_no_tables_of_the_schema_are_one_row():
    text = """\
robot.model = "a.urdf"
robot.frozen = {elbow = 0.0}
robot.friction = ["viscous", {term = "dahl", distance = 1e-3}]
[[recording]]
files = {q = "a.csv", tau = "b.csv"}
columns = {q = {file = "q", columns = ["a"]}}
units = {tau = {unit = "A", gain = 2.0}}
[[recording]]
files = "b.csv"
[recording.units]
q = "deg"
[identify.piv]
noise = {criterion = "bic"}
strange = {a = 1}
"""
    assert {place: row.value for place, row in by_place(experiment_rows(text)).items()} == {
        ("robot", "model"): '"a.urdf"',
        ("robot", "frozen"): "{elbow = 0.0}",
        ("robot", "friction"): '["viscous", {term = "dahl", distance = 1e-3}]',
        ("recording", 0, "files"): '{q = "a.csv", tau = "b.csv"}',
        ("recording", 0, "columns", "q"): '{file = "q", columns = ["a"]}',
        ("recording", 0, "units", "tau"): '{unit = "A", gain = 2.0}',
        ("recording", 1, "files"): '"b.csv"',
        ("recording", 1, "units", "q"): '"deg"',
        ("identify", "piv", "noise", "criterion"): '"bic"',
        ("identify", "piv", "strange"): "{a = 1}",
    }


def test_comments_are_reasons_and_suggestions():
    text = """\
# The whole file.

[recording]
# By the data sheet.
rate = 1000.0

# far away

delay = 0.0
# Late torques.
# torque_timing = "sampled"
# side = "motor" or so
# unheard = 3

# [controller]
# The law of the cabinet.
# type = "pd"
# kp = [1.0]
"""
    rows = experiment_rows(text)
    assert [(r.key, r.value, r.reason) for r in rows] == [
        ("rate", "1000.0", "By the data sheet."),
        ("delay", "0.0", ""),
        ("torque_timing", None, "Late torques."),
        ("type", None, "The law of the cabinet."),
        ("kp", None, ""),
    ]
    assert rows[2].example == '"sampled"' and rows[3].place == ("controller", "type")


def test_what_can_be_added_is_what_the_file_has_not():
    rows = by_place(addable(EXPERIMENT))
    assert ("recording", 0, "delay") in rows and ("robot", "gravity") in rows
    assert ("controller", "ki") in rows and ("validation", "folds") in rows
    assert not rows.keys() & by_place(experiment_rows(EXPERIMENT)).keys()
    for row in rows.values():
        assert row.value is None and row.kind and row.meaning
        parse_toml(f"x = {row.example}")
    text = edited(EXPERIMENT, [(("recording", 0, "delay"), "0.001")])
    assert ("recording", 0, "delay") not in by_place(addable(text))


@pytest.mark.parametrize("path", sorted(REPOSITORY.glob("examples/*/*.toml")), ids=str)
def test_examples_have_rows_with_meanings(path):
    text = path.read_text("utf-8")
    if "[recording" not in text and "\nrecording" not in text:
        pytest.skip("a robot or a table of friction")
    rows = experiment_rows(text)
    assert rows and all(row.meaning for row in rows)


def test_what_is_not_toml():
    with pytest.raises(ExperimentError, match=r"is not TOML.*line 1"):
        experiment_rows("robot = \n")
