"""Torques that a result predicts for a recording, and where its motion leaves the fitted range.

Where a motion leaves the range that an estimate was fitted to.

Torques there are extrapolated: friction above all, which no record determines at speeds that it
does not have.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.equation_record import MotionRange
from pivident.estimation.kinematics import Kinematics
from pivident.foundation.document.curves import Curve, Curves, compared, torque_axis
from pivident.foundation.document.document import Accounted, Document, Part
from pivident.foundation.document.table import Column, Table
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.judgement.validation.held_out.held_out_errors import HeldOutErrors, LogError
from pivident.judgement.validation.held_out.prediction import PredictionError
from pivident.robot.description import Robot
from pivident.studies.prediction.beside_held_out import error_ratios

#: Width of text beside the table, in characters.
WIDTH = 110
#: A motion leaves a range where it is beyond it by this share of its extent …
BEYOND = 0.05
#: … in this share of the samples.
REPORTED = 0.01
#: The error inside and outside is compared where both have this share of the samples.
COMPARED = 0.05


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
        moving: errors below the highest frequency without standstill, by joint and of all joints.
    """

    errors: PredictionError
    intervals: np.ndarray
    in_band_intervals: np.ndarray
    total_interval: np.ndarray
    blocks: int
    edges: tuple[float, float]
    by_band: np.ndarray
    moving: Mapping[str, LogError]

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
class RangeExit:
    """How one joint leaves its fitted range."""

    joint: str  # its name
    outside: np.ndarray  # True for samples outside in position, speed or acceleration, (samples,)
    position: float  # farthest distance beyond the fitted positions [rad or m], zero within
    speed: float  # fastest speed over the fastest fitted
    acceleration: float  # likewise

    @property
    def share(self) -> float:
        """Share of the samples outside, 0 to 1."""
        return float(self.outside.mean())


def range_exits(
    robot: Robot, fitted: MotionRange, kinematics: Kinematics, span: slice
) -> Iterator[RangeExit]:
    """One for each joint that leaves its range, over some samples of a motion."""
    for j, joint in enumerate(robot.joints):
        q, dq, ddq = (x[j] for x in kinematics.stretch(span))
        low, high = fitted.low[j], fitted.high[j]
        beyond = np.maximum(np.maximum(low - q, q - high), 0.0)
        extent = max(high - low, 1e-12)
        speed, acceleration = (
            np.abs(x) / max(largest, 1e-12)
            for x, largest in ((dq, fitted.speed[j]), (ddq, fitted.acceleration[j]))
        )
        ratios = beyond / extent, speed - 1.0, acceleration - 1.0
        left = [x > BEYOND for x in ratios]
        often = [own.mean() >= REPORTED for own in left]
        if not any(often):
            continue
        farthest, fastest, hardest = (
            float(x.max()) if named else 0.0
            for x, named in zip((beyond, speed, acceleration), often, strict=True)
        )
        yield RangeExit(joint.name, np.any(left, axis=0), farthest, fastest, hardest)


def exit_findings(
    robot: Robot, fitted: MotionRange, exits: tuple[RangeExit, ...], error: np.ndarray | None
) -> Iterator[Finding]:
    """What each means; ``error``: τ - Φθ on the same samples, shape (samples, joints), or None."""
    for one in exits:
        j = robot.joint_names.index(one.joint)
        unit, torque = ("rad", "N m") if robot.joints[j].kind == "revolute" else ("m", "N")
        how = []
        if one.position:
            range_text = " to ".join(map(format_significant, (fitted.low[j], fitted.high[j])))
            far = format_significant(one.position, 2)
            how.append(f"positions beyond {range_text} {unit} by up to {far} {unit}")
        how += [
            f"{name} up to {ratio:.1f} times the largest fitted"
            for name, ratio in (("speeds", one.speed), ("accelerations", one.acceleration))
            if ratio
        ]
        text = (
            f"{one.joint} leaves the fitted range in {percent(100 * one.share)} of the samples: "
            f"{', '.join(how)}."
        )
        if error is not None and COMPARED <= one.share <= 1.0 - COMPARED:
            outside, inside = (
                float(np.sqrt(np.mean(error[own, j] ** 2))) for own in (one.outside, ~one.outside)
            )
            text += (
                f" Its rms error there is {format_significant(outside)} {torque}, inside "
                f"{format_significant(inside)} {torque}."
            )
        evidence = {"samples outside": Quantity(100 * one.share, "%")}
        yield Finding("warning", "range", "left", text, evidence=evidence)


