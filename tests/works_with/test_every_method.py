"""What every method has to do, whichever it is; what it says it copes with, it copes with."""

import ast
import json
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import pivident
from pivident.estimation.identification_file import method_of_options
from pivident.estimation.method import KNOWN, Handles, Method
from pivident.estimation.methods import METHODS, method_named, name_of
from pivident.experiment.identify_table import IdentifyEntry, method_of
from pivident.foundation.errors import PividentError
from pivident.foundation.options import annotations_of, declarations
from pivident.foundation.text.plain_values import plain
from tests.works_with.page import PAGE, page
from tests.works_with.scenes import FEATURES, problem

ALL = METHODS.usable()

#: Fewer steps than by default, where a default is made for long records.
QUICK = {
    "frequency": {"period": 1.0},
    "particle": {"particles": 40, "torque_noise": 5.0},
    "adaline": {"epochs": 2},
    "hopfield": {"time": 1e3},
}


def quick(name: str) -> Method:
    return replace(ALL[name], **QUICK.get(name, {}))


@pytest.mark.parametrize("name", ALL)
def test_it_says_what_it_is(name):
    method = ALL[name]
    assert method.label and method.summary and not method.summary.endswith(".")
    assert method.cost.seconds > 0.0 and method.cost.each > 0.0
    assert set(method.keys) <= set(declarations(type(method)))
    assert all(declarations(type(method))[key].meaning for key in method.keys)
    assert method_named(name) is method and method_named(method) is method
    assert type(METHODS[name_of(method)]) is type(method)


@pytest.mark.parametrize("name", ALL)
def test_it_comes_back_from_its_options(name):
    method = ALL[name]
    options = json.loads(json.dumps(plain(dict(vars(method)))))
    assert method_of_options(options, name_of(method), method.label) == method
    assert method_of_options(options, None, method.label) == method  # as older files have it


@pytest.mark.parametrize("name", ALL)
def test_a_file_that_says_nothing_leaves_it_as_it_is(name):
    assert method_of(name, IdentifyEntry()) == ALL[name]


@pytest.mark.parametrize("name", ALL)
def test_limits_hold_in_python_and_in_a_file(name):
    method = ALL[name]
    for key in method.keys:
        declared = declarations(type(method))[key]
        if not declared.limits:
            continue
        outside = -1.0 if int not in _types(method, key) else -1
        with pytest.raises(PividentError, match=key):
            replace(method, **{key: outside})
        with pytest.raises(ValueError, match=key):
            IdentifyEntry.model_validate({name: {key: outside}})


def _types(method: Method, key: str) -> tuple[object, ...]:
    annotation = annotations_of(type(method))[key]
    return getattr(annotation, "__args__", (annotation,))


@pytest.mark.parametrize("name", ALL)
def test_the_same_problem_has_the_same_answer(name):
    first, again = (pivident.identify(problem(), quick(name)) for _ in range(2))
    assert np.array_equal(first.theta, again.theta)
    assert np.isfinite(first.std).all() and (first.std > 0.0).all()


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("name", ALL)
def test_it_copes_with_what_it_says(name, feature):
    method, asked = quick(name), FEATURES[feature]
    if asked.handled(method):
        assert np.isfinite(asked.task(method)).all()
    else:
        with pytest.raises(PividentError):
            asked.task(method)


def test_every_declared_feature_is_a_column_of_the_page():
    declared = {f.name for f in fields(Handles)} - {"known"} | set(KNOWN)
    assert declared == set(FEATURES) - {"trees"}
    assert PAGE.read_text("utf-8") == page()  # python -m tests.works_with.page


SOURCE = Path(pivident.__file__).parent


def test_no_other_file_asks_which_method_it_has():
    """Neither by class nor by name; what one needs to know of a method, the method declares."""
    own = {type(method) for method in ALL.values()}
    classes = {c.__name__ for kind in own for c in kind.__mro__ if issubclass(c, Method)}
    classes -= {"Method"}
    asked = []
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text("utf-8")
        if not re.search(r"\b(isinstance|hasattr|getattr|case)\b", text):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
                named = {n.id for n in ast.walk(node.args[1]) if isinstance(n, ast.Name)}
                asked += [f"{path.name}:{node.lineno} {named & classes}"] * bool(named & classes)
            if isinstance(node, ast.MatchClass) and getattr(node.cls, "id", "") in classes:
                asked.append(f"{path.name}:{node.pattern} match")
            looks = isinstance(node, ast.Call) and getattr(node.func, "id", "")
            if looks in ("hasattr", "getattr"):
                about = ast.unparse(node.args[0])
                asked += [f"{path.name}:{node.lineno} {ast.unparse(node)}"] * ("method" in about)
    assert not asked
