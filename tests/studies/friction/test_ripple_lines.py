"""Ripple over the position: found where it is, silent where it is not, told from lines in time."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import ExperimentError
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission
from pivident.studies.friction.friction_figures import ripple_figures
from pivident.studies.friction.order_spectrum import WhiteRows, order_grid, order_spectrum
from pivident.studies.friction.ripple_lines import (
    NamedOrder,
    angles_of,
    relate,
    remove_ripple,
    ripple_torque,
)
from pivident.studies.friction.ripple_search import find_ripple
from tests.synthetic_identification import synthetic_identification

RATE = 400.0
GEAR = 20.0


def one_gear(robot_name: str = "planar_2r", gear: float = GEAR):
    robot = load_robot(robot_name)
    ones = np.ones(robot.size)
    return replace(robot, transmission=Transmission(np.diag(gear * ones), ones, 0 * ones))


def motion(rng, t, speed_ratio: float = 1.0):
    """Three sines: one joint's position and speed."""
    w = 2 * np.pi * np.array([0.21, 0.5, 0.83]) * rng.uniform(0.8, 1.2, 3) * speed_ratio
    phase, size = rng.uniform(0, 2 * np.pi, 3), np.array([0.8, 0.3, 0.15])
    angle = np.outer(t, w) + phase
    return np.sin(angle) @ size, np.cos(angle) @ (size * w)


