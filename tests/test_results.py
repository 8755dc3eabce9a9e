"""What every public result does: it fits on one line, is shown in notebooks, and travels whole."""

import inspect
import pickle
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module

import numpy as np
import pytest

import pivident as pv
from pivident.foundation.text.display import MAX_LINE, Displayed, in_one_line
from pivident.judgement.validation.essential_parameters import essential_parameters
from pivident.models.runnable_model import runnable_model
from pivident.robot.gallery import load_robot
from tests.planar_results import LAW, planar_results
from tests.planar_simulations import planar_problem
from tests.rooms import ROOMS

#: Fields of a small class, whose instances `dataclass` may write as the call that makes them.
SMALL = 6


def public_classes():
    """Classes that the fronts of the package and of its rooms name."""
    fronts = [pv, *(import_module(f"pivident.{room}") for room in ROOMS if room != "app")]
    named = [getattr(front, name) for front in fronts for name in front.__all__]
    own = [x for x in named if inspect.isclass(x) and x.__module__.startswith("pivident.")]
    return sorted(set(own), key=lambda kind: kind.__name__)


@cache
def results():
    """Results of all kinds of one record of the planar arm, and what they were made of."""
    problem = planar_problem()
    ls, piv = planar_results("ls", "piv")
    judged = pv.diagnose(problem, {"ls": ls, "piv": piv}, folds=3)
    rng = np.random.default_rng(1)
    u = np.sign(np.sin(0.02 * np.arange(500)))
    consistent = pv.make_consistent(piv)
    simulated = pv.simulate(problem.robot, pv.Loop(LAW), duration=2.0)
    model = import_module("pivident.linear").srivc(
        u, np.convolve(u, np.exp(-0.1 * np.arange(80)))[:500] + 0.01 * rng.standard_normal(500),
        0.01, 0, 1,
    )  # fmt: skip
    return {
        "problem": problem,
        "identification": piv,
        "decimated": ls,
        "diagnostics": judged,
        "verdict": pv.verdict(judged),
        "comparison": pv.compare([ls, piv]),
        "prediction": pv.predict(piv, problem.recordings[0]),
        "held_out": pv.cross_validate(problem, "ls", folds=3),
        "essential": essential_parameters(problem, "ls"),
        "consistent": consistent,
        "intervals": consistent.intervals(),
        "model": runnable_model(piv),
        "simulated": simulated,
        "linear": model,
        "summary": piv.summary(),
        "tests": piv.t_test("fv1"),
        "table": pv.table(piv),
        "six_axes": load_robot("staubli_tx40"),
        "six_axes_in_a_loop": pv.Loop(pv.PID(kp=[1.0] * 6, kd=[0.1] * 6, ki=[0.2] * 6)),
    }


def inside(root):
    """All dataclasses that an object holds, itself first."""
    seen, waiting = set(), [root]
    while waiting:
        here = waiting.pop()
        if id(here) in seen:
            continue
        seen.add(id(here))
        if is_dataclass(here) and not isinstance(here, type):
            yield here
            waiting += [getattr(here, f.name, None) for f in fields(here)]
        elif isinstance(here, dict):
            waiting += here.values()
        elif isinstance(here, list | tuple) and len(here) < 100:
            waiting += here


NAMES = (
    "problem identification decimated diagnostics verdict comparison prediction held_out essential "
    "consistent intervals model simulated linear summary tests table six_axes six_axes_in_a_loop"
).split()


def test_every_public_class_with_arrays_or_parts_has_a_short_line():
    """`dataclass` writes all fields of all parts; its own functions are wrapped ones."""
    large = ("ndarray", "tuple[", "dict[", "Mapping", "Sequence", "Identification")
    long_ones = [
        kind.__name__
        for kind in public_classes()
        if is_dataclass(kind) and hasattr(kind.__repr__, "__wrapped__")
        if len(fields(kind)) > SMALL
        if any(word in str(field.type) for field in fields(kind) for word in large)
    ]
    assert long_ones == []


@pytest.mark.parametrize("name", NAMES)
def test_no_result_is_longer_than_a_line(name):
    public, parts = set(public_classes()), list(inside(results()[name]))
    assert parts or name == "summary"
    for part in parts:
        if type(part) in public or isinstance(part, Displayed):
            assert len(repr(part)) <= MAX_LINE and "\n" not in repr(part), type(part)


@pytest.mark.parametrize("name", NAMES)
def test_every_result_is_shown_in_notebooks(name):
    html = results()[name]._repr_html_()
    assert "<table" in html and len(html) < 300_000


def numbers(root):
    """All arrays of an object, in the order of its fields."""
    return [
        value
        for part in inside(root)
        for field in fields(part)
        if isinstance(value := getattr(part, field.name, None), np.ndarray | float | int | str)
    ]


@pytest.mark.parametrize("name", NAMES)
def test_every_result_reaches_another_process_with_the_same_numbers(name):
    result = results()[name]
    other = pickle.loads(pickle.dumps(result))
    assert type(other) is type(result)
    mine, theirs = numbers(result), numbers(other)
    assert len(mine) == len(theirs)
    for one, two in zip(mine, theirs, strict=True):
        np.testing.assert_array_equal(one, two)
    if name not in ("table", "summary"):
        assert len(mine) > 2


def test_a_line_says_what_it_holds_and_stops_in_time():
    long = pv.PID(kp=np.arange(40.0), kd=[0.123456789] * 40)
    assert in_one_line(long) == (
        "<PID: kp of shape (40,), kd 40 float, derivative_time 0, speed_feed_forward 1>"
    )
    assert repr(pv.PrefilteredIV()) == "PrefilteredIV()"
    assert repr(pv.Bandpass(cutoff=5.0)) == "Bandpass(cutoff=5.0)"
    options = pv.PrefilteredIV(signals=pv.Bandpass(cutoff=5.0), tolerance=0.1)
    assert eval(repr(options), vars(pv) | {n: getattr(pv, n) for n in pv.__all__}) == options


def test_print_shows_what_a_problem_is_made_of():
    problem = planar_problem()
    texts = [str(problem.robot), str(problem.recordings[0]), str(problem), str(problem.loop)]
    for text, words in zip(
        texts, (["elbow", "N m"], ["elbow", "rms torque"], ["run1", "rate_hz"], ["PD", "kp"]),
        strict=True,
    ):  # fmt: skip
        assert len(text.splitlines()) > 3 and all(word in text for word in words)
    assert "kp                  [1, 2]" in str(pv.PID(kp=[1.0, 2.0], kd=0.1))


def test_a_loaded_result_names_its_loop(tmp_path):
    (piv,) = planar_results("piv")
    piv.save(tmp_path)
    loaded = pv.load_identification(tmp_path)
    assert loaded.loop is None
    assert loaded.loop_in_words == piv.loop_in_words
    assert (
        loaded.loop_in_words.startswith("Loop: controller ") and "drive_gain 1" in piv.loop_in_words
    )
    loaded.save(tmp_path / "again")
    assert pv.load_identification(tmp_path / "again").loop_in_words == piv.loop_in_words
    assert planar_results("ls")[0].loop_in_words == ""
