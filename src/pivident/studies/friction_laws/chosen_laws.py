"""Friction laws that were tried on the joints, the rules of the choice, and which were chosen.

Rules by which one friction law is preferred to another.

Errors of two laws are compared cell by cell of the motion, and neighbouring cells count as far as
they are independent. There are two measures: the mean square error, and the mean of (a - b)/(a + b)
of the cells' errors, in which no cell outweighs the others. A change has to gain more than a
standard error in both: gained in a few cells alone, or on average but not in sum, it does not show
on the next motion. One that adds an unknown has to be significant as well, unless the
present law has an impossible sign that it repairs. Many laws are tried on many joints, and the best
of many useless ones looks useful, so the level is divided by the number of tests (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.problem import Problem
from pivident.foundation.distributions import student
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import format_significant, plain_table
from pivident.judgement.validation.held_out.segment_sums import effective_rows
from pivident.robot.friction import law_toml
from pivident.robot.naming import find_joint
from pivident.studies.friction_laws.filtered_rows import row_samples
from pivident.studies.friction_laws.held_out_cells import Division
from pivident.studies.friction_laws.law_scores import JointJudge, LawScore
from pivident.studies.friction_laws.shape_constants import GAMMA

#: Chance that any joint's law is changed where no law differs from the present one.
LEVEL = 0.05
#: Chance that a normal variable is more than one standard deviation above its mean.
ONE_SIGMA = 0.159


@dataclass(frozen=True)
class TriedRange:
    """The farthest that held-out motion went beyond the motion fitted at the same time."""

    unit: str  # of the joint's position, rad or m
    torque_unit: str  # N m or N
    speed: float  # largest held-out speed over the largest fitted one
    fastest: float  # largest held-out speed there [unit/s]
    load: float  # largest held-out load over the largest fitted one
    heaviest: float  # largest held-out load there [N m or N]
    position: float  # largest distance beyond the fitted positions, zero within [unit]
    travel: tuple[float, float]  # all positions that were judged [unit]

    @classmethod
    def of(cls, judge: JointJudge, kind: str) -> TriedRange:
        """Over all divisions of a joint; ``kind``: revolute or prismatic."""
        j, cells = judge.joint, judge.cells
        rows = [row_samples(r) for r in judge.last.equations.records]
        pairs = list(zip(judge.motions, rows, strict=True))
        speed = cells.by_cell([np.abs(k.dq[j, own]) for k, own in pairs], np.max)
        load = cells.by_cell([np.abs(x) for x in judge.load], np.max)
        low = cells.by_cell([k.q[j, own] for k, own in pairs], np.min)
        high = cells.by_cell([k.q[j, own] for k, own in pairs], np.max)
        held = [d.held_out for d in judge.divisions]
        faster = max((_beyond(speed, h) for h in held), key=lambda x: x[0])
        heavier = max((_beyond(load, h) for h in held), key=lambda x: x[0])
        farther = max(
            max(low[~h].min() - low[h].min(), high[h].max() - high[~h].max(), 0.0) for h in held
        )
        units = ("rad", "N m") if kind == "revolute" else ("m", "N")
        return cls(*units, *faster, *heavier, float(farther), (float(low.min()), float(high.max())))

    def __str__(self) -> str:
        number = format_significant
        low, high = (number(x) for x in self.travel)
        where = (
            f"{number(self.position, 2)} {self.unit} beyond the fitted ones"
            if self.position > 0.0
            else "all within the fitted ones"
        )
        return (
            f"tried up to {self.speed:.2f} times the fitted speed ({number(self.fastest)} "
            f"{self.unit}/s) and {self.load:.2f} times the fitted load ({number(self.heaviest)} "
            f"{self.torque_unit}), at positions from {low} to {high} {self.unit}, {where}"
        )


def _beyond(values: np.ndarray, held_out: np.ndarray) -> tuple[float, float]:
    """Largest held-out value over the largest fitted one, and itself."""
    largest = float(values[held_out].max())
    return largest / max(float(values[~held_out].max()), 1e-300), largest


@dataclass(frozen=True)
class Gain:
    """Gain of a law over the joint's original law, on held-out motion."""

    percent: float  # reduction of the mean square error, in percent of the original law's [%]
    std: float  # its standard error over the cells of the motion [%]

    def __str__(self) -> str:
        return f"{self.percent:+z.1f} ± {2.0 * self.std:.1f}"