def record(
    seed, ripple=None, *, seconds=5.0, sigma=0.02, colour=(1, -1.5, 0.7), extra=None, joints=2
):
    """A fitted recording of two joints with coloured residuals and, on the first, ``ripple(q)``."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, dq = np.stack([motion(rng, t) for _ in range(joints)], axis=-1)
    noise = (
        lfilter([1.0], colour, rng.standard_normal((t.size + 200, joints)), axis=0)[200:] * sigma
    )
    model = 5.0 + 3.0 * np.cos(q)
    error = noise.copy()
    if ripple is not None:
        error[:, 0] += ripple(q[:, 0], dq[:, 0], model[:, 0])
    if extra is not None:
        error[:, 0] += extra(t)
    return SimpleNamespace(
        name="run", t=t, q=q, dq=dq, tau=model + error, tau_model=model, used=np.abs(dq) >= 0.05
    )


def found_in(*records, robot=None, **options):
    robot = robot or one_gear("planar_2r" if records[0].q.shape[1] == 2 else "emps")
    fits = tuple(SimpleNamespace(f50=np.nan) for _ in robot.joints)
    answer = SimpleNamespace(robot=robot, recordings=records, joints=fits)
    return find_ripple(answer, **options)


def cosine(order, amplitude, phase):
    return lambda q, dq, load: amplitude * np.cos(order * q - phase)


def test_spectrum_is_that_of_least_squares():
    """At any order the amplitude is that of a plain regression on the visited positions."""
    rng = np.random.default_rng(3)
    q, dq = motion(rng, np.arange(1500) / RATE)
    white = rng.standard_normal(q.size) + 0.5 * np.sin(30 * q)
    rows = WhiteRows(white, q, dq / RATE, np.ones(1))
    spectrum = order_spectrum(rows, order_grid(q, 100.0), 4.0)
    for k in (40, 90, int(np.argmax(spectrum.gain))):
        columns = np.column_stack([np.cos(spectrum.orders[k] * q), np.sin(spectrum.orders[k] * q)])
        beta = np.linalg.lstsq(columns, white, rcond=None)[0]
        explained = white @ white - np.sum((white - columns @ beta) ** 2)
        assert spectrum.gain[k] == pytest.approx(0.5 * explained, rel=1e-6)
    assert spectrum.orders[np.argmax(spectrum.gain)] == pytest.approx(30.0, abs=1.0)


def test_planted_ripple_is_found_within_its_interval():
    """Records of coloured noise, three orders: 95 % intervals cover in 88 to 100 %.

    Intervals of two thirds of their width would cover in 81 %.
    """
    covered, orders, missed = [], [], 0
    for seed in range(25):
        rng = np.random.default_rng(1000 + seed)
        order, size = rng.choice([40.0, 60.0, 77.3]), rng.uniform(0.05, 0.12)
        made = record(seed, cosine(order, size, rng.uniform(-3, 3)), joints=1)
        lines = found_in(made, lag=0.0, most=1).joints[0].lines
        if not lines or abs(lines[0].order - order) > 1.0:
            missed += 1
            continue
        line = lines[0]
        covered.append(line.interval[0] <= size <= line.interval[1])
        orders.append(abs(line.order - order) < 1.96 * line.order_std)
    assert missed == 0
    assert 0.88 <= np.mean(covered) <= 1.0
    assert 0.85 <= np.mean(orders) <= 1.0


def test_false_alarms_under_coloured_residuals():
    """Of 200 joints without ripple, 5 % ± the width of chance have a line."""
    alarms = sum(
        bool(joint.lines)
        for seed in range(100)
        for joint in found_in(
            record(5000 + seed, seconds=4.0), lag=0.0, most=1, highest=200.0
        ).joints
    )
    assert 0.03 <= alarms / 200 <= 0.07


def test_mains_are_no_ripple():
    mains = record(7, extra=lambda t: 0.3 * np.cos(2 * np.pi * 50 * t + 1), seconds=8.0)
    assert not found_in(mains, lag=0.0).joints[0].lines


def test_a_line_in_time_is_taken_out_where_speed_hardly_varies():
    """Two slow speeds: 30 Hz looks like order 60 and 75, until time is asked."""
    rng = np.random.default_rng(5)
    t = np.arange(4000) / RATE
    dq = np.where(t < 5, 3.0, 3.05)
    q = np.cumsum(dq) / RATE
    noise = lfilter([1.0], [1.0, -0.5], rng.standard_normal(t.size)) * 0.02
    error = noise + 0.1 * np.cos(2 * np.pi * 30.0 * t)
    made = SimpleNamespace(
        name="run", t=t, q=np.column_stack([q, q]), dq=np.column_stack([dq, dq]),
        tau=np.column_stack([5 + error, 5 + noise]), tau_model=np.full((t.size, 2), 5.0),
        used=np.ones((t.size, 2), bool),
    )  # fmt: skip
    joint = found_in(made, lag=0.0).joints[0]
    assert not joint.lines
    assert [line.frequency for line in joint.time_lines] == pytest.approx([30.0], abs=0.02)
    ripple = replace_error(made, noise + 0.1 * np.cos(62.0 * q))
    lines = found_in(ripple, lag=0.0).joints[0].lines
    assert lines and lines[0].order == pytest.approx(62.0, abs=0.05) and lines[0].distinct_from_time


def replace_error(made, error):
    tau = made.tau.copy()
    tau[:, 0] = made.tau_model[:, 0] + error
    return SimpleNamespace(**{**vars(made), "tau": tau})


def test_constant_speed_cannot_tell():
    """One speed only: the line is reported, with the doubt."""
    t = np.arange(4000) / RATE
    q = 3.0 * t
    noise = 0.02 * np.random.default_rng(2).standard_normal(t.size)
    made = SimpleNamespace(
        name="run", t=t, q=np.column_stack([q, q]), dq=np.full((t.size, 2), 3.0),
        tau=5 + np.column_stack([noise + 0.1 * np.cos(60 * q), noise]),
        tau_model=np.full((t.size, 2), 5.0), used=np.ones((t.size, 2), bool),
    )  # fmt: skip
    (line,) = found_in(made, lag=0.0).joints[0].lines
    assert not line.distinct_from_time
    assert "constant frequency" in str(line)


def test_load_and_direction():
    by_load = record(11, lambda q, dq, load: 0.04 * load * np.cos(40 * q), seconds=8.0)
    line = found_in(by_load, lag=0.0, most=1).joints[0].lines[0]
    assert line.depends_on_load
    assert line.load_slope == pytest.approx(1.0, abs=3 * line.load_slope_std)
    one_way = record(12, lambda q, dq, load: 0.2 * (dq > 0) * np.cos(40 * q), seconds=8.0)
    line = found_in(one_way, lag=0.0, most=1).joints[0].lines[0]
    assert line.depends_on_direction
    assert line.forward == pytest.approx(0.2, rel=0.15) and line.backward < 0.04
    plain = record(13, cosine(40.0, 0.1, 1.0), seconds=8.0)
    line = found_in(plain, lag=0.0, most=1).joints[0].lines[0]
    assert not line.depends_on_load and not line.depends_on_direction


def test_relation_to_the_motor_and_named_orders():
    made = record(21, cosine(60.0, 0.1, 1.0))
    poles = NamedOrder("pole pairs", 3.0)
    slow = NamedOrder("cam", 1.0, of="joint")
    fast = NamedOrder("teeth", 40.0)
    joint = found_in(made, named=[poles, slow, fast], lag=0.0).joints[0]
    (line,) = joint.lines
    assert line.relation is not None and line.relation.order == 60.0
    assert line.relation.text == "pole pairs: 3 per revolution of the motor of shoulder"
    seen, few, many = joint.named
    assert seen.amplitude == pytest.approx(0.1, rel=0.2) and seen.p_value < 1e-4
    assert "fewer than 4 cycles" in few.unseen
    assert np.isnan(many.amplitude) and "above the search" in many.unseen
    assert joint.orders == (line.order,)
    (again,) = found_in(made, lag=0.0).joints[0].lines
    assert again.relation is not None
    assert again.relation.text == "3 per revolution of the motor of shoulder"


def test_nothing_is_near_where_everything_is():
    """A resolution of half a revolution matches any order; then no relation is claimed."""
    (own,) = angles_of(one_gear(), 0)
    assert relate(60.0, 0.1, own, True, ()).order == 60.0
    assert relate(50.0, 0.04, own, True, ()).text == "50 per revolution of shoulder"
    assert relate(50.4, 0.02, own, True, ()) is None
    assert relate(60.0, 8.0, own, True, ()) is None


def test_coupled_motor_has_an_angle_of_its_own():
    """TX40: motor 6 turns with q5 + q6 and ripples in the rows of both joints."""
    robot = load_robot("staubli_tx40")
    own, motor = angles_of(robot, 4)
    assert own.motors == (("motor of joint_5", 45.0),)
    assert motor.name == "motor of joint_6" and not motor.own
    np.testing.assert_allclose(motor.coefficients, [0, 0, 0, 0, 1, 1])
    assert [a.name for a in angles_of(robot, 5)] == ["joint_6", "motor of joint_6"]


def test_coupled_ripple_is_found_over_the_motor():
    robot = one_gear()
    reduction = np.array([[20.0, 0.0], [20.0, 20.0]])
    robot = replace(robot, transmission=Transmission(reduction, np.ones(2), np.zeros(2)))
    made = record(31, seconds=6.0)
    both = made.q.sum(axis=1)
    joint = found_in(
        replace_error(made, 0.3 * np.cos(60.0 * both) + made.tau[:, 0] - made.tau_model[:, 0]),
        robot=robot,
        lag=0.0,
    ).joints[0]
    line = joint.lines[0]
    assert line.angle.name == "motor of elbow" and line.order == pytest.approx(60.0, abs=0.3)
    assert line.relation.text == "3 per revolution of the motor of elbow"
    assert line.order not in joint.orders


def test_sliding_joint_counts_in_cycles_per_lead():
    robot = one_gear("emps", gear=2 * np.pi / 0.005)
    base = record(41, seconds=8.0)
    q, dq = 0.02 * base.q[:, :1], 0.02 * base.dq[:, :1]
    error = base.tau[:, :1] - base.tau_model[:, :1] + 0.1 * np.cos(2 * 2 * np.pi / 0.005 * q)
    made = SimpleNamespace(
        name="run", t=base.t, q=q, dq=dq, tau=error + 5.0, tau_model=np.full(q.shape, 5.0),
        used=np.abs(dq) >= 1e-3,
    )  # fmt: skip
    (line,) = found_in(made, robot=robot, lag=0.0, most=1).joints[0].lines
    assert line.unit == "N"
    assert line.order == pytest.approx(4 * np.pi / 0.005, rel=2e-3)
    assert line.relation.text == "2 per revolution of the motor of carriage"


def test_late_torque_is_found_and_made_up_for():
    """A log that is 5 ms late smears the line; its lag is told to half a sample."""
    seconds, rng = 8.0, np.random.default_rng(3)
    made = record(51, seconds=seconds)
    then = np.interp(made.t - 0.005, made.t, made.q[:, 0])
    noise = 0.02 * rng.standard_normal(made.t.size)
    late = replace_error(made, noise + 0.1 * np.cos(200.0 * then))
    line = found_in(late).joints[0].lines[0]
    assert line.order == pytest.approx(200.0, abs=0.3)
    assert line.lag == pytest.approx(0.005, abs=0.5 / RATE)
    assert line.amplitude == pytest.approx(0.1, abs=3 * line.amplitude_std)
    now = replace_error(made, noise + 0.1 * np.cos(200.0 * made.q[:, 0]))
    assert found_in(now).joints[0].lines[0].lag == 0.0


def test_removed_from_a_recording():
    """A held torque speaks of half a sample later; what is removed is what was put in."""
    found = synthetic_identification(robot_name="planar_2r", samples=4000, rate=500.0)
    fitted = found.recordings[0]
    ripple = 0.5 * np.cos(60.0 * fitted.q[:, 0] - 0.4)
    robot = one_gear()
    clean = 0.02 * np.random.default_rng(0).standard_normal(fitted.q.shape)
    made = SimpleNamespace(
        name="run", t=fitted.t, q=fitted.q, dq=fitted.dq, tau_model=fitted.tau_model,
        tau=fitted.tau_model + clean + np.column_stack([ripple, 0 * ripple]), used=fitted.used,
    )  # fmt: skip
    result = found_in(made, robot=robot, lag=0.0)
    lines = result.main_lines
    assert [round(line.order) for line in lines] == [60]
    assert result.orders == {"shoulder": (lines[0].order,)}
    recording = Recording(
        "run", ("shoulder", "elbow"), fitted.q, made.tau, 500.0, torque_timing="sampled"
    )
    left = remove_ripple(recording, lines)
    assert lines[0].order == pytest.approx(60.0, abs=0.02)
    assert left.name.startswith("run (ripple removed: shoulder order ")
    assert left.sources == recording.sources and left.q is recording.q
    difference = recording.tau - left.tau
    np.testing.assert_allclose(difference[:, 0], ripple, atol=0.03)
    assert not difference[:, 1].any()
    held = remove_ripple(replace(recording, torque_timing="held"), lines)
    later = ripple_torque(lines, recording.q, 500.0, shift=0.5)
    np.testing.assert_allclose(recording.tau - held.tau, later, atol=1e-12)
    figures = ripple_figures(result.joints[0])
    assert len(figures) == 2 and "60" not in figures[0].title
    assert "0.5" in figures[0].note or "0.49" in figures[0].note
    assert "no line" in ripple_figures(result.joints[1])[0].note


def test_errors_name_what_is_wrong():
    with pytest.raises(ExperimentError, match="positive"):
        NamedOrder("teeth", -1.0)
    with pytest.raises(ExperimentError, match="the robot has shoulder, elbow"):
        found_in(record(1), named=[NamedOrder("teeth", 3.0, joint="wrist")])
    made = record(21, cosine(60.0, 0.1, 1.0))
    lines = found_in(made, lag=0.0).lines
    other = Recording("b", ("a", "b"), made.q, made.tau, RATE)
    with pytest.raises(ExperimentError, match="joints are a, b"):
        remove_ripple(other, lines)


def test_short_motion_says_that_it_shows_nothing():
    made = record(61)
    short = SimpleNamespace(
        **{
            **vars(made),
            "q": 0.001 * made.q,
            "dq": 0.001 * made.dq,
            "mask": np.zeros(made.q.shape, bool),
        }
    )
    joint = found_in(short, lag=0.0).joints[0]
    assert not joint.lines and "move the joint further" in joint.notes[0]
