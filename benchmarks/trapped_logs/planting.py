"""Faults that are planted in a plain log, one each.

A trap changes a copy of the log in place; `apply_trap` copies. Positions of a joint are those of
every channel that holds positions, its reference among them: encoders and controllers share their
zero. Logged speeds keep the true clock and unit unless the trap is about the sign of the joint.
"""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from pivident import load_experiment
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identify import identify

from .logs import Source
from .plain_log import POSITIONS, PlainLog

#: Sizes: delay of the torque [s], share of repeated rows, factor of a torque, mass [kg], time of
#: standstill at either end [s] and noise of an encoder there [rad], a tenth of it [m].
DELAY, REPEATED, GAIN, MASS, STANDSTILL, ENCODER = 0.02, 0.2, 1.5, 3.0, 5.0, 1e-5

#: Share of the log at either end in which the slowest row is where standstill is put.
ENDS = 0.1

SEED = 20

Trap = Callable[[PlainLog, Source], None]


def clock(factor: float) -> Trap:
    """Time stamps, and the part that is used, times a factor."""

    def plant(log: PlainLog, source: Source) -> None:
        for entry, run in zip(log.experiment["recording"], log.runs, strict=True):
            run["t"] *= factor
            if "part" in entry:
                entry["part"] = [factor * time for time in entry["part"]]

    return plant


def reversed_channels(*kinds: str) -> Trap:
    """Positions (``q``, with speeds and references), torque (``tau``) or both of one joint negated.

    Torques that are fed forward count as the controller does: they turn with the whole joint only.
    """

    def plant(log: PlainLog, source: Source) -> None:
        for run in log.runs:
            for channel in run.keys() - {"t"}:
                concerned = {"tau"} if channel == "tau" else {"q"}
                if channel.startswith("inputs"):
                    concerned = {"q", "tau"}
                if concerned <= set(kinds):
                    run[channel][:, source.joint] *= -1.0

    return plant


def exchanged_torques(log: PlainLog, source: Source) -> None:
    """The torques of two joints in each other's columns."""
    first, second = source.pair
    for run in log.runs:
        run["tau"][:, [first, second]] = run["tau"][:, [second, first]]


def zero_offset(log: PlainLog, source: Source) -> None:
    """Positions of one joint 90 degrees too large."""
    size = {"rad": np.pi / 2.0, "deg": 90.0}[log.angle_unit(source.joint)]
    for run in log.runs:
        for channel in set(POSITIONS) & run.keys():
            run[channel][:, source.joint] += size * log.gear[source.joint]


def other_angle_unit(log: PlainLog, source: Source) -> None:
    """Positions of one joint in degrees under rad, or in rad under degrees."""
    factor = {"rad": 180.0 / np.pi, "deg": np.pi / 180.0}[log.angle_unit(source.joint)]
    for run in log.runs:
        for channel in set(POSITIONS) & run.keys():
            run[channel][:, source.joint] *= factor


def wrong_gravity(log: PlainLog, source: Source) -> None:
    """Gravity along x in the experiment file."""
    log.experiment["robot"]["gravity"] = [-9.80665, 0.0, 0.0]


def late_torque(log: PlainLog, source: Source) -> None:
    """Torques that were logged 20 ms late."""
    for run in log.runs:
        t = run["t"]
        run["tau"] = CubicSpline(t, run["tau"])(np.maximum(t - DELAY, t[0]))


def repeated_rows(log: PlainLog, source: Source) -> None:
    """Every fifth row, at random, repeats the row before; stamps go on."""
    for number, run in enumerate(log.runs):
        samples = len(run["t"])
        stale = np.random.default_rng([SEED, number]).random(samples) < REPEATED
        stale[0] = False
        rows = np.maximum.accumulate(np.where(stale, 0, np.arange(samples)))
        for channel in run.keys() - {"t"}:
            run[channel] = run[channel][rows]


def scaled_torque(log: PlainLog, source: Source) -> None:
    """The torque of one joint 1.5 times as large."""
    for run in log.runs:
        run["tau"][:, source.pair[0]] *= GAIN


def heavier_description(log: PlainLog, source: Source) -> None:
    """3 kg in the description's last link that the arm of the log does not carry."""
    if not source.flange:
        (last,) = list(re.finditer(r"^mass = ([\d.]+)", log.robot, re.MULTILINE))[-1:]
        mass = float(last[1]) + MASS
        log.robot = log.robot[: last.start(1)] + f"{mass:.6g}" + log.robot[last.end(1) :]
        return
    robot = ElementTree.fromstring(log.robot)
    mass_tag = robot.find(f"./link[@name='{source.flange}']/inertial/mass")
    if mass_tag is None:
        raise ValueError(f"link {source.flange} has no mass")
    mass_tag.set("value", f"{float(mass_tag.get('value', 0.0)) + MASS:.6g}")
    log.robot = ElementTree.tostring(robot, encoding="unicode")


