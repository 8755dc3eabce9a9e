"""The time that a run still takes: what is expected of its stages, at the pace of this run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from pivident.foundation.text.numbers import time_in_words

#: What comes before the stages where nothing is known of it: expected, and taken [s].
PRIOR = (1.0, 1.0)

#: How much slower or faster than expected a beginning may have been and still tell the pace: disks
#: that are cold delay the beginning alone.
TELLING = 4.0

#: Less than this is not worth a word [s].
SHORT = 3.0


def pace(expected: float, taken: float) -> float:
    """How much slower this computer is now than the one whose times are expected, from a beginning.

    ``expected``, ``taken``: seconds of what is behind.
    """
    return min(max(taken / expected, 1.0 / TELLING), TELLING)


class Remaining:
    """Stages of a run, how long each is expected to take, and how long those done have taken.

    The pace is the time that all that is behind has taken over the time that was expected of it: at
    first the libraries and the records, then one stage after the other. A stage that takes longer
    than expected slows it at once, not only when it ends.

    Args:
        expected: seconds of each stage by its name, in their order.
        clock: what the time is read from [s].
        before: what came before the stages: seconds expected of it, and taken.
    """

    def __init__(
        self,
        expected: Mapping[str, float],
        clock: Callable[[], float] = time.perf_counter,
        before: tuple[float, float] = PRIOR,
    ) -> None:
        self._expected, self._clock = dict(expected), clock
        self._order = list(expected)
        self._stage, self._since = "", clock()
        self._done = before[0]
        self._taken = self._done * pace(*before)

    def begin(self, stage: str) -> None:
        """A stage begins, and the one before has ended."""
        now = self._clock()
        if self._stage:
            self._done += self._expected[self._stage]
            self._taken += now - self._since
        self._stage, self._since = stage, now

    @property
    def seconds(self) -> float:
        """Time until the end of the last stage [s]."""
        here = self._expected.get(self._stage, 0.0)
        elapsed = self._clock() - self._since if self._stage else 0.0
        late = (self._taken + elapsed) / (self._done + here)
        pace = max(self._taken / self._done, late if self._stage else 0.0)
        after = self._order[self._order.index(self._stage) + 1 :] if self._stage else self._order
        rest = sum(self._expected[name] for name in after)
        return max(pace * here - elapsed, 0.0) + pace * rest

    def place(self) -> dict[str, float]:
        """Number of the stage, of how many, and the seconds left; empty before the first."""
        if not self._stage:
            return {}
        number = self._order.index(self._stage) + 1
        return {"number": number, "of": len(self._order), "left_s": round(self.seconds, 1)}

    def __str__(self) -> str:
        """Which stage is running, and the time that is left if that is worth a word."""
        if not self._stage:
            return ""
        text = f"stage {self._order.index(self._stage) + 1} of {len(self._order)}"
        left = self.seconds
        return text if left < SHORT else f"{text}, about {time_in_words(left)} left"
