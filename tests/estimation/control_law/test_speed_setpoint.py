"""Drives that follow a speed setpoint: their law identified again, or refused."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pivident.data.recording.public_records import load_kuka_kr300
from pivident.data.recording.recording import Recording
from pivident.estimation.control_law.identified_law import identify_controller
from pivident.estimation.control_law.law_equations import channel_of
from pivident.estimation.control_law.speed_setpoint import speed_setpoint
from pivident.estimation.control_law.unknown_loop import reconstruct_loop
from pivident.foundation.errors import IdentificationError
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.gallery import load_robot

KR300 = Path(__file__).parents[3] / "examples" / "kuka_kr300" / "kuka_kr300_axes_1_3.toml"

#: Steps per second of the drive and of the log; position, speed and integral gain; the way of the
#: setpoint; inertia, viscous and dry friction of the axis.
DRIVE, RATE = 5000, 250
POSITION, SPEED, INTEGRAL, DELAY = 0.5, 10.0, 70.0, 0.006
INERTIA, VISCOUS, DRY = 0.1, 0.8, 0.9


def setpoint_record(seed, seconds=10.0, mass=0.7, size=1.0):
    """An axis whose drive gets T late the reference's speed, K e and a feed-forward off by 30 %.

    The reference is as large as ``size`` says.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * DRIVE)) / DRIVE
    waves = [(f, *rng.uniform((0.2, 0.0), (0.4, 6.0))) for f in (0.11, 0.23, 0.41)]
    r = 0.3 + size * sum(a * np.sin(2 * np.pi * f * t + p) for f, a, p in waves)
    dr, ddr = np.gradient(r, t), np.gradient(np.gradient(r, t), t)
    feed = mass * (INERTIA * ddr + VISCOUS * dr + DRY * np.tanh(50 * dr))
    push = 0.05 * np.convolve(rng.normal(size=t.size), np.ones(40), "same")
    late = int(DELAY * DRIVE)
    q, v, integral = r[0], dr[0], 0.0
    logged = np.empty((t.size, 2))
    for k in range(t.size):
        logged[k, 0] = q
        before = max(k - late, 0)
        w = dr[before] + POSITION * (r[before] - logged[before, 0]) + feed[before] / SPEED - v
        integral += INTEGRAL * w / DRIVE
        logged[k, 1] = u = SPEED * (w + integral)
        v += (u + push[k] - VISCOUS * v - DRY * np.tanh(50 * v)) / INERTIA / DRIVE
        q += v / DRIVE
    part = slice(None, None, DRIVE // RATE)
    column = [x[part, None] for x in (logged[:, 0], logged[:, 1], r, dr, feed)]
    return Recording(
        f"setpoint_{seed}", ("axis",), column[0], column[1], float(RATE), q_ref=column[2],
        dq_ref=column[3], inputs={"feed_forward": column[4]},
    )  # fmt: skip


@pytest.fixture(scope="module")
def records():
    return setpoint_record(1), setpoint_record(2)


@pytest.fixture(scope="module")
def found(records):
    return identify_controller(records)


def test_gains_and_delay_are_found(found):
    (law,) = found.joints
    truth = {
        "position_gain": POSITION,
        "speed_gain": SPEED,
        "integral_gain": INTEGRAL,
        "delay": DELAY,
    }
    for term, value in truth.items():
        std = law.std[law.terms.index(term)]
        assert abs(law.gain(term) - value) < 4 * std + 0.02 * value, term
        assert std < 0.1 * value, term
    assert law.relative_error < 0.02
    assert isinstance(found.law, Cascade) and found.law.speed_feed_forward == 1.0
    assert "position_gain" in str(found) and "speed setpoint" in found.warnings[0]


def test_the_recordings_hold_the_setpoint_as_it_arrives(records, found):
    given = records[0]
    seen = found.signals[0]
    late = found.joints[0].gain("delay") * RATE
    k = np.arange(100, 2000)
    arrived = np.interp(k - late, np.arange(given.samples), given.q_ref[:, 0])
    np.testing.assert_allclose(seen.q_ref[k, 0], arrived, rtol=0, atol=2e-5)
    feed = given.inputs["feed_forward"][:, 0] / found.joints[0].gain("speed_gain")
    wanted = np.interp(k - late, np.arange(given.samples), given.dq_ref[:, 0] + feed)
    np.testing.assert_allclose(seen.dq_ref[k, 0], wanted, rtol=0, atol=5e-3)
    assert not seen.inputs


def test_without_the_inputs_the_law_is_refused(records):
    bare = [dataclasses.replace(r, inputs={}) for r in records]
    with pytest.raises(IdentificationError, match="all known inputs"):
        identify_controller(bare)


def test_a_reference_that_stays_has_no_band_but_a_law(found):
    """The joint is pushed about by the others; a reference without power has no frequency."""
    held = [setpoint_record(seed, size=0.0) for seed in (1, 2)]
    assert all(np.ptp(r.q_ref) == 0.0 and np.ptp(r.q) > 1e-4 for r in held)
    own = speed_setpoint([channel_of(r, 0, 1.0, np.inf) for r in held], [np.zeros(2500)] * 2)
    assert abs(own.position_gain - POSITION) < 4 * own.std[0] + 0.02 * POSITION
    assert abs(own.speed_gain - SPEED) < 4 * own.std[1] + 0.1 * SPEED
    assert 0.0 < own.cutoff < found.setpoints[0].cutoff


def test_a_reversed_torque_is_no_speed_loop(records):
    turned = [dataclasses.replace(r, tau=-r.tau) for r in records]
    channels = [channel_of(r, 0, 1.0, np.inf) for r in turned]
    own = speed_setpoint(channels, [r.inputs["feed_forward"][:, 0] for r in turned])
    assert own.explained > 0.99 and own.integral_gain < 0.0 and not own.believable


@pytest.mark.record
def test_the_kr300_follows_a_speed_setpoint(public_data):
    """Stated by the authors of the records: 573/kd, kd; they know of no integrator and delay."""
    robot = load_robot(KR300)
    runs = [load_kuka_kr300(run, robot=robot).slice(1.8, 8.2) for run in "AB"]
    gain = np.diag(robot.transmission.reduction)
    recordings, loop = reconstruct_loop(robot, runs, drive_gain=gain)
    stated = np.array([1046.4, 1137.6, 1073.4])
    np.testing.assert_allclose(loop.controller.kv, stated, rtol=0.1)
    np.testing.assert_allclose(loop.controller.kp, 572.96 / stated, rtol=0.12)
    assert all(law.relative_error < 0.025 for law in loop.identified.joints)
    delays = [law.gain("delay") for law in loop.identified.joints]
    np.testing.assert_allclose(delays, 0.006, atol=0.001)
    assert not recordings[0].inputs
    with pytest.raises(IdentificationError, match=r"explains \d+\.\d % of its position error"):
        identify_controller([dataclasses.replace(r, inputs={}) for r in runs], gain)
