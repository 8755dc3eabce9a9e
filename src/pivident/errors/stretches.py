"""What gaps leave of a log: the evidence of errors about its clock."""

from __future__ import annotations

from dataclasses import dataclass

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

    def advice(self) -> str:
        """What the gaps cost, and what to write into the experiment file, as a half sentence."""
        fill = "set resample = true" if self.resample else ""
        if not self.lost:
            return f"{fill}, which fills gaps as short as these" if fill else ""
        length = self.longest[1] - self.longest[0]
        kept = f"{length:.4g} s of {self.seconds:.4g} s"
        text = f"write {written(self.longest)} to keep the longest stretch between gaps, {kept}"
        if len(self.parts) > 1:
            first = sorted(self.parts, key=lambda part: part[0] - part[1])[:LISTED]
            listed = ", ".join(written(part) for part in sorted(first))
            number = "both" if len(self.parts) == 2 else f"the {len(first)} longest"
            number = "each" if 2 < len(self.parts) <= LISTED else number
            text += f", or one table [[recording]] for {number}: {listed}"
        costs = [f"{self.lost:.3g} s are lost inside of the gaps"]
        if self.short:
            costs.append(f"{self.short:.3g} s in stretches too short for a motion")
        more = f"; {fill} too, which fills the shorter gaps" if fill else ""
        return f"{text} ({' and '.join(costs)}){more}"


def written(part: tuple[float, float]) -> str:
    """A part as the experiment file has it."""
    return f"part = [{part[0]!r}, {part[1]!r}]"
