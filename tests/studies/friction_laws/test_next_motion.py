"""Laws that fit the next motion. Long: benchmarks/friction_laws_on_next_motion.py."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.signal_recipes import RandomWalk
from pivident.judgement.validation.held_out.segment_sums import Segments
from pivident.robot.friction import FrictionLaw, coulomb, offset, stribeck, viscous
from pivident.signals.bandpass import butterworth
from pivident.studies.friction_laws.held_out_cells import Cells
from pivident.studies.friction_laws.law_choice import choose_laws, settled_together
from pivident.studies.friction_laws.law_scores import LawScore
from tests.studies.friction_laws.friction_arms import RATE, friction_arm, programmes
from tests.studies.friction_laws.friction_axis import Axis, Noise
from tests.studies.friction_laws.friction_cases import CASES

METHOD = LeastSquares(signals=RandomWalk())


@cache  # by arguments as they are written: none is left out in a call
def chosen(seed, rich, motions):
    """The arm, its problem, and the laws chosen from some of its motions."""
    made, plan = friction_arm(seed, rich, 3), programmes(seed, seconds=15.0)
    problem = made.problem({k: plan[k] for k in motions})
    return made, plan, problem, choose_laws(problem)


def error(made, plan, problem):
    """Torque error of each joint on the third motion, below 20 Hz, over its torque."""
    q, dq, ddq, torque = made.motion(3, plan[3])
    predicted = identify(problem, METHOD).predict(q, dq, ddq)
    left, size = (butterworth(x, RATE, 20.0) for x in (torque - predicted, torque))
    return np.sqrt(np.mean(left**2, axis=0) / np.mean(size**2, axis=0))


def columns(law):
    return [t.column for t in law.terms]


@pytest.mark.parametrize("motions", [(1, 2), (1,)])
def test_plain_friction_gets_no_further_term_and_a_sharp_sign(motions):
    """The truth is sharp: the sign costs no unknown and nearly all of the error."""
    made, plan, problem, choice = chosen(4, False, motions)
    assert all(columns(j.chosen.law) == columns(j.base.law) for j in choice.joints)
    assert (error(made, plan, choice.problem) < 0.1 * error(made, plan, problem)).all()


def test_laws_chosen_on_two_motions_fit_a_third():
    made, plan, problem, choice = chosen(8, True, (1, 2))
    present, after = error(made, plan, problem), error(made, plan, choice.problem)
    assert (after < 0.2 * present).all()
    assert made.truth.load.all()
    assert all("load" in j.chosen.name for j in choice.joints)


def test_a_smooth_sign_is_found_with_its_slope():
    """The axis has (2/π) atan(50 v); its user believes in a slope of 200 s/rad."""
    axis = Axis(CASES["Coulomb"].truth, noise=Noise(encoder=2e-7, torque=0.3))
    law = FrictionLaw((viscous(), coulomb("atan", 200.0), offset()))
    joint = choose_laws(axis.problem(law, 0), depth=1).joint("axis")
    assert joint.chosen.name == "free steepness"
    assert joint.chosen.unknowns == joint.base.unknowns + 1
    assert joint.chosen.law.slopes == pytest.approx([50.0], rel=0.05)


def test_the_range_in_which_laws_were_tried():
    """Oracle: largest speeds and positions of both recordings from their smoothed motion."""
    _, _, problem, choice = chosen(4, False, (1, 2))
    motions = [estimate_kinematics(r, RandomWalk()) for r in problem.recordings]
    for j, joint in enumerate(choice.joints):
        fastest = [np.abs(k.dq[j, k.start : k.stop]).max() for k in motions]
        assert joint.tried.speed == pytest.approx(max(fastest) / min(fastest), rel=0.05)
        assert joint.tried.fastest == pytest.approx(max(fastest), rel=0.05)
        low, high = ([f(k.q[j, k.start : k.stop]) for k in motions] for f in (np.min, np.max))
        beyond = max(np.ptp(low), np.ptp(high))
        assert joint.tried.position == pytest.approx(beyond, abs=0.02)
        assert f"{joint.tried.speed:.2f} times the fitted speed" in choice.headline()
        assert "rad/s) and" in choice.headline() and "N m), at positions" in choice.headline()


def law_score(name, law):
    errors = np.zeros((1, 4))
    n = len(law.terms)
    return LawScore(name, law, n, errors, 1.0, np.ones(n), np.full(n, 0.1))


PRESENT = law_score("present law", FrictionLaw((viscous(), coulomb())))
LARGER = law_score("Stribeck", FrictionLaw((viscous(), coulomb(), stribeck(0.1))))


def two_joints(errors, theta):
    """Two joints whose errors and parameters depend on which of them has the larger law."""

    def held_out(laws):
        key = "".join("P" if law == PRESENT.law else "S" for law in laws)
        ripple = np.array([0.0, 0.01, 0.0, -0.01])
        found = [e + ripple for e in errors[key]]
        return found, [np.array(theta.get(key, [1.0] * 3))[: len(law.terms)] for law in laws]

    return SimpleNamespace(held_out=held_out, judges=[SimpleNamespace(joint=k) for k in (0, 1)])


PATHS = [[PRESENT, LARGER], [PRESENT, LARGER]]
GOOD = {"PP": (1.0, 1.0), "SS": (0.5, 0.5), "SP": (0.5, 1.0), "PS": (1.0, 0.5)}


def test_laws_that_hold_together_stay():
    settled, dropped = settled_together(two_joints(GOOD, {}), PATHS)
    assert [s.name for s in settled] == ["Stribeck", "Stribeck"] and not dropped


def test_a_law_that_is_impossible_together_with_the_others_goes_back():
    robot = two_joints(GOOD, {"SS": [1.0, 1.0, -0.3]})
    settled, ((joint, law),) = settled_together(robot, PATHS)
    assert [s.name for s in settled] == ["present law", "Stribeck"]
    assert joint == 0 and law.verdict.endswith("other joints' laws: fs = -0.30 ± 0.20")


@pytest.mark.parametrize("worse", [0, 1])
def test_a_joint_that_gains_nothing_together_goes_back(worse):
    together = (1.1, 0.5) if worse == 0 else (0.5, 1.1)
    settled, ((joint, law),) = settled_together(two_joints({**GOOD, "SS": together}, {}), PATHS)
    assert joint == worse and settled[worse].name == "present law"
    assert settled[1 - worse].name == "Stribeck"
    assert law.verdict == "no gain with the other joints' laws"


def test_a_law_that_makes_another_joint_worse_goes_back():
    errors = {"PP": (1.0, 1.0), "SP": (0.5, 1.2)}
    settled, ((joint, law),) = settled_together(two_joints(errors, {}), [PATHS[0], [PRESENT]])
    assert joint == 0 and settled[0].name == "present law"
    assert law.verdict == "makes another joint worse"


@pytest.mark.record
@pytest.mark.parametrize("fitted", [0, 1])
def test_kr300_laws_of_one_motion_are_not_worse_on_the_other(public_data, fitted):
    """Axes 1 to 3 below 4 Hz; axis 1 does not move alike in both."""
    from benchmarks.kuka_kr300_blocks import EXAMPLE, START, STOP, squares

    from pivident.data.recording.public_records import load_kuka_kr300
    from pivident.estimation.problem import Problem
    from pivident.robot.gallery import load_robot

    robot = load_robot(EXAMPLE / "kuka_kr300_axes_1_3.toml")
    runs = [load_kuka_kr300(motion, robot=robot) for motion in ("A", "B")]
    problem = Problem(robot, (runs[fitted].slice(START, STOP),))
    choice = choose_laws(problem)
    motion = estimate_kinematics(runs[1 - fitted], RandomWalk())
    present, after = (
        squares(identify(p, METHOD), motion, START, STOP)[0] for p in (problem, choice.problem)
    )
    assert (after <= present * (1.0 + 1e-9)).all()
    assert not any(j.chosen.impossible for j in choice.joints)


def test_whole_recordings_are_held_out_of_joints_that_move_in_several():
    cells = Cells(Segments((), 8), np.repeat([0, 1], 4), ("A", "B"), 4, 0.1)
    divisions = cells.divisions(np.ones(8), np.arange(8.0))
    assert [d.name for d in divisions] == ["A", "B"]
    assert [d.held_out.tolist() for d in divisions] == [
        [True] * 4 + [False] * 4,
        [False] * 4 + [True] * 4,
    ]
    speed = np.array([1.0, 4.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0])
    parts = cells.divisions(speed, np.arange(8.0))  # it stands in B
    assert [d.name for d in parts[:4]] == ["blocks in turn"] * 4
    assert np.sum([d.held_out for d in parts[:4]], axis=0).tolist() == [1] * 8
    by_name = {d.name: np.flatnonzero(d.held_out).tolist() for d in parts[4:]}
    assert by_name["fastest part"] == [1, 2, 3]
    assert by_name["most loaded part"] == by_name["last part"] == [5, 6, 7]
    assert by_name["least loaded part"] == by_name["first part"] == [0, 1, 2]
    few = Cells(Segments((), 2), np.array([0, 1]), ("A", "B"), 4, 0.1)  # and fewer than blocks
    held_out = [d.held_out.tolist() for d in few.divisions(np.array([1.0, 0.0]), np.ones(2))]
    assert len(held_out) == 8 and all(map(any, held_out))
