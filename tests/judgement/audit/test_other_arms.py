"""Records of arms that another program made, with stops, 14 bits and irregular clocks.

The larger count is in benchmarks/audit_alarms.py.
"""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.audit.steps import unsteady_steps
from pivident.judgement.audit.timing import check_timing
from pivident.robot.urdf import parse_urdf
from tests.judgement.audit.logs import delayed
from tests.other_arms import ArmLog, Setting, make_log


def log_of(made: ArmLog, **more) -> Log:
    channels = {"q": made.q, "tau": made.tau} | more.pop("channels", {})
    names = made.arm.joint_names
    robot = parse_urdf(made.arm.urdf)
    given = {"logged": channels, "channels": channels, "robot": robot, "torque_timing": "sampled"}
    return Log("log", names, {}, {"t": made.t}, **given | more)


def late_joints(log: Log) -> set[str]:
    return {f.subject for f in audit_log(log).of("delay") if f.severity != "ok" and f.subject}


def test_dry_friction_at_reversals_is_no_delay_of_a_joint():
    made = make_log(23, Setting("regular", 50.0, 30.0, 2.0, speed="none"))
    late = made.tau.copy()
    late[:, 4] = delayed(late[:, 4], 2)
    moving = (1.02, 29.98)
    assert late_joints(log_of(made).between(*moving)) == set()
    assert "axis_5" in late_joints(log_of(replace(made, tau=late)).between(*moving))


@pytest.mark.parametrize("samples", [2000, 2001])
@pytest.mark.parametrize("resample", [False, True])
def test_ten_and_twelve_milliseconds_are_irregular_whatever_their_number(samples, resample):
    """Of an even number of intervals the median lies between the two, within a tenth of both."""
    made = make_log(1, Setting("alternating", 1000 / 11, 30.0, speed="none"))
    log = log_of(made, resample=resample)
    timing = check_timing(log.between(log.clock[0], log.clock[samples]))
    (jitter,) = (f for f in timing.findings if f.kind == "jitter")
    assert jitter.severity == ("ok" if resample else "error")
    assert not timing.regular and timing.rate == pytest.approx(1000 / 11, rel=1e-3)


@pytest.mark.parametrize("clock", ["regular", "alternating", "jitter"])
def test_reference_speeds_on_any_clock_are_derivatives_of_their_positions(clock):
    made = make_log(2, Setting(clock, 1000 / 11, 30.0, 0.0, speed="none"))
    q_ref, dq_ref, _ = made.motion
    for n in (0, 1):
        rows = slice(None, len(q_ref) - n)
        log = log_of(made, channels={"q_ref": q_ref, "dq_ref": dq_ref})
        log = log.between(log.clock[0], log.clock[rows][-1])
        speeds = [f for f in audit_log(log).of("speed") if f.subject.startswith("dq_ref")]
        assert len(speeds) == 6
        assert {f.severity for f in speeds} == {"ok"}
        assert [f.quantity.value for f in speeds] == pytest.approx([1.0] * 6, abs=5e-3)


@pytest.mark.parametrize("seed", [67, 75, 91])
def test_a_short_stop_is_no_repeated_sample(seed):
    slow = Setting("regular", 50.0 if seed == 67 else 91.0, 40.0, 0.5, 0.02, "none", 0.5)
    made = make_log(seed, slow)
    assert not unsteady_steps(made.q).size
    k = int(np.argmax(np.abs(made.motion[1]).min(axis=1)))  # all joints move
    twice = np.insert(made.q, k, made.q[k], axis=0)
    assert unsteady_steps(twice).tolist() == [[k, -1]]


def test_a_drive_s_speed_of_a_single_count_is_no_outlier():
    """14 bits, 91 Hz and a slow start: one count stands alone in a speed that is nearly zero."""
    slow = Setting("alternating", 1000 / 11, 20.0, 2.0, 0.002, "drive", 0.5)
    made = make_log(556, slow)
    dq = np.column_stack([made.columns[f"dq_{name}"] for name in made.arm.joint_names])
    assert np.abs(dq[1485, 5]) > 100 * np.abs(dq[[1484, 1486], 5]).max()
    assert not spikes(log_of(made, channels={"dq": dq}))
    dq[1485, 5] += 1.0
    assert spikes(log_of(made, channels={"dq": dq})) == {"dq of axis_6"}


def spikes(log: Log) -> set[str]:
    return {f.subject for f in audit_log(log).of("channels") if f.kind == "spike"}


def test_weak_is_what_matters_in_full_motion_not_in_a_slow_one():
    """What zz1r leaves open is 18 % of the torque of this motion, 6 % of that of full motion."""
    made = make_log(594, Setting("regular", 250.0, 12.0, 2.0, 0.005, "none", 0.5))
    found = audit_log(log_of(made)).excitation
    k = found.names.index("zz1r")
    assert found.used[k] < 0.2 and found.open_torque[k] < 0.1


def test_stamps_that_tremble_make_no_outliers():
    """Smooth positions; one stamp in a hundred, 7 and 9 ms from its neighbours, is no jump of q."""
    made = make_log(3, Setting("regular", 1000.0, 30.0, 0.0, speed="none"))
    rows = 8 * np.arange(1, len(made.t) // 8 - 1)
    rows[50::100] += 1
    q, tau = made.motion[0][rows], made.tau[rows]
    log = replace(log_of(made), channels={"q": q, "tau": tau}, logged={"q": q, "tau": tau})
    log = replace(log, clocks={"t": made.t[rows]})
    assert not spikes(log)
    late = made.t[rows].copy()
    late[700] += 1.5e-3  # a message that was stamped late: its value is right
    assert not spikes(replace(log, clocks={"t": late}))
    q = q.copy()
    q[1234, 1] += 0.01
    assert spikes(replace(log, channels={"q": q, "tau": tau}, logged={"q": q, "tau": tau})) == {
        "q of axis_2"
    }
