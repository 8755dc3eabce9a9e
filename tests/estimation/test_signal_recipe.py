"""Cut-offs from the record: what they follow, what they gain, and where a result names them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from pivident.data.recording.load import load_recording
from pivident.data.recording.recording import Recording
from pivident.estimation.identification_file import to_json
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import (
    ABOVE_HALF_POWER,
    estimate_kinematics,
    settled_recipe,
)
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass, RandomWalk
from pivident.foundation.errors import ExperimentError
from pivident.judgement.report.builder import render_report
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import read_urdf
from pivident.signals.random_walk import half_power_frequencies
from pivident.signals.random_walk_model import nvr_from_f50
from tests.other_arms import Setting, make_log, predicted_motion
from tests.planar_results import planar_results


def walk(f50: float, rate: float, seed: int, samples: int = 8000) -> np.ndarray:
    """A trajectory of white third difference in white noise, whose half power is at f50 [Hz]."""
    rng = np.random.default_rng(seed)
    drive = np.sqrt(nvr_from_f50(f50, 3, rate)) * rng.standard_normal(samples)
    return 1e-4 * (lfilter([1.0], [1.0, -3.0, 3.0, -1.0], drive) + rng.standard_normal(samples))


def record(q: np.ndarray, rate: float) -> Recording:
    noise = np.random.default_rng(1).standard_normal(q.shape)
    return Recording("walk", tuple("ab"[: q.shape[1]]), q, noise, rate)


@pytest.mark.parametrize(("f50", "rate"), [(4.0, 100.0), (9.0, 100.0), (20.0, 250.0)])
def test_the_half_power_of_a_known_walk_is_found(f50, rate):
    q = np.column_stack([walk(f50, rate, seed) for seed in range(4)])
    assert half_power_frequencies(q, rate) == pytest.approx(np.full(4, f50), rel=0.06)


def test_new_samples_at_a_standstill_are_no_counts():
    """A cubic spline leaves ripples of 1e-17 where an encoder stood; they are not its steps."""
    log = make_log(0, Setting("jitter", 97.0, 60.0, stops=12.0, speed="none"))
    grid = np.arange(0.0, log.t[-1], 1 / 97.0)
    coarse = log.arm.reduction == 1.0
    q = CubicSpline(log.t, log.q)(grid)[:, coarse]
    assert np.mean(np.abs(np.diff(q, axis=0)) < 1e-12) > 0.5  # mostly at rest
    assert (half_power_frequencies(q, 97.0) < 15.0).all()


def test_each_joint_is_cut_off_where_its_motion_ends():
    q = np.column_stack([walk(4.0, 100.0, 0), walk(9.0, 100.0, 1)])
    own = record(q, 100.0)
    found = settled_recipe(Bandpass(), [own])
    assert found.cutoff == pytest.approx(ABOVE_HALF_POWER * np.array([4.0, 9.0]), rel=0.07)
    assert found.bandwidth == pytest.approx(100.0 / 8.0) and found.factor(100.0) == 4
    assert found.at_instants is True
    k = estimate_kinematics(own, Bandpass())
    np.testing.assert_array_equal(k.ddq, estimate_kinematics(own, found).ddq)
    twice = settled_recipe(Bandpass(), [own, record(q[:, ::-1], 100.0)])
    assert twice.cutoff == pytest.approx([max(found.cutoff)] * 2, rel=1e-9)


def test_what_is_given_stays():
    own = record(np.column_stack([walk(4.0, 100.0, 0)]), 100.0)
    given = Bandpass(cutoff=30.0, decimation=2)
    assert settled_recipe(given, [own]) == given
    assert settled_recipe(RandomWalk(), [own]) == RandomWalk()
    assert settled_recipe(Bandpass(cutoff=30.0), [own]).at_instants is None  # as the literature
    with pytest.raises(ExperimentError, match="cutoff has 2 numbers for 3 joints"):
        Bandpass(cutoff=(10.0, 20.0)).cutoffs(3)


def test_a_quiet_fast_record_has_the_recipe_of_the_literature():
    (found,) = planar_results("ls")
    used = found.method_used.signals
    assert (used.cutoff, used.bandwidth) == ((50.0, 50.0), 20.0)


@pytest.mark.parametrize("rate", [40.0, 100.0])
def test_no_rate_forbids_the_recipe_from_the_record(rate):
    found = settled_recipe(Bandpass(), [record(np.column_stack([walk(30.0, rate, 0)]), rate)])
    assert max(found.cutoff) < rate / 2 and found.bandwidth <= rate / 8


@pytest.mark.parametrize(
    ("highest", "size", "coloured", "white"),
    [(11.0, 3e-4, 0.0, 100.0), (11.0, 1e-4, 200.0, 10.0), (24.0, 1e-4, 0.0, 10.0)],
)
def test_least_squares_thins_a_slow_log_where_that_is_surer(highest, size, coloured, white):
    """Motion above an eighth of 100 Hz: in white noise, in noise that grows, or wrongly derived.

    The whole rate is better in the first, the band in the others; errors are those of torques.
    """
    rate, robot, squares = 100.0, load_robot("emps"), []
    t, omega = np.arange(2000) / rate, 2 * np.pi * np.array([0.3, 1.1, 3.0, highest])[:, None]
    size, phase = np.array([0.1, 0.02, 2e-3, size])[:, None], np.arange(4.0)[:, None]
    q = (size * np.sin(omega * t + phase)).sum(0)[:, None]
    dq = (size * omega * np.cos(omega * t + phase)).sum(0)[:, None]
    ddq = -(size * omega**2 * np.sin(omega * t + phase)).sum(0)[:, None]
    exact = 95.0 * ddq + 200.0 * dq + 20.0 * np.sign(dq)
    for seed in range(16):
        rng = np.random.default_rng(seed)
        noise = white * rng.standard_normal(t.size)
        noise += coloured * np.diff(rng.standard_normal(t.size + 3), 3)
        run = Recording.from_arrays(
            q, exact + noise[:, None], rate, joint_names=robot.joint_names, torque_timing="sampled"
        )
        found = [
            identify(Problem(robot, (run,)), LeastSquares(signals=recipe))
            for recipe in (Bandpass(), Bandpass(bandwidth=rate / 8), Bandpass(decimation=1))
        ]
        squares.append([np.mean((i.predict(q, dq, ddq) - exact) ** 2) for i in found])
        used = found[0].method_used.signals
        assert used in [i.method_used.signals for i in found[1:]]
    own, *given = np.mean(squares, axis=0)
    assert np.ptp(given) > 0.05 * min(given)
    assert own < 1.001 * min(given)


def test_corrected_differences_keep_accelerations_at_low_rates():
    rate, frequency = 80.0, 5.0
    t = np.arange(4000) / rate
    q = np.sin(2 * np.pi * frequency * t)[:, None]
    exact = -((2 * np.pi * frequency) ** 2) * q[:, 0]
    lost = {}
    for at_instants in (False, True):
        recipe = Bandpass(cutoff=35.0, at_instants=at_instants)
        ddq = estimate_kinematics(record(q, rate), recipe).ddq[0]
        lost[at_instants] = 1.0 - ddq[200:-200] @ exact[200:-200] / np.sum(exact[200:-200] ** 2)
    # sin(x)/x squared at x = 2π f / rate, and with a sixth of the second difference taken off
    x = 2 * np.pi * frequency / rate
    assert lost[False] == pytest.approx(1 - (np.sin(x) / x) ** 2, abs=1e-4)
    corrected = np.sin(x) / x * (1 + (2 - 2 * np.cos(x)) / 6)
    assert lost[True] == pytest.approx(1 - corrected**2, abs=1e-4)
    assert lost[False] > 0.04 and lost[True] < 0.003


def torque_error(folder: Path, seed: int, setting: Setting, *recipes: Bandpass) -> list[float]:
    """Error of predicted torque on another motion of a Pinocchio arm, for each recipe [%]."""
    log = make_log(seed, setting)
    table, description = log.write(folder)
    names, robot = log.arm.joint_names, read_urdf(description)
    columns = {"t": "t", "q": [f"q_{n}" for n in names], "tau": [f"tau_{n}" for n in names]}
    read = load_recording(table, columns, robot=robot, resample=True, torque_timing="sampled")
    q, dq, ddq, tau = predicted_motion(seed, setting)
    found = [identify(Problem(robot, (read,)), LeastSquares(signals=r)) for r in recipes]
    return [100 * np.linalg.norm(i.predict(q, dq, ddq) - tau) / np.linalg.norm(tau) for i in found]


def test_an_irregular_clock_costs_no_accuracy(tmp_path):
    """Geometric means over three arms: jittery against regular clock, and against fixed cut-offs.

    benchmarks/irregular_clocks.py has more of them: 0.98 and 0.60.
    """
    jitter = Setting("jitter", 97.0, 40.0, stops=1.0, torque_noise=0.002, speed="none", fastest=2.0)
    fixed, rows = Bandpass(cutoff=45.0, bandwidth=20.0), []
    for seed in (2, 3, 7):
        own, of_fixed = torque_error(tmp_path, seed, jitter, Bandpass(), fixed)
        (regular,) = torque_error(tmp_path, seed, replace(jitter, clock="regular"), Bandpass())
        rows.append([own, of_fixed, regular])
    own, of_fixed, regular = np.exp(np.mean(np.log(rows), axis=0))
    assert own < 1.05 * regular
    assert own < 0.8 * of_fixed


def test_a_result_names_its_filters():
    least_squares, prefiltered = planar_results("ls", "iv", "piv")[::2]
    assert "Signals: positions low-passed at 50.0 Hz, equations to 20 Hz" in str(least_squares)
    options = json.loads(to_json(least_squares))["options"]["signals"]
    assert options["cutoff"] == [50.0, 50.0] and options["bandwidth"] == 20.0
    shoulder, elbow = (joint.f50 for joint in prefiltered.joints)
    line = f"half power at {shoulder:.1f} Hz (shoulder), {elbow:.1f} Hz (elbow)"
    assert f"Signals: positions smoothed, {line}" in str(prefiltered)
    assert "50.0 Hz" in render_report([least_squares])
