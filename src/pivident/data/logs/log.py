"""A log as it is, judged by nobody yet: in its own units, or in SI on the joint side.

From units of the log to SI, and from the motors to the joints.

joint-side SI = N⁻¹ (factor · logged) + offset        positions; speeds without the offset
Nᵀ (gain · factor · logged)           torques
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pivident.data.logs.bad_samples import BadSamples
from pivident.data.logs.clock_alignment import ClockedChannel
from pivident.data.logs.source_files import SourceFile
from pivident.data.logs.torque_scale import TorqueScale
from pivident.data.logs.units import factor_to_si
from pivident.foundation.errors import PividentError, RecordingError
from pivident.foundation.scratch import working_array
from pivident.foundation.text.display import Displayed
from pivident.robot.description import Robot
from pivident.robot.transmission import Transmission

#: Channels with one column per joint that an audit knows.
CHANNELS = ("q", "dq", "tau", "q_ref", "dq_ref", "ddq_ref")
#: Channels of positions, to which the zero of the model is added.
POSITIONS = ("q", "q_ref", "q_link")


@dataclass(frozen=True, eq=False)
class Description:
    """What was said about the channels of a log; it turns them into SI on the joint side."""

    units: Mapping[str, Any] = field(default_factory=dict)  # by channel and ``t``
    side: Any = "joint"  # ``joint`` or ``motor``, for all channels or by channel
    transmission: Transmission | None = None  # between motor and joint side, or None
    position_offset: Sequence[float] | None = None  # on the joint side [rad or m]
    clock: str | None = None  # name of the one time column, or None


@dataclass(frozen=True, eq=False)
class Log(Displayed):
    """One log, read and not judged.

    Attributes:
        name: name of the log.
        joint_names: names of the joints, empty where no channel is known.
        columns: every column by name, in the units of the file, shape (samples,).
        clocks: time columns [s].
        rate: sampling rate that somebody declared [Hz], or None.
        logged: channels in the units and on the side of the file, shape (samples, joints).
        channels: the same in SI and on the joint side.
        robot: the robot, or None.
        torque_timing: which instant a torque sample belongs to, as in a `Recording`; empty where
            nobody has said, and then held.
        control_rate: declared rate of the control loop [Hz], zero for the sampling rate.
        delay: declared delay of the torque [s].
        commands: joints whose torque is a drive command without a known gain.
        sources: the files.
        notes: how the columns were taken, in sentences.
        side: ``joint`` or ``motor``, where the logged positions were measured.
        clock_unit: unit of the clocks in the file.
        torque_scale: joints whose torque has a scale that nobody has verified.
        resample: whether a recording has new samples at equal intervals, and over short gaps.
        description: what was said about the channels.
        own_clocks: channels that were logged by clocks of their own, with their stamps [s].
        faults: what a recording refuses, in the order in which it was met.
        bad: samples that are no measurement, NaN in ``logged`` and ``channels``.
        kept: rows of the files that the log has, shape (rows of the files,); None: all of them.
        dropped: which rows it does not have and why, in sentences.
    """

    name: str
    joint_names: tuple[str, ...]
    columns: dict[str, np.ndarray]
    clocks: dict[str, np.ndarray]
    rate: float | None = None
    logged: dict[str, np.ndarray] = field(default_factory=dict)
    channels: dict[str, np.ndarray] = field(default_factory=dict)
    robot: Robot | None = None
    torque_timing: str = ""
    control_rate: float = 0.0
    delay: float = 0.0
    commands: tuple[int, ...] = ()
    sources: tuple[SourceFile, ...] = ()
    notes: tuple[str, ...] = ()
    side: str = "joint"
    clock_unit: str = "s"
    torque_scale: tuple[TorqueScale, ...] = ()
    resample: bool = False
    description: Description = Description()
    own_clocks: dict[str, ClockedChannel] = field(default_factory=dict)
    faults: tuple[PividentError, ...] = ()
    bad: tuple[BadSamples, ...] = ()
    kept: np.ndarray | None = None
    dropped: tuple[str, ...] = ()

    def rows_kept(self, column: np.ndarray) -> np.ndarray:
        """Another column of the files without the rows that the log has left out."""
        fits = self.kept is not None and len(self.kept) == len(column)
        return column[self.kept] if fits else column

    @property
    def samples(self) -> int:
        """Number of samples of the longest column."""
        return max([len(v) for v in (*self.columns.values(), *self.logged.values())], default=0)

    @property
    def clock(self) -> np.ndarray | None:
        """The first time column [s], or None."""
        return next(iter(self.clocks.values()), None)

    def signals(self) -> dict[str, np.ndarray]:
        """Every signal that is no clock by a name for people, in the units of the file."""
        named = {
            f"{channel} of {joint}": values[:, j]
            for channel, values in self.logged.items()
            for j, joint in enumerate(self.joint_names)
        }
        return named | {n: v for n, v in self.columns.items() if n not in self.clocks}

    def position_unit(self, joint: int) -> str:
        """Unit of a joint's positions in ``channels``, both kinds where the robot is not known."""
        if self.robot is None or joint >= self.robot.size:
            return "rad (or m)"
        return self.robot.joints[joint].position_unit

    def time_of(self, sample: int | None) -> float | None:
        """Time of a sample on the log's own clock, or from its declared rate [s]."""
        if sample is None:
            return None
        clock = self.clock
        if clock is not None and sample < len(clock):
            return float(clock[sample])
        return sample / self.rate if self.rate else None

    def between(self, start: float, stop: float) -> Log:
        """The samples with start ≤ t < stop, on the clock that was declared, else at the rate.

        Time columns that nobody declared are there to be judged; no recording is made of them.

        Args:
            start: first time [s].
            stop: time at which it ends, not included [s].

        Raises:
            RecordingError: no sample lies between them.
        """
        declared = self.description.clock is not None or self.own_clocks or self.rate is None
        clock = self.clock if declared else None
        t = clock if clock is not None else np.arange(self.samples) / (self.rate or 1.0)
        inside = np.flatnonzero((t >= start) & (t < stop))
        if not inside.size:
            raise RecordingError(
                f"no sample of {self.name} lies between {start:.10g} and {stop:.10g} s"
            )
        cut = slice(int(inside[0]), int(inside[-1]) + 1)
        return replace(
            self,
            columns={k: v[cut] for k, v in self.columns.items()},
            clocks={k: v[cut] for k, v in self.clocks.items()},
            logged={k: v[cut] for k, v in self.logged.items()},
            channels={k: v[cut] for k, v in self.channels.items()},
            bad=tuple(b for f in self.bad if (b := f.within(cut.start, cut.stop)).rows.size),
        )


