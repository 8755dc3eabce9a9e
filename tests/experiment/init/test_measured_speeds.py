"""Logged speeds in a first file: only where they come from a sensor of their own.

Motion and torques are those of arms that another program made, see `tests.other_arms`.
"""

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from tests.other_arms import ArmLog, Setting, make_log


def with_speeds(made: ArmLog, speeds: np.ndarray) -> ArmLog:
    """The log with other speeds [rad/s]."""
    made.columns.update(
        {f"dq_{name}": x for name, x in zip(made.arm.joint_names, speeds.T, strict=True)}
    )
    return made


def tachometers(made: ArmLog) -> np.ndarray:
    """True speeds with noise of their own [rad/s]."""
    true = made.motion[1]
    return true + 2e-3 * np.random.default_rng(3).standard_normal(true.shape)


def first_file(made: ArmLog, folder):
    log, robot = made.write(folder)
    out = folder / "experiment.toml"
    draft = draft_experiment([log], str(robot), out=out)
    out.write_text(draft.text, encoding="utf-8")
    return out, draft


@pytest.mark.parametrize("clock", ["regular", "alternating", "jitter"])
def test_speeds_of_a_sensor_of_their_own_make_instruments(clock, tmp_path):
    made = make_log(5, Setting(clock, 1000 / 11, 20.0, 0.0, speed="none"))
    out, draft = first_file(with_speeds(made, np.rad2deg(tachometers(made))), tmp_path)
    line = next(a for a in draft.assumptions if (a.table, a.key) == ("recording.columns", "dq"))
    assert "not that of the positions" in line.seen and line.value[0] == "dq_axis_1"
    experiment = load_experiment(out)
    (recording,) = experiment.recordings()
    assert np.abs(recording.dq).max() < 5.0  # in rad/s
    found = identify(experiment.problem(), "piv")
    assert found.instruments.kind == "sensor" and not found.instruments.shares_noise
    assert "measured speeds (dq)" in found.instruments.found[0]


@pytest.mark.parametrize("clock", ["regular", "alternating"])
def test_speeds_that_a_drive_makes_of_its_positions_check_the_clock(clock, tmp_path):
    """An encoder at the joint, whose counts the log shows; the drive differentiates at 1 kHz."""
    made = make_log(3, Setting(clock, 1000 / 11, 30.0, 0.0, speed="drive"))
    assert made.arm.reduction[0] == 1.0
    out, draft = first_file(made, tmp_path)
    assert load_experiment(out).recordings()[0].dq is not None
    said = draft.text.replace("\n# ", " ")
    assert "clock and units of these are checked against them" in said


def test_speeds_with_gaps_are_left_out(tmp_path):
    made = make_log(5, Setting("regular", 1000 / 11, 20.0, 0.0, speed="none"))
    speeds = tachometers(made)
    speeds[700:703] = np.nan
    out, _ = first_file(with_speeds(made, speeds), tmp_path)
    assert load_experiment(out).recordings()[0].dq is None
