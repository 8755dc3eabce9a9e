"""What dry friction does at reversals is no delay: joints that stick, and that give way first."""

import numpy as np
import pytest

from pivident.data.logs.timestamps import runs_of
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.robot_regressor import regressor_of
from pivident.judgement.audit.delay import check_delay
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.recording_audit import log_of
from pivident.judgement.audit.timing import check_timing
from pivident.robot.gallery import load_robot

FAST, RATE, SECONDS = 1000.0, 100.0, 40.0
FRICTION = np.array([60.0, 60.0, 30.0, 15.0, 15.0, 8.0])  # N m
PAUSES = np.array([0.12, 0.2, 0.08, 0.16, 0.1, 0.24])  # s


def motion(pauses):
    """Swings of all joints, each held for a while where it turns back, and when it is held."""
    samples = int(SECONDS * FAST)
    q, held = np.zeros((samples, 6)), np.zeros((samples, 6), bool)
    t = np.arange(2 * samples) / FAST
    for j, pause in enumerate(pauses):
        free = 0.7 * np.sin((1.0 + 0.2 * j) * t + j) + 0.2 * np.sin((3.1 + 0.3 * j) * t)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(free)))) + 1
        rows = np.sort(np.concatenate([np.arange(len(t)), np.repeat(turns, int(pause * FAST))]))
        q[:, j], held[:, j] = free[rows][:samples], (np.diff(rows, prepend=-1) == 0)[:samples]
    return q, held


def log(pauses, delay):
    """Torques of an arm whose friction passes from one side to the other while a joint is held."""
    robot = load_robot("staubli_tx40")
    q, held = motion(pauses)
    dq = np.gradient(q, axis=0) * FAST
    ddq = np.gradient(dq, axis=0) * FAST
    ddq[held | np.roll(held, 1, 0) | np.roll(held, -1, 0)] = 0.0
    side = np.sign(dq)
    for j in range(6):
        for start, stop in runs_of(held[:, j]):
            rows = slice(max(start - 1, 0), min(stop + 1, len(side)))
            before, after = side[max(start - 3, 0), j], side[min(stop + 3, len(side) - 1), j]
            side[rows, j] = np.linspace(before, after, rows.stop - rows.start)
    base = base_parameters(robot)
    rigid = regressor_of(robot, base.parameters).torque(
        q, dq, ddq, base.values(nominal_values(robot, base.standard))
    )
    tau = np.roll(rigid + FRICTION * (side + 0.1 * dq), round(delay * FAST), axis=0)
    rows = slice(100, None, int(FAST / RATE))
    noise = np.random.default_rng(4).standard_normal
    q, tau = q[rows], tau[rows]
    made = Recording(
        "run", robot.joint_names, q + 1e-5 * noise(q.shape), tau + 0.05 * noise(tau.shape), RATE,
        torque_timing="sampled",
    )  # fmt: skip
    return log_of(robot, made)


@pytest.mark.parametrize("delay", [0.0, 0.03])
def test_the_delay_of_a_log_of_sticking_joints(delay):
    made = log(PAUSES, delay)
    found = check_delay(made, build_inverse_model(made, check_timing(made)))
    mean, error = found.common
    assert abs(mean - delay) < 2.0 * error, (mean, error)
    (common,) = (f for f in found.findings if not f.subject)
    assert (common.severity != "ok") == (delay > 0.0), common


WOUND_UP = 0.006  # rad, over which friction changes its side


def wound_up(friction, delay):
    """Torques of a planar arm with Dahl's friction, dF/dq = (1 - F sign(dq)/Fc) Fc/s."""
    robot = load_robot("planar_2r")
    t = np.arange(int(SECONDS * FAST)) / FAST
    q = np.stack([0.7 * np.sin(2.1 * t) + 0.2 * np.sin(6.3 * t), 0.8 * np.sin(3.7 * t + 1)], 1)
    dq = np.gradient(q, axis=0) * FAST
    ddq = np.gradient(dq, axis=0) * FAST
    dry = np.zeros_like(q)
    for k, step in enumerate(np.diff(q, axis=0), start=1):
        side = np.sign(step) * friction
        dry[k] = side + (dry[k - 1] - side) * np.exp(-np.abs(step) / (WOUND_UP / 3.0))
    base = base_parameters(robot)
    rigid = regressor_of(robot, base.parameters).torque(
        q, dq, ddq, base.values(nominal_values(robot, base.standard))
    )
    tau = np.roll(rigid + dry, round(delay * FAST), axis=0)
    noise = np.random.default_rng(5).standard_normal
    made = Recording(
        "run", robot.joint_names, q + 1e-5 * noise(q.shape), tau + 0.02 * noise(tau.shape), FAST,
        torque_timing="sampled",
    )  # fmt: skip
    return log_of(robot, made)


@pytest.mark.parametrize("delay", [0.0, 0.012])
def test_friction_that_is_wound_up_behind_a_reversal_is_no_delay(delay):
    made = wound_up(np.array([8.0, 4.0]), delay)
    found = check_delay(made, build_inverse_model(made, check_timing(made)))
    mean, error = found.common
    assert abs(mean - delay) < 3.0 * error + 5e-4, (mean, error)
    (common,) = (f for f in found.findings if not f.subject)
    assert (common.severity != "ok") == (delay > 0.0), common
