"""Curves over time, as they are drawn on pages and in figures for papers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.foundation.text.numbers import format_significant


@dataclass(frozen=True, eq=False)
class Curve:
    """One line.

    Attributes:
        name: in the legend.
        values: one for each instant, NaN where there is none.
        role: ``measured``, ``error``, or the number of a model, which is its colour.
        width: of the line [px].
    """

    name: str
    values: np.ndarray
    role: str | int
    width: float = 1.2


@dataclass(frozen=True, eq=False)
class Curves:
    """Lines over one axis of time.

    Attributes:
        title: whose they are, such as the joint.
        axis: quantity and unit of the ordinate.
        t: instants [s].
        curves: the lines, the last on top.
        subject: what is drawn, in words.
        note: numbers that belong to it.
    """

    title: str
    axis: str
    t: np.ndarray
    curves: Sequence[Curve]
    subject: str
    note: str = ""

    @property
    def label(self) -> str:
        """The drawing in words, for those who do not see it."""
        label = f"{self.subject} over {format_significant(self.t[-1] - self.t[0])} s"
        return f"{label}: {self.note}" if self.note else label


def compared(
    measured: np.ndarray, model: np.ndarray, name: str, role: int = 0, label: str = "measured"
) -> Sequence[Curve]:
    """What was measured, what a model makes of it, and the difference.

    Args:
        measured: shape (samples,).
        model: likewise, same unit.
        name: what the model's curve is called.
        role: number of the model.
        label: what the measured one is called.
    """
    return (
        Curve(label, measured, "measured", 2.4),
        Curve(name, model, role),
        Curve("error", measured - model, "error", 1.0),
    )


def torque_axis(unit: str) -> str:
    """Quantity and unit of a joint's torque [N m] or force [N]."""
    return f"torque [{unit}]" if unit != "N" else "force [N]"
