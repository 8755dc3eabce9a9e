"""Gains of the file against those of the log: what is a difference, and what is a delay."""

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.experiment.check.gains_check import check_gains
from pivident.experiment.file_keys import ControllerEntry
from pivident.judgement.audit.timing import Timing

RATE, KP, KD = 1000.0, 1000.0, 2.0
TIMING = Timing((), np.full(2999, 1.0 / RATE), RATE, True)


def log(late: int) -> Log:
    """A PD loop of one joint whose torque is logged some samples late."""
    t = np.arange(3100) / RATE
    q_ref = np.sin(2 * np.pi * 2.0 * t)[:, None]
    error = 0.01 * np.sin(2 * np.pi * 3.0 * t + 1.0) + 0.004 * np.sin(2 * np.pi * 11.0 * t)
    error = error[:, None]
    tau = KP * error + KD * np.diff(error, axis=0, prepend=error[:1]) * RATE
    channels = {"q": q_ref - error, "q_ref": q_ref, "tau": np.roll(tau, late, axis=0)}
    channels = {name: signal[50:-50] for name, signal in channels.items()}
    return Log("log", ("elbow",), {}, {}, RATE, logged=channels, channels=channels)


def told(late: int, **gains: float) -> list[str]:
    entry = ControllerEntry(type="pd", **gains)
    return [r.place[-1] for r in check_gains(log(late), TIMING, entry, ())]


@pytest.mark.parametrize("late", [0, 1, 5, 20, -8])
def test_a_torque_that_is_late_is_no_other_gain_and_no_reversed_one(late):
    """Late by d, the gain on the speed seems kd - kp d: -18 for d = 20 samples of 1 ms."""
    assert told(late, kp=KP, kd=KD) == []


def test_other_gains_are_told():
    assert told(0, kp=KP, kd=60.0) == ["kd"]
    assert told(0, kp=2 * KP, kd=KD) == ["kp"]
    assert told(12, kp=KP, kd=60.0) == ["kd"]
    assert told(0, kp=-KP, kd=-KD) == ["drive_gain"]
    assert told(0, kp=KP * np.pi / 180, kd=10.0) == ["kp", "kd"]
