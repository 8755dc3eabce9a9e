"""Signs by power and by gravity, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.robot_regressor import regressor_of
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.power import check_power, mechanical_power
from pivident.judgement.audit.recording_audit import log_of
from pivident.judgement.audit.timing import check_timing
from tests.judgement.audit.scara import RATE, arm

#: Friction of every joint, F_v dq + F_c tanh(100 dq), and the weight of the slide [N].
VISCOUS, DRY, WEIGHT = 2.0, 4.0, 2.0 * 9.81

#: Seconds of motion, of slowing down, and of rest.
MOVES, SLOWS, RESTS = 12.0, 1.0, 3.0


def power(held=WEIGHT, sign=1.0, friction=1.0):
    """What is said of a SCARA that moves and then rests, of its rows, and its speeds.

    ``held``: force of the resting slide [N]; ``sign``: of its logged force; ``friction``: share of
    it that there is.
    """
    robot, t = arm("0 0 1"), np.arange(int((MOVES + SLOWS + RESTS) * RATE)) / RATE
    pace = 0.5 + 0.5 * np.cos(np.pi * np.clip((t - MOVES) / SLOWS, 0.0, 1.0))
    rates = np.array([1.1, 2.3, 3.7])
    angle = np.cumsum(pace)[:, None, None] / RATE * rates + np.arange(9.0).reshape(3, 3)
    q = np.sum(np.array([0.8, 0.7, 0.2])[:, None] * np.sin(angle) / rates, axis=2)
    dq = np.gradient(q, axis=0) * RATE
    ddq = np.gradient(dq, axis=0) * RATE
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    tau = regressor_of(robot, base.parameters).torque(q, dq, ddq, theta)
    tau += friction * (VISCOUS * dq + DRY * np.tanh(100.0 * dq))
    tau[:, 2] += (held - WEIGHT) * (1.0 - pace)
    tau += 0.02 * np.random.default_rng(1).standard_normal(tau.shape)
    made = Recording(
        "run", robot.joint_names, q, tau * [1.0, 1.0, sign], RATE, torque_timing="sampled"
    )
    log = log_of(robot, made)
    model = build_inverse_model(log, check_timing(log))
    return check_power(log, model), model, dq[model.at.astype(int)]


def test_friction_takes_the_power_of_its_law():
    """P = mean (F_v dq² + F_c |dq|), and a level of mean (F_v |dq| + F_c)."""
    found, model, dq = power()
    assert found.right == (0, 1, 2) and found.reversed == ()
    for j, moving in enumerate(model.moving.T):
        speed = np.abs(dq[moving, j])
        level = VISCOUS * speed + DRY * np.tanh(100.0 * speed)
        assert found.friction[j] == pytest.approx(np.mean(level * speed), rel=5e-3)
        assert found.static[j] == pytest.approx(np.mean(level), rel=5e-3)
        assert found.standard_errors[j] < 0.01 * found.friction[j]
    signs = [f for f in found.findings if f.kind == "sign"]
    assert [f.quantity.bound for f in signs] == [0.0, 0.0, 0.0]
    (weight,) = (f for f in found.findings if f.kind == "weight")
    assert weight.quantity.value == pytest.approx(WEIGHT, rel=5e-3)


def test_a_motion_without_friction_determines_no_sign():
    found, *_ = power(friction=0.0)
    signs = [f for f in found.findings if f.kind == "sign"]
    assert found.right == found.reversed == () and len(signs) == 3
    assert all("does not determine its sign" in f.message for f in signs)
    assert not any("does not determine" in f.message for f in power()[0].findings)


@pytest.mark.parametrize(
    ("held", "severity"),
    [(12.0, "ok"), (-12.0, "ok"), (16.0, "warning"), (-22.6, "warning"), (-25.6, "error")],
)
def test_a_resting_joint_holds_its_weight_within_friction_and_half_of_it(held, severity):
    """Friction of 4 to 5 N and half of 19.6 N may be missing; more than friction is a sign."""
    found, *_ = power(WEIGHT + held)
    (rest,) = (f for f in found.findings if f.kind == "gravity at rest")
    assert (rest.subject, rest.severity) == ("slide", severity)
    assert rest.quantity.value == pytest.approx(WEIGHT + held, abs=0.8)
    assert bool(rest.next_step) == (severity != "ok")
    allowed = np.sign(held) * (found.static[2] + 0.5 * WEIGHT)
    assert rest.quantity.bound == pytest.approx(WEIGHT + allowed)
    assert rest.quantity.interval is None


def test_a_weight_of_the_wrong_sign_is_not_named_again_at_rest():
    found, *_ = power(sign=-1.0)
    kinds = {f.kind: f.severity for f in found.findings if f.subject == "slide"}
    assert kinds == {"sign": "error", "weight": "error"} and found.reversed == (2,)


@pytest.mark.parametrize(
    ("share", "periods", "is_said"),
    [(0.04, 20, False), (0.06, 20, True), (-0.06, 20, False), (0.2, 1, False)],
)
def test_an_arm_without_description_that_gives_energy_all_the_time(share, periods, is_said):
    """τ = q - d dq on q = sin t gives d π a period, beside a turnover of 2 by the spring.

    What it gives in one of twenty periods is within chance.
    """
    steps = 500
    t = 2.0 * np.pi * np.arange(20 * steps + 1) / steps
    damping = 2.0 * share * 20 / periods / np.pi * (t < 2.0 * np.pi * periods)
    q, tau = np.sin(t), np.sin(t) - damping * np.cos(t)
    record = log_of(arm("0 0 1"), Recording("run", ("a",), q[:, None], tau[:, None], 100.0))
    found = mechanical_power(replace(record, robot=None, joint_names=("a",)))
    assert [f.subject for f in found] == ["a"] * is_said
    if is_said:
        assert found[0].quantity.value == pytest.approx(-2.0 * share * 20, rel=1e-3)
        low, high = found[0].quantity.interval
        assert low < found[0].quantity.value < high < 0.0