@dataclass(frozen=True)
class Difference:
    """Mean square error of one law minus that of another [unit²]."""

    mean: float
    std: float  # its standard error
    cells: float  # number of independent cells

    @classmethod
    def of(cls, cells: np.ndarray) -> Difference:
        """From the differences in each cell, shape (cells,)."""
        if cells.size < 2:
            return cls(float(cells.mean()), float("inf"), float(cells.size))
        number = min(effective_rows([cells]), float(cells.size))
        return cls(float(cells.mean()), float(cells.std(ddof=1) / np.sqrt(number)), number)

    def chance(self) -> float:
        """Probability of a mean so far below zero where the laws do not differ."""
        if self.std == 0.0:
            return 0.0 if self.mean < 0.0 else 1.0
        return float(student.cdf(self.mean / self.std, self.cells - 1.0))


def difference(a: LawScore, b: LawScore) -> Difference:
    """Error of law a minus that of b."""
    return Difference.of(a.errors - b.errors)


def balanced_difference(a: LawScore, b: LawScore) -> Difference:
    """(a - b)/(a + b) of the errors of laws a and b, each cell with the same weight."""
    size = a.errors + b.errors
    return Difference.of((a.errors - b.errors) / np.where(size > 0.0, size, 1.0))


def worse_directions(a: LawScore, b: LawScore, divisions: Sequence[Division]) -> Iterator[str]:
    """Directions in which law a is worse than b.

    By more than a standard error, if there is one direction; the chance that a law as good as b is
    called worse stays the same if there are several.
    """
    names = list(dict.fromkeys(d.name for d in divisions))
    for name in names:
        own = [k for k, d in enumerate(divisions) if d.name == name]
        held_out = np.any([divisions[k].held_out for k in own], axis=0)
        d = Difference.of((b.held_out[own] - a.held_out[own]).sum(axis=0)[held_out])
        if d.chance() < ONE_SIGMA / len(names):
            yield name


def judged(
    new: Sequence[LawScore], current: LawScore, divisions: Sequence[Division], tests: int
) -> Iterator[LawScore]:
    """Laws with the reason why they may not replace the current one; without one, they may.

    An impossible sign that the current law has, too, is no reason yet: it shows that a term is
    missing, and the term that repairs it need not be significant.

    ``tests``: number of changes tried on all joints.
    """
    for s in new:
        measures = difference(s, current), balanced_difference(s, current)
        chance = len(measures) * min(d.chance() for d in measures)
        worse = tuple(worse_directions(s, current, divisions))
        repairs = bool(current.impossible_terms) and not s.impossible_terms
        if s.impossible_terms - current.impossible_terms:
            verdict = f"impossible sign: {', '.join(s.impossible)}"
        elif s.at_bound:
            verdict = f"not determined: {', '.join(s.at_bound).replace('_', ' ')} at its bound"
        elif s.rms >= current.rms or any(d.mean >= -d.std for d in measures):
            verdict = "no gain beyond a standard error"
        elif s.unknowns > current.unknowns and not repairs and chance > LEVEL / tests:
            verdict = "no significant gain"
        elif s.bic >= current.bic:
            verdict = "gain too small for its unknowns"
        elif worse:
            verdict = f"worse on {', '.join(worse)}"
        else:
            verdict = ""
        yield replace(s, verdict=verdict)


def simplest(scores: Sequence[LawScore]) -> LawScore:
    """The simplest law within a standard error of the best one.

    A law is left out where another with no more unknowns has a lower Schwarz criterion, because
    among many held-out errors one is low by chance.
    """
    candidates = [
        s
        for s in scores
        if not any(other.unknowns <= s.unknowns and other.bic < s.bic for other in scores)
    ]
    best = min(candidates, key=lambda s: s.rms)
    near = [s for s in candidates if (d := difference(s, best)).mean <= d.std]
    return min(near, key=lambda s: (s.unknowns, s.rms))


