"""Errors carry what was seen and what to do apart: nothing takes them from a sentence."""

import ast
import pickle

import pytest

from pivident.errors import ExperimentError, RecordingError, RobotDescriptionError, UnusableValue
from pivident.robot.naming import nearest
from tests.conftest import REPOSITORY

SOURCE = REPOSITORY / "src" / "pivident"

#: Attributes of findings and errors that hold sentences.
SENTENCES = {"message", "next_step", "advised", "sentence", "fact", "advice"}

#: What takes a text apart or asks what is in it.
READING = {
    "partition", "rpartition", "split", "rsplit", "startswith", "endswith", "find", "index",
    "replace", "removeprefix", "removesuffix", "search", "match", "findall", "fullmatch", "sub",
}  # fmt: skip


def trees():
    for path in sorted(SOURCE.rglob("*.py")):
        yield path.relative_to(SOURCE).as_posix(), ast.parse(path.read_text("utf-8"))


def literal_parts(node):
    """Literal text of a string or f-string."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    return [p.value for p in parts if isinstance(p, ast.Constant) and isinstance(p.value, str)]


def test_no_error_is_raised_with_both_in_one_sentence():
    joined = [
        f"{name}:{node.lineno}"
        for name, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args
        if ast.unparse(node.exc.func) != "KeyError"  # whose text is a repr
        if any("; " in text for text in literal_parts(node.exc.args[0]))
    ]
    assert joined == []


def is_sentence(node):
    """Whether an expression is the sentence of a finding or an error."""
    return isinstance(node, ast.Attribute) and node.attr in SENTENCES


def reads(node):
    """Whether an expression takes a sentence apart or looks for something in it."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        is_method = node.func.attr in READING and is_sentence(node.func.value)
        is_pattern = node.func.attr in READING and any(map(is_sentence, node.args))
        return is_method or is_pattern
    if isinstance(node, ast.Subscript):
        return is_sentence(node.value)
    if isinstance(node, ast.Compare):
        return any(map(is_sentence, [node.left, *node.comparators]))
    return False


def test_no_program_code_reads_a_message():
    readers = [
        f"{name}:{node.lineno}: {ast.unparse(node)}"
        for name, tree in trees()
        for node in ast.walk(tree)
        if reads(node)
    ]
    assert readers == []


@pytest.mark.parametrize("kind", [ExperimentError, RecordingError, UnusableValue])
def test_both_survive_another_process(kind):
    error = kind("it has no p", advice=nearest("p", ["pp", "q"]))
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "it has no p; did you mean 'pp'?"
    assert (again.fact, again.advice) == ("it has no p", "did you mean 'pp'?")
    assert again.meant == ("p", "pp")


def test_the_error_of_a_part_keeps_its_advice():
    part = UnusableValue("it has no p", advice=nearest("p", ["pp"]))
    whole = RobotDescriptionError.of_part("joint 3: ", part)
    assert (whole.fact, whole.advice, whole.meant) == (
        "joint 3: it has no p",
        part.advice,
        part.meant,
    )
    assert str(RobotDescriptionError.of_part("joint 3: ", ValueError("bad"))) == "joint 3: bad"


def test_an_error_without_advice_has_none():
    error = ExperimentError("it is empty")
    assert (str(error), error.fact, error.advice, error.meant) == ("it is empty",) * 2 + ("", None)
