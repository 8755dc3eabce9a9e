"""Errors of recordings: their samples, their clocks, and the files that they are read from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from pivident.foundation.errors.kinds import FileFormatError, PividentError, RecordingError

#: Most stretches that are listed one by one.
LISTED = 6


@dataclass(frozen=True)
class Stretches:
    """What gaps leave of a log.

    Attributes:
        parts: first and last time of each stretch that is worth a recording, in order of time [s];
            written as decimals, they lie within the stretch.
        seconds: length of the whole log, gaps included [s].
        lost: time that is inside of the gaps that nothing bridges [s].
        short: time of the stretches that are not worth a recording [s].
        resample: whether shorter gaps remain inside of the parts, to be interpolated.
    """

    parts: tuple[tuple[float, float], ...]
    seconds: float
    lost: float
    short: float
    resample: bool

    @property
    def longest(self) -> tuple[float, float]:
        """First and last time of the longest stretch [s]."""
        return max(self.parts, key=lambda part: part[1] - part[0])

    @property
    def listed(self) -> list[tuple[float, float]]:
        """The longest stretches, in order of time: those that are worth a line [s]."""
        return sorted(sorted(self.parts, key=lambda part: part[0] - part[1])[:LISTED])

    def advice(self) -> str:
        """What the gaps cost, and what to write into the experiment file, as a half sentence."""
        fill = "set resample = true" if self.resample else ""
        if not self.lost and len(self.parts) < 2:
            return f"{fill}, which fills gaps as short as these" if fill else ""
        length = self.longest[1] - self.longest[0]
        kept = f"{length:.4g} s of {self.seconds:.4g} s"
        text = f"write {written(self.longest)} to keep the longest stretch between gaps, {kept}"
        if len(self.parts) > 1:
            listed = ", ".join(map(written, self.listed))
            number = "both" if len(self.parts) == 2 else f"the {len(self.listed)} longest"
            number = "each" if 2 < len(self.parts) <= LISTED else number
            text += f", or one table [[recording]] for {number}: {listed}"
        costs = [f"{self.lost:.3g} s are lost inside the gaps"] if self.lost else []
        if self.short:
            costs.append(f"{self.short:.3g} s in stretches too short for a motion")
        more = f"; {fill} too, which fills the shorter gaps" if fill else ""
        lost = f" ({' and '.join(costs)})" if costs else ""
        return f"{text}{lost}{more}"


def written(part: tuple[float, float]) -> str:
    """A part as the experiment file has it."""
    return f"part = [{part[0]!r}, {part[1]!r}]"


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
        self.about("columns", *channel.split("."))
        super().__init__(
            f"{channel} of joint {joint!r} has {count} sample(s) that are NaN or infinite, the "
            f"first at sample {sample}",
            advice="cut the recording there or repair the log",
        )


class PositionsBeyondLimits(RecordingError):
    """Positions so far beyond a joint's limits that they mostly are in another unit.

    Attributes:
        channel: name of the channel, such as ``q``.
        joint: name of the joint.
        position: the farthest one [unit].
        limits: of the joint [unit].
        unit: ``rad`` or ``m``.
        likely_unit: the unit that they may be in, where nobody has given one; else empty.
    """

    def __init__(
        self,
        channel: str,
        joint: str,
        position: float,
        limits: tuple[float, float],
        unit: str,
        likely_unit: str,
        advice: str,
    ) -> None:
        self.channel, self.joint, self.position = channel, joint, position
        self.limits, self.unit, self.likely_unit = limits, unit, likely_unit
        self.about("columns", *channel.split("."))
        low, high = limits
        super().__init__(
            f"{channel} of joint {joint!r} reaches {position:.4g} {unit}, far beyond its limits "
            f"{low:.4g} to {high:.4g} {unit}",
            advice=advice,
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
        self.about("columns", *channel.split("."))
        super().__init__(
            f"{channel} has shape {self.shape}, but {self.expected} is needed (samples, joints)",
            advice="select the columns of these joints and cut all channels to the same samples",
        )


class RecordingTooShort(RecordingError):
    """A recording with too few samples to differentiate and fit.

    Attributes:
        samples: number of samples met.
        minimum: smallest number that is accepted.
    """

    place = ("part",)

    def __init__(self, samples: int, minimum: int) -> None:
        self.samples, self.minimum = samples, minimum
        super().__init__(
            f"the recording has {samples} sample(s), at least {minimum} are needed",
            advice="take a longer part, or check which axis of the file is time",
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
        self.about("columns", *channel.split("."))
        super().__init__(
            f"{channel} of joint {joint!r} is {value:.6g} at every sample",
            advice="freeze that joint and leave it out of the recording, check its column, or "
            "accept it with allow_constant",
        )


class SaturatedSignal(RecordingError):
    """A torque channel that is cut off at its extreme value while the joint moves.

    Attributes:
        channel: name of the channel, such as ``tau``.
        joint: name of the joint.
        value: the value at which it is cut off.
        count: number of samples at that value.
        samples: number of samples of the recording.
        sample: index of the first such sample.
    """

    def __init__(
        self, channel: str, joint: str, value: float, count: int, samples: int, sample: int
    ) -> None:
        self.channel, self.joint, self.value = channel, joint, value
        self.count, self.samples, self.sample = count, samples, sample
        self.about("columns", *channel.split("."))
        super().__init__(
            f"{channel} of joint {joint!r} is cut off at {value:.6g} N m (or N) for {count} of "
            f"{samples} samples, first at sample {sample}",
            advice="cut these parts, repeat the motion more "
            'slowly, or accept them with saturation = "allow"',
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
            f"{_duration(interval)} instead of {_duration(expected)} ({kind})",
            advice=self.ADVICE[kind],
        )


class MissingSamples(IrregularSampling):
    """Time stamps of one regular clock from which samples are missing.

    Attributes:
        missing: how many samples.
        gaps: number of gaps.
        sample: index of the last sample before the largest gap.
        time: its stamp [s].
        interval: length of the largest gap, from stamp to stamp [s].
        stretches: the stretches between the gaps.
    """

    place = ("part",)

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
            f"{sample} (t = {time:.6f} s)",
            advice=stretches.advice(),
        )


class GapInClock(IrregularSampling):
    """A gap in the samples of a channel over which nothing can be interpolated.

    Attributes:
        channel: name of the channel.
        clock: name of its stamps.
        time: last stamp before the longest gap [s].
        interval: length of that gap [s].
        gaps: number of gaps.
        stretches: the stretches between the gaps.
    """

    place = ("part",)

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
            f"{clock}{others}, and nothing is interpolated over that",
            advice=stretches.advice(),
        )


class BrokenMotion(IrregularSampling):
    """Positions that jump and do not come back, or that are not known for too long.

    Attributes:
        sample: first sample behind the first break.
        time: its stamp [s].
        breaks: number of breaks.
        stretches: the stretches between the breaks.
    """

    place = ("part",)

    def __init__(
        self, what: str, sample: int, time: float, breaks: int, stretches: Stretches
    ) -> None:
        self.sample, self.time, self.breaks, self.stretches = sample, time, breaks, stretches
        self.kind = "break"
        others = "" if breaks == 1 else f", the first of {breaks} such places"
        fact = f"{what} at sample {sample} (t = {time:.6f} s){others}"
        RecordingError.__init__(self, fact, advice=stretches.advice())


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
        text = (
            f"{spans[0]}, {spans[1]}: they share no time"
            if apart is None
            else f"{spans[0]}, {spans[1]}: these are two clocks, {abs(apart):.3f} s apart by when "
            "the messages were received"
        )
        super().__init__(
            f"{text}. Does one count from 1970 and the other from when its machine was switched "
            "on? Name stamps of one clock",
            advice='in a bag t = "receive_time" is one',
        )


class UnknownColumn(FileFormatError, KeyError):
    """A column or array that the file does not hold.

    Attributes:
        file: name of the file.
        column: requested name.
        near: names in the file that look like it.
    """

    place = ()

    def __init__(self, file: str, column: str, near: Sequence[str], known: Sequence[str]) -> None:
        self.file, self.column, self.near = file, column, tuple(near)
        hint = f"did you mean {', '.join(self.near)}?" if near else f"it has {_shortened(known)}"
        if known[:1] == ("column_1",):
            hint = (
                f"it has no header, so its columns are called column_1 to column_{len(known)}; "
                "name them in their order with column_names under [recording]"
            )
        super().__init__(f"{file} has no column or array {column!r}", advice=hint)
        self.meant = (column, self.near[0]) if near else None


class BadCell(FileFormatError):
    """A line of a text table that cannot be read as numbers.

    Attributes:
        file: name of the file.
        line: number of the line, counted from one, header included.
        column: name of the column, or None where the whole line is at fault.
        text: its text.
    """

    def __init__(
        self,
        file: str,
        line: int,
        column: str | None,
        text: str,
        reason: str,
        advice: str = "correct or remove that line",
    ) -> None:
        self.file, self.line, self.column, self.text = file, line, column, text
        where = f"line {line}" if column is None else f"line {line}, column {column!r}"
        super().__init__(f"{file}, {where}: {reason}", advice=advice)


class NoSamples(FileFormatError):
    """A table whose header no line of samples follows.

    Attributes:
        file: name of the file.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        super().__init__(f"{file} has a header but no samples", advice="export the log again")


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
            f"{file} has SHA-256 {found[:12]}… instead of {expected[:12]}…",
            advice="delete it and fetch it again",
        )


class DatasetUnavailable(PividentError, LookupError):
    """A public record that is neither here nor can be fetched.

    Attributes:
        dataset: name of the data set.
        file: name of the missing file.
    """

    def __init__(self, dataset: str, file: str, reason: str) -> None:
        self.dataset, self.file = dataset, file
        super().__init__(
            f"{file} of data set {dataset!r} is not available: {reason}",
            advice="set the environment variable PIVIDENT_DATA to a folder that holds "
            f"{dataset}/{file}",
        )


def _duration(seconds: float) -> str:
    """A time with six digits, in microseconds where it is short."""
    return f"{seconds:.6g} s" if abs(seconds) >= 0.01 else f"{1e6 * seconds:.6g} µs"


def _shortened(names: Sequence[str], most: int = 12) -> str:
    """The first few names of a list, and how many follow."""
    listed = ", ".join(repr(name) for name in names[:most])
    return listed if len(names) <= most else f"{listed} and {len(names) - most} more"
