"""One run of a robot: what was measured, in SI units on the joint side, checked once.

Whoever holds a `Recording` may rely on it: all channels have the shape (samples, joints), are
finite, move, and are not cut off. Estimators therefore carry no guards of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pivident.data.logs import timestamps
from pivident.data.logs.source_files import SourceFile
from pivident.data.logs.torque_scale import TorqueScale
from pivident.data.recording import checks
from pivident.data.recording.checks import (
    BESIDE,
    CHANNELS,
    SOURCE_SENTENCES,
    TIMING_WORDS,
    MeasuredWrench,
    Saturation,
    TorqueSource,
    TorqueTiming,
    one_column,
    settled,
)
from pivident.data.recording.usable_samples import leave_out_missing
from pivident.foundation.errors import RecordingError, require_kind
from pivident.foundation.text.display import Printed
from pivident.foundation.text.identifiers import is_printable
from pivident.robot.description import TorqueSide
from pivident.robot.naming import numbered_joints

__all__ = [
    "CHANNELS",
    "MeasuredWrench",
    "Recording",
    "Saturation",
    "TorqueSource",
    "TorqueTiming",
]


@dataclass(frozen=True, eq=False)
class Recording(Printed):
    """One run, checked when it is made. Its arrays are float64 and read-only.

    Attributes:
        name: name of the run.
        joint_names: names of the joints, one per column.
        q: joint positions, shape (samples, joints) [rad or m].
        tau: joint torques, shape (samples, joints) [N m or N].
        rate: sampling rate [Hz].
        q_ref: reference positions, shape (samples, joints) [rad or m], or None.
        dq_ref: reference speeds, shape (samples, joints) [rad/s or m/s], or None.
        ddq_ref: reference accelerations, shape (samples, joints) [rad/s² or m/s²], or None.
        inputs: known inputs that were added to the controller's output, by name, each of shape
            (samples, joints) in the unit of that output (V, A or N m).
        q_link: positions of second encoders behind the gear, shape (samples, joints) [rad or m],
            or None; q is then the motor encoder over the gear ratio. See
            `pivident.studies.flexibility`.
        dq: measured speeds, shape (samples, joints) [rad/s or m/s], or None; of use where their
            noise is not that of q, see `pivident.loop.instruments.second_sensor`.
        control_rate: rate of the control loop [Hz]; zero stands for the sampling rate.
        torque_timing: ``held``: applied from its instant until the next control instant;
            ``averaged``: mean over the period before its instant; ``sampled``: value at its
            instant. Where it is not given, motors hold a torque and sensors behind the gears
            sample one.
        delay: how much later the torque channel is than the positions [s].
        drive_delay: how much later than its sample a logged torque acts: the log holds what the
            drive was commanded, and the simulated loop waits as long [s].
        start_time: time of the first sample [s].
        sources: the files it was read from.
        allow_constant: whether a joint may stand still, or its torque be constant.
        saturation: ``refuse`` or ``allow`` torques that are cut off at a limit.
        notes: how the samples were brought onto one clock, in sentences.
        slowed: why the rate is lower than that of the logged positions, and what keeps theirs, as
            a half sentence; empty where it is not.
        torque_scale: joints whose torque has a scale that nobody has verified; its parameters then
            are as good as that scale.
        reading: arguments of `load_recording` but the files, by which another log of the same
            columns can be read; empty where the recording was not read from a log.
        torque_side: ``motor``: torques of the motors, on the joint side; ``link``: of sensors
            behind the gears, which feel neither rotors nor the friction of the drives.
        torque_source: ``measured``: the log holds a torque; ``law``: it does not, and ``tau`` is
            what the control law commands at the recorded positions, see
            `pivident.loop.motion.law_torque`; ``none``: it does not, and ``tau`` is zero until a
            `Problem` with the known law computes it.
        wrenches: what force sensors measured, see `pivident.data.with_wrenches`.
        wrench_torque: torque at the joints that they stand for, Σ Jᵀ f at the instants of the
            samples, shape (samples, joints) [N m or N], or None. It is no part of ``tau``, which is
            that of the motors; the equations of motion have the sum of both.
        weights: what each sample counts in a joint's equation, shape (samples, joints), above
            zero: the inverse of its variance, relative to that of a sample of weight one; None: all
            one.
        valid: True for samples that may stand in a joint's equation, shape (samples, joints); None:
            all of them. The others were no measurement and have been filled.
        temperature: of the motor or gear of each joint, shape (samples, joints) [°C or K], or None.
            With it `pivident.judgement.corrections` brings friction to one temperature.

    Raises:
        ShapeMismatch: a channel is not (samples, joints).
        RecordingTooShort: fewer than 16 samples.
        NonFiniteSamples: a channel holds NaN or infinite values.
        ConstantChannel: a position or torque never changes, and `allow_constant` is false.
        SaturatedSignal: a torque is cut off for more than `checks.TOLERATED_CLIPPING` of the
            samples, and `saturation` is ``refuse``.
        RecordingError: a rate is not positive, a joint name appears twice, an option is unknown.

    Example:
        >>> t = np.arange(4000) / 1000.0
        >>> q = np.column_stack([np.sin(t), np.cos(3.0 * t)])
        >>> tau = np.column_stack([np.cos(t), np.sin(3.0 * t)])
        >>> recording = pv.Recording.from_arrays(q, tau, rate=1000.0, name="run 1")
        >>> recording.part(seconds=(1.0, 3.0))
        <Recording 'run 1': 2000 samples of 2 joints at 1000 Hz, 1.999 s, channels q, tau>
    """

    name: str
    joint_names: tuple[str, ...]
    q: np.ndarray
    tau: np.ndarray
    rate: float
    q_ref: np.ndarray | None = None
    dq_ref: np.ndarray | None = None
    ddq_ref: np.ndarray | None = None
    inputs: dict[str, np.ndarray] = field(default_factory=dict)
    q_link: np.ndarray | None = field(default=None, kw_only=True)  # flexible joints
    dq: np.ndarray | None = field(default=None, kw_only=True)
    control_rate: float = 0.0
    torque_timing: TorqueTiming = ""  # type: ignore[assignment]  # settled by the torque's side
    delay: float = 0.0
    drive_delay: float = field(default=0.0, kw_only=True)
    start_time: float = 0.0
    sources: tuple[SourceFile, ...] = ()
    allow_constant: bool = False
    saturation: Saturation = "refuse"
    notes: tuple[str, ...] = field(default=(), kw_only=True)  # how clocks were brought together
    slowed: str = field(default="", kw_only=True)  # by a channel with a slower clock
    torque_scale: tuple[TorqueScale, ...] = field(default=(), kw_only=True)
    reading: dict[str, Any] = field(default_factory=dict, kw_only=True, repr=False)
    torque_side: TorqueSide = field(default="motor", kw_only=True)
    torque_source: TorqueSource = field(default="measured", kw_only=True)
    wrenches: tuple[MeasuredWrench, ...] = field(default=(), kw_only=True)
    wrench_torque: np.ndarray | None = field(default=None, kw_only=True)
    valid: np.ndarray | None = field(default=None, kw_only=True)
    weights: np.ndarray | None = field(default=None, kw_only=True)
    temperature: np.ndarray | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        settle = object.__setattr__
        settle(self, "joint_names", tuple(self.joint_names))
        settle(self, "sources", tuple(self.sources))
        settle(self, "control_rate", self.control_rate or self.rate)
        settle(self, "torque_timing", self.torque_timing or checks.usual_timing(self.torque_side))
        for channel in (*CHANNELS, "wrench_torque", "weights", "temperature"):
            if getattr(self, channel) is not None:
                settle(self, channel, settled(channel, getattr(self, channel)))
        settle(self, "inputs", {key: settled(key, value) for key, value in self.inputs.items()})
        if self.valid is not None:
            settle(self, "valid", np.asarray(self.valid, bool))
        self._check()

    def _check(self) -> None:
        """Refuse what no estimator could use."""
        self._check_options()
        for name in (self.name, *self.joint_names, *self.inputs):
            require_kind("a name", name, str, "give text")
            if not is_printable(name):
                raise RecordingError(
                    f"the name {name!r} holds control characters", advice="rename it"
                )
        if not self.joint_names or len(set(self.joint_names)) != self.joints:
            raise RecordingError(
                f"recording {self.name!r}: joint names {self.joint_names} are missing or repeated"
            )
        beside = {k: x for k in BESIDE if (x := getattr(self, k)) is not None}
        masks = {k: beside.pop(k) for k in ("valid", "weights") if k in beside}
        channels = {"tau": self.tau} | self.channels() | beside
        for channel, values in (channels | masks).items():
            checks.check_shape(channel, values, (*self.q.shape[:1], self.joints))
        timestamps.check_length(self.samples)
        for channel, values in channels.items():
            checks.check_finite(channel, values, self.joint_names)
        if self.weights is not None:
            checks.check_weights(self.weights, self.joint_names)
        if not self.allow_constant:
            checks.check_changing("q", self.q, self.joint_names)
        if self.torque_source != "measured":
            return  # a law is constant and cut off where it commands so
        # a joint whose torque nobody measured has none that could be wrong
        own = (
            np.arange(self.joints) if self.valid is None else np.flatnonzero(self.valid.any(axis=0))
        )
        if not self.allow_constant:
            checks.check_changing("tau", self.tau[:, own], [self.joint_names[j] for j in own])
        if self.saturation == "refuse":
            names = [self.joint_names[j] for j in own]
            checks.check_not_saturated("tau", self.tau[:, own], self.q[:, own], names)

    def _check_options(self) -> None:
        """Refuse rates, times and choices that mean nothing."""
        checks.check_times(
            rate=self.rate,
            control_rate=self.control_rate,
            delay=self.delay,
            drive_delay=self.drive_delay,
            start_time=self.start_time,
        )
        taken = [name for name in self.inputs if name in CHANNELS]
        if taken:
            raise RecordingError(
                f"an input is called {taken[0]!r} like a channel", advice="rename it"
            )
        for name, choices in (
            ("torque_timing", TorqueTiming),
            ("saturation", Saturation),
            ("torque_side", TorqueSide),
            ("torque_source", TorqueSource),
        ):
            if getattr(self, name) not in get_args(choices):
                raise RecordingError(
                    f"{name} is {getattr(self, name)!r}",
                    advice=f"choose one of {', '.join(get_args(choices))}",
                ).about(name)

    def __repr__(self) -> str:
        joints = f"{self.joints} joint{'s' * (self.joints != 1)}"
        law = {"tau": "tau by the control law"} if self.torque_source == "law" else {}
        named = [law.get(name, name) for name in self.channels()]
        return (
            f"<Recording {self.name!r}: {self.samples} samples of {joints} at {self.rate:.6g} Hz, "
            f"{self.duration:.4g} s, channels {', '.join(named)}>"
        )

    def channels(self) -> dict[str, np.ndarray]:
        """All arrays that are there, by name: q, tau, references, then inputs."""
        named = {channel: getattr(self, channel) for channel in CHANNELS}
        if self.torque_source == "none":
            del named["tau"]
        return {key: values for key, values in named.items() if values is not None} | self.inputs

    @property
    def has_torque(self) -> bool:
        """Whether a torque was measured."""
        return self.torque_source == "measured"

    def require_torque(self, purpose: str) -> None:
        """Refuse what only a measured torque can tell.

        Args:
            purpose: what needs it, the beginning of a sentence such as ``drive gains are found``.

        Raises:
            RecordingError: the torque was not measured.
        """
        if not self.has_torque:
            raise RecordingError(
                f"recording {self.name!r} has no measured torque, and {purpose} from one",
                advice="map the column of tau",
            ).about("columns", "tau")

    def behind(self, joints: int) -> Recording:
        """The recording without the first joints, those of a measured base.

        Args:
            joints: how many are left out.
        """
        return self.indexed(np.s_[:, joints:], {"joint_names": self.joint_names[joints:]})

    def indexed(self, where: Any, others: Mapping[str, Any]) -> Recording:
        """The recording with other samples or joints of all signals but the wrenches.

        Args:
            where: index of the arrays.
            others: fields that change with it, by name.
        """
        cut: dict[str, Any] = {
            channel: None if (values := getattr(self, channel)) is None else values[where]
            for channel in (*CHANNELS, *BESIDE)
        }
        inputs = {key: values[where] for key, values in self.inputs.items()}
        return replace(self, **cut, inputs=inputs, **others)

    def with_reference_of(self, driven: Recording) -> Recording:
        """The recording with the reference of its last joints, those that have motors.

        Args:
            driven: the same run of these joints alone, see `behind`.
        """
        base = self.q[:, : self.joints - driven.joints]
        speed = None if driven.dq_ref is None else np.hstack([np.zeros_like(base), driven.dq_ref])
        position = None if driven.q_ref is None else np.hstack([base, driven.q_ref])
        return replace(self, q_ref=position, dq_ref=speed)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.q)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def dt(self) -> float:
        """Sampling period [s]."""
        return 1.0 / self.rate

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return (self.samples - 1) / self.rate

    @property
    def t(self) -> np.ndarray:
        """Time of each sample, shape (samples,) [s]."""
        return self.start_time + np.arange(self.samples) / self.rate

    @property
    def account(self) -> tuple[str, ...]:
        """How it was logged and what was done to its samples, in sentences."""
        sentences = [
            f"{self.samples} samples at {self.rate:.6g} Hz, control loop at "
            f"{self.control_rate:.6g} Hz.",
        ]
        if self.torque_source != "measured":
            sentences.append(SOURCE_SENTENCES[self.torque_source])
        if self.torque_source != "none":
            sentences.append(f"A torque sample is {TIMING_WORDS[self.torque_timing]}.")
        if self.torque_side == "link":
            sentences.append("The torques are those of sensors behind the gears.")
        if self.delay:
            late = "later" if self.delay > 0 else "earlier"
            sentences.append(
                f"The torque channel is {1e3 * abs(self.delay):.4g} ms {late} than the positions, "
                "which is allowed for."
            )
        if self.drive_delay:
            sentences.append(
                f"A logged torque acts {1e3 * self.drive_delay:.4g} ms after its sample, which is "
                "allowed for."
            )
        return (*sentences, *self.notes)

    def part(
        self,
        start: int | None = None,
        stop: int | None = None,
        *,
        samples: Sequence[int] | None = None,
        seconds: Sequence[float] | None = None,
    ) -> Recording:
        """The samples start … stop-1 as a recording of their own, without copying.

        A part may stand still or touch a limit: that was judged on the whole recording.

        Args:
            start: index of the first sample; None: from the beginning.
            stop: index after the last sample; None: to the end.
            samples: both by name, such as ``samples=(100, 2000)``.
            seconds: in place of them the times between which it lies, as of `slice` [s].

        Raises:
            RecordingError: the indices or times lie outside the recording, or are no whole numbers.
        """
        if seconds is not None:
            return self.slice(*seconds)
        start, stop = samples if samples is not None else (start, stop)
        start, stop = 0 if start is None else start, self.samples if stop is None else stop
        if not (isinstance(start, Integral) and isinstance(stop, Integral)):
            raise RecordingError(
                f"a part of samples {start!r} to {stop!r} has no whole numbers",
                advice="give part(seconds=(1.5, 20.0)) for times",
            )
        if not 0 <= start < stop <= self.samples:
            raise RecordingError(
                f"samples {start} to {stop} do not lie inside recording {self.name!r}, which has "
                f"samples 0 to {self.samples}"
            )
        others = {
            "wrenches": tuple(replace(w, values=w.values[start:stop]) for w in self.wrenches),
            "start_time": self.start_time + start / self.rate,
            "allow_constant": True,
            "saturation": "allow",
        }
        return self.indexed(np.s_[start:stop], others)

    def slice(self, start_s: float, stop_s: float) -> Recording:
        """The samples with start_s ≤ t < stop_s, on the recording's own clock `t`.

        Args:
            start_s: first time [s].
            stop_s: time at which it ends, not included [s].

        Raises:
            RecordingError: no sample lies between these times.
        """
        # Rounding keeps a time that is meant to be a sample's own from missing it by one bit.
        first, last = (
            np.nan_to_num(np.ceil(round((time - self.start_time) * self.rate, 6)))
            for time in (start_s, stop_s)
        )
        first, last = (int(np.clip(index, 0, self.samples)) for index in (first, last))
        if first >= last:
            raise RecordingError(
                f"no sample of recording {self.name!r} lies between {start_s:g} and {stop_s:g} s",
                advice=f"it runs from {self.start_time:g} to {self.start_time + self.duration:g} s",
            )
        return self.part(first, last)

    @classmethod
    def from_arrays(
        cls,
        q: ArrayLike,
        tau: ArrayLike | None,
        rate: float,
        *,
        joint_names: Sequence[str] | None = None,
        name: str = "recording",
        q_ref: ArrayLike | None = None,
        dq_ref: ArrayLike | None = None,
        ddq_ref: ArrayLike | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        q_link: ArrayLike | None = None,
        dq: ArrayLike | None = None,
        valid: ArrayLike | None = None,
        control_rate: float = 0.0,
        torque_timing: TorqueTiming = "",  # type: ignore[assignment]  # as above
        delay: float = 0.0,
        drive_delay: float = 0.0,
        start_time: float = 0.0,
        torque_side: TorqueSide = "motor",
        allow_constant: bool = False,
        saturation: Saturation = "refuse",
        notes: Sequence[str] = (),
        gaps: Literal["refuse", "leave out"] = "refuse",
    ) -> Recording:
        """A recording from arrays in SI units on the joint side.

        A vector is the channel of a single joint. Columns of a data frame, in any unit, are read by
        `pivident.load_recording`.

        Args:
            q: joint positions, shape (samples, joints) or (samples,) [rad or m].
            tau: joint torques, likewise [N m or N]; None: none were logged, see `torque_source`.
            rate: sampling rate [Hz].
            joint_names: names of the joints in the order of the columns; ``joint_1`` … where they
                are not given. For `Problem` they are those of the robot.
            name: name of the run.
            q_ref: reference positions, shape of ``q`` [rad or m].
            dq_ref: reference speeds [rad/s or m/s].
            ddq_ref: reference accelerations [rad/s² or m/s²].
            inputs: known inputs that were added to the controller's output, by name, each of the
                shape of ``q``.
            q_link: positions behind the gear [rad or m].
            dq: measured speeds [rad/s or m/s].
            valid: True for samples that may stand in a joint's equation, shape of ``q``.
            control_rate: rate of the control loop [Hz]; zero: the sampling rate.
            torque_timing: ``held``, ``averaged`` or ``sampled``; empty: by the torque's side.
            delay: how much later the torque channel is than the positions [s].
            drive_delay: how much later than its sample a logged torque acts [s].
            start_time: time of the first sample [s].
            torque_side: ``motor`` or ``link``.
            allow_constant: whether a joint may stand still, or its torque be constant.
            saturation: ``refuse`` or ``allow`` torques that are cut off at a limit.
            notes: how the samples came about, in sentences.
            gaps: samples that are NaN are refused, or filled for the filters and left out of the
                equations: a torque of that joint's, a position of all. A joint without any torque
                then has no equation.

        Returns:
            The recording; arrays that are float64, in C order and read-only are not copied.

        Raises:
            RecordingError: as for the recording itself.

        Example:
            >>> t = np.arange(2000) / 1000.0
            >>> q, tau = np.column_stack([np.sin(5 * t)] * 2), np.column_stack([np.cos(5 * t)] * 2)
            >>> pv.Recording.from_arrays(q, tau, rate=1000.0).joint_names
            ('joint_1', 'joint_2')
        """
        require_kind("inputs", inputs or {}, Mapping, "give arrays by name")
        if gaps not in ("refuse", "leave out"):
            raise RecordingError(
                f"gaps is {gaps!r}", advice='choose "refuse" or "leave out"'
            ).about("gaps")
        source: TorqueSource = "none" if tau is None else "measured"
        given = {
            "q": q, "tau": np.zeros(np.shape(q)) if tau is None else tau, "q_ref": q_ref,
            "dq_ref": dq_ref, "ddq_ref": ddq_ref, "q_link": q_link, "dq": dq,
        }  # fmt: skip
        signals: dict[str, Any] = {
            key: one_column(key, x) for key, x in given.items() if x is not None
        }
        joints = signals["q"].shape[-1] if signals["q"].ndim else 1
        names = tuple(joint_names or numbered_joints(joints))
        usable = None if valid is None else one_column("valid", valid)
        if gaps == "leave out":
            found, left_out = leave_out_missing(signals, names, rate)
            usable, notes = found if usable is None else found & usable, (*notes, *left_out)
        return cls(
            name=name,
            joint_names=names,
            rate=rate,
            **signals,
            inputs={key: one_column(key, x) for key, x in (inputs or {}).items()},
            valid=usable,
            control_rate=control_rate,
            torque_timing=torque_timing,
            delay=delay,
            drive_delay=drive_delay,
            start_time=start_time,
            torque_side=torque_side,
            torque_source=source,
            allow_constant=allow_constant,
            saturation=saturation,
            notes=tuple(notes),
        )
