# ruff: noqa: E501  (one case, one line)
"""Mistakes on the command line: wrong command, wrong kind of file, missing and misspelt words."""

import pytest

from tests.questions.conftest import answered
from tests.questions.material import EXPERIMENT, URDF, Case, log

FILES = {"arm.urdf": URDF}
ROBOT = 'name = "arm"\n[[joints]]\nname = "shoulder"\n'


def typed(question: str, line: str, *answer: str, code: int = 2, **more) -> Case:
    return Case(question, answer, command=tuple(line.split()), code=code, **more)


CASES = [
    typed("a command is misspelt", "idnetify experiment.toml", "unknown command", "identify"),
    typed("a command of another program is typed", "fit experiment.toml", "unknown command", "fit"),
    typed("an argument is missing", "identify", "EXPERIMENT"),
    typed("nothing is named to check", "check", "EXPERIMENT"),
    typed("an option is misspelt", "identify experiment.toml --metod ls", "--metod"),
    typed("an option has no value", "identify experiment.toml --out", "--out"),
    typed("a method is misspelt", "identify experiment.toml -m pvi", "no method 'pvi'", "'piv'"),
    typed("a method's long name is typed", "identify experiment.toml -m IDIM-PIV", "no method", "'piv'"),
    typed("no method is named", "identify experiment.toml -m ,", "names no method"),
    typed("one fold is asked for", "identify experiment.toml --folds 1", "--folds 1", "nothing to fit"),
    typed("folds are not a number", "identify experiment.toml --folds many", "folds", "many"),
    typed("the experiment file does not exist", "check absent.toml", "absent.toml", "No such file", code=1),
    typed("the experiment file is a folder", "check .", "directory", code=1),
    typed("the log is given for the experiment file", "check log.csv", "log.csv", "looks like a log", "files =", code=1),
    typed("the log is identified without an experiment file", "identify log.csv", "log.csv", "looks like a log", code=1),
    typed("the robot is given for the experiment file", "check arm.urdf", "arm.urdf", "robot description", code=1, files=FILES),
    typed("the robot is identified", "identify arm.urdf", "arm.urdf", "robot description", code=1, files=FILES),
    typed("the robot's table is identified", "identify arm.toml", "arm.toml", "robot description", code=1, files={"arm.toml": ROBOT}),
    typed("the experiment file is given for a robot", "robots experiment.toml", "experiment.toml", "experiment file", code=1),
    typed("the robot's name is misspelt", "robots tx4", "no robot 'tx4'", "staubli_tx40", code=1),
    typed("the robot to check with is misspelt", "check experiment.toml --robot planar_2", "no robot 'planar_2'", "'planar_2r'", code=1),
    typed("the robot to check with has other joints", "check experiment.toml --robot staubli_tx40", "2 column(s) for 6 joint(s)", code=1),
    typed("the experiment file is audited with a robot", "audit experiment.toml --robot planar_2r", "names robot and columns itself", code=1),
    typed("the robot is audited", "audit arm.urdf", "arm.urdf", "robot description", code=1, files=FILES),
    typed("a log that does not exist is audited", "audit absent.csv", "absent.csv", "No such file", code=1),
    typed("the folder of the results is a file", "identify experiment.toml --out log.csv", "log.csv is a file", "--out", code=1, log=log()),
    typed("a data set is misspelt", "datasets fetch empss", "no data set 'empss'", "emps", code=1),
    typed("a result that does not exist is exported", "export absent --to urdf --out x.urdf", "absent: cannot be read", code=1),
    typed("the experiment is exported", "export experiment.toml --to urdf --out x.urdf", "experiment.toml: is not JSON", code=1),
    typed("a result is exported to an unknown format", "export results --to stl --out x", "stl", "urdf"),
    typed("a load is identified without a record of it", "payload experiment.toml", "no record with the load", "[[payload.recording]]", code=1, log=log(), text=EXPERIMENT),
    typed("only the arm without load is given", "payload results.json", "LOADED.toml", code=1),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.question)
def test_the_answer_names_cause_and_place(ask, case):
    code, lines = ask(case)
    assert answered(lines, case.answer), "\n".join(lines)
    assert code == case.code, "\n".join(lines)