def with_criterion(scores: Sequence[LawScore], rows: float, effective: float) -> list[LawScore]:
    """Scores with their Schwarz criterion, the deviance scaled to the effective rows."""
    deviance = [effective * np.log(max(s.squares, 1e-300) / rows) for s in scores]
    return [
        replace(s, bic=float(x + s.unknowns * np.log(effective)))
        for s, x in zip(scores, deviance, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class JointLawChoice:
    """Laws that were tried on one joint."""

    joint: str  # name of the joint
    unit: str  # of the error
    scores: tuple[LawScore, ...]  # the joint's original law first, then in the order tried
    chosen: LawScore
    tried: TriedRange  # how far beyond the fitted motion

    @property
    def base(self) -> LawScore:
        """The joint's original law."""
        return self.scores[0]

    @property
    def is_changed(self) -> bool:
        """Whether another law than the original one was chosen."""
        return self.chosen is not self.base

    def gain(self, score: LawScore) -> Gain:
        """Gain of a law over the joint's original one."""
        size, d = max(float(self.base.errors.mean()), 1e-300), difference(score, self.base)
        return Gain(-100.0 * d.mean / size, 100.0 * d.std / size)

    def rejected(self, score: LawScore) -> bool:
        """Whether a law's held-out error exceeds the chosen one's by more than a standard error."""
        d = difference(score, self.chosen)
        return d.mean > d.std

    def table(self) -> str:
        """All laws, smallest held-out error first; the chosen one is marked."""
        rows = sorted(self.scores, key=lambda s: s.rms)
        return plain_table(
            [
                ("", "<", ["→" if s is self.chosen else "" for s in rows]),
                (f"law of {self.joint}", "<", [s.name for s in rows]),
                ("unknowns", ">", [str(s.unknowns) for s in rows]),
                (f"held-out rms [{self.unit}]", ".", [format_significant(s.rms) for s in rows]),
                ("gain % ± 2σ", ">", [str(self.gain(s)) for s in rows]),
                ("ΔBIC", ".", [f"{s.bic - self.base.bic:.1f}" for s in rows]),
                ("constants", "<", [_constants(s, self.unit) for s in rows]),
                ("not chosen because", "<", [s.verdict for s in rows]),
            ]
        )

    def sentence(self) -> str:
        """What was chosen, and how far the motion reaches."""
        text = f"{self.joint}: {self.tried}. "
        if self.is_changed:
            return text + f"{self.chosen.name}, gain {self.gain(self.chosen)} %."
        kept = "It keeps its law; no other one predicts held-out motion significantly better."
        if self.base.impossible:
            kept += f" Its own law has an impossible sign, {', '.join(self.base.impossible)}."
        return text + kept


@dataclass(frozen=True, eq=False)
class LawChoice(Displayed):
    """Friction laws chosen for the joints of a robot.

    Attributes:
        problem: the problem with the chosen laws.
        joints: the laws tried on each joint.
        method: name of the estimator.
        held_out: what was held out, in words.
        gap: gap between held-out cells and the fitted data [s].
        band: laws are judged on torques below this frequency [Hz].
    """

    problem: Problem
    joints: tuple[JointLawChoice, ...]
    method: str
    held_out: str
    gap: float
    band: float

    def joint(self, name: str) -> JointLawChoice:
        """What was tried on the joint ``name``."""
        return self.joints[find_joint([j.joint for j in self.joints], name)]

    def toml(self) -> str:
        """Lines for an experiment file with the laws that changed; empty where none did."""
        changed = [j for j in self.joints if j.is_changed]
        lines = [f'"{j.joint}" = {law_toml(j.chosen.law)}' for j in changed]
        return "\n".join(["[robot.joint_friction]", *lines]) if lines else ""

    def headline(self) -> str:
        """The method, and what came out for each joint."""
        parts = [
            f"{self.method}. Held out: {self.held_out}, with gaps of {self.gap:.2g} s. Errors are "
            f"those of the torque below {self.band:g} Hz, gain is the reduction of the mean "
            "square error on held-out motion. Beyond the ranges below a law is extrapolated."
        ]
        return "\n".join([*parts, *(j.sentence() for j in self.joints)])

    def __str__(self) -> str:
        parts = [self.headline(), *(j.table() for j in self.joints), self.toml()]
        return "\n\n".join(part for part in parts if part)


def _constants(score: LawScore, torque_unit: str) -> str:
    """The free constants with their units."""
    length = "m" if torque_unit == "N" else "rad"
    units = {"speed": f" {length}/s", "position": f" {length}", "angle": " rad"}
    parts = [
        f"{s.name.replace('_', ' ')} {format_significant(s.value)}{units.get(s.unit, '')}"
        for s in score.law.shapes
        if s.free
    ]
    if GAMMA in score.free:
        parts.append(f"γ {format_significant(score.law.slopes[0])} s/{length}")
    return ", ".join(parts)