def factors_of(channel: str, units: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Factor to SI of each joint, and whether it is a drive command; None stands for SI."""
    pairs = [(1.0, False) if unit is None else factor_to_si(channel, unit) for unit in units]
    return np.array([factor for factor, _ in pairs]), np.array([c for _, c in pairs], dtype=bool)


def gains_of(
    commands: np.ndarray, transmission: Transmission | None
) -> tuple[np.ndarray, tuple[int, ...]]:
    """Drive gain of each joint with a command, 1 of the others, and commands without a gain."""
    joints = len(commands)
    if transmission is None:
        return np.ones(joints), tuple(int(j) for j in np.flatnonzero(commands))
    gains = np.where(commands, transmission.drive_gain[:joints], 1.0)
    without = np.flatnonzero(commands & ~np.asarray(transmission.gain_given, bool)[:joints])
    return gains, tuple(int(j) for j in without)


def sides_of(side: Any) -> dict[str, Any]:
    """Side of each channel that has one; references are on that of the positions."""
    given = dict(side) if isinstance(side, Mapping) else dict.fromkeys(("q", "tau"), side)
    positions = given.get("q", "joint")
    sides = {channel: given.get(channel, positions) for channel in ("q", "dq", "q_ref")}
    sides |= {channel: given.get(channel, sides["q_ref"]) for channel in ("dq_ref", "ddq_ref")}
    return sides | {"tau": given.get("tau", "joint"), "q_link": "joint"}  # flexible joints


def on_joint_side(
    channel: str, values: np.ndarray, sides: Mapping[str, str], said: Description
) -> np.ndarray:
    """A channel in SI behind the gear, positions with the zero of the model."""
    joints = values.shape[1]
    given, transmission = said.position_offset, said.transmission
    offset = np.zeros(joints) if given is None else np.asarray(given, float)[:joints]
    on_motor = {key: own == "motor" and transmission is not None for key, own in sides.items()}
    if on_motor[channel] and transmission is not None:
        gear = transmission.first(joints)
        if channel == "tau":
            return gear.joint_torques(values)
        values = gear.joint_positions(values)
        values -= gear.position_offset
    if transmission is not None and given is None:
        # Both encoders of a flexible joint are in the model's coordinates.
        if on_motor[channel] or (channel == "q_link" and on_motor["q"]):
            offset = transmission.position_offset[:joints]
    if channel in POSITIONS and offset.any():
        return np.add(values, offset, out=working_array(values.shape))
    return values
