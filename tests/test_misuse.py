"""Wrong arguments of the front names: errors of pivident that say what to give."""

from dataclasses import replace

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


def cases():
    """Each case by name: what is called, the cousin of Python that its error is, what it says."""
    problem = planar_problem()
    robot, run = problem.robot, problem.recordings[0]
    ls, piv = planar_results("ls", "piv")
    term = robot.joints[0].friction.terms[0]

    def without_torque(columns, method="ls", **given):
        silent = replace(run, tau=run.tau * columns, allow_constant=True)
        return lambda: pv.identify(pv.Problem(robot, silent, **given), method)

    zero = "the torque of joint 'elbow' is zero at every sample, and it moves"
    return {
        "a constant that a term lacks": (lambda: term.shape("v_s"), KeyError, "no constant 'v_s'"),
        "a term of text": (lambda: FrictionTerm("fv", "viscous"), TypeError, "type str"),
        "a law of text": (lambda: FrictionLaw(("viscous",)), TypeError, "type str; make it"),
        "results not in a list": (lambda: pv.compare(ls, piv), ValueError, r"compare\(\[one"),
        "no results": (lambda: pv.compare(5), ValueError, "a int cannot be compared"),
        "zero torque": (without_torque([1, 0]), ValueError, zero),
        "zero torque, PIV": (without_torque([0, 0], "piv", loop=pv.Loop(LAW)), ValueError, "zero"),
        "an array for a recording": (lambda: pv.predict(piv, run.q), TypeError, "from_arrays"),
        "results without names": (lambda: pv.diagnose(problem, ls), TypeError, "by name"),
        "a verdict of a problem": (lambda: pv.verdict(problem), TypeError, "type Problem"),
        "a robot for a result": (lambda: pv.make_consistent(robot), TypeError, "type Robot"),
        "a name of a parameter": (lambda: ls.value("zz9"), KeyError, "did you mean"),
        "a number for a name": (lambda: ls.value(3), KeyError, "no parameter 3"),
        "a column of a table": (lambda: pv.table(ls)["x"], KeyError, "no column 'x'; there are"),
        "a level of text": (lambda: ls.conf_int("95 %"), TypeError, "0.95 is usual"),
        "names of numbers": (
            lambda: pv.Recording.from_arrays(run.q, run.tau, 1e3, joint_names=[1, 2]),
            TypeError,
            "a name is of type int",
        ),
        "a rate of text": (
            lambda: pv.Recording.from_arrays(run.q, run.tau, "1 kHz"),
            ValueError,
            "rate is '1 kHz'",
        ),
        "a signal of text": (lambda: srivc("u", "y", 0.01, 0, 1), ValueError, "array of numbers"),
        "too few standard parameters": (
            lambda: problem.base.values(np.zeros(3)), ValueError, r"shape \(3,\)",
        ),
        "a duration of text": (
            lambda: pv.simulate(robot, pv.Loop(LAW), duration="10 s"), TypeError, "give seconds",
        ),
        "text for a result": (lambda: pv.write_report("x", "y"), TypeError, "list of results"),
    }  # fmt: skip


@pytest.mark.parametrize("name", list(cases()))
def test_misuse_is_answered(name):
    call, cousin, said = cases()[name]
    with pytest.raises(cousin, match=said) as caught:
        call()
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
