"""Errors carry what was seen and what to do apart: nothing takes them from a sentence."""

import ast
import copy
import pickle
from functools import cache

import pytest

from pivident.foundation.errors import (
    ExperimentError,
    IdentificationFileError,
    LoopOpened,
    MissingSamples,
    NonFiniteSamples,
    RecordingError,
    RobotDescriptionError,
    UnknownColumn,
    UnusableValue,
)
from pivident.foundation.errors.recordings import Stretches
from pivident.foundation.extras import MissingExtra
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


def pieces(node):
    """The strings that a text is put together from: both of a sum, both of a choice."""
    if isinstance(node, ast.BinOp):
        return [*pieces(node.left), *pieces(node.right)]
    if isinstance(node, ast.IfExp):
        return [*pieces(node.body), *pieces(node.orelse)]
    return [node]


def is_error(maker):
    """Whether what is called makes an error, of its kind or of that of its parent, or its part."""
    last = getattr(maker, "attr", getattr(maker, "id", ""))
    if not last.endswith(("Error", "UnusableValue", "__init__", "of_part")):
        return False
    makers = ("Error", "Error.__init__", "Error.of_part", "UnusableValue", "super().__init__")
    called = ast.unparse(maker)
    return called.endswith(makers) and called != "KeyError"  # whose text is a repr


def joins(node):
    """Whether an expression makes an error with what was seen and what to do in one sentence."""
    if not (isinstance(node, ast.Call) and node.args and is_error(node.func)):
        return False
    return any("; " in text for part in pieces(node.args[0]) for text in literal_parts(part))


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


@cache
def found():
    """Where an error is made of one sentence, and where a message is read: by one walk."""
    places = ([], [])
    for name, tree in trees():
        for node in ast.walk(tree):
            for wrong, own in zip((joins, reads), places, strict=True):
                if wrong(node):
                    own.append(f"{name}:{node.lineno}: {ast.unparse(node)}")
    return places


def test_no_error_is_made_with_both_in_one_sentence():
    assert found()[0] == []


def test_no_program_code_reads_a_message():
    assert found()[1] == []


@pytest.mark.parametrize("kind", [ExperimentError, RecordingError, UnusableValue])
def test_both_survive_another_process(kind):
    error = kind("it has no p", advice=nearest("p", ["pp", "q"]))
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "it has no p; did you mean 'pp'?"
    assert (again.fact, again.advice) == ("it has no p", "did you mean 'pp'?")
    assert again.meant == ("p", "pp")


def stretches():
    return Stretches(((0.0, 1.0), (2.0, 5.0)), 5.0, 1.0, 0.0, resample=True)


@pytest.mark.parametrize(
    "error",
    [
        NonFiniteSamples("tau", "elbow", 3, 2),
        MissingSamples(1, 1, 1, 0.1, 0.2, stretches()),
        UnknownColumn("log.csv", "q1", ["q_1"], ["q_1"]),
        LoopOpened(1, [0.0, 1.0], ["shoulder", "elbow"], 0.3),
        IdentificationFileError("identification.json", "is empty", advice="identify again"),
        MissingExtra("plotly", "report", "the report"),
        ExperimentError("it has no p", advice="drop it").within("identify.piv", "p").headed("a:"),
    ],
    ids=lambda error: type(error).__name__,
)
@pytest.mark.parametrize("again", [lambda e: pickle.loads(pickle.dumps(e)), copy.copy])
def test_every_kind_survives_another_process(error, again):
    error.add_note("of the second log")
    other = again(error)
    assert type(other) is type(error)
    assert str(other) == str(error)
    assert error.advice and str(error).endswith(error.advice)
    assert vars(other).keys() == vars(error).keys()
    for name in ("fact", "advice", "sentence", "place", "table", "headings", "__notes__"):
        assert getattr(other, name) == getattr(error, name)


def test_headings_stand_in_front_of_the_message_but_not_of_what_was_seen():
    bare = ExperimentError("it has no p", advice="drop it")
    headed = bare.headed("[piv]").headed("arm.toml:", "[identify]")
    assert str(headed) == "arm.toml: [identify] [piv] it has no p; drop it"
    assert headed.headings == ("arm.toml:", "[identify]", "[piv]")
    assert (headed.fact, headed.advice) == ("it has no p", "drop it")
    whole = ExperimentError.of_part("fleet: ", headed)
    assert str(whole) == f"fleet: {headed}"
    assert (whole.fact, whole.advice) == (
        "fleet: arm.toml: [identify] [piv] it has no p",
        "drop it",
    )


def test_what_to_do_about_a_file_stands_behind_what_to_do_about_its_content():
    content = UnusableValue("it has no p", advice="drop it")
    error = IdentificationFileError.of_content("a.json", content, "identify again")
    assert str(error) == "a.json: it has no p; drop it; identify again"
    assert (error.reason, error.advice) == ("it has no p", "drop it; identify again")
    error = IdentificationFileError.of_content("a.json", ValueError("bad"), "identify again")
    assert (error.reason, error.advice) == ("bad", "identify again")


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
