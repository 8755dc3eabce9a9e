"""Force sensors and floating bases in experiment files and logs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pivident.data.recording.load import load_recording
from pivident.experiment.experiment import load_experiment
from pivident.experiment.gains_table import DeclaredGain, _trusted_gains
from pivident.foundation.errors import PividentError
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.gallery import load_robot
from pivident.robot.measured_base import with_floating_base, with_wrench_sensors

SAMPLES = 300
NAMES = "t q1 q2 tau1 tau2 fx fy fz mx my mz x y z roll pitch yaw qx qy qz qw".split()

HELD = """
[robot]
model = "planar_2r"

[[wrench]]
name = "floor"
link = "base"
at = [0.1, 0.0, -0.2]
rpy = [0.0, 0.0, 1.5]
acts = "by_robot"

[recording]
files = "log.csv"
side = {q = "joint", tau = "joint"}
units = {q = "deg", wrench = {floor = "kN"}}

[recording.columns]
t = "t"
q = ["q1", "q2"]
tau = ["tau1", "tau2"]
wrench = {floor = ["fx", "fy", "fz", "mx", "my", "mz"]}
"""

FLOATING = (
    HELD.replace('model = "planar_2r"', 'model = "planar_2r"\nfloating_base = true').replace(
        'wrench = {floor = "kN"}',
        'wrench = {floor = ["kN", "kN", "kN", "N m", "N m", '
        '"N m"]}, base = {position = "mm", rpy = "deg"}',
    )
    + 'base = {position = ["x", "y", "z"], rpy = ["roll", "pitch", "yaw"]}\n'
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A log in degrees, kilonewtons and millimetres."""
    rng = np.random.default_rng(3)
    t = np.arange(SAMPLES) / 500.0
    q = np.column_stack([np.sin(6.0 * t), np.cos(9.0 * t)])
    rpy = 0.3 * np.column_stack([np.sin(3 * t), np.sin(4 * t), t])
    quaternion = Rotation.from_euler("xyz", rpy).as_quat()
    made = {
        "t": t, "q": q, "tau": rng.normal(size=(SAMPLES, 2)),
        "wrench": rng.normal(size=(SAMPLES, 6)), "place": rng.normal(size=(SAMPLES, 3)),
        "rpy": rpy, "folder": tmp_path_factory.mktemp("wrenches"),
    }  # fmt: skip
    scaled = [t, np.rad2deg(q), made["tau"], 1e-3 * made["wrench"], 1e3 * made["place"]]
    table = np.column_stack([*scaled, np.rad2deg(rpy), quaternion])
    np.savetxt(
        made["folder"] / "log.csv", table, fmt="%.12g", delimiter=",", header=",".join(NAMES),
        comments="",
    )  # fmt: skip
    return made


def experiment(folder, text):
    path = folder["folder"] / "experiment.toml"
    path.write_text(text, encoding="utf-8")
    return load_experiment(path)


def test_a_sensor_under_the_base(folder):
    problem = experiment(folder, HELD).problem()
    robot, (recording,) = problem.robot, problem.recordings
    (sensor,) = robot.sensors
    assert robot.base_motion == "held" and sensor.acts == "by_robot"
    np.testing.assert_array_equal(sensor.frame.translation, [0.1, 0.0, -0.2])
    np.testing.assert_allclose(sensor.frame.rotation, rotation_from_rpy(0.0, 0.0, 1.5))
    np.testing.assert_allclose(recording.wrenches[0].values, folder["wrench"], rtol=1e-9)
    np.testing.assert_allclose(recording.q[:, 6:], folder["q"], atol=1e-11)
    force = -folder["wrench"][:, :3] @ sensor.frame.rotation.T
    np.testing.assert_allclose(recording.wrench_torque[:, :3], force, atol=1e-9)


@pytest.mark.parametrize("turned", ["rpy", "quaternion"])
def test_a_floating_base(folder, turned):
    text = FLOATING
    if turned == "quaternion":
        text = text.replace(', rpy = "deg"', "")
        text = text.replace(
            'rpy = ["roll", "pitch", "yaw"]', 'quaternion = ["qx", "qy", "qz", "qw"]'
        )
    problem = experiment(folder, text).problem()
    (recording,) = problem.recordings
    np.testing.assert_allclose(recording.q[:, :3], folder["place"], atol=1e-9)
    turns = Rotation.from_euler("XYZ", recording.q[:, 3:6])
    off = turns * Rotation.from_euler("xyz", folder["rpy"]).inv()
    assert off.magnitude().max() < 1e-9
    values = folder["wrench"].copy()
    values[:, 3:] *= 1e-3  # the moments are in N m here
    np.testing.assert_allclose(recording.wrenches[0].values, values, rtol=1e-9)


