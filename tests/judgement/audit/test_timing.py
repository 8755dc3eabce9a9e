"""Clocks: every kind of irregularity, with its place."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import RecordingError
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.steps import unsteady_steps
from pivident.judgement.audit.timing import check_timing
from tests.judgement.audit.logs import only_rows, planar


def serious(log):
    return [f for f in check_timing(log).findings if f.severity != "ok"]


def clocked(t, **more):
    return replace(planar(), clocks={"t": t}, **more)


def test_gap():
    rows = np.r_[:2000, 2030:5000]
    (finding,) = serious(only_rows(planar(), rows))
    assert (finding.kind, finding.severity, finding.sample) == ("gap", "warning", 1999)
    assert finding.quantity.value == 30.0


def test_a_clock_that_was_set_is_not_an_hour_of_lost_samples():
    t = np.arange(5000) * 1e-3
    t[3000:] += 3600.0
    (finding,) = serious(clocked(t))
    assert (finding.kind, finding.severity, finding.sample) == ("gap", "warning", 2999)
    assert "jumps ahead by 3600 s after sample 2999" in finding.message
    assert "4.998 s" in finding.message and "are missing" not in finding.message
    t[3000:] -= 3599.0  # lost samples: shorter than the log
    (finding,) = serious(clocked(t))
    assert "1000 sample(s) are missing in 1 gap(s); the longest lasts 1.001 s" in finding.message


def test_a_jump_of_decades_asks_for_no_memory():
    t = np.arange(5000) * 1e-3
    t[3000:] += 3e9
    log = clocked(t)
    with pytest.raises(RecordingError, match="gaps in the log are longer than its samples"):
        build_inverse_model(log, check_timing(log))


def test_a_first_stamp_above_all_others_is_backward_time():
    t = np.arange(5000) * 1e-3
    t[0] = 100.0
    backward = next(f for f in serious(clocked(t)) if f.kind == "backward")
    assert backward.sample == 1
    assert check_timing(clocked(t)).rate == pytest.approx(1000.0)


def test_jitter():
    t = np.arange(5000) * 1e-3
    t[3000] += 0.4e-3
    (finding,) = serious(clocked(t))
    assert finding.kind == "jitter" and finding.sample in (2999, 3000)
    assert finding.quantity.value == pytest.approx(
        40.0, abs=0.1
    ) and finding.quantity.bound == pytest.approx(10.0)


def test_what_new_samples_make_good_is_told_and_not_wrong():
    t = np.arange(5000) * 1e-3
    t[3000] += 0.4e-3
    t[3500:] += 6e-3  # shorter than what is interpolated, 10 ms
    log = clocked(t, resample=True)
    (jitter,) = [f for f in check_timing(log).findings if f.kind == "jitter"]
    assert jitter.severity == "ok" and jitter.quantity.value == pytest.approx(600.0, abs=0.1)
    assert serious(log) == [] and serious(replace(log, resample=False)) != []
    t[4000:] += 0.5
    (gap,) = serious(clocked(t, resample=True))
    assert gap.kind == "gap" and gap.severity == "warning" and gap.sample == 3999
    assert "part = " in gap.next_step and "resample" not in gap.next_step
    assert "2 stretch(es) between gaps are used" in gap.message


def test_repeated_backward_and_missing_stamps():
    t = np.arange(5000) * 1e-3
    t[100] = t[99]
    t[200:] -= 0.5
    t[4000] = np.nan
    kinds = {f.kind: f.sample for f in serious(clocked(t))}
    assert kinds["duplicate"] == 100 and kinds["backward"] == 200 and kinds["no stamp"] == 4000


def test_unit_of_the_stamps():
    kinds = [f.kind for f in serious(clocked(np.arange(5000) * 1.0))]
    assert kinds == ["rate"]


def test_drift_against_the_declared_rate():
    t = np.arange(5000) * 1e-3
    (finding,) = serious(clocked(t * 1.001, rate=1000.0))
    assert finding.kind == "drift" and finding.severity == "warning"
    assert finding.quantity.value == pytest.approx(1000.0, rel=1e-3)
    assert serious(clocked(t * 1.02, rate=1000.0))[0].severity == "error"
    assert serious(clocked(t * (1 + 5e-5), rate=1000.0)) == []


def test_two_clocks():
    t = np.arange(5000) * 1e-3
    late = 1.0005 * t
    late[2500:] += 0.02
    found = {f.kind: f for f in serious(replace(planar(), clocks={"t": t, "host": late}))}
    assert found["clocks jump"].sample == 2500
    assert found["clocks jump"].quantity.value == pytest.approx(20.0, rel=0.01)
    drift = serious(replace(planar(), clocks={"t": t, "host": 1.0005 * t}))
    assert [f.subject for f in drift] == ["host"]
    assert drift[0].quantity.value == pytest.approx(500.0, rel=1e-6)


def test_no_clock():
    assert serious(replace(planar(), clocks={}))[0].kind == "no clock"
    assert serious(replace(planar(), clocks={}, rate=1000.0)) == []


def test_steps_of_smooth_motion_are_steady():
    t = np.linspace(0, 3, 3000)
    q = np.column_stack([np.sin(2 * t), np.cos(5 * t)])
    assert len(unsteady_steps(q)) == 0
    assert len(unsteady_steps(np.round(q / 1e-4) * 1e-4)) == 0
    assert unsteady_steps(np.delete(q, [1000, 1001], axis=0)).tolist() == [[999.0, 2.0]]
