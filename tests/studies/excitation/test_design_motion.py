"""Designs as a user asks for them."""

import importlib
import threading
from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.experiment.excite_keys import ExciteEntry
from pivident.foundation.errors import ExperimentError
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import read_urdf
from pivident.studies import (
    Clearances,
    DesignRequest,
    clearances_of_room,
    design_motion,
    joint_limits,
    load_design,
    outline_of,
    write_design,
)
from pivident.studies.excitation.checked_motion import FineCheck
from pivident.studies.excitation.constraints import Constraints
from pivident.studies.excitation.questions import gain_question, load_question
from pivident.studies.excitation.request import limits_of
from tests.studies.excitation.test_constraints import Wall

PLANAR = load_robot("planar_2r")
LOAD = np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.01, 0.1, 0.0, 0.0, 1.0])


def request(**wishes):
    return DesignRequest(**({"duration": 6.0, "seconds": 1.0} | wishes))


@pytest.fixture(scope="module")
def planar():
    return design_motion(PLANAR, request())


def fine_ratio(robot, design, limits, clearances=None):
    """Largest ratio of a design on its fine grid, through constraints made anew."""
    rate = 120.0 / design.motion.family.time_scale
    made = Constraints.of(design.motion.family, rate, limits, (), clearances)
    return made.largest_ratio(design.motion.coefficients)


@pytest.mark.parametrize("motion", ["fourier", "splines", "postures"])
def test_a_design_is_better_than_its_start_and_keeps_every_limit(motion):
    design = design_motion(PLANAR, request(motion=motion))
    assert design.cost[1] < 0.9 * design.cost[0]
    limits = joint_limits(PLANAR)
    assert fine_ratio(PLANAR, design, limits) <= 1.0
    q, dq, ddq = design.motion.sampled(2000.0)
    uses = {(u.joint, u.quantity): u for u in design.limits}
    for j, joint in enumerate(PLANAR.joints):
        for quantity, signal in (("position", q), ("speed", dq), ("acceleration", ddq)):
            use = uses[joint.name, quantity]
            assert use.low <= signal[:, j].min() and signal[:, j].max() <= use.high
            assert use.largest == pytest.approx(signal[:, j].max(), rel=2e-3, abs=1e-3)
        tau = design.robot and uses[joint.name, "torque"]
        assert tau.share <= 1.0


def test_predicted_errors_are_those_of_least_squares_with_that_noise(planar):
    """Against the covariance of a regression on the motion's own rows, by hand."""
    base = base_parameters(PLANAR)
    q, dq, ddq = planar.motion.sampled(40.0)
    from pivident.dynamics.regressor import Regressor

    phi = Regressor.build(PLANAR, base.parameters).matrix(q, dq, ddq)
    deviation = 0.01 * np.array([80.0, 40.0])
    rows = (phi / deviation[:, None]).reshape(-1, len(base))
    expected = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    np.testing.assert_allclose([p.std for p in planar.predicted], expected, rtol=0.05)
    assert [p.name for p in planar.predicted] == list(base.names)


def test_a_design_for_chosen_parameters_beats_the_others_for_them():
    names = ("fc1", "fc2")
    chosen = design_motion(PLANAR, request(parameters=names, seconds=2.0))
    d_optimal = design_motion(PLANAR, request(criterion="d", seconds=2.0))

    def worst(design):
        return max(p.relative for p in design.predicted if p.name in names)

    assert worst(chosen) < worst(d_optimal)
    assert [p.name for p in chosen.predicted if p.wanted] == list(names)


def test_a_goal_gives_a_shorter_motion_that_reaches_it():
    loose = design_motion(PLANAR, request(parameters=("fv1",), goal=0.05, duration=20.0))
    assert loose.motion.duration < 15.0
    assert next(p.relative for p in loose.predicted if p.wanted) <= 0.05
    assert loose.motion.duration == pytest.approx(round(loose.motion.duration, 1), abs=1e-9)


def test_a_goal_for_a_parameter_without_a_value_is_one_for_its_size():
    """A first moment that the description has as zero: its noticeable torque counts."""
    design = design_motion(PLANAR, request(parameters=("my1",), goal=1e-5))
    (wanted,) = (p for p in design.predicted if p.wanted)
    assert np.isnan(wanted.relative) and wanted.share > 1e-5
    assert "my1 to" in design.notes[0] and "nan" not in design.notes[0]


