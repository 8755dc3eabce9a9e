"""Predicted torques and their errors against Pinocchio, closed forms and simulated truth."""

from dataclasses import replace

import numpy as np
import pytest

import pivident as pv
from pivident.estimation.equation_record import MotionRange
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import format_significant
from pivident.judgement.validation.held_out.held_out_errors import (
    ALL_JOINTS,
    HeldOutErrors,
    LogError,
    jackknife_spread,
)
from pivident.models.runnable_model import runnable_model
from pivident.studies.prediction.beside_held_out import ErrorRatio
from pivident.studies.prediction.predict import (
    block_squares,
    joint_intervals,
    motion_band_start,
    rms_by_band,
    total_interval,
)
from tests.planar_log import RATE, planar_log
from tests.planar_results import planar_results

#: Kinds of the finding beside held-out motion.
KINDS_BESIDE = ("as held out", "worse", "unknown")

ARM = """<robot name="arm"><link name="base"/>
<joint name="waist" type="revolute"><parent link="base"/><child link="a"/>
 <origin xyz="0 0 0.3" rpy="0.1 0 0"/><axis xyz="0 0 1"/>
 <limit lower="-3" upper="3" velocity="2" effort="100"/>
 <dynamics damping="1.5" friction="2.5"/></joint>
<link name="a"><inertial><origin xyz="0.1 0.02 0.2" rpy="0 0.2 0"/><mass value="6"/>
 <inertia ixx="0.2" iyy="0.25" izz="0.1" ixy="0.01" ixz="0.02" iyz="-0.01"/></inertial></link>
<joint name="lift" type="prismatic"><parent link="a"/><child link="b"/>
 <origin xyz="0.2 0 0.4" rpy="0.4 0 0.3"/><axis xyz="0 1 0"/>
 <limit lower="-1" upper="1" velocity="1" effort="500"/>
 <dynamics damping="30" friction="8"/></joint>
<link name="b"><inertial><origin xyz="0.05 0.1 -0.03"/><mass value="3"/>
 <inertia ixx="0.02" iyy="0.03" izz="0.02" ixy="0" ixz="0.001" iyz="0"/></inertial></link>
</robot>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return path


def sines(rate=500.0, seconds=20.0):
    """A motion of two joints in closed form: t, q, dq, ddq."""
    t = np.arange(int(rate * seconds)) / rate
    q, dq, ddq = np.zeros((3, t.size, 2))
    for j, waves in enumerate([((0.9, 0.4), (0.3, 1.3)), ((0.3, 0.5), (0.1, 1.1))]):
        for size, frequency in waves:
            w = 2 * np.pi * frequency
            q[:, j] += size * np.sin(w * t)
            dq[:, j] += size * w * np.cos(w * t)
            ddq[:, j] -= size * w**2 * np.sin(w * t)
    return t, q, dq, ddq


def pinocchio_torque(path, robot, q, dq, ddq):
    """Inverse dynamics by Pinocchio, with the friction of the URDF in the robot's smooth law."""
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *x).copy() for x in zip(q, dq, ddq, strict=True)])
    viscous, dry = np.array([1.5, 30.0]), np.array([2.5, 8.0])
    gamma = np.array([j.friction.terms[1].gamma for j in robot.joints])
    return tau + viscous * dq + dry * 2 / np.pi * np.arctan(gamma * dq)


def test_torques_and_errors_are_those_of_pinocchio(arm):
    robot = pv.load_robot(arm)
    t, q, dq, ddq = sines()
    truth = pinocchio_torque(arm, robot, q, dq, ddq)
    wrong = np.column_stack([0.5 * np.sin(2 * np.pi * 3.0 * t), 4.0 * np.cos(2 * np.pi * 60.0 * t)])
    record = pv.Recording.from_arrays(
        q, truth + wrong, 500.0, joint_names=robot.joint_names, torque_timing="sampled"
    )
    found = pv.predict(runnable_model(robot), record)
    assert found.units == ("N m", "N") and found.tau.shape == found.tau_model.shape
    inside = np.searchsorted(t, found.t[0]) + np.arange(found.t.size)
    scale = np.abs(truth).max(axis=0)
    assert (np.abs(found.tau_model - truth[inside]).max(axis=0) < 0.01 * scale).all()
    errors = found.error.errors
    assert errors.rms == pytest.approx([0.5 / np.sqrt(2), 4.0 / np.sqrt(2)], rel=0.01)
    total = np.sqrt(np.mean((truth + wrong)[inside] ** 2, axis=0))
    assert errors.torque == pytest.approx(total, rel=1e-3)
    # the error of each joint lies in its own band, of which 20 Hz is the end
    assert found.error.shares_by_band[1, 0] == pytest.approx(errors.relative[0], rel=0.01)
    assert found.error.shares_by_band[2, 1] == pytest.approx(errors.relative[1], rel=0.01)
    assert errors.relative_in_band[1] < 0.1 * errors.relative[1]
    assert "largest of a joint" in str(found) and "waist" in str(found.table())


