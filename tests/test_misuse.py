"""Wrong arguments of the front names: errors of pivident that say what to give."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import pivident as pv
from pivident.foundation.errors import PividentError
from pivident.linear.srivc import srivc
from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_term import FrictionTerm
from pivident.studies.comparison.entry import ComparisonError
from tests.planar_results import LAW, planar_results
from tests.planar_simulations import planar_problem


@cache
def made():
    """What is misused; not made while tests are collected, which each worker does for itself."""
    problem = planar_problem()
    ls, piv = planar_results("ls", "piv")
    robot, run = problem.robot, problem.recordings[0]
    term = robot.joints[0].friction.terms[0]
    return SimpleNamespace(problem=problem, robot=robot, run=run, ls=ls, piv=piv, term=term)


def without_torque(columns, method="ls", **given):
    def identified(own):
        silent = replace(own.run, tau=own.run.tau * columns, allow_constant=True)
        return pv.identify(pv.Problem(own.robot, silent, **given), method)

    return identified


ZERO = "the torque of joint 'elbow' is zero at every sample, and it moves"

#: Each case by name: what is called, the cousin of Python that its error is, what it says.
CASES = {
    "a constant that a term lacks": (lambda s: s.term.shape("v_s"), KeyError, "no constant 'v_s'"),
    "a term of text": (lambda s: FrictionTerm("fv", "viscous"), TypeError, "type str"),
    "a law of text": (lambda s: FrictionLaw(("viscous",)), TypeError, "type str; make it"),
    "results not in a list": (lambda s: pv.compare(s.ls, s.piv), ValueError, r"compare\(\[one"),
    "no results": (lambda s: pv.compare(5), ValueError, "a int cannot be compared"),
    "zero torque": (without_torque([1, 0]), ValueError, ZERO),
    "zero torque, PIV": (without_torque([0, 0], "piv", loop=pv.Loop(LAW)), ValueError, "zero"),
    "an array for a recording": (lambda s: pv.predict(s.piv, s.run.q), TypeError, "from_arrays"),
    "results without names": (lambda s: pv.diagnose(s.problem, s.ls), TypeError, "by name"),
    "a verdict of a problem": (lambda s: pv.verdict(s.problem), TypeError, "type Problem"),
    "a robot for a result": (lambda s: pv.make_consistent(s.robot), TypeError, "type Robot"),
    "a name of a parameter": (lambda s: s.ls.value("zz9"), KeyError, "did you mean"),
    "a number for a name": (lambda s: s.ls.value(3), KeyError, "no parameter 3"),
    "a column of a table": (lambda s: pv.table(s.ls)["x"], KeyError, "no column 'x'; there are"),
    "a level of text": (lambda s: s.ls.conf_int("95 %"), TypeError, "0.95 is usual"),
    "names of numbers": (
        lambda s: pv.Recording.from_arrays(s.run.q, s.run.tau, 1e3, joint_names=[1, 2]),
        TypeError,
        "a name is of type int",
    ),
    "a rate of text": (
        lambda s: pv.Recording.from_arrays(s.run.q, s.run.tau, "1 kHz"),
        ValueError,
        "rate is '1 kHz'",
    ),
    "a signal of text": (lambda s: srivc("u", "y", 0.01, 0, 1), ValueError, "array of numbers"),
    "too few standard parameters": (
        lambda s: s.problem.base.values(np.zeros(3)), ValueError, r"shape \(3,\)",
    ),
    "a duration of text": (
        lambda s: pv.simulate(s.robot, pv.Loop(LAW), duration="10 s"), TypeError, "give seconds",
    ),
    "text for a result": (lambda s: pv.write_report("x", "y"), TypeError, "list of results"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_misuse_is_answered(name):
    call, cousin, said = CASES[name]
    own = made()
    with pytest.raises(cousin, match=said) as caught:
        call(own)
    assert isinstance(caught.value, PividentError)


def test_results_of_joints_in_another_order_are_not_compared():
    """Their parameters have each other's numbers: fv1 is another joint's in each."""
    (ls,) = planar_results("ls")
    first, second = ls.robot.joints
    names = replace(
        ls.robot, joints=(replace(first, name="elbow"), replace(second, name="shoulder"))
    )
    with pytest.raises(ComparisonError, match="mean different joints; describe the robot"):
        pv.compare([ls, replace(ls, robot=names)])


def test_results_are_compared_by_the_names_of_a_table():
    ls, piv = planar_results("ls", "piv")
    assert pv.compare({"least squares": ls, "PIV": piv}).labels == ("least squares", "PIV")
    assert pv.compare({"a": ls, "b": piv}, alpha=0.01).alpha == 0.01
