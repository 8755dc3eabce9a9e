"""Whether a log is predicted better or worse than motion that was held out of the fit.

With e the relative error in motion on the log and e₀ that on held-out motion, the ratio is

    r = e/e₀,      interval r exp(±t √(σ² + σ₀²))

with the standard deviations σ and σ₀ of their logarithms over blocks and t of Student's
distribution by Welch's degrees of freedom. Samples at which a joint stands are left out of both:
dry friction then holds it with any torque up to its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.foundation.distributions import student
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.foundation.text.sentences import listed
from pivident.judgement.validation.held_out.held_out_errors import (
    ALL_JOINTS,
    HeldOutErrors,
    LogError,
)
from pivident.judgement.validation.held_out.prediction import POOR

Answer = Literal["better", "as good", "worse", "unknown"]

#: Ratio from which on two errors differ, and up to which they are alike.
DIFFERENT, ALIKE = 1.05, 1.25


@dataclass(frozen=True)
class ErrorRatio:
    """Error on a log over that on held-out motion.

    Attributes:
        now: error in motion on the log [%].
        then: error in motion on what was held out [%].
        low: lower end of the 95 % interval of their ratio; NaN where nothing tells it.
        high: upper end.
    """

    now: float
    then: float
    low: float
    high: float

    @classmethod
    def of(cls, now: LogError, then: LogError) -> ErrorRatio:
        """The ratio of two errors with its interval."""
        ratio = now.value / max(then.value, 1e-300)
        parts = np.array([now.spread, then.spread]) ** 2
        counts = np.array([now.blocks, then.blocks])
        if not np.isfinite(parts).all() or counts.min() < 2:
            return cls(now.value, then.value, math.nan, math.nan)
        freedom = parts.sum() ** 2 / max(float((parts**2 / (counts - 1)).sum()), 1e-300)
        reach = float(student.ppf(0.975, max(freedom, 1.0))) * math.sqrt(float(parts.sum()))
        factor = math.exp(min(reach, 50.0))
        return cls(now.value, then.value, ratio / factor, ratio * factor)

    @property
    def answer(self) -> Answer:
        """Which of the two is smaller, as far as the interval tells."""
        if self.low > DIFFERENT:
            return "worse"
        if self.high < 1.0 / DIFFERENT:
            return "better"
        return "as good" if 1.0 / ALIKE <= self.low and self.high <= ALIKE else "unknown"

    def __str__(self) -> str:
        if math.isnan(self.low):
            return self.answer
        low, high = (format_significant(x, 2) for x in (self.low, self.high))
        return f"{self.answer} ({low} to {high} times)"


def error_ratios(
    now: Mapping[str, LogError], then: HeldOutErrors, joints: Sequence[str]
) -> dict[str, ErrorRatio]:
    """Ratios of each joint and of all together, by name.

    Args:
        now: errors in motion on the log, by joint and of all joints.
        then: those of held-out motion.
        joints: names, in the order of the robot.
    """
    return {
        name: ErrorRatio.of(now[name], then.moving[name])
        for name in (ALL_JOINTS, *joints)
        if name in then.moving
    }


def finding_of(ratios: Mapping[str, ErrorRatio], then: HeldOutErrors) -> Finding | None:
    """Better, as good, worse or unknown: all joints, and each that differs from them."""
    if ALL_JOINTS not in ratios:
        return None
    whole = ratios[ALL_JOINTS]
    text = (
        f"In motion the error is {percent(whole.now)}; it was {percent(whole.then)} on "
        f"{then.where} when the result was made (by {then.method}, below {then.band:g} Hz): "
        f"{whole}."
    )
    others = {name: ratio for name, ratio in ratios.items() if name != ALL_JOINTS}
    for answer in ("worse", "better", "unknown"):
        names = [name for name, ratio in others.items() if ratio.answer == answer]
        if names and len(others) > 1 and (len(names) < len(others) or answer != whole.answer):
            text += f" {answer.capitalize()}: {listed(names)}."
    evidence = {
        "error in motion": Quantity(whole.now, "%"),
        "held out": Quantity(whole.then, "%"),
        "ratio": Quantity(whole.now / max(whole.then, 1e-300), interval=(whole.low, whole.high)),
    }
    is_worse = [name for name, ratio in ratios.items() if ratio.answer == "worse"]
    if is_worse:
        step = (
            "Look for another payload, temperature, gain or calibration, or for motion outside the "
            "fit."
        )
        return Finding("warning", "prediction", "worse", text, "", step, evidence)
    if whole.answer == "unknown":
        text += " A longer log would tell."
        return Finding("note", "prediction", "unknown", text, evidence=evidence)
    if whole.then > POOR:
        text += " Neither is good."
        return Finding("note", "prediction", "as held out", text, evidence=evidence)
    return Finding("ok", "prediction", "as held out", text, evidence=evidence)
