"""Sensors behind the gears and motors, told apart by the rotors that a log contains."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.check.torque_side import TorqueSideEvidence, torque_side_evidence
from pivident.experiment.init.column_lines import side_lines
from pivident.experiment.init.draft import draft_experiment
from pivident.experiment.init.torque_unit import compare, torque_unit
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.timing import check_timing
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw, offset
from pivident.robot.urdf import parse_urdf
from tests.other_arms import Setting, make_log
from tests.seven_axis_arm import COULOMB, ROTORS, VISCOUS, seven_axis_log, write_log

pytest.importorskip("mujoco")

SECONDS = 8.0

made = cache(seven_axis_log)


def evidence(seed: int, side: str, bearings: float = 0.0, robot: Robot | None = None):
    log = made(seed, seconds=SECONDS, bearings=bearings)
    tau = log.tau_link if side == "link" else log.tau_motor
    robot = robot or parse_urdf(log.urdf)
    channels = {"q": log.q, "tau": tau}
    bare = Log(
        "log",
        robot.joint_names,
        {},
        {"t": log.t},
        logged=channels,
        channels=channels,
        robot=robot,
    )
    timing = check_timing(bare)
    return torque_side_evidence(bare, timing, build_inverse_model(bare, timing))


def test_the_arm_is_what_it_says():
    """Its motors need the torque of the sensors, and rotors and friction besides."""
    log = made(0, seconds=SECONDS)
    _, dq, ddq = log.motion
    slow = np.abs(dq) < 0.02  # dry friction holds or turns round there
    drives = ROTORS * ddq + COULOMB * np.sign(dq) + VISCOUS * dq
    rest = np.where(slow, 0.0, log.tau_motor - log.tau_link - drives)
    rest -= np.nanmean(np.where(slow, np.nan, rest), axis=0)  # offsets of the sensors
    assert (np.sqrt(np.mean(rest**2, axis=0)) < 0.04 * np.std(log.tau_motor, axis=0)).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("bearings", [0.0, 0.15])
def test_sensors_behind_the_gears_are_recognised(seed, bearings):
    found = evidence(seed, "link", bearings)
    assert found.side == "link"
    share, error = found.pooled
    assert abs(share) < 0.03 + 3 * error
    assert np.isnan(found.rotor[:2]).all(), "the first rotors turn like their links"


@pytest.mark.parametrize("seed", range(4))
def test_motors_are_recognised_and_their_rotors_found(seed):
    found = evidence(seed, "motor")
    assert found.side == "motor"
    assert set(found.with_rotor) == {f"joint_{j}" for j in range(3, 8)}
    assert (found.rotor[4:] > 0.7).all(), "at the wrist the rotor is most of the inertia"


@pytest.mark.parametrize("side", ["link", "motor"])
def test_a_model_without_rotors_is_completed_first(side):
    robot = parse_urdf(made(1, seconds=SECONDS).urdf).with_link_torques(FrictionLaw((offset(),)))
    found, same = evidence(1, side, robot=robot), evidence(1, side)
    assert found.side == side
    assert np.allclose(found.rotor[2:], same.rotor[2:], atol=1e-9)


def test_without_rotors_much_friction_is_of_no_known_side():
    """An idealised arm: what its drives lack cannot be told from sensors with stiff bearings."""
    log = made(2, seconds=SECONDS)
    _, dq, _ = log.motion
    rubbing = log.tau_link + COULOMB * np.tanh(dq / 1e-3) + VISCOUS * dq
    robot = parse_urdf(log.urdf)
    channels = {"q": log.q, "tau": rubbing}
    bare = Log("log", robot.joint_names, {}, {"t": log.t}, channels=channels, robot=robot)
    timing = check_timing(bare)
    found = torque_side_evidence(bare, timing, build_inverse_model(bare, timing))
    assert found.side == "unknown"
    assert not found.with_rotor


@pytest.fixture(scope="module", params=["link", "motor"])
def draft(request, tmp_path_factory):
    """The file of `pivident init` for one side, with the folder and the side."""
    folder = tmp_path_factory.mktemp(request.param)
    log = made(3, seconds=SECONDS)
    tau = log.tau_link if request.param == "link" else log.tau_motor
    path = write_log(folder, log, tau)
    found = draft_experiment([path], str(folder / "arm.urdf"), out=folder / "experiment.toml")
    (folder / "experiment.toml").write_text(found.text, encoding="utf-8")
    return found, folder / "experiment.toml", request.param


def test_init_writes_the_side_with_its_evidence(draft):
    found, _, side = draft
    lines = [a for a in found.assumptions if a.key == "torque_side"]
    assert [a.value for a in lines] == (["link"] if side == "link" else [])
    assert not found.troubles
    for line in lines:
        assert line.sure == "likely"
        assert "rotors take" in line.seen and "joint_7" in line.seen and "friction" in line.seen


def test_check_is_content_with_what_init_wrote(draft):
    _, path, _ = draft
    assert not [r for r in check_experiment(path).remarks if r.kind == "torque side"]


def test_check_contradicts_the_other_side(draft):
    _, path, side = draft
    text = path.read_text(encoding="utf-8")
    other = path.with_name("other.toml")
    if side == "link":
        text = text.replace('torque_side = "link"', 'torque_side = "motor"')
    else:
        text = text.replace('side = "joint"', 'side = "joint"\ntorque_side = "link"')
        head, _, _ = text.partition("[controller]")
        text = f"{head}[identify]\nmethods = ['ls']\n"
    other.write_text(text, encoding="utf-8")
    (remark,) = [r for r in check_experiment(other).remarks if r.kind == "torque side"]
    assert remark.severity == ("warning" if side == "link" else "error")
    assert remark.place == ("recording", 0, "torque_side")
    assert remark.line == 1 + text.splitlines().index(
        f'torque_side = "{"motor" if side == "link" else "link"}"'
    )
    share = remark.evidence["rotors"]
    assert share.unit == "%" and share.interval[0] < share.value < share.interval[1]
    assert (share.interval[1] < 10) == (side == "link")


def test_a_gain_of_one_sensor_leaves_the_side_alone():
    """Sensors are calibrated to some per cent, each by itself."""
    log = made(0, seconds=SECONDS)
    wrong = replace(log, tau_link=log.tau_link * np.array([1.0, 0.97, 1.03, 1.02, 0.98, 1.03, 1.0]))
    robot = parse_urdf(log.urdf)
    channels = {"q": wrong.q, "tau": wrong.tau_link}
    bare = Log("log", robot.joint_names, {}, {"t": log.t}, channels=channels, robot=robot)
    timing = check_timing(bare)
    assert torque_side_evidence(bare, timing, build_inverse_model(bare, timing)).side == "link"


def test_small_rotors_are_not_none():
    """Motors whose rotors are a twelfth of what they move, ten standard errors from nothing."""
    arm = make_log(94, Setting("gaps", 50.0, 20.0, 0.0, 0.002, "none", 0.5))
    channels, robot = {"q": arm.q, "tau": arm.tau}, parse_urdf(arm.arm.urdf)
    log = Log("log", robot.joint_names, {}, {"t": arm.t}, channels=channels, robot=robot)
    log = replace(log, resample=True, torque_timing="sampled").between(0.0, 11.981)
    timing = check_timing(log)
    found = torque_side_evidence(log, timing, build_inverse_model(log, timing))
    assert found.pooled[0] == pytest.approx(0.076, abs=0.02)
    assert found.side == "unknown"


def test_one_rotor_that_certainly_turns_is_enough():
    """Over all joints perhaps none, of the second 29 ± 17 %."""
    shares, errors = np.array([0.023, 0.29, -0.04, 0.03]), np.array([0.029, 0.085, 0.075, 0.265])
    found = TorqueSideEvidence(tuple("abcd"), shares, errors, np.full(4, 0.4), (0.02, 0.012))
    assert found.side == "unknown"
    assert replace(found, rotor=np.r_[0.023, 0.19, -0.04, 0.03]).side == "link"


def test_joints_without_friction_outweigh_a_rotor_that_noise_made():
    """A Panda at 30 Hz: its wrist carries so little that noise gives it a rotor."""
    nan = np.nan
    rotor = np.array([nan, nan, -0.35, -0.02, 1.27, 1.52, 1.39])
    errors = np.array([nan, nan, 0.43, 0.06, 0.59, 0.58, 0.41])
    friction = np.array([0.514, 0.02, 0.021, 0.008, 0.528, 0.319, 0.983])
    names = tuple("abcdefg")
    found = TorqueSideEvidence(names, rotor, errors, friction, (0.029, 0.063))
    assert found.with_rotor == ("g",) and found.side == "link"
    assert replace(found, pooled=(0.15, 0.063)).side == "unknown"
    assert replace(found, friction=np.r_[0.5, 0.1, 0.1, 0.008, 0.5, 0.3, 0.98]).side == "unknown"
    # most joints without friction leave room for errors of accelerations, but not for rotors
    free = replace(found, friction=np.full(7, 0.02), rotor=np.full(7, 0.05), pooled=(0.055, 0.021))
    assert free.side == "link"
    assert replace(free, pooled=(0.055, 0.01)).side == "unknown"


def test_nothing_is_said_of_rotors_that_no_joint_shows():
    unknown, friction = np.full(2, np.nan), np.array([0.25, 0.94])
    found = TorqueSideEvidence(("a", "b"), unknown, unknown, friction, (np.nan, np.nan))
    assert str(found) == "friction takes 25 to 94 % of their rms torques"


def test_init_says_that_the_side_is_open():
    """Motors and sensors alike would have such shares; they are taken for those of the motors."""
    log = make_log(60, Setting("regular", 200.0, 15.0, 0.0, 0.002, "none", 0.6), joints=4)
    robot = parse_urdf(log.arm.urdf)
    found = compare(robot, log.q, log.tau, log.t)
    assert found.torque_side.side == "unknown"
    unit = torque_unit(robot, found, "N m", False, None)
    *_, line = side_lines(unit, found)
    assert (line.key, line.value, line.example) == ("torque_side", None, '"link"')
    assert "the log leaves open" in line.seen and "rotors take" in line.seen
    current = torque_unit(robot, found, "A", True, None)
    assert all(line.key != "torque_side" for line in side_lines(current, found))
