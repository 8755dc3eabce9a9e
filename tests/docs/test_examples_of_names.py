"""Every name of the front has an example in its docstring, and examples show what comes out.

A reader can paste one as it stands: but for ``pv`` and ``np`` it needs nothing from elsewhere.
"""

import doctest
import inspect

import numpy as np
import pytest

import pivident as pv
from tests.docs.test_docstrings import section

#: The version is a text, whose docstring is Python's.
NAMES = sorted(set(pv.__all__) - {"__version__"})
#: Lines of code of an example.
MIN_LINES, MAX_LINES = 2, 8
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.REPORT_NDIFF


def examples_of(value: object, name: str) -> list[doctest.DocTest]:
    """The examples of an object, those of the methods of a class after its own."""
    finder = doctest.DocTestFinder(recurse=isinstance(value, type))
    names = {"pv": pv, "np": np}
    found = finder.find(value, name, module=False, globs=names)
    return sorted((test for test in found if test.examples), key=lambda test: test.name != name)


def difference(test: doctest.DocTest) -> str:
    """What an example shows and what it should, in lines; empty where they agree."""
    said: list[str] = []
    doctest.DocTestRunner(verbose=False, optionflags=FLAGS).run(test, out=said.append)
    return "".join(said)


@pytest.mark.parametrize("name", NAMES)
def test_example_shows_what_comes_out(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tests = examples_of(getattr(pv, name), name)
    assert tests and tests[0].name == name, f"{name} has no example"
    for test in tests:
        assert any(example.want for example in test.examples), f"{test.name} shows no result"
        assert difference(test) == ""


@pytest.mark.parametrize("name", NAMES)
def test_example_ends_the_docstring_and_is_short(name):
    doc = inspect.getdoc(getattr(pv, name)) or ""
    body = section(doc, "Example")
    assert body is not None and doc.rstrip().endswith(body.rstrip()), name
    lines = doctest.DocTestParser().get_examples(body)
    assert MIN_LINES <= sum(line.source.count("\n") for line in lines) <= MAX_LINES, name


def test_an_example_that_is_wrong_or_missing_is_found():
    def wrong():
        """Two.

        Example:
            >>> 1 + 1
            3
        """

    (test,) = examples_of(wrong, "wrong")
    assert "- 3\n    + 2" in difference(test)
    assert examples_of(examples_of, "without") == []
