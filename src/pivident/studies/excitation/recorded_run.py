"""Did the robot run the design? A log beside it: tracking, speeds, stops, and what it still gives.

Tracking and the start of the motion are those of `followed_motion`. Speeds and accelerations are
those of the smoothed positions within the runs, beside the largest of the design. What the log
determines follows from the information of the motion that was recorded, with the same noise for
both motions,

    σ_k(log) = σ_k(design) √((I_log⁻¹)_kk / (I_design⁻¹)_kk),      I = Σ_jt Φ_jtᵀ Φ_jt / σ_j².
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.data.logs.timestamps import runs_of
from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.signal_recipes import Bandpass
from pivident.foundation.document.document import Accounted, Document, Part
from pivident.foundation.document.table import Column, Table
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.sentences import listed, plural
from pivident.loop.motion.motion import Kinematics
from pivident.studies.excitation.criteria import standard_errors
from pivident.studies.excitation.design import Design
from pivident.studies.excitation.followed_motion import (
    DEVIATES,
    MOVES,
    FollowedMotion,
    followed_motion,
)
from pivident.studies.excitation.information import Samples
from pivident.studies.excitation.reached import (
    AS_PREDICTED,
    COMPLETE,
    NAMED,
    followed_sentences,
    other_motion,
)

#: Rate at which both motions are sampled [Hz].
RATE = 50.0

#: Cut-off of the filter of the positions, times the shortest time in which the motion changes.
BAND = 5.0

#: Noise of a joint's torque over its largest one in the design.
NOISE_SHARE = 0.01

#: Shortest stop that is reported, and shortest part that makes a motion that of the design [s], at
#: least so much of its duration.
MIN_STOP, MIN_PART, MIN_SHARE = 0.3, 1.0, 0.15

#: A joint that reaches less than this share of its designed speed or acceleration falls short.
SHORT = 0.8


@dataclass(frozen=True, eq=False)
class RecordedRun(Accounted):
    """A recording beside the motion that was designed.

    Attributes:
        design: the design.
        followed: when the motion was run, and how far the positions are from it.
        part: beginning and end of the longest part of the motion that was followed [s].
        stops: beginning and end of each time at which the robot stood although the design moves,
            in seconds of the motion.
        speed: largest speed that was recorded, shape (joints,) [rad/s or m/s]; NaN where nothing
            was compared, and so below.
        acceleration: likewise [rad/s² or m/s²].
        std: standard errors that are expected of the log, shape (parameters,), in the order of
            ``design.predicted``.
    """

    design: Design
    followed: FollowedMotion
    part: tuple[float, float]
    stops: tuple[tuple[float, float], ...]
    speed: np.ndarray
    acceleration: np.ndarray
    std: np.ndarray

    @property
    def is_as_designed(self) -> bool:
        """Whether the robot ran all of the motion, without a stop, and every joint followed it."""
        followed = self.followed
        whole = followed.covered >= COMPLETE and not self.stops
        return followed.is_same and whole and not followed.deviating

    @property
    def ratio(self) -> np.ndarray:
        """Standard errors expected of the log over those of the design, shape (parameters,)."""
        alone = np.array([p.alone for p in self.design.predicted])
        return self.std / np.where(np.isfinite(alone), alone, np.nan)

    def joints_table(self) -> Table:
        """Tracking, largest speed and acceleration of each joint beside the design."""
        _, speed, acceleration = self.design.motion.sampled(RATE)
        joints = self.design.robot.joints
        columns = {
            "joint": Column([joint.name for joint in joints]),
            "rms": Column(self.followed.rms, "tracking error, rms", digits=3),
            "unit": Column([joint.position_unit for joint in joints]),
            "share": Column(100.0 * self.followed.share, "% of the motion", digits=2),
            "speed": Column(self.speed, "largest speed", digits=3),
            "designed_speed": Column(np.abs(speed).max(axis=0), "designed", digits=3),
            "speed_unit": Column([f"{joint.position_unit}/s" for joint in joints], "unit"),
            "acceleration": Column(self.acceleration, "largest acceleration", digits=3),
            "designed_acceleration": Column(np.abs(acceleration).max(axis=0), "designed", digits=3),
            "acceleration_unit": Column([f"{joint.position_unit}/s²" for joint in joints], "unit"),
        }
        return Table("joints", columns, title="The log beside the design")

    def parameters_table(self) -> Table:
        """Standard errors of the design, and those that are expected of the log."""
        predicted = self.design.predicted
        columns = {
            "parameter": Column([p.name for p in predicted]),
            "design": Column(np.array([p.alone for p in predicted]), "σ design", digits=3),
            "log": Column(self.std, "σ log", digits=3),
            "ratio": Column(self.ratio, "log/design", digits=3),
            "unit": Column([p.unit for p in predicted]),
        }
        return Table("parameters", columns, title="Standard errors expected of the log")

    def sentences(self) -> list[str]:
        """What the comparison says."""
        followed, duration = self.followed, self.design.motion.duration
        start, stop = self.part
        if followed.is_same:
            said = list(followed_sentences(followed))
        elif stop - start >= max(MIN_PART, MIN_SHARE * duration):
            said = [
                f"{followed.recording} followed the design from {start:.1f} to {stop:.1f} s of its "
                f"{duration:.1f} s only."
            ]
        else:
            said = [other_motion((followed,), [followed.recording])]
        if self.stops:
            times = listed([f"{start:.1f} to {stop:.1f} s" for start, stop in self.stops])
            said.append(
                f"The robot stood still {plural(len(self.stops), 'time')} although the design "
                f"moves, at {times} of the motion: look for a protective stop or a slowed program."
            )
        if not followed.is_same:
            return said
        begins = ", ".join(f"{start:.3f} s" for start in followed.starts)
        said.append(
            f"The motion begins {begins} after the first sample; {100 * followed.covered:.0f} % of "
            "it was recorded."
        )
        for quantity, reached, designed in (
            ("speed", self.speed, self.design.motion.sampled(RATE)[1]),
            ("acceleration", self.acceleration, self.design.motion.sampled(RATE)[2]),
        ):
            share = reached / np.maximum(np.abs(designed).max(axis=0), 1e-12)
            if names := [n for n, s in zip(followed.joint_names, share, strict=True) if s < SHORT]:
                said.append(
                    f"Largest {quantity} below {100 * SHORT:.0f} % of the designed one: "
                    f"{listed(names)}, at least {100 * float(np.min(share)):.0f} %."
                )
        return [*said, *self._consequence()]

    def _consequence(self) -> list[str]:
        """What that does to the standard errors."""
        names = [p.name for p in self.design.predicted]
        pairs = [(r, n) for r, n in zip(self.ratio, names, strict=True) if math.isfinite(r)]
        if not pairs:
            return []
        mean = math.exp(sum(math.log(max(r, 1e-12)) for r, _ in pairs) / len(pairs))
        said = [
            f"Standard errors expected of this log: {format_significant(mean)} times those of the "
            f"design (geometric mean of {len(pairs)} parameters, with the same noise)."
        ]
        worst = [
            (r, n) for r, n in sorted(pairs, reverse=True) if r > AS_PREDICTED * max(1.0, mean)
        ]
        if worst:
            named = ", ".join(f"{n} {format_significant(r)}" for r, n in worst[:NAMED])
            said.append(f"Furthest above: {named} times.")
        return said

    def account(self) -> Document:
        """Tracking, stops and standard errors."""
        heading = f"{self.followed.recording} beside the design"
        tables = [self.joints_table()]
        if np.isfinite(self.std).any():
            tables.append(self.parameters_table())
        return Document(heading, [Part("Recorded run", [" ".join(self.sentences()), *tables])])


def recorded_run(design: Design, recording: Recording) -> RecordedRun:
    """Compare a recording with the motion that was designed.

    Args:
        design: the design.
        recording: of the same joints, which are found by name.

    Returns:
        Tracking error, stops, speeds, accelerations, and the standard errors to expect.

    Raises:
        ExperimentError: it has other joints than the design.
        RecordingTooShort: too few samples for speeds and accelerations.
    """
    motion, recording = design.motion, in_order_of(design.robot, recording)
    followed = followed_motion(recording, motion)
    signals = Bandpass(cutoff=min(BAND / motion.family.time_scale, 0.4 * recording.rate), edge=0)
    kinematics = estimate_kinematics(recording, signals)
    runs = [_sampled(kinematics, start, motion.duration) for start in followed.starts]
    part = max((_part(t, q, design) for t, (q, _, _) in runs), key=lambda part: part[1] - part[0])
    stops = tuple(stop for t, (_, dq, _) in runs for stop in _stops(t, dq, motion.sampled(RATE)[1]))
    unknown, nothing = (np.full(n, np.nan) for n in (recording.joints, len(design.predicted)))
    if not followed.is_same:
        return RecordedRun(design, followed, part, stops, unknown, unknown, nothing)
    speed = np.max([np.abs(dq).max(axis=0) for _, (_, dq, _) in runs], axis=0)
    acceleration = np.max([np.abs(ddq).max(axis=0) for _, (_, _, ddq) in runs], axis=0)
    std = _expected(design, [samples for _, samples in runs])
    return RecordedRun(design, followed, part, stops, speed, acceleration, std)


def _part(t: np.ndarray, q: np.ndarray, design: Design) -> tuple[float, float]:
    """The longest time in which most joints are near the design, by the rms of their motion [s]."""
    place = design.motion.at(t)[0]
    spread = np.maximum(place.std(axis=0), 1e-12)
    near = np.median(np.abs(q - place) / spread, axis=1) <= DEVIATES
    parts = [(float(t[a]), float(t[b - 1])) for a, b in runs_of(near)]
    return max(parts, key=lambda part: part[1] - part[0], default=(0.0, 0.0))


def _sampled(known: Kinematics, start: float, duration: float) -> tuple[np.ndarray, Samples]:
    """Times since a start and the smoothed motion at `RATE`, as far as it was recorded."""
    recording = known.recording
    own = np.arange(recording.samples) / recording.rate - start
    here = np.arange(int(duration * RATE) + 1) / RATE
    here = here[(here >= own[known.start]) & (here <= own[known.stop - 1])]
    q, dq, ddq = (
        np.column_stack([np.interp(here, own, x) for x in signal])
        for signal in (known.q, known.dq, known.ddq)
    )
    return here, (q, dq, ddq)


def _stops(t: np.ndarray, dq: np.ndarray, designed: np.ndarray) -> list[tuple[float, float]]:
    """Times at which no joint moves, and some joint of the design does [s]."""
    fastest = np.maximum(np.abs(designed).max(axis=0), 1e-12)
    moves = (np.abs(designed) > MOVES * fastest).any(axis=1)
    moves = moves[np.minimum(np.rint(t * RATE).astype(int), len(designed) - 1)]
    stands = (np.abs(dq) < MOVES * fastest).all(axis=1)
    found = [(a, b) for a, b in runs_of(stands) if np.mean(moves[a:b]) > 0.5]
    return [(float(t[a]), float(t[b - 1])) for a, b in found if t[b - 1] - t[a] >= MIN_STOP]


def _expected(design: Design, runs: Sequence[Samples]) -> np.ndarray:
    """Standard errors that the recorded motion gives, in the order of the design's."""
    robot = design.robot
    base = base_parameters(robot)
    if [p.name for p in design.predicted] != list(base.names):
        return np.full(len(design.predicted), np.nan)  # of two runs that are asked together
    regressor = regressor_of(robot, base.parameters)
    limits = np.array([joint.torque_limit or 1.0 for joint in robot.joints])
    largest = limits if design.torque is None else np.abs(design.torque).max(axis=0)
    noise = NOISE_SHARE * np.where(largest > 0.0, largest, 1.0)
    designed = _information(regressor, design.motion.sampled(RATE), noise)
    logged = sum(_information(regressor, samples, noise) for samples in runs)
    share = standard_errors(np.asarray(logged)) / standard_errors(designed)
    return np.array([p.alone for p in design.predicted]) * share


def _information(regressor: Regressor, motion: Samples, noise: np.ndarray) -> np.ndarray:
    """Σ_jt Φ_jtᵀ Φ_jt/σ_j² of a motion, shape (parameters, parameters)."""
    q, dq, ddq = (np.ascontiguousarray(x.T) for x in motion)
    packed = regressor.packed(q, dq, ddq, inner=regressor.levels(dq))
    out = np.zeros((len(regressor.parameters),) * 2)
    for j, sigma in enumerate(noise):
        rows = packed[regressor.offsets[j] : regressor.offsets[j + 1]] / sigma
        out[np.ix_(regressor.columns_of(j), regressor.columns_of(j))] += rows @ rows.T
    return out
