"""Gears of a machine in MuJoCo whose motors and sensors were logged: its truth is found again."""

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.data.recording.recording import Recording
from pivident.estimation.drives.gear_losses import identify_gears
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.robot.urdf import parse_urdf
from tests.seven_axis_arm import COULOMB, HEADER, NOISE, RATE, ROTORS, VISCOUS, seven_axis_log

GAINS = np.array([11.0, 12.0, 9.0, 9.0, 5.0, 4.0, 4.0])  # N m/A
LOSS = np.array([0.25, 0.1, 0.3, 0.15, 0.2, 0.3, 0.1])  # of what a gear transmits


@pytest.fixture(scope="module")
def log():
    return seven_axis_log(3, seconds=25.0, offset=0.0)


@pytest.fixture(scope="module")
def currents(log):
    """Those of the machine's motors, which make good for the losses of the gears as well."""
    clean = log.tau_link  # noisy by 0.02 to 0.05 N m, which is 0.01 N m of the losses
    return (log.tau_motor + LOSS * np.abs(clean) * np.sign(log.motion[1])) / GAINS


def problem_of(log, currents) -> Problem:
    names = tuple(f"joint_{j}" for j in range(1, 8))
    record = Recording("run", names, log.q, currents, RATE, torque_timing="sampled")
    return Problem(parse_urdf(log.urdf), (record,))


def test_gain_efficiency_friction_and_rotor_are_found_within_their_intervals(log, currents):
    gears = identify_gears(problem_of(log, currents), [log.tau_link])
    true = np.array([GAINS, 1.0 / (1.0 + LOSS), ROTORS, VISCOUS, COULOMB, np.zeros(7)]).T
    values, std = (np.array([getattr(g, a) for g in gears]) for a in ("values", "std"))
    assert [gear.joint for gear in gears] == [f"joint_{j}" for j in range(1, 8)]
    np.testing.assert_allclose(values[:, :5], true[:, :5], rtol=0.015)
    assert np.abs((values - true) / std).max() < 5.0
    assert np.abs(values[:, 5]).max() < 0.01 and max(g.relative_error for g in gears) < 0.03


def test_noise_of_the_sensors_does_not_make_gains_too_large(log, currents):
    """Least squares would have 1/κ too small where noise is a third of what the sensor feels."""
    rng = np.random.default_rng(5)
    noisy = log.tau_link + 10.0 * NOISE * rng.normal(size=log.tau_link.shape)
    gears = identify_gears(problem_of(log, currents), [noisy])
    last = gears[-1]
    assert np.std(10.0 * NOISE[6] * rng.normal(size=1000)) > 0.3 * np.std(log.tau_link[:, 6])
    assert abs(last.values[0] - GAINS[6]) < 4 * last.std[0] and last.std[0] < 0.2 * GAINS[6]


def test_a_joint_that_carries_nothing_is_named(log, currents):
    with pytest.raises(IdentificationError, match="'joint_7' does not separate gain and friction"):
        still = currents.copy()
        felt = log.tau_link.copy()
        felt[:, 6] = 0.5 + 1e-9 * np.random.default_rng(2).normal(size=len(felt))
        identify_gears(problem_of(log, still), [felt])


def test_the_command_prints_a_line_for_each_gear(log, currents, tmp_path, capsys):
    (tmp_path / "arm.urdf").write_text(log.urdf)
    t = np.arange(len(log.q)) / RATE
    header = HEADER.replace("q_ref_", "felt_")
    table = np.column_stack([t, log.q, log.tau_link, currents])[::4]
    np.savetxt(tmp_path / "log.csv", table, fmt="%.9g", delimiter=",", header=header, comments="")
    columns = {k: [f"{k}_{j}" for j in range(1, 8)] for k in ("q", "tau")}
    (tmp_path / "both.toml").write_text(
        'robot = "arm.urdf"\n[recording]\nfiles = "log.csv"\ntorque_timing = "sampled"\n'
        f'columns = {{t = "t", q = {columns["q"]}, tau = {columns["tau"]}}}\n'
        'units = {q = "rad", tau = {unit = "A", gain = 1.0}}\n'
        f"[gains]\nsensors = {[f'felt_{j}' for j in range(1, 8)]}\n"
    )
    assert main(["gains", str(tmp_path / "both.toml")]) == 0
    said = capsys.readouterr().out
    assert "efficiency" in said and "the scale is that of the sensors" in said
    line = next(x for x in said.splitlines() if x.startswith("joint_4 ") and "0.869" in x)
    assert line.split()[1].startswith("9.0") and "N m/A" in line
    assert "gain = 9.0" in said.rpartition("For the experiment file")[2]