def test_a_part_and_new_samples_keep_their_wrenches(folder):
    whole = experiment(folder, HELD).problem().recordings[0]
    text = HELD.replace('files = "log.csv"', 'files = "log.csv"\npart = [0.1, 0.4]')
    (part,) = experiment(folder, text).problem().recordings
    np.testing.assert_allclose(part.wrench_torque, whole.wrench_torque[50:200])
    text = HELD.replace('files = "log.csv"', 'files = "log.csv"\nrate = 250\nresample = true')
    (slow,) = experiment(folder, text).problem().recordings
    assert slow.rate == 250.0
    assert slow.wrenches[0].values.shape == (slow.samples, 6) and slow.joints == 8


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('link = "base"', 'link = "hand"', r"wrench sensor 'floor'.*'hand'.*\[robot\]"),
        ('acts = "by_robot"', 'acts = "both"', r"wrench.*acts"),
        ("at = [0.1, 0.0, -0.2]", "at = [0.1, 0.0]", r"wrench.*at"),
        ("at = [0.1, 0.0, -0.2]", "at = [0.1, nan, 0.0]", r"wrench.*at"),
        ('"mz"]}', "]}", r"columns\.wrench\.floor|wrench\.floor.*5"),
        ('"mz"]}', '"nothing"]}', r"'nothing'.*\[recording\]"),
        ('wrench = {floor = ["fx"', 'wrench = {wall = ["fx"', r"wrench"),
        ('{floor = "kN"}', '{floor = "kg"}', r"'kg' of wrench.floor.*\[recording\]"),
        ('{floor = "kN"}', '{floor = "A"}', r"'A' of wrench.floor.*\[recording\]"),
        ('{floor = "kN"}', '{wall = "kN"}', r"wrench.wall, which has no columns"),
        ("wrench = {floor = [", "wrench = 3 # [", r"columns.*wrench"),
    ],
)  # fmt: skip
def test_errors_of_a_held_base(folder, old, new, message):
    assert old in HELD
    with pytest.raises(PividentError, match="(?s)" + message):
        experiment(folder, HELD.replace(old, new)).problem()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("base = {position = [\"x\", \"y\", \"z\"], rpy = [\"roll\", \"pitch\", \"yaw\"]}", "",
         r"does not hold its pose|base.*no columns"),
        ('position = ["x", "y", "z"], ', "", r"position and either quaternion or rpy|no columns"),
        ('position = "mm"', 'position = "deg"', r"'deg' of base.position"),
        ('rpy = "deg"', 'rpy = "mm"', r"'mm' of base.rpy"),
        ('rpy = ["roll"', 'place = [1], rpy = ["roll"', r"no channel 'place'"),
        ("floating_base = true", "", r"columns.base|write floating_base = true"),
        ('rpy = ["roll"', 'quaternion = ["qx", "qy", "qz", "qw"], rpy = ["roll"',
         r"either quaternion or rpy"),
    ],
)  # fmt: skip
def test_errors_of_a_floating_base(folder, old, new, message):
    assert old in FLOATING
    with pytest.raises(PividentError, match="(?s)" + message):
        experiment(folder, FLOATING.replace(old, new)).problem()


def test_wrenches_need_a_robot_with_the_sensor(folder):
    columns = {"t": "t", "q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
    columns["wrench"] = {"floor": ["fx", "fy", "fz", "mx", "my", "mz"]}
    with pytest.raises(PividentError, match=r"wrench.*robot"):
        load_recording(folder["folder"] / "log.csv", columns)


@pytest.mark.parametrize("turned", ["rpy", "quaternion"])
def test_a_base_that_turns_past_half_a_turn_is_resampled_between_its_samples(folder, turned):
    """Roll, pitch and yaw jump there, and q and -q are the same rotation."""
    t = np.arange(SAMPLES) / 500.0
    rpy = np.column_stack([0.3 * np.sin(3 * t), 0.3 * np.sin(4 * t), 2.5 + 4.0 * t])
    quaternion = Rotation.from_euler("xyz", rpy).as_quat(canonical=True)
    assert rpy[-1, 2] > np.pi and (np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0).any()
    wrapped = (rpy + np.pi) % (2.0 * np.pi) - np.pi
    own = wrapped if turned == "rpy" else quaternion
    names = NAMES[14:17] if turned == "rpy" else NAMES[17:]
    table = np.column_stack([t, folder["q"], folder["tau"], folder["wrench"], folder["place"], own])
    path = folder["folder"] / f"turning_{turned}.csv"
    np.savetxt(path, table, delimiter=",", header=",".join([*NAMES[:14], *names]), comments="")
    (floating,) = experiment(folder, FLOATING).problem().recordings
    robot = with_wrench_sensors(
        with_floating_base(load_robot("planar_2r")), [w.sensor for w in floating.wrenches]
    )
    columns = {"t": "t", "q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
    columns |= {"wrench": {"floor": NAMES[5:11]}, "base": {"position": NAMES[11:14], turned: names}}
    recording = load_recording(path, columns, robot=robot, rate=333.0, resample=True)
    at = np.arange(recording.samples) / 333.0
    true = np.column_stack([0.3 * np.sin(3 * at), 0.3 * np.sin(4 * at), 2.5 + 4.0 * at])
    off = Rotation.from_euler("XYZ", recording.q[:, 3:6]) * Rotation.from_euler("xyz", true).inv()
    assert off.magnitude().max() < 1e-6


def test_numbers_of_joints_in_an_experiment_do_not_count_those_of_a_measured_base(folder):
    for text in (HELD, FLOATING):
        read = experiment(folder, text + "[gains]\ntrusted = {2 = 3.0, shoulder = 4.0}\n")
        robot = read.problem().robot
        declared = [DeclaredGain(gain, "A", True, "robot") for gain in (2.0, 6.0)]
        trusted = _trusted_gains(read.content.gains, robot, declared)
        assert {name: own.value for name, own in trusted.items()} == {
            "elbow": 0.5,
            "shoulder": 2.0,
        }
        assert robot.joint_index("2") == robot.joint_index("elbow") == 7
