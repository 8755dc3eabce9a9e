"""What nothing is wrong with is said to be fine, with what was looked at and what would be done."""

import json

import pytest

from tests.questions.material import URDF, URDF_EXPERIMENT, WITHOUT_ROTORS, Case, csv, log

TEXT = csv(log())
HEADER, ROWS = TEXT.split("\n", 1)


def test_a_clean_experiment_looks_fine(ask):
    code, lines = ask(Case("", (), log=log()))
    assert code == 0
    assert lines[0] == "experiment.toml: no errors, no warnings"
    text = "\n".join(lines)
    assert "3200 samples at 1000 Hz" in text and "13 base parameters" in text
    assert "shoulder, elbow" in text and "methods        ls" in text and "expected time" in text


def test_a_clean_urdf_looks_fine(ask):
    code, lines = ask(Case("", (), text=URDF_EXPERIMENT, log=log(), files={"arm.urdf": URDF}))
    assert (code, lines[0]) == (0, "experiment.toml: no errors, no warnings")


def test_a_loop_that_rotors_make_stable_is_no_fault_of_a_urdf(ask):
    """The links alone would be too light for the gains; least squares finds the rotors."""
    code, lines = ask(Case("", (), text=WITHOUT_ROTORS, log=log(), files={"arm.urdf": URDF}))
    assert (code, lines[0]) == (0, "experiment.toml: no errors, no warnings")


def test_json_holds_the_same(ask):
    case = Case("", (), log=log(), command=("check", "experiment.toml", "--json"))
    code, lines = ask(case)
    content = json.loads("\n".join(line for line in lines if line[:1] in ' {}["'))
    assert code == 0 and content["remarks"] == [] and content["severity"] == "ok"
    assert content["plan"]["joints"] == ["shoulder", "elbow"]
    assert len(content["plan"]["parameters"]) == 13


def test_another_robot_can_be_tried(ask):
    case = Case("", (), log=log(), command=("check", "experiment.toml", "--robot", "emps"))
    code, lines = ask(case)
    assert code == 1 and any("1 joint(s) (carriage)" in line for line in lines)


@pytest.mark.parametrize(
    "content",
    [
        f"{HEADER}\ns,rad,rad,rad,rad,Nm,Nm\n{ROWS}",
        f"Record of the arm\n{TEXT}",
        TEXT.encode("utf-16"),
        TEXT.replace(",", ";").replace(".", ","),
        TEXT.replace(",", " "),
    ],
    ids=["a line of units", "a title", "UTF-16", "decimal commas", "blanks"],
)
def test_habits_of_other_programs_are_no_mistakes(ask, content):
    code, lines = ask(Case("", (), log=content))
    assert (code, lines[0]) == (0, "experiment.toml: no errors, no warnings")
    assert "3200 samples at 1000 Hz" in "\n".join(lines)
