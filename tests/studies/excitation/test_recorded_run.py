"""Did the robot run the design: tracking, stops, and what the log still gives."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import pivident as pv
from pivident.app.cli.app import main
from pivident.data.recording.recording import Recording
from pivident.studies import write_design
from pivident.studies.excitation.recorded_run import recorded_run
from tests.planar_arm import LAW
from tests.studies.excitation.designs import made_design

NOISE = 1e-6


@cache
def planar_design():
    return made_design(kind="splines", duration=8.0)


@cache
def planar_record():
    """The design in closed loop, after 0.3 s of rest."""
    motion = planar_design().motion
    reference = np.vstack([motion.start[None].repeat(300, 0), motion.sampled(1000.0)[0]])
    robot = planar_design().robot
    made = pv.simulate(robot, pv.Loop(LAW), reference, rate=1000, encoder=2e-6, torque=0.5, seed=3)
    return replace(made.recording, name="log")


def recorded(q, rate=200.0):
    """Positions as a logger sees them, with some torque."""
    names = planar_design().robot.joint_names
    return Recording("log", names, q, np.sin(np.arange(len(q)))[:, None] + q, rate)


def noisy(recording):
    """The same with noise of an encoder, without which nothing is smoothed."""
    noise = np.random.default_rng(2).standard_normal(recording.q.shape)
    return replace(recording, q=recording.q + NOISE * noise)


def test_a_run_as_designed_reaches_speeds_accelerations_and_standard_errors():
    found = recorded_run(planar_design(), planar_record())
    determined = np.isfinite(found.std)
    assert determined.sum() == len(found.std) - 1
    np.testing.assert_allclose(found.ratio[determined], 1.0, rtol=0.05)
    place, speed, acceleration = planar_design().motion.sampled(200.0)
    rest = np.repeat(place[:1], 60, axis=0)
    found = recorded_run(planar_design(), noisy(recorded(np.concatenate([rest, place, rest]))))
    assert found.is_as_designed and found.stops == ()
    assert found.followed.starts[0] == pytest.approx(0.3, abs=0.02)
    np.testing.assert_allclose(found.speed, np.abs(speed).max(axis=0), rtol=0.03)
    np.testing.assert_allclose(found.acceleration, np.abs(acceleration).max(axis=0), rtol=0.1)


def test_expected_standard_errors_are_those_of_an_identification():
    """Of the first three quarters of the motion: fewer rows, another mix of them."""
    whole = planar_record()
    part = whole.slice(0.3, 0.3 + 0.75 * planar_design().motion.duration)
    found = recorded_run(planar_design(), part)
    assert not found.is_as_designed and found.followed.covered == pytest.approx(0.75, abs=0.01)
    law = pv.Loop(pv.PD([6000.0, 2500.0], [180.0, 60.0]))
    std = [
        pv.identify(
            pv.Problem(whole.robot if False else planar_design().robot, (r,), law), "ls"
        ).std
        for r in (part, whole)
    ]
    assert np.exp(np.nanmean(np.log(found.ratio))) == pytest.approx(
        np.exp(np.mean(np.log(std[0] / std[1]))), rel=0.2
    )


@pytest.mark.parametrize("pause", [1.0, np.inf])
def test_a_stop_within_the_motion_is_found(pause):
    """The robot stands from 3 s of the motion on, for a second or for good."""
    motion = planar_design().motion
    t = np.arange(int((motion.duration + 3.0) * 200.0)) / 200.0
    at = np.where(t < 3.0, t, np.maximum(t - pause, 3.0))
    found = recorded_run(planar_design(), noisy(recorded(motion.at(at)[0])))
    start, stop = found.stops[0]
    began = 0.0 if pause == np.inf else found.followed.starts[0]
    assert start + began == pytest.approx(3.0, abs=0.1) and stop - start > 0.5
    assert not found.is_as_designed and "stood still" in str(found)
    if pause == np.inf:
        assert "followed the design from" in str(found) and found.part[1] == pytest.approx(
            3, abs=0.3
        )


def test_the_command_says_whether_the_design_was_run(tmp_path, capsys):
    write_design(planar_design(), tmp_path / "motion", 100.0)
    run = planar_record()
    columns = np.column_stack([run.t, run.q, run.tau])
    header = "time,q_shoulder,q_elbow,tau_shoulder,tau_elbow"
    np.savetxt(tmp_path / "log.csv", columns, "%.9g", ",", header=header, comments="")
    assert main(["excite", str(tmp_path / "motion"), "--check", str(tmp_path / "log.csv")]) == 0
    said = capsys.readouterr().out
    assert "followed the design" in said and "rad/s²" in said and "log/design" in said
    columns[:, 1] = np.sin(columns[:, 0])
    columns[:, 2] = np.cos(2.0 * columns[:, 0])
    np.savetxt(tmp_path / "log.csv", columns, "%.9g", ",", header=header, comments="")
    assert main(["excite", str(tmp_path / "motion"), "--check", str(tmp_path / "log.csv")]) == 4
    assert "another motion than the design" in capsys.readouterr().out