def test_ctrl_c_ends_all_searches_of_a_goal(monkeypatch):
    module = importlib.import_module("pivident.studies.excitation.design_motion")
    searched = []

    class Interrupted(module.Search):
        def run(self, first=None):
            best = super().run(first)
            searched.append(self.objective.constraints.family.duration)
            best.interrupted = True
            return best

    monkeypatch.setattr(module, "Search", Interrupted)
    design = design_motion(PLANAR, request(parameters=("fv1",), goal=0.05, duration=20.0))
    assert len(searched) == 1 and design.motion.duration == 20.0


@pytest.mark.parametrize("kind", ["fourier", "splines", "postures"])
def test_longer_motions_are_better(kind):
    """Rounds of a motion as long as the functions reach, σ ∝ 1/√T."""
    costs = [design_motion(PLANAR, request(motion=kind, duration=d)).cost[1] for d in (20.0, 100.0)]
    assert costs[1] < 0.65 * costs[0]


def test_a_goal_that_no_motion_reaches_says_what_is_reached_and_what_binds():
    design = design_motion(PLANAR, request(parameters=("fv1",), goal=1e-5))
    note = next(n for n in design.notes if n.startswith("No motion"))
    assert "fv1 to" in note and "What binds: " in note


def test_numbers_of_numpy_are_numbers(tmp_path):
    design = design_motion(PLANAR, request(duration=np.float64(6.0), seconds=np.float64(0.5)))
    write_design(design, tmp_path, 100.0)
    assert load_design(tmp_path).settings["duration"] == 6.0


def test_an_obstacle_is_kept_clear_of():
    design = design_motion(PLANAR, request(), clearances=Wall(0.1))
    q, *_ = design.motion.sampled(2000.0)
    assert Wall().distances(q).min() >= 0.1
    assert design.clearances[0].least == pytest.approx(Wall().distances(q).min(), abs=1e-3)


def test_motions_begin_where_they_are_told_to():
    start = (0.3, -0.4)
    design = design_motion(PLANAR, request(start=start))
    np.testing.assert_array_equal(design.motion.start, start)


def test_a_second_motion_adds_what_the_first_one_lacked():
    """After a result that knows the first joint well, the second one counts."""
    from tests.planar_results import planar_results

    (first,) = planar_results("piv")
    blind = design_motion(PLANAR, request())
    after = design_motion(first.robot, request(), after=[first])
    assert all(p.std <= p.before * (1 + 1e-9) for p in after.predicted)
    assert len(after.predicted) == len(blind.predicted)
    assert "found it" in after.noise


@pytest.mark.parametrize("make", [load_question, gain_question])
def test_questions_about_a_load_and_about_drive_gains(make):
    robot = load_robot("staubli_tx40")
    body = np.array([0.02, 0, 0, 0.02, 0, 0.01, 0.02, 0.02, 0.2, 2.0])
    design = design_motion(
        robot,
        request(duration=10.0, seconds=2.0),
        question=lambda known: make(known.base, known.model_values, body),
    )
    wanted = [p for p in design.predicted if p.wanted]
    assert len(wanted) == (10 if make is load_question else 6)
    assert all(np.isfinite(p.std) for p in wanted)
    assert design.cost[1] < design.cost[0]


def test_an_interruption_keeps_the_best_so_far(monkeypatch):
    """Ctrl-C while the starts are searched."""
    from concurrent.futures import Future

    from pivident.studies.excitation import search

    result, interrupted = Future.result, threading.Event()

    def once(self, timeout=None):
        if not interrupted.is_set():
            interrupted.set()
            search.time.sleep(0.8)
            raise KeyboardInterrupt
        return result(self, timeout)

    monkeypatch.setattr(Future, "result", once)
    said = []
    begin = search.time.perf_counter()
    design = design_motion(PLANAR, request(seconds=60.0), progress=said.append)
    assert search.time.perf_counter() - begin < 30.0
    assert interrupted.is_set() and any("kept" in line for line in said)
    assert design.cost[1] < design.cost[0]