def test_bands_of_sines_and_their_sum():
    t = np.arange(10000) / 1000.0
    x = np.column_stack([3 * np.sin(2 * np.pi * f * t + 0.3) for f in (0.11, 2.0, 47.0)])
    parts = rms_by_band(x, 1000.0, (0.5, 20.0))
    assert np.diag(parts) == pytest.approx(np.sqrt(np.mean(x**2, axis=0)), rel=0.02)
    assert np.sqrt((parts**2).sum(axis=0)) == pytest.approx(np.sqrt(np.mean(x**2, axis=0)))
    speeds = np.column_stack([np.cos(2 * np.pi * 0.7 * t), np.cos(2 * np.pi * 3.0 * t)])
    assert motion_band_start(speeds, 1000.0, 20.0) == pytest.approx(0.7, abs=0.05)


def test_intervals_hold_the_error_of_motion_like_this():
    """Errors of changing size and colour, beside their known share of the torque."""
    rng = np.random.default_rng(5)
    held = np.zeros(2)
    runs = 400
    for _ in range(runs):
        size = np.repeat(rng.gamma(4.0, 0.25, 40), 50)  # 40 moves, hard and easy ones
        torque = 5 * np.convolve(rng.standard_normal(2009), np.ones(10) / np.sqrt(10), "valid")
        colour = np.convolve(rng.standard_normal(2009), np.ones(10) / np.sqrt(10), "valid")
        error = 0.5 * size * colour
        squares = [block_squares(x[:, None], 100.0) for x in (error, torque)]
        true = 10.0 * np.sqrt(1.25)  # E size² = 1 + 1/4
        low, high = joint_intervals(*squares)[0]
        both = total_interval(*[np.repeat(s, 2, axis=1) for s in squares], ("N", "N"))
        assert both == pytest.approx([low, high])  # two joints alike
        held += low <= true <= high, high / low < 3.0
    assert 0.90 <= held[0] / runs <= 0.985
    assert held[1] == runs


def result_and_record():
    """Least squares of the planar arm, and another second of its loop."""
    (result,) = planar_results("ls")
    table = planar_log()[6000:]
    q = np.deg2rad(table[:, 1:3])
    return result, pv.Recording.from_arrays(q, table[:, 5:7], RATE, name="later")


def test_error_beside_that_of_held_out_motion():
    result, record = result_and_record()
    plain = pv.predict(result, record).error

    def beside(factor, spread=0.02, joints=(1.0, 1.0)):
        """The finding, with held-out errors so many times those of the log."""
        now = [plain.moving[name] for name in (ALL_JOINTS, "shoulder", "elbow")]
        moving = {
            name: LogError(factor * share * one.value, spread, 20)
            for name, one, share in zip(
                (ALL_JOINTS, "shoulder", "elbow"), now, (1.0, *joints), strict=True
            )
        }
        held_out = HeldOutErrors("IDIM-WLS", "3 held-out blocks", 20.0, 0.42, 0.4, {}, {}, {},
                                 moving=moving)  # fmt: skip
        found = pv.predict(result, record, held_out=held_out)
        return found, next(f for f in found.findings if f.kind in KINDS_BESIDE)

    found, better = beside(5.0)
    assert better.severity == "ok" and ": better (" in better.message
    assert str(found.table()).count("better") == 2
    _, worse = beside(0.2)
    assert worse.severity == "warning" and ": worse (" in worse.message
    assert 4.0 < worse.evidence["ratio"].value < 6.0
    _, one = beside(1.0, joints=(1.0, 0.1))
    assert one.severity == "warning" and "Worse: elbow." in one.message
    _, unknown = beside(1.0, spread=1.0)
    assert unknown.severity == "note" and ": unknown (" in unknown.message
    _, blind = beside(1.0, spread=float("nan"))
    assert ": unknown." in blind.message


@pytest.mark.parametrize(
    ("now", "then", "answer"),
    [
        (LogError(10.0, 0.02, 20), LogError(10.2, 0.02, 5), "as good"),
        (LogError(20.0, 0.08, 20), LogError(14.0, 0.01, 5), "worse"),
        (LogError(14.0, 0.01, 20), LogError(20.0, 0.08, 20), "better"),
        (LogError(10.4, 0.001, 20), LogError(10.0, 0.001, 20), "as good"),
        (LogError(10.0, 0.3, 20), LogError(10.0, 0.01, 20), "unknown"),
        (LogError(10.0, 0.3, 1), LogError(10.0, 0.01, 20), "unknown"),
    ],
)
def test_two_errors_are_told_apart_by_the_interval_of_their_ratio(now, then, answer):
    assert ErrorRatio.of(now, then).answer == answer


def test_the_interval_of_a_ratio_holds_the_true_one():
    """Two logs of the same machine: their true ratio is one."""
    rng = np.random.default_rng(7)
    held, runs = 0, 400

    def error(blocks):
        size = np.repeat(rng.gamma(6.0, 1.0 / 6.0, blocks), 100)
        squares = block_squares((size * rng.standard_normal(100 * blocks))[:, None], 100.0)
        left_out = np.sqrt(squares.sum(axis=0) - squares)
        value = np.sqrt(squares.sum() / (100 * blocks))
        return LogError(value, float(jackknife_spread(left_out)[0]), len(squares))

    for _ in range(runs):
        ratio = ErrorRatio.of(error(20), error(5))
        held += ratio.low <= 1.0 <= ratio.high
    assert 0.90 <= held / runs <= 0.985


