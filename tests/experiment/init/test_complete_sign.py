"""Which smoothed sign `pivident init` writes for dry friction, on arms that Pinocchio moves."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.experiment.explained import validated
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.text.toml import parse_toml
from tests.other_arms import Setting, make_log, torque_of

SETTING = Setting(clock="regular", rate=200.0, seconds=12.0, stops=0.5, torque_noise=0.002)


def draft_of(log, folder):
    table, robot = log.write(folder)
    return draft_experiment([table], str(robot), out=folder / "experiment.toml")


def with_sign(log, sign_of):
    """The same motion of an arm whose dry friction has another sign of its speeds."""
    q, dq, ddq = log.motion
    torque = torque_of(log.arm, q, dq, ddq, sign_of(dq))
    tau = torque + (log.tau - log.torque)
    columns = {**log.columns, **dict(zip(tau_columns(log), tau.T, strict=True))}
    return replace(log, tau=tau, torque=torque, columns=columns)


def tau_columns(log):
    """Names of the torques' columns."""
    return [
        name
        for name, values in log.columns.items()
        if any(np.array_equal(values, own) for own in log.tau.T)
    ]


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_dry_friction_that_is_complete_at_once_gets_tanh(seed, tmp_path):
    draft = draft_of(make_log(seed, SETTING), tmp_path)
    line = next(a for a in draft.assumptions if a.key == "friction")
    assert {"term": "coulomb", "smoothing": "tanh"} in line.value
    assert "± 2σ" in line.seen and "axis_1" in line.seen
    entry = validated(parse_toml(draft.text)).robot.friction
    assert [term.smoothing for term in entry if term.term == "coulomb"] == ["tanh"]


def arctangent(log):
    """The default sign of an arm's speeds."""
    return lambda dq: 2.0 / np.pi * np.arctan(750.0 / log.arm.speed * dq)


def soft(log):
    """One that tanh fits worse where it is slow, and an arctangent where it is fast."""
    return lambda dq: np.tanh(100.0 * dq)


@pytest.mark.parametrize("sign", [arctangent, soft])
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_an_arctangent_stays_that_is_nearer_at_slow_speeds(seed, sign, tmp_path):
    log = make_log(seed, SETTING)
    draft = draft_of(with_sign(log, sign(log)), tmp_path)
    line = next(a for a in draft.assumptions if a.key == "friction")
    assert line.value is None
