"""Grids: the encoder's step, the digits of the file, and what both mean."""

import numpy as np
import pytest

from pivident.experiment.check.audit_file import audit_file
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.audit.quantisation import find_grid, significant_digits
from pivident.robot.urdf import parse_urdf
from pivident.signals.bandpass import bandpass
from tests.judgement.audit.logs import planar, with_channels
from tests.other_arms import Setting, make_log


def rounded(x, step):
    return step * np.round(x / step)


def test_step_of_an_encoder():
    q = planar().channels["q"][:, 0]
    for counts in (3600, 2**16, 200_000):
        grid = find_grid("q", rounded(q, 2 * np.pi / counts))
        assert grid.step == pytest.approx(2 * np.pi / counts, rel=1e-6)
        assert grid.digits is None


def test_noise_has_no_grid():
    rng = np.random.default_rng(3)
    assert np.isnan(find_grid("x", rng.standard_normal(5000)).step)
    assert np.isnan(find_grid("x", planar().channels["tau"][:, 0]).step)


def test_encoder_below_the_digits_of_a_text_file():
    resting = 2e-4 * np.random.default_rng(1).standard_normal(1000)
    q = rounded(np.r_[resting, 40.0 * planar().channels["q"][:, 0]], 3.2e-5)
    digits = np.array([float(f"{x:.5g}") for x in q])
    grid = find_grid("q", digits)
    assert grid.digits == 5
    assert grid.step == pytest.approx(3.2e-5, rel=1e-3)


def test_significant_digits():
    rng = np.random.default_rng(0)
    x = rng.standard_normal(500) * 10.0 ** rng.integers(-3, 3, 500)
    for digits in (2, 4, 6):
        assert significant_digits(np.array([float(f"{v:.{digits}g}") for v in x])) == digits
    assert significant_digits(x) is None
    assert significant_digits(np.round(1e4 * x)) is None  # counts


def test_counts_per_turn_and_severity():
    log = planar()
    fine = rounded(log.channels["q"], 2 * np.pi / 2**20)
    steps = [f for f in audit_log(with_channels(log, q=fine)).of("quantisation")]
    assert {f.severity for f in steps} == {"ok"}
    assert any("2^20" in f.message for f in steps)
    coarse = rounded(log.channels["q"], 2 * np.pi / 360)
    steps = [f for f in audit_log(with_channels(log, q=coarse)).of("quantisation")]
    assert {(f.severity, f.subject) for f in steps} == {
        ("warning", "q of shoulder"),
        ("warning", "q of elbow"),
    }
    assert all("360 counts per turn" in f.message for f in steps)


def test_counts_that_last_several_samples_of_a_slow_joint_are_no_fault(tmp_path):
    """14 bits at 250 Hz: a count lasts for samples, and rounding hardly shows below 8 Hz."""
    made = make_log(63, Setting("regular", 250.0, 30.0, 2.0, speed="none", fastest=0.5))
    (audit,) = audit_file(made.write(tmp_path)[0], parse_urdf(made.arm.urdf))
    steps = [f for f in audit.of("quantisation") if f.kind == "step"]
    assert any("q of axis_2" == f.subject for f in steps)
    assert {f.severity for f in steps} == {"ok"}
    true, logged = (
        bandpass(x[:, [1]], 250.0, 7.6, at_instants=True).ddq for x in (made.motion[0], made.q)
    )
    assert np.std(logged - true) < 0.15 * np.std(true)  # the inertia is 2 % too small by it
