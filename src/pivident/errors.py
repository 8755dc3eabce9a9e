"""Errors of pivident: one base class, children that keep their evidence.

Every message names the object (joint, sample, file, key), the value met, the value expected
and the next step, so that it can be shown to a user as one readable line.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from pivident.printable import shortened

if TYPE_CHECKING:
    from pivident.recording.gaps import Stretches


class PividentError(Exception):
    """Base of every error that pivident raises on purpose.

    As text it is cut to what a person reads; ``args`` holds all of it, for instance the whole of a
    name of 50,000 letters.
    """

    def __str__(self) -> str:
        return shortened(super().__str__())


class RobotDescriptionError(PividentError, ValueError):
    """A robot description (modified DH table or URDF) that cannot be used."""


class RecordingError(PividentError, ValueError):
    """A recording whose content cannot be used as it is."""


class FileFormatError(RecordingError):
    """A file that is missing, unreadable or not what its name promises."""


class ExperimentError(PividentError, ValueError):
    """An experiment file with unknown keys, bad values or contradictory options."""


class IdentificationError(PividentError):
    """An identification that cannot be carried out on the given data."""


class IdentificationFileError(PividentError, ValueError):
    """An identification on disk that cannot be used.

    Attributes:
        file: the file.
        reason: what is wrong with it, and the next step.
    """

    def __init__(self, file: str, reason: str) -> None:
        self.file, self.reason = file, reason
        super().__init__(f"{file}: {reason}")


class ExportError(PividentError, ValueError):
    """A model that cannot be written in a format, or a file that must not be written."""


class NonFiniteSamples(RecordingError):
    """A channel holds NaN or infinite samples.

    Attributes:
        channel: name of the channel, such as ``tau``.
        joint: name of the joint.
        sample: index of the first such sample.
        count: how many there are.
    """

    def __init__(self, channel: str, joint: str, sample: int, count: int) -> None:
        self.channel, self.joint, self.sample, self.count = channel, joint, sample, count
        super().__init__(
            f"{channel} of joint {joint!r} has {count} sample(s) that are NaN or infinite, "
            f"the first at sample {sample}; cut the recording there or repair the log"
        )


class ShapeMismatch(RecordingError):
    """Arrays of one recording that do not belong together.

    Attributes:
        channel: name of the channel, such as ``tau``.
        shape: shape met.
        expected: shape needed, (samples, joints).
    """

    def __init__(self, channel: str, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
        self.channel, self.shape, self.expected = channel, tuple(shape), tuple(expected)
        super().__init__(
            f"{channel} has shape {self.shape}, but {self.expected} is needed (samples, joints); "
            "select the columns of these joints and cut all channels to the same samples"
        )


class RecordingTooShort(RecordingError):
    """A recording with too few samples to differentiate and fit.

    Attributes:
        samples: number of samples met.
        minimum: smallest number that is accepted.
    """

    def __init__(self, samples: int, minimum: int) -> None:
        self.samples, self.minimum = samples, minimum
        super().__init__(
            f"the recording has {samples} sample(s), at least {minimum} are needed; "
            "take a longer part, or check which axis of the file is time"
        )


class ConstantChannel(RecordingError):
    """A channel of one joint holds the same value from beginning to end.

    Attributes:
        channel: name of the channel, such as ``q``.
        joint: name of the joint.
        value: the value it holds [SI].
    """

    def __init__(self, channel: str, joint: str, value: float) -> None:
        self.channel, self.joint, self.value = channel, joint, value
        super().__init__(
            f"{channel} of joint {joint!r} is {value:.6g} at every sample; freeze that joint and "
            "leave it out of the recording, check its column, or accept it with allow_constant"
        )


class SaturatedSignal(RecordingError):
    """A torque channel that is cut off at its extreme value while the joint moves.

    Attributes:
        channel: name of the channel, such as ``tau``.
        joint: name of the joint.
        value: the value at which it is cut off.
        count: number of samples that sit there.
        samples: number of samples of the recording.
        sample: index of the first such sample.
    """

    def __init__(
        self, channel: str, joint: str, value: float, count: int, samples: int, sample: int
    ) -> None:
        self.channel, self.joint, self.value = channel, joint, value
        self.count, self.samples, self.sample = count, samples, sample
        super().__init__(
            f"{channel} of joint {joint!r} is cut off at {value:.6g} during {count} of {samples} "
            f"samples, first at sample {sample}; cut these parts, repeat the motion more slowly, "
            'or accept them with saturation = "allow"'
        )


class IrregularSampling(RecordingError):
    """Time stamps that are not one regular clock.

    Attributes:
        kind: ``jitter``, ``duplicate`` or ``backward``.
        sample: index of the first stamp at fault.
        time: that stamp [s].
        interval: distance to the stamp before it [s].
        expected: median interval of the recording [s].
    """

    ADVICE: ClassVar[dict[str, str]] = {
        "jitter": "resample the recording onto a uniform grid, or give the rate if the clock of "
        "the samples is regular and only its stamps are not",
        "duplicate": "remove the repeated rows, or give the rate if the stamps are only coarse",
        "backward": "cut the recording there; two logs may have been joined",
    }

    def __init__(
        self, kind: str, sample: int, time: float, interval: float, expected: float
    ) -> None:
        self.kind, self.sample, self.time = kind, sample, time
        self.interval, self.expected = interval, expected
        super().__init__(
            f"time stamp {time:.6f} s of sample {sample} follows its predecessor by "
            f"{_duration(interval)} instead of {_duration(expected)} ({kind}); {self.ADVICE[kind]}"
        )


class MissingSamples(IrregularSampling):
    """Time stamps of one regular clock from which samples are missing.

    Attributes:
        missing: how many samples.
        gaps: in how many places.
        sample: index of the last sample before the largest gap.
        time: its stamp [s].
        interval: length of the largest gap, from stamp to stamp [s].
        stretches: what the gaps leave.
    """

    def __init__(
        self,
        missing: int,
        gaps: int,
        sample: int,
        time: float,
        interval: float,
        stretches: Stretches,
    ) -> None:
        self.missing, self.gaps, self.kind = missing, gaps, "gap"
        self.sample, self.time, self.interval = sample, time, interval
        self.stretches = stretches
        where = "in one gap" if gaps == 1 else f"in {gaps} gaps, the largest"
        RecordingError.__init__(
            self,
            f"{missing} sample(s) are missing {where} of {_duration(interval)} after sample "
            f"{sample} (t = {time:.6f} s); {stretches.advice()}",
        )


class GapInClock(IrregularSampling):
    """A gap in the samples of a channel over which nothing can be interpolated.

    Attributes:
        channel: name of the channel.
        clock: name of its stamps.
        time: last stamp before the longest gap [s].
        interval: length of that gap [s].
        gaps: number of gaps.
        stretches: what the gaps leave.
    """

    def __init__(
        self,
        channel: str,
        clock: str,
        time: float,
        interval: float,
        gaps: int,
        stretches: Stretches,
    ) -> None:
        self.channel, self.clock, self.time, self.interval = channel, clock, time, interval
        self.gaps, self.stretches, self.kind = gaps, stretches, "gap"
        others = "" if gaps == 1 else f", the longest of {gaps} gaps"
        RecordingError.__init__(
            self,
            f"{channel} has no samples for {_duration(interval)} after {time:.3f} s on the clock "
            f"{clock}{others}, and nothing is interpolated over that; {stretches.advice()}",
        )


class ClocksDisagree(RecordingError):
    """Channels whose stamps are not of one clock, or that were logged at different times.

    Attributes:
        one: channel, name of its clock, first and last stamp [s].
        other: the same of another channel.
        apart: how much the second clock is ahead of the first [s], where that is known.
    """

    def __init__(
        self,
        one: tuple[str, str, float, float],
        other: tuple[str, str, float, float],
        apart: float | None = None,
    ) -> None:
        self.one, self.other, self.apart = one, other, apart
        spans = [
            f"{c} by {clock} runs from {a:.3f} to {b:.3f} s" for c, clock, a, b in (one, other)
        ]
        if apart is None:
            text = f"{spans[0]}, {spans[1]}: they share no time"
        else:
            text = (
                f"{spans[0]}, {spans[1]}: these are two clocks, {abs(apart):.3f} s apart by when "
                "the messages were received"
            )
        super().__init__(
            f"{text}. Does one count from 1970 and the other from when its machine was switched "
            'on? Name stamps of one clock; in a bag t = "receive_time" is one'
        )


class UnknownColumn(FileFormatError):
    """A column or array that the file does not hold.

    Attributes:
        file: name of the file.
        column: name asked for.
        near: names in the file that look like it.
    """

    def __init__(self, file: str, column: str, near: Sequence[str], known: Sequence[str]) -> None:
        self.file, self.column, self.near = file, column, tuple(near)
        hint = f"did you mean {', '.join(self.near)}?" if near else f"it has {_shortened(known)}"
        if known[:1] == ("column_1",):
            hint = f"it has no header, so its columns are called column_1 to column_{len(known)}"
        super().__init__(f"{file} has no column or array {column!r}; {hint}")


class BadCell(FileFormatError):
    """A line of a text table that cannot be read as numbers.

    Attributes:
        file: name of the file.
        line: number of the line, counted from one, header included.
        column: name of the column, or None where the whole line is at fault.
        text: what stands there.
    """

    def __init__(self, file: str, line: int, column: str | None, text: str, reason: str) -> None:
        self.file, self.line, self.column, self.text = file, line, column, text
        where = f"line {line}" if column is None else f"line {line}, column {column!r}"
        super().__init__(f"{file}, {where}: {reason}; correct or remove that line")


class ChecksumMismatch(FileFormatError):
    """A file of a public record whose content is not the published one.

    Attributes:
        file: name of the file.
        found: SHA-256 of its content.
        expected: SHA-256 of the published file.
    """

    def __init__(self, file: str, found: str, expected: str) -> None:
        self.file, self.found, self.expected = file, found, expected
        super().__init__(
            f"{file} has SHA-256 {found[:12]}… instead of {expected[:12]}…; "
            "delete it and fetch it again"
        )


class DatasetUnavailable(PividentError):
    """A public record that is neither here nor can be fetched.

    Attributes:
        dataset: name of the data set.
        file: name of the missing file.
    """

    def __init__(self, dataset: str, file: str, reason: str) -> None:
        self.dataset, self.file = dataset, file
        super().__init__(
            f"{file} of data set {dataset!r} is not available: {reason}; set the environment "
            f"variable PIVIDENT_DATA to a folder that holds {dataset}/{file}"
        )


class RankDeficientRegressor(IdentificationError):
    """The motion does not separate all requested parameters.

    Attributes:
        rank: numerical rank of the observation matrix.
        expected: number of parameters asked for.
        groups: names of the parameters that cannot be told apart, one tuple per missing rank.
    """

    def __init__(self, rank: int, expected: int, groups: Sequence[Sequence[str]]) -> None:
        self.rank, self.expected = rank, expected
        self.groups = tuple(tuple(group) for group in groups)
        listed = "; ".join(", ".join(group) for group in self.groups)
        super().__init__(
            f"the motion separates {rank} of {expected} parameters; not separable: {listed}. "
            "Add a recording that moves these joints, or leave parameters out of the set"
        )


class MassMatrixNotPositiveDefinite(IdentificationError):
    """The mass matrix of the current parameters is indefinite on the motion.

    Attributes:
        joint: name of the joint at which the Cholesky factorisation failed.
        time: time of that sample [s].
        pivot: the pivot that should have been positive.
    """

    def __init__(self, joint: str, time: float, pivot: float) -> None:
        self.joint, self.time, self.pivot = joint, time, pivot
        super().__init__(
            f"the mass matrix is not positive definite at joint {joint!r}, t = {time:.4f} s "
            f"(pivot {pivot:.3g}); start from larger rotor inertias or CAD values"
        )


class SimulationDiverged(IdentificationError):
    """The simulated closed loop left the neighbourhood of its reference.

    Attributes:
        joint: name of the joint that left first.
        time: time at which it did [s].
        deviation: distance from the reference at that time [rad or m], or the speed.
        bound: the largest one allowed.
        speed: whether the joint was too fast, and not too far away.
    """

    def __init__(
        self, joint: str, time: float, deviation: float, bound: float, speed: bool = False
    ) -> None:
        self.joint, self.time, self.deviation, self.bound = joint, time, deviation, bound
        self.speed = speed
        what = (
            f"has a speed of {deviation:.3g}"
            if speed
            else f"is {deviation:.3g} away from its reference"
        )
        super().__init__(
            f"the simulated joint {joint!r} {what} at t = {time:.4f} s "
            f"(bound {bound:.3g}); check the controller's gains, units and sign, "
            "the drive gain and the initial parameters"
        )


class UnusableSignal(IdentificationError, ValueError):
    """An input or output from which no linear model can be estimated.

    Attributes:
        signal: name of the signal, such as ``u2``.
        found: what it is like.
    """

    def __init__(self, signal: str, found: str, advice: str) -> None:
        self.signal, self.found = signal, found
        super().__init__(f"{signal} {found}; {advice}")


class DelayTooLong(IdentificationError, ValueError):
    """A delay that leaves too little of the record.

    Attributes:
        delay: the delay [samples].
        samples: samples of the record.
    """

    def __init__(self, delay: int, samples: int) -> None:
        self.delay, self.samples = delay, samples
        super().__init__(
            f"a delay of {delay} samples leaves nothing to fit in a record of {samples}; "
            "give delays in samples (not seconds), or take a longer record"
        )


class OrdersNotSupported(IdentificationError):
    """Orders of a linear model that the record cannot support.

    Attributes:
        parameters: number of parameters asked for.
        reason: what is missing.
    """

    def __init__(self, parameters: int, reason: str) -> None:
        self.parameters, self.reason = parameters, reason
        super().__init__(
            f"the record does not support a model of {parameters} parameters: {reason}; "
            "lower the orders (select_orders compares several), or excite more frequencies"
        )


class UnstableFit(IdentificationError):
    """A linear model that fits only with unstable poles.

    Attributes:
        poles: the unstable ones [rad/s].
    """

    def __init__(self, poles: Sequence[complex]) -> None:
        self.poles = tuple(poles)
        listed = ", ".join(f"{pole:.4g}" for pole in self.poles)
        super().__init__(
            f"the estimate has unstable poles at {listed} rad/s; check the sign of u, the orders "
            "and the delay. Of an unstable plant in a loop, identify the closed loop"
        )


class NegativePayload(IdentificationError):
    """A load that weighs less than nothing.

    Attributes:
        mass: the estimated mass [kg].
        std: its standard deviation [kg].
    """

    def __init__(self, mass: float, std: float) -> None:
        self.mass, self.std = mass, std
        super().__init__(
            f"the load's mass is {mass:.4g} ± {2 * std:.2g} kg (2σ): the record with the load "
            "carries less than the one without. Swap the two records, or check which tool each "
            "one was taken with"
        )


def _duration(seconds: float) -> str:
    """A time with six digits, in microseconds where it is short."""
    return f"{seconds:.6g} s" if abs(seconds) >= 0.01 else f"{1e6 * seconds:.6g} µs"


def _shortened(names: Sequence[str], most: int = 12) -> str:
    """The first few names of a list, and how many follow."""
    listed = ", ".join(repr(name) for name in names[:most])
    return listed if len(names) <= most else f"{listed} and {len(names) - most} more"


class ContradictoryBounds(IdentificationError):
    """Declared bounds that no consistent set of parameters satisfies.

    Attributes:
        bounds: those in question, in words.
    """

    def __init__(self, bounds: Sequence[str]) -> None:
        self.bounds = tuple(bounds)
        super().__init__(
            f"no consistent parameters satisfy the bounds: {'; '.join(self.bounds)}; "
            "they contradict each other or what a real body can be, widen them"
            if self.bounds
            else "no consistent parameters can be found from this estimate, which is too far from "
            "any machine; check signs, units and gear ratios (pivident audit), or identify again"
        )


class NoConsistentModelNear(IdentificationError):
    """An estimate so poor that the nearest consistent parameters explain the record much worse.

    Attributes:
        distance: from the estimate to the nearest consistent parameters [σ].
        p_value: probability of such a distance if the estimate's intervals were true.
        error_free: relative torque error of the estimate on the fitted record.
        error_consistent: of the nearest consistent parameters.
        at_fault: links and joints whose constraints are active, the most expensive first.
        model: the nearest consistent model, for a look.
    """

    def __init__(
        self,
        distance: float,
        p_value: float,
        error_free: float,
        error_consistent: float,
        at_fault: Sequence[str],
        model: object = None,
    ) -> None:
        self.distance, self.p_value, self.model = distance, p_value, model
        self.error_free, self.error_consistent = error_free, error_consistent
        self.at_fault = tuple(at_fault)
        super().__init__(
            f"no consistent parameters lie near the estimate: the nearest are {distance:.3g} σ "
            f"away (p = {p_value:.2g}), with a torque error of {100 * error_consistent:.3g} % on "
            f"the fitted record ({100 * error_free:.3g} % free), by demands on "
            f"{', '.join(self.at_fault[:4]) or 'the links'}; check geometry, gear ratios, units "
            "and signs (pivident audit), the friction law and the parameters that were left out; "
            "--accept-far (accept_far = True) gives the model all the same"
        )
