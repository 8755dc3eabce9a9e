"""Torques that a result predicts for a recording, beside what was measured."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pivident.prediction.range_exits import RangeExit
from pivident.text.finding import Finding
from pivident.text.numbers import format_significant, percent
from pivident.text.plain_table import plain_table
from pivident.validation.held_out.held_out_errors import HeldOutErrors
from pivident.validation.held_out.prediction import PredictionError

if TYPE_CHECKING:
    from pivident.robot.description import Robot

#: Width of text beside the table, in characters.
WIDTH = 110


@dataclass(frozen=True, eq=False)
class ErrorOnLog:
    """Errors of predicted torques, over the part of a log from the first to the last motion.

    Attributes:
        errors: rms of each joint, over all frequencies and below the highest one of the motion.
        intervals: 95 % intervals of ``errors.relative`` [%], shape (joints, 2).
        in_band_intervals: those of ``errors.relative_in_band`` [%], likewise.
        total_interval: that of ``errors.total_in_band`` [%], shape (2,).
        blocks: blocks of time that the intervals come from.
        edges: frequencies at which the band of the motion begins and ends [Hz].
        by_band: rms below, in and above that band, shape (3, joints) [N m or N].
    """

    errors: PredictionError
    intervals: np.ndarray
    in_band_intervals: np.ndarray
    total_interval: np.ndarray
    blocks: int
    edges: tuple[float, float]
    by_band: np.ndarray

    @property
    def band_names(self) -> tuple[str, str, str]:
        """The three bands in words."""
        low, high = self.edges
        return f"below {low:g} Hz", f"{low:g} to {high:g} Hz", f"above {high:g} Hz"

    @property
    def shares_by_band(self) -> np.ndarray:
        """``by_band`` over the rms torque [%]; their squares add up to that of the error."""
        return 100.0 * self.by_band / np.maximum(self.errors.torque, 1e-300)

    @property
    def worst(self) -> int:
        """Index of the joint with the largest relative error."""
        return int(np.argmax(self.errors.relative_in_band))


@dataclass(frozen=True, eq=False)
class Prediction:
    """Torques of one recording by one result; arrays have shape (samples, joints).

    Attributes:
        method: name of the method that made the result.
        robot: its robot.
        recording: name of the recording.
        t: time of each sample [s], shape (samples,).
        q: smoothed positions [rad or m]; ``dq ddq`` likewise.
        dq: speeds [rad/s or m/s].
        ddq: accelerations [rad/s² or m/s²].
        tau: measured torque on the same instants [N m or N], NaN where it was left out as no
            measurement; None: the log has none.
        tau_model: predicted torque [N m or N].
        moving: samples from the first to the last motion of any joint; errors are those of them.
        error: errors of the prediction; None without a measured torque.
        exits: joints that leave the range of the fitted motion, where that is known.
        held_out: errors of the result on motion held out when it was made, where they are known.
        findings: what the errors mean.
    """

    method: str
    robot: Robot
    recording: str
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray | None
    tau_model: np.ndarray
    moving: slice
    error: ErrorOnLog | None
    exits: tuple[RangeExit, ...]
    held_out: HeldOutErrors | None
    findings: tuple[Finding, ...]

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's torque."""
        return tuple("N m" if j.kind == "revolute" else "N" for j in self.robot.joints)

    @property
    def headline(self) -> str:
        """What was predicted, and over which time."""
        t = self.t[self.moving]
        span = f"{format_significant(t[-1] - t[0])} s of motion"
        rate = (self.t.size - 1) / (self.t[-1] - self.t[0])
        return (
            f"Torques of {self.recording} by {self.method}, {self.robot.name}: {span} at "
            f"{rate:.6g} Hz"
        )

    def table(self) -> str:
        """One line for each joint."""
        return plain_table(list(self.columns()))

    def columns(self) -> Iterator[tuple[str, str, list[str]]]:
        """Title, alignment and cells of each column of the table."""
        model, error = self.tau_model[self.moving], self.error
        yield "joint", "<", list(self.robot.joint_names)
        if error is None:
            rms, peak = np.sqrt(np.mean(model**2, axis=0)), np.abs(model).max(axis=0)
            yield "predicted rms", ".", [format_significant(x) for x in rms]
            yield "largest", ".", [format_significant(x) for x in peak]
            yield "unit", "<", list(self.units)
            return
        e = error.errors
        yield "torque rms", ".", [format_significant(x) for x in e.torque]
        yield "error rms", ".", [format_significant(x) for x in e.rms]
        yield "unit", "<", list(self.units)
        yield "error %", ".", [format_significant(x) for x in e.relative]
        yield "95 %", "<", [interval_text(x) for x in error.intervals]
        for name, shares in zip(("slower", "in band", "faster"), error.shares_by_band, strict=True):
            yield f"{name} %", ".", [format_significant(x, 2) for x in shares]
        yield f"< {e.band:g} Hz %", ".", [format_significant(x) for x in e.relative_in_band]
        if self.held_out is not None:
            held = [self.held_out.joints.get(name, np.nan) for name in self.robot.joint_names]
            yield "held out %", ".", [format_significant(x) for x in held]

    def legend(self) -> str:
        """What the columns of the table are, in sentences."""
        error = self.error
        if error is None:
            return "The log has no torque: nothing is compared."
        text = (
            "Errors are over the rms torque of the joint, from the first to the last motion, with "
            f"95 % intervals from their scatter over {error.blocks} blocks of time. Squared, they "
            f"are the sum of three parts: slower than the motion ({error.band_names[0]}), in its "
            f"band ({error.band_names[1]}), and faster."
        )
        if self.held_out is not None:
            text += (
                f" Below {self.held_out.band:g} Hz it can be compared with that on "
                f"{self.held_out.where} (held out) when the result was made."
            )
        return text

    def account(self) -> str:
        """Headline, table and what its columns are."""
        legend = textwrap.fill(self.legend(), WIDTH, break_on_hyphens=False)
        return "\n\n".join([f"{self.headline}.", self.table(), legend])

    def __str__(self) -> str:
        return "\n".join([self.account(), "", *map(str, self.findings)]).rstrip()

    def __repr__(self) -> str:
        error = self.error
        text = "no torque" if error is None else f"error {percent(error.errors.total)}"
        return f"<Prediction of {self.recording!r} by {self.method}: {text}>"


def interval_text(ends: np.ndarray) -> str:
    """``5.1 to 7.4``."""
    return " to ".join(format_significant(x, 2) for x in ends)