@dataclass(frozen=True, eq=False)
class Prediction(Accounted):
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
        return tuple(joint.torque_unit for joint in self.robot.joints)

    def account(self) -> Document:
        """Errors of each joint and what they are, the torques over time, the findings."""
        t = self.t[self.moving]
        headline = (
            f"Torques of {self.recording} by {self.method}, {self.robot.name}: "
            f"{format_significant(t[-1] - t[0])} s of motion at "
            f"{(self.t.size - 1) / (self.t[-1] - self.t[0]):.6g} Hz."
        )
        legend = textwrap.fill(self._legend(), WIDTH, break_on_hyphens=False)
        errors = Part("Errors", (headline, self.table(), legend))
        torques = Part("Torques", figures=[self.curves(j) for j in range(self.robot.size)])
        title = f"{self.robot.name}: torques predicted by {self.method}"
        return Document(title, (errors, torques), self.findings, sheet=self._signals())

    def table(self) -> Table:
        """Errors, one row for each joint."""
        model, error = self.tau_model[self.moving], self.error
        columns: dict[str, Column] = {"joint": Column(self.robot.joint_names)}
        if error is None:
            rms, peak = np.sqrt(np.mean(model**2, axis=0)), np.abs(model).max(axis=0)
            columns["predicted_rms"] = Column(rms, "predicted rms", digits=3)
            columns["largest"] = Column(peak, digits=3)
            return Table("errors", columns | {"unit": Column(self.units)})
        e, intervals = error.errors, tuple(map(interval_text, error.intervals))
        columns |= {
            "torque_rms": Column(e.torque, "torque rms", digits=3),
            "error_rms": Column(e.rms, "error rms", digits=3),
            "unit": Column(self.units),
            "error_percent": Column(e.relative, "error %", digits=3),
            "interval": Column(intervals, "95 %"),
            "low_percent": Column(error.intervals[:, 0], shown="files"),
            "high_percent": Column(error.intervals[:, 1], shown="files"),
        }
        for name, shares in zip(("slower", "in band", "faster"), error.shares_by_band, strict=True):
            columns[f"{name.replace(' ', '_')}_percent"] = Column(shares, f"{name} %", digits=2)
        in_band = Column(e.relative_in_band, f"< {e.band:g} Hz %", digits=3)
        columns["error_in_band_percent"] = in_band
        if self.held_out is not None:
            names = self.robot.joint_names
            held = np.array([self.held_out.joints.get(name, np.nan) for name in names])
            columns["held_out_percent"] = Column(held, "held out %", digits=3)
            ratios = error_ratios(error.moving, self.held_out, names)
            answers = [ratios[name].answer if name in ratios else "" for name in names]
            if any(answers):
                columns["in_motion"] = Column(answers, "in motion")
        return Table("errors", columns, title="Errors of the predicted torques")

    def _legend(self) -> str:
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
                f"{self.held_out.where} (held out) when the result was made; in motion, without "
                "standstill, it is better, as good or worse where the 95 % interval of their ratio "
                "tells."
            )
        return text

    def curves(self, j: int, part: slice = slice(None)) -> Curves:
        """Measured and predicted torque of one joint, and their difference.

        Args:
            j: index of the joint.
            part: of the samples.
        """
        name, unit, model = self.robot.joint_names[j], self.units[j], self.tau_model[part, j]
        curves: Sequence[Curve] = [Curve("predicted", model, 0)]
        subject, note = f"Predicted torque of {name}", ""
        if self.tau is not None:
            curves = compared(self.tau[part, j], model, "predicted")
            subject = f"Measured and predicted torque of {name}"
        if self.error is not None:
            e = self.error.errors
            note = (
                f"error {percent(e.relative[j])}, rms {format_significant(e.rms[j])} {unit}, from "
                "the first to the last motion"
            )
        return Curves(name, torque_axis(unit), self.t[part], curves, subject, note)

    def _signals(self) -> Table:
        """Time, positions, measured and predicted torques, one row for each sample."""
        # stamps since 1970 have ten digits before the point, and microseconds behind it
        digits = max(10, len(str(int(np.abs(self.t).max(initial=0.0)))) + 6)
        columns = {"t [s]": Column(self.t, file_format=f"%.{digits}g")}
        for j, (joint, unit) in enumerate(zip(self.robot.joints, self.units, strict=True)):
            named = {f"q_{joint.name} [{joint.position_unit}]": self.q}
            if self.tau is not None:
                named[f"tau_{joint.name} [{unit}]"] = self.tau
            named[f"tau_model_{joint.name} [{unit}]"] = self.tau_model
            columns |= {key: Column(x[:, j], file_format="%.10g") for key, x in named.items()}
        return Table("signals", columns)

    def __repr__(self) -> str:
        error = self.error
        text = "no torque" if error is None else f"error {percent(error.errors.total)}"
        return f"<Prediction of {self.recording!r} by {self.method}: {text}>"


def interval_text(ends: np.ndarray) -> str:
    """``5.1 to 7.4``."""
    return " to ".join(format_significant(x, 2) for x in ends)