def test_a_motion_that_breaks_a_limit_between_samples_is_made_smaller(planar):
    limits = joint_limits(PLANAR)
    tight = replace(limits, speed=0.97 * np.array([
        max(abs(u.least), u.largest) for u in planar.limits if u.quantity == "speed"
    ]))  # fmt: skip
    made = Constraints.of(planar.motion.family, 12.0, tight, (), None)
    fine = FineCheck.of(made)
    assert not fine.keeps_all(planar.motion.coefficients)
    smaller = fine.repaired(planar.motion.coefficients)
    assert fine.keeps_all(smaller)
    np.testing.assert_array_equal(smaller[0], planar.motion.coefficients[0])


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        ({"parameters": ("fc3",)}, "no parameter 'fc3'; did you mean 'fc"),
        ({"parameters": ("yy1",)}, "has no effect|part of"),
        ({"start": (0.0,)}, "start has 1 positions; one finite number for each of the 2"),
        ({"start": (9.0, 0.0)}, "the start has shoulder at 9 rad; choose a posture between -2.8"),
        ({"duration": 1.0}, "the duration is 1 s"),
        ({"duration": 2.0, "speed": 1e-3}, "in 2 s shoulder moves over less than 1 % of its range"),
        ({"motion": "sine"}, "no motion 'sine'; did you mean 'splines'"),
        ({"criterion": "e"}, "no criterion 'e'"),
        ({"goal": 0.02}, "needs the parameters"),
        ({"goal": 2.0, "parameters": ("fc1",)}, "standard error of 200 %"),
    ],
)
def test_what_cannot_be_asked(wishes, message):
    speed = wishes.pop("speed", None)
    given = {j.name: {"speed": speed} for j in PLANAR.joints} if speed else {}
    with pytest.raises(ExperimentError, match=message):
        design_motion(PLANAR, request(**wishes), limits=joint_limits(PLANAR, given))


def test_a_start_in_collision_is_refused():
    with pytest.raises(ExperimentError, match=r"at the start, arm and wall: the clearance is"):
        design_motion(PLANAR, request(start=(1.55, 0.0)), clearances=Wall())


def test_joints_without_limits_are_asked_for_by_name():
    joints = tuple(
        replace(j, position_limits=None) if j.name == "elbow" else j for j in PLANAR.joints
    )
    robot = replace(PLANAR, joints=joints)
    with pytest.raises(
        ExperimentError,
        match=r"no position limits are known of elbow.*excite\.joint\.\"elbow\"\.pos",
    ):
        design_motion(robot, request())
    limits = joint_limits(robot, {"elbow": {"position": (-1.0, 1.0)}})
    assert limits.source["position"] == ("description", "file")
    slow = replace(PLANAR, joints=tuple(replace(j, rated_speed=None) for j in PLANAR.joints))
    with pytest.raises(ExperimentError, match="no speed limits are known of shoulder, elbow"):
        joint_limits(slow)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"elbow": {"position": (1.0, -1.0)}},
            "limits of elbow, 1 to -1 rad, are in the wrong",
        ),
        ({"elbow": {"speed": -1.0}}, "speed limit of elbow is -1; a positive"),
    ],
)
def test_limits_that_contradict(given, message):
    with pytest.raises(ExperimentError, match=message):
        joint_limits(PLANAR, given)


def test_torques_too_small_for_gravity_are_named():
    weak = joint_limits(PLANAR, {"shoulder": {"torque": 0.5}})
    with pytest.raises(ExperimentError, match="torque limit of shoulder does not hold the arm"):
        design_motion(PLANAR, request(), limits=weak)


def test_the_noise_to_expect_is_as_large_as_the_reported_standard_errors():
    """A result whose robust standard errors are twice and three times those of white residuals."""
    from pivident.studies.excitation.knowledge import knowledge
    from tests.planar_results import planar_results

    (result,) = planar_results("piv")
    joints = np.array([p.joint for p in result.parameters])
    factor = np.where(joints == 0, 2.0, 3.0)
    formula = result.formula_covariance
    inflated = replace(result, covariance=formula * np.outer(factor, factor))
    limits = joint_limits(result.robot)
    found = knowledge(result.robot, limits, [inflated]).noise
    for j, (own, before) in enumerate(
        zip(found.filters, result.equation_noise.filters, strict=True)
    ):
        assert own.variance == pytest.approx((2.0 + j) ** 2 * before.variance, rel=1e-9)
        np.testing.assert_array_equal(own.fir, before.fir)


