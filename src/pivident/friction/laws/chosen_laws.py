"""Friction laws that were tried on the joints, with the rule by which one is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.problem import Problem
from pivident.friction.laws.law_scores import LawScore
from pivident.robot.friction_toml import law_toml
from pivident.robot.naming import find_joint
from pivident.text.numbers import format_significant
from pivident.text.plain_table import plain_table


@dataclass(frozen=True)
class Gain:
    """Gain of a law over the joint's original law, on held-out blocks."""

    percent: float  # reduction of the mean square error, in percent of the original law's [%]
    std: float  # its standard error over the blocks [%]

    def __str__(self) -> str:
        return f"{self.percent:+.1f} ± {2.0 * self.std:.1f}"


@dataclass(frozen=True, eq=False)
class JointLawChoice:
    """Laws that were tried on one joint."""

    joint: str  # name of the joint
    unit: str  # of the error
    scores: tuple[LawScore, ...]  # the joint's original law first, then in the order tried
    chosen: LawScore
    rows: float  # number of rows
    effective_rows: float  # effective number of independent rows

    @property
    def base(self) -> LawScore:
        """The joint's original law."""
        return self.scores[0]

    def gain(self, score: LawScore) -> Gain:
        """Gain of a law over the joint's original one."""
        return _gain(self.base, score)

    def rejected(self, score: LawScore) -> bool:
        """Whether a law's held-out error exceeds the chosen one's by more than a standard error."""
        worse, std = difference(score, self.chosen)
        return worse > std

    def table(self) -> str:
        """All laws, best held-out error first; the chosen one is marked."""
        rows = sorted(self.scores, key=lambda s: s.rms)
        return plain_table(
            [
                ("", "<", ["→" if s is self.chosen else "" for s in rows]),
                (f"law of {self.joint}", "<", [s.name for s in rows]),
                ("unknowns", ">", [str(s.unknowns) for s in rows]),
                (f"held-out rms [{self.unit}]", ".", [format_significant(s.rms) for s in rows]),
                ("gain % ± 2σ", ">", [str(self.gain(s)) for s in rows]),
                ("ΔAIC", ".", [f"{s.aic - self.base.aic:.1f}" for s in rows]),
                ("ΔBIC", ".", [f"{s.bic - self.base.bic:.1f}" for s in rows]),
                ("constants", "<", [_remarks(s, self.unit) for s in rows]),
            ]
        )


@dataclass(frozen=True, eq=False)
class LawChoice:
    """Friction laws chosen for the joints of a robot.

    Attributes:
        problem: the problem with the chosen laws.
        joints: the laws tried on each joint.
        method: name of the estimator.
        folds: number of blocks.
        gap: gap between a held-out block and the fitted data [s].
    """

    problem: Problem
    joints: tuple[JointLawChoice, ...]
    method: str
    folds: int
    gap: float

    def joint(self, name: str) -> JointLawChoice:
        """What was tried on the joint ``name``."""
        return self.joints[find_joint([j.joint for j in self.joints], name)]

    def toml(self) -> str:
        """Lines for an experiment file with the laws that changed; empty where none did."""
        changed = [j for j in self.joints if j.chosen is not j.base]
        lines = [f'"{j.joint}" = {law_toml(j.chosen.law)}' for j in changed]
        return "\n".join(["[robot.joint_friction]", *lines]) if lines else ""

    def headline(self) -> str:
        """The method, and one sentence about each joint."""
        parts = [
            f"{self.method}, {self.folds} held-out blocks, gaps of {self.gap:.2g} s. Gain: "
            "reduction of the mean square error on held-out blocks. The rms covers all "
            "frequencies, including noise."
        ]
        for j in self.joints:
            if j.chosen is j.base:
                parts.append(f"{j.joint}: keeps its law; no other law predicts better.")
            else:
                parts.append(f"{j.joint}: {j.chosen.name}, gain {j.gain(j.chosen)} %.")
        return "\n".join(parts)

    def __str__(self) -> str:
        parts = [self.headline(), *(j.table() for j in self.joints), self.toml()]
        return "\n\n".join(part for part in parts if part)


def chosen_law(scores: Sequence[LawScore]) -> LawScore:
    """The simplest law within a standard error of the best, by the rules of `law_choice`."""
    physical = [s for s in scores if s.physical] or [scores[0]]
    candidates = [
        s
        for s in physical
        if not any(other.unknowns <= s.unknowns and other.bic < s.bic for other in physical)
    ]
    best = min(candidates, key=lambda s: s.rms)
    near = []
    for s in candidates:
        worse, std = difference(s, best)
        if worse <= std:
            near.append(s)
    return min(near, key=lambda s: (s.unknowns, s.rms))


def with_criteria(scores: Sequence[LawScore], rows: float, effective: float) -> list[LawScore]:
    """Scores with their information criteria, the deviance scaled to the effective rows."""
    made = []
    for s in scores:
        deviance = effective * np.log(max(s.squares, 1e-300) / rows)
        made.append(
            replace(
                s,
                aic=float(deviance + 2.0 * s.unknowns),
                bic=float(deviance + s.unknowns * np.log(effective)),
            )
        )
    return made


def difference(a: LawScore, b: LawScore) -> tuple[float, float]:
    """Mean over the blocks of mean square error a minus b, and its standard error."""
    d = a.errors - b.errors
    return float(d.mean()), float(d.std(ddof=1) / np.sqrt(d.size))


def _gain(base: LawScore, score: LawScore) -> Gain:
    mean, std = difference(base, score)
    size = max(float(base.errors.mean()), 1e-300)
    return Gain(100.0 * mean / size, 100.0 * std / size)


def _remarks(score: LawScore, torque_unit: str) -> str:
    """The chosen shape constants, and whether a friction level is negative."""
    length = "rad" if torque_unit == "N m" else "m"
    units = {"speed": f" {length}/s", "position": f" {length}", "angle": " rad"}
    parts = [
        f"{s.name.replace('_', ' ')} {format_significant(s.value)}{units.get(s.unit, '')}"
        + (" (at its bound)" if s.value in (s.low, s.high) else "")
        for s in score.law.shapes
        if s.free
    ]
    return ", ".join(parts if score.physical else [*parts, "(a negative level)"])