def standstill(folder: Path) -> Trap:
    """5 s of standstill before and behind the motion, in place of what was there.

    The arm holds the pose of the slowest row near either end, with the torque that least squares
    gives for it and its reference there, with noise of the log's own size on the torque and some
    of an encoder on positions.

    Args:
        folder: of the log without a trap.
    """

    def plant(log: PlainLog, source: Source) -> None:
        experiment = load_experiment(folder / "experiment.toml")
        found = identify(experiment.problem(), experiment.methods(["ls"])["ls"])
        regressor = regressor_of(found.robot, found.parameters)
        random = np.random.default_rng(SEED)
        entries = zip(log.experiment["recording"], log.runs, experiment.recordings(), strict=True)
        for number, (entry, run, recording) in enumerate(entries):
            times = recording.start_time + np.arange(recording.samples) / recording.rate
            speeds = np.gradient(recording.q, axis=0)
            pace = (np.abs(speeds) / np.abs(speeds).max(axis=0)).max(axis=1)
            near = max(1, int(ENDS * recording.samples))
            ends = [int(np.argmin(pace[:near])), len(pace) - near + int(np.argmin(pace[-near:]))]
            at_rest = np.zeros((2, len(log.joints)))
            static = regressor.torque(recording.q[ends], at_rest, at_rest, found.theta)
            logged = np.column_stack([np.interp(times, run["t"], x) for x in run["tau"].T])
            to_log = np.linalg.lstsq(recording.tau, logged, rcond=None)[0]
            rows = np.searchsorted(run["t"], times[ends])
            log.runs[number] = _held(run, rows, static @ to_log, log, random)
            entry.pop("part", None)

    return plant


def _held(
    run: dict[str, np.ndarray],
    rows: np.ndarray,
    torque: np.ndarray,
    log: PlainLog,
    random: np.random.Generator,
) -> dict[str, np.ndarray]:
    """A recording between two rows, with standstill at both."""
    t = run["t"]
    period = float(np.median(np.diff(t)))
    samples = round(STANDSTILL / period)
    moving = slice(int(rows[0]), int(rows[1]) + 1)
    rest = period * np.arange(1, samples + 1)
    begin, end = t[moving][0], t[moving][-1]
    held = {"t": np.concatenate([begin - rest[::-1], t[moving], end + rest])}
    size = len(log.joints)
    units = {"rad": 1.0, "deg": np.degrees(1.0), "m": 0.1}
    encoder = ENCODER * np.array([units[log.angle_unit(j)] for j in range(size)])
    third = np.diff(run["tau"][moving], 3, axis=0)
    noise = 1.4826 * np.median(np.abs(third), axis=0) / np.sqrt(20.0)
    for channel in run.keys() - {"t"}:
        parts = [run[channel][moving]]
        for k, side in enumerate((0, 1)):
            value = run[channel][rows[k]]
            if channel == "tau":
                value = torque[k] + noise * random.standard_normal((samples, size))
            elif channel in ("q", "q_link"):
                value = value + encoder * random.standard_normal((samples, size))
            elif channel == "q_ref":
                value = run["q"][rows[k]]
            elif channel.startswith("d"):
                value = np.zeros(size)
            block = np.broadcast_to(value, (samples, size))
            parts.insert(0 if side == 0 else len(parts), block)
        held[channel] = np.vstack(parts)
    return {channel: held[channel] for channel in run}


#: All traps but `standstill`, which needs the log without a trap.
TRAPS: dict[str, Trap] = {
    "none": lambda log, source: None,
    "clock x2": clock(2.0),
    "clock x0.5": clock(0.5),
    "sign of torque": reversed_channels("tau"),
    "sign of position": reversed_channels("q"),
    "joint reversed": reversed_channels("q", "tau"),
    "torques exchanged": exchanged_torques,
    "zero 90 deg off": zero_offset,
    "degrees as rad": other_angle_unit,
    "gravity along x": wrong_gravity,
    "torque 20 ms late": late_torque,
    "rows repeated": repeated_rows,
    "torque x1.5": scaled_torque,
    "3 kg missing": heavier_description,
}

STANDSTILL_TRAP = "standstill"

NAMES = (*TRAPS, STANDSTILL_TRAP)


def apply_trap(name: str, log: PlainLog, source: Source, folder: Path) -> PlainLog:
    """A copy of a log with a trap.

    Args:
        name: of the trap.
        log: without one.
        source: where it goes.
        folder: of the log without a trap.

    Returns:
        The spoilt log.
    """
    spoilt = copy.deepcopy(log)
    plant = standstill(folder) if name == STANDSTILL_TRAP else TRAPS[name]
    plant(spoilt, source)
    return spoilt