def test_a_load_on_a_planar_arm_is_asked_for_what_torques_tell():
    """Four of its ten parameters: gravity and one axis of rotation tell no more."""
    body = np.array([0.02, 0, 0, 0.02, 0, 0.01, 0.02, 0.0, 0.2, 2.0])
    design = design_motion(
        PLANAR,
        request(),
        question=lambda known: load_question(known.base, known.model_values, body),
    )
    wanted = {p.name: p for p in design.predicted if p.wanted}
    assert list(wanted) == ["load zz", "load mx", "load my", "load m"]
    assert all(np.isfinite(p.std) for p in wanted.values())
    assert wanted["load my"].size > 0.0  # from its torque: its value is zero
    assert any("No torque of this robot depends on xx, xy, xz" in note for note in design.notes)


def test_gains_that_no_motion_tells_are_named_instead_of_more_time():
    """Without any load the two runs are the same: all gains may be larger by one factor."""
    with pytest.raises(ExperimentError, match="identifies gain of shoulder, gain of elbow, what"):
        design_motion(
            PLANAR,
            request(seconds=0.5),
            question=lambda known: gain_question(known.base, known.model_values, np.zeros(10)),
        )


def test_a_start_that_gravity_does_not_allow_is_refused():
    """Stretched out, the arm needs more than the limit; hanging down it would not."""
    given = {"shoulder": {"torque": 3.0}}
    with pytest.raises(
        ExperimentError, match=r"gravity takes \d+ % of the torque limit of shoulder"
    ):
        design_motion(PLANAR, request(start=(0.0, 0.0)), limits=joint_limits(PLANAR, given))


def test_room_in_which_no_posture_is_free_is_refused_before_the_search():
    """A floor above the robot, as where metres and millimetres are mixed up."""
    robot = load_robot("staubli_tx40")
    clearances = Clearances.of(robot, outline_of(robot).bodies, floor=1.0)
    (plate,) = clearances.surroundings
    assert plate.translation[2] + 0.5 * plate.size[2] == pytest.approx(1.0)
    said: list[str] = []
    with pytest.raises(ExperimentError, match=r"none of 500 .* above the floor.* all in metres"):
        design_motion(robot, request(), clearances=clearances, progress=said.append)
    assert said == []


def test_what_can_touch_depends_on_the_limits_that_the_user_gives(tmp_path):
    """A slide of 0.2 m by its description, of 2 m by its user: the wall at 1.5 m counts."""
    file = tmp_path / "slide.urdf"
    file.write_text(
        '<robot name="slide"><link name="rail"/><link name="car"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="slide" type="prismatic"><parent link="rail"/><child link="car"/>'
        '<axis xyz="1 0 0"/><limit lower="0" upper="0.2" effort="50" velocity="1"/></joint></robot>'
    )
    robot = read_urdf(file)
    wall = {"name": "wall", "shape": "box", "size": [0.1, 1, 1], "at": [1.5, 0, 0]}
    body = {"name": "car", "link": "car", "from": [0, 0, 0], "to": [0, 0, 0], "radius": 0.1}
    table = ExciteEntry.model_validate(
        {"obstacle": [wall], "body": [body], "joint": {"slide": {"position": [0.0, 2.0]}}}
    )
    limits = limits_of(robot, table)
    narrow = clearances_of_room(robot, table)
    assert narrow.names == ()
    with pytest.raises(
        ExperimentError, match=r"slide from 0 to 0\.2, the motion may go from 0 to 2 m"
    ):
        design_motion(robot, request(), limits=limits, clearances=narrow)
    room = clearances_of_room(limits.of_robot(robot), table)
    assert room.names == ("car and wall",)
    design = design_motion(robot, request(duration=6.0), limits=limits, clearances=room)
    q, *_ = design.motion.sampled(1000.0)
    assert 0.9 < q.max() < 1.45 - 0.1 - 0.02 + 1e-9