def test_motion_beyond_the_fit_is_named_with_its_error():
    result, record = result_and_record()
    inside = pv.predict(result, record)
    whole = MotionRange(*(np.array(x) for x in inside_range(inside)))
    assert pv.predict(result, record, fitted=whole).exits == ()
    half = replace(whole, speed=whole.speed * [1.0, 0.5], high=whole.high - [0.4, 0.0])
    found = pv.predict(result, record, fitted=half)
    shoulder, elbow = found.exits
    assert (shoulder.joint, elbow.joint) == ("shoulder", "elbow")
    assert shoulder.position == pytest.approx(0.4, rel=1e-6) and shoulder.speed == 0.0
    assert elbow.speed == pytest.approx(2.0, rel=1e-6) and elbow.position == 0.0
    fast = np.abs(found.dq[found.moving, 1]) > 1.05 * half.speed[1]
    assert elbow.share == pytest.approx(fast.mean())
    error = (found.tau - found.tau_model)[found.moving, 1]
    outside, within = (np.sqrt(np.mean(error[own] ** 2)) for own in (fast, ~fast))
    text = found.findings[-1].message
    there, own = (format_significant(float(x)) for x in (outside, within))
    assert f"rms error there is {there} N m, inside {own} N m" in text


def inside_range(found):
    q, dq, ddq = (x[found.moving] for x in (found.q, found.dq, found.ddq))
    return q.min(axis=0), q.max(axis=0), np.abs(dq).max(axis=0), np.abs(ddq).max(axis=0)


def test_friction_at_rest_is_named():
    result, _ = result_and_record()
    t = np.arange(2000) / RATE
    swing, rest = 0.5 * (1 - np.cos(np.pi * t)), np.zeros(1000)
    q = np.column_stack([np.concatenate([swing, rest, swing])] * 2)
    speed = np.gradient(q, 1 / RATE, axis=0)
    tau = result.predict(q, speed, np.gradient(speed, 1 / RATE, axis=0))
    noise = 0.1 * np.random.default_rng(3).standard_normal(q.shape)
    tau = (
        tau
        + noise
        + np.where((np.arange(5000) >= 2000) & (np.arange(5000) < 3000), 2.0, 0.0)[:, None]
    )
    record = pv.Recording.from_arrays(q, tau, RATE, torque_timing="sampled")
    (note,) = [f for f in pv.predict(result, record).findings if f.topic == "standstill"]
    there = float(note.message.split("shoulder ")[1].split(" N m")[0])
    assert there == pytest.approx(2.0, rel=0.05)
    assert "elbow 2.0" in note.message or "elbow 1.9" in note.message


def test_a_log_in_other_units_is_recognised_as_useless():
    result, record = result_and_record()
    found = pv.predict(result, replace(record, tau=record.tau * [1.0, -1.0]))
    error = next(f for f in found.findings if f.severity == "error")
    assert error.message == "The error is larger than the torque itself on elbow."


def test_without_torque_nothing_is_compared():
    result, record = result_and_record()
    found = pv.predict(result, record, compare=False)
    assert found.tau is None and found.error is None
    np.testing.assert_array_equal(found.tau_model, pv.predict(result, record).tau_model)
    assert "predicted rms" in str(found.table()) and "nothing is compared" in str(found)


def test_consistent_and_runnable_models_predict_too():
    result, record = result_and_record()
    consistent = pv.make_consistent(result)
    by_model = pv.predict(runnable_model(consistent), record)
    found = pv.predict(consistent, record)
    np.testing.assert_allclose(found.tau_model, by_model.tau_model, atol=1e-9)
    assert found.method == by_model.method == "PC-IDIM-WLS"
    assert len(found.exits) == len(by_model.exits) == len(pv.predict(result, record).exits)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_names": ("elbow", "hand")}, "elbow, hand, robot 'planar 2R' has shoulder, elbow"),
        ({"joint_names": ("a", "b")}, "has the joints a, b, robot"),
    ],
)
def test_another_robots_recording_is_refused(change, message):
    result, record = result_and_record()
    with pytest.raises(ExperimentError, match=message):
        pv.predict(result, replace(record, **change))
    three = np.column_stack([record.q, record.q[:, 0]])
    more = pv.Recording.from_arrays(three, three, RATE, allow_constant=True)
    with pytest.raises(ExperimentError, match="3 joints instead of 2"):
        pv.predict(result, more)
    with pytest.raises(ExperimentError, match="type Problem predicts no torques"):
        pv.predict(pv.Problem(result.robot, (record,)), record)


def test_a_computed_torque_is_no_measured_one():
    """Neither zeros nor the torque of a control law are compared with the prediction."""
    result, record = result_and_record()
    for source in ("none", "law"):
        found = pv.predict(result, replace(record, torque_source=source))
        assert found.tau is None
        assert found.error is None
        np.testing.assert_allclose(found.tau_model, pv.predict(result, record).tau_model)
