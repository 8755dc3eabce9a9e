"""Each planted fault is found, with the right channel, and nothing else is blamed."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pivident.experiment.init.torque_unit import compare, torque_unit
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.audit.delay import possible_loops, undeclared_timing
from tests.judgement.audit.logs import (
    clean_log,
    delayed,
    only_rows,
    planar,
    serious,
    tx40,
    with_channels,
    with_torque,
)


def found(log, check):
    return [f for f in audit_log(log).of(check) if f.severity != "ok"]


@pytest.mark.parametrize("late", (10e-3, 3e-3, -10e-3))
@pytest.mark.parametrize("make", (planar, tx40))
def test_delay_of_all_torques(make, late):
    log = make()
    rate = 1.0 / np.median(np.diff(log.clock))
    tau = np.column_stack([delayed(x, late * rate) for x in log.channels["tau"].T])
    audit = audit_log(with_channels(log, tau=tau))
    (finding,) = [f for f in audit.of("delay") if f.severity != "ok"]
    assert finding.kind == ("late" if late > 0 else "early") and finding.subject == ""
    assert audit.delay.common[0] == pytest.approx(late, abs=4 * audit.delay.common[1] + 1e-5)
    assert audit.delay.common[1] < 0.5e-3
    low, high = finding.quantity.interval
    assert low < finding.quantity.value < high
    if abs(late) == 10e-3:
        assert finding.severity == "error"
        assert f"delay = {audit.delay.common[0]:.3g}" in finding.next_step
    # The rest of the audit is carried out on the aligned torque, and finds nothing.
    assert {kind for _, kind, _ in serious(audit)} == {finding.kind}


def test_declared_delay_is_taken_into_account():
    log = planar()
    tau = np.column_stack([delayed(x, 10) for x in log.channels["tau"].T])
    right = replace(with_channels(log, tau=tau), delay=10e-3)
    assert serious(audit_log(right)) == set()
    short = replace(right, delay=4e-3)
    (finding,) = found(short, "delay")
    assert finding.quantity.value == pytest.approx(6.0, abs=0.1)
    advised = float(re.search(r"delay = (\S+) ", finding.next_step)[1])
    assert advised == pytest.approx(0.01, abs=1e-4)
    assert "declared delay of 4 ms" in finding.message


def test_a_fit_on_which_singular_values_do_not_converge():
    log = tx40(104, seconds=2.0)
    tau = np.column_stack([delayed(x, 15) for x in log.channels["tau"].T])
    assert audit_log(with_channels(log, tau=tau)).delay.common[0] == pytest.approx(3e-3, abs=3e-4)


def test_delay_of_one_joint():
    log = with_torque(tx40(100, seconds=4.0), 3, lambda x: delayed(x, 25))
    (finding,) = found(log, "delay")
    assert finding.subject == "joint_4" and finding.kind == "joint late"
    assert finding.quantity.value == pytest.approx(5.0, abs=0.5)


@pytest.mark.parametrize(
    ("make", "joint"), [(planar, 0), (planar, 1), *((tx40, j) for j in range(6))]
)
def test_sign_of_one_torque(make, joint):
    log = with_torque(make(), joint, np.negative)
    audit = audit_log(log)
    name = log.joint_names[joint]
    assert ("error", "sign", name) in serious(audit)
    assert {where for _, _, where in serious(audit)} == {name}
    assert audit.power.reversed == (joint,)


def test_all_signs():
    log = planar()
    audit = audit_log(with_channels(log, tau=-log.channels["tau"]))
    assert audit.power.reversed == (0, 1)
    assert "tau = -1.0" in next(f for f in audit.of("power") if f.kind == "sign").next_step


@pytest.mark.parametrize(
    ("factor", "severity"), [(1.2, None), (1.35, "warning"), (0.7, "warning"), (5.0, "error")]
)
def test_gain_of_one_torque(factor, severity):
    log = with_torque(tx40(), 1, lambda x: factor * x)
    audit = audit_log(log)
    assert audit.scale.factors[1] == pytest.approx(factor, rel=0.01)
    gains = {(f.severity, f.subject) for f in audit.of("scale") if f.severity != "ok"}
    assert gains == (set() if severity is None else {(severity, "joint_2")})


def test_a_body_described_the_wrong_way_round_is_no_reversed_sign():
    log = planar()
    elbow = log.robot.links[1]
    turned = replace(elbow, inertia=elbow.inertia * np.r_[np.ones(6), -np.ones(3), 1.0])
    wrong = replace(log, robot=replace(log.robot, links=(log.robot.links[0], turned)))
    audit = audit_log(wrong)
    assert audit.scale.factors[1] < 0 and audit.power.right == (0, 1)
    assert serious(audit) == {("warning", "gain", "elbow")}
    (finding,) = [f for f in audit.of("scale") if f.severity != "ok"]
    assert finding.next_step.startswith("Friction shows that its sign is right")
    found = compare(wrong.robot, log.channels["q"], log.channels["tau"], log.clock)
    assert torque_unit(wrong.robot, found, "N m", False, None).value == "N m"


def test_a_wrong_body_has_another_shape_than_a_wrong_gain():
    log = planar()
    elbow = log.robot.links[1]
    heavy = replace(elbow, inertia=elbow.inertia * np.r_[np.ones(6), 0.1, 1.0, 1.0, 1.0])
    robot = replace(log.robot, links=(log.robot.links[0], heavy))
    assert abs(audit_log(replace(log, robot=robot)).scale.likeness[1]) < 0.95
    assert audit_log(with_torque(log, 1, lambda x: 5.0 * x)).scale.likeness[1] > 0.99


def test_motor_torque_taken_for_joint_torque():
    log = tx40()
    ratio = abs(log.robot.transmission.reduction[1, 1])
    audit = audit_log(with_torque(log, 1, lambda x: x / ratio))
    (finding,) = [f for f in audit.of("scale") if f.severity != "ok"]
    assert finding.subject == "joint_2" and 'tau = "motor"' in finding.next_step


def test_command_without_gain():
    log = replace(with_torque(planar(), 0, lambda x: x / 12.5), commands=(0,))
    finding = next(f for f in audit_log(log).of("scale") if f.subject == "shoulder")
    assert finding.severity == "warning" and "suggests 12.5 N m per unit" in finding.message


@pytest.mark.parametrize(("make", "pair"), [(planar, (0, 1)), (tx40, (1, 2)), (tx40, (4, 5))])
def test_order_of_the_torques(make, pair):
    log = make()
    tau = log.channels["tau"].copy()
    tau[:, pair] = tau[:, pair[::-1]]
    audit = audit_log(with_channels(log, tau=tau))
    names = ", ".join(log.joint_names[j] for j in pair)
    assert serious(audit) == {("error", "order", names)}


def test_degrees_for_radians():
    log = planar()
    audit = audit_log(with_channels(log, q=np.rad2deg(log.channels["q"])))
    kinds = {(kind, where) for _, kind, where in serious(audit)}
    assert kinds == {("reach", "shoulder"), ("reach", "elbow"), ("angle unit", "q")}
    assert '"deg"' in next(f for f in audit.findings if f.kind == "angle unit").next_step


def test_radians_for_degrees():
    log = tx40()
    audit = audit_log(with_channels(log, q=np.deg2rad(log.channels["q"])))
    assert serious(audit) == {("error", "angle unit", "q")}
    assert '"rad"' in next(f for f in audit.findings if f.kind == "angle unit").next_step


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_one_joint_in_another_angle_unit(joint):
    log = tx40()
    q = log.channels["q"].copy()
    q[:, joint] = np.deg2rad(q[:, joint])  # radians that were read as degrees
    audit = audit_log(with_channels(log, q=q))
    name = log.robot.joints[joint].name
    assert ("error", "joint angle unit", name) in serious(audit)
    assert name in next(f for f in audit.findings if f.kind == "joint angle unit").next_step


def test_clipped_torque():
    log = planar()
    limit = 0.6 * np.abs(log.channels["tau"][:, 0]).max()
    audit = audit_log(with_torque(log, 0, lambda x: np.clip(x, -limit, limit)))
    assert ("error", "clipped", "tau of shoulder") in serious(audit)


def test_missing_values():
    tau = planar().channels["tau"].copy()
    tau[1234:1237, 1] = np.nan
    audit = audit_log(with_channels(planar(), tau=tau))
    assert serious(audit) == {("error", "missing", "tau of elbow")}
    finding = next(f for f in audit.findings if f.kind == "missing")
    assert finding.sample == 1234 and finding.quantity.value == 3
    assert finding.time == pytest.approx(1.234, abs=1e-4)
    assert audit.delay is not None


@pytest.mark.parametrize(("channel", "height"), [("q", 0.01), ("tau", 100.0)])
def test_spike(channel, height):
    values = planar().channels[channel].copy()
    values[1234, 1] += height
    audit = audit_log(with_channels(planar(), **{channel: values}))
    assert serious(audit) == {("warning", "spike", f"{channel} of elbow")}
    finding = next(f for f in audit.findings if f.kind == "spike")
    assert finding.sample == 1234 and finding.quantity.value == pytest.approx(height, rel=0.05)


def test_constant_channel():
    q = planar().channels["q"].copy()
    q[:, 1] = 0.3
    audit = audit_log(with_channels(planar(), q=q))
    assert ("error", "constant", "q of elbow") in serious(audit)
    assert any("fc2 (fv2" in f.message for f in audit.of("excitation") if f.kind == "inseparable")


def test_turning_past_a_full_turn():
    q = planar().channels["q"].copy()
    q[:, 0] = (q[:, 0] + 0.3 + np.pi) % (2 * np.pi) - np.pi
    wound = q[:, 0].copy()
    wound[2000:] -= 2 * np.pi
    q[:, 0] = wound
    audit = audit_log(with_channels(planar(), q=q))
    assert ("error", "wrapped", "q of shoulder") in serious(audit)


@pytest.mark.parametrize("make", (planar, tx40))
def test_lost_and_repeated_samples_without_stamps(make):
    log = make()
    rate = 1.0 / np.median(np.diff(log.clock))
    rows = np.arange(log.samples)
    lost = found(only_rows(log, np.delete(rows, [700, 1500, 2200]), rate), "timing")
    assert [(f.kind, f.quantity.value, f.sample) for f in lost] == [("lost", 3.0, 699)]
    twice = found(only_rows(log, np.sort(np.r_[rows, 700, 1500, 2200]), rate), "timing")
    assert [(f.kind, f.quantity.value, f.sample) for f in twice] == [("repeated", 3.0, 700)]


def test_motion_too_poor_to_separate_the_parameters():
    log = planar()
    audit = audit_log(only_rows(log, np.arange(0, 420)))
    assert audit.model is None  # 420 samples of 20 Hz are nothing to compare
    still = log.channels["q"].copy()
    still[:, 0] = still[0, 0] + 1e-6 * np.random.default_rng(0).standard_normal(log.samples)
    audit = audit_log(with_channels(log, q=still))
    assert serious(audit) == {("error", "standstill", "shoulder")} and audit.model is None
    (found_still,) = audit.of("motion")
    assert found_still.quantity.unit == "mrad" and " mrad in the whole" in found_still.message
    slow = log.channels["q"].copy()
    slow[:, 0] = slow[0, 0] + 0.01 * (slow[:, 0] - slow[0, 0])
    weak = audit_log(with_channels(log, q=slow)).of("excitation")
    assert any(f.severity != "ok" and "shoulder" in f.next_step for f in weak)


def every(log, count):
    """The log of a slower logger, beside the same loop."""
    channels = {kind: values[::count] for kind, values in log.channels.items()}
    clocks = {name: t[::count] for name, t in log.clocks.items()}
    return replace(log, channels=channels, logged=dict(channels), clocks=clocks)


def faster_loop(log, rate, common):
    """The likeliest rate of a faster loop [Hz], or None."""
    return next(iter(possible_loops(log, rate, common)), None)


def test_a_loop_that_is_faster_than_the_log_is_told_from_the_time_that_it_holds_a_torque():
    whole = clean_log("planar_2r", 4, 10.0)  # a loop of 1 kHz
    slow = audit_log(every(whole, 2))
    rate = faster_loop(every(whole, 2), slow.model.rate, slow.delay.common)
    assert rate == pytest.approx(1000.0, rel=1e-3)
    assert undeclared_timing(every(whole, 2), slow.model.rate, slow.delay.common) is None
    same = audit_log(whole)
    assert faster_loop(whole, same.model.rate, same.delay.common) is None
    declared = replace(every(whole, 2), control_rate=1000.0)
    assert faster_loop(declared, slow.model.rate, slow.delay.common) is None


@pytest.mark.parametrize(("delay", "error"), [(0.0, 1e-5), (2e-3, 1e-5), (1.5e-3, 6e-4)])
def test_no_loop_is_told_where_the_torque_is_held_throughout_or_not_or_nobody_knows(delay, error):
    log = every(clean_log("planar_2r", 1, 10.0), 4)
    assert faster_loop(log, 250.0, (delay, error)) is None


def test_a_torque_that_is_held_for_a_quarter_is_told_before_one_of_an_instant():
    """1 ms of 4 ms in a log of 250 Hz, with a standard error of 0.4 ms: not clear of nothing."""
    log = every(clean_log("planar_2r", 1, 10.0), 4)
    assert faster_loop(log, 250.0, (1.5e-3, 2e-4)) == pytest.approx(1000.0)
    assert undeclared_timing(log, 250.0, (1.5e-3, 2e-4)) is None
    assert faster_loop(log, 250.0, (1.9e-3, 2e-4)) is None
    assert undeclared_timing(log, 250.0, (1.9e-3, 2e-4)) == "sampled"


def test_of_loops_that_are_as_possible_the_usual_one_is_taken():
    """Half a sample at most: 1,000 to 2,500 Hz for a log of 500 Hz."""
    log = every(clean_log("planar_2r", 1, 10.0), 2)
    assert possible_loops(log, 500.0, (0.78e-3, 1e-5)) == [2000.0, 2500.0]
    assert possible_loops(log, 500.0, (0.72e-3, 3e-5)) == [2000.0, 1500.0, 2500.0]
    assert faster_loop(log, 500.0, (0.667e-3, 1e-5)) == pytest.approx(1500.0)
    assert faster_loop(log, 499.99, (0.75e-3, 1e-5)) == 2000.0
