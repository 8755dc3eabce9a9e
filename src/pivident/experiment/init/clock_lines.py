"""Time in ``[recording]``: rate, resampling, the stamps of each channel, and when the joints move.

When the joints move.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.data.logs.bags.bag_table import OwnClock
from pivident.data.logs.bags.read_bag import STAMP
from pivident.data.logs.nominal_rate import QUARTZ, ClockRate, clock_rate
from pivident.data.logs.recognition.log_clock import LogClock
from pivident.data.logs.timestamps import EVEN, check_rate, stamp_error
from pivident.experiment.init.assumption import Assumption, Question
from pivident.foundation.errors import concerning
from pivident.judgement.audit.steps import unsteady_steps

#: Periods of a sampled law in a time step of MuJoCo, whose actuators know the speed and damp by it
#: at the end of the step, and periods in a sample of the log at most.
PER_STEP, MAX_MULTIPLE = 4, 64


def clock_lines(
    clock: LogClock, others: Mapping[str, OwnClock], given: float | None = None
) -> Iterator[Assumption]:
    """Rate and resampling; ``given``: a rate that somebody said [Hz]."""
    correct = "In Hz; every speed and acceleration depends on it."
    if given is not None:
        if not (clock.by_rate or clock.resample or others):
            with concerning("rate"):
                check_rate(given, clock.seconds)
        yield Assumption("recording", "rate", given, "certain", "as given", correct)
    elif clock.by_rate:
        question = None
        if clock.sure == "assumed":
            question = Question("rate", "At what rate was the log taken, in Hz?")
        rate = float(f"{clock.rate:.8g}")
        yield Assumption("recording", "rate", rate, clock.sure, clock.seen, correct, question)
    elif others:
        positions = clock_rate(clock.seconds)
        yield Assumption(
            "recording", "rate", _common_rate(positions, others.get("tau")), "likely",
            "new samples are made at the rate of the positions, or of the torques where these "
            "are slower; without this line they are made at that of the slowest channel "
            f"({_listed(others)})",
            "In Hz.",
        )  # fmt: skip
    elif clock.resample and (found := clock_rate(clock.seconds)).nominal is not None:
        seen = f"{found}; new samples are made at that rate"
        yield Assumption("recording", "rate", found.nominal, "likely", seen, "In Hz.")
    if clock.resample or others:
        seen = f"{_listed(others)} by clocks of their own, so that all channels are interpolated"
        if clock.resample:
            seen = f"the clock is irregular ({clock.seen}), so that samples are interpolated"
        yield Assumption("recording", "resample", True, "certain", seen)


def control_rate_line(clock: LogClock, step: float) -> list[Assumption]:
    """The rate of a loop that MuJoCo closes in each of its time steps [s]."""
    multiple = int(np.ceil(PER_STEP / (step * clock.rate) - 1e-6))
    if not 1 < multiple <= MAX_MULTIPLE:
        return []
    rate = float(f"{multiple * float(f'{clock.rate:.8g}'):.10g}")
    seen = f"the actuators of the robot's file act in each of its time steps of {1e3 * step:g} ms, "
    seen += f"and not only at the samples of the log: {PER_STEP} periods of the law in each step"
    correct = "In Hz. Where the log is of a real drive, the rate of its position loop."
    return [Assumption("recording", "control_rate", rate, "likely", seen, correct)]


def as_the_joints_move(clock: LogClock, q: np.ndarray) -> LogClock:
    """The clock with its rate instead of new samples, where only its stamps are irregular.

    Where new samples are made, its rate is the one that it was set to, if the stamps show it.

    Args:
        clock: the clock as its stamps are.
        q: positions, shape (samples, joints) [rad or m].
    """
    if not clock.resample or clock.by_rate:
        return clock
    rows = np.isfinite(q).all(axis=1)
    steady = not unsteady_steps(q).size
    error = stamp_error(q[rows], clock.seconds[rows]) if steady else float("nan")
    if not error > EVEN:
        return replace(clock, rate=clock_rate(clock.seconds).nominal or clock.rate)
    seen = (
        f"the stamps are irregular ({clock.seen}), but the joints move as if the samples were "
        f"equally spaced: equal steps fit the motion {error:.3g} times better than the stamps"
    )
    found = clock_rate(clock.seconds, even=True)
    if found.nominal is not None:
        seen += f"; {found}"
    return replace(clock, rate=found.rate, sure="likely", seen=seen, resample=False, by_rate=True)


def clock_place(column: str, others: Mapping[str, OwnClock], channels: Iterable[str]) -> Any:
    """Where the stamps are: one column, whose name also finds those of other topics, or several."""
    kind = column.rpartition("/")[2]
    if kind != STAMP or all(own.column.endswith(f"/{STAMP}") for own in others.values()):
        return column
    return {name: others[name].column if name in others else column for name in channels}


def _common_rate(positions: ClockRate, torque: OwnClock | None) -> float:
    """The rate of the positions; smooth references can be resampled to it [Hz].

    To three digits where it is no usual one, or that of the torques where these are slower.
    """
    if torque is None or torque.rate > (1.0 - QUARTZ) * positions.mean:
        return positions.nominal or float(f"{positions.mean:.3g}")
    return float(f"{torque.rate:.3g}")


def _listed(others: Mapping[str, OwnClock]) -> str:
    return ", ".join(f"{name} comes at {own.rate:.5g} Hz" for name, own in others.items())
