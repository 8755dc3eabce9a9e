"""Rules by which one friction law is preferred to another.

Errors of two laws are compared cell by cell of the motion, and neighbouring cells count as far as
they are independent. There are two measures: the mean square error, and the mean of (a - b)/(a + b)
of the cells' errors, in which no cell outweighs the others. A change has to gain more than a
standard error in one of them. One that adds an unknown has to be significant as well, unless the
present law has an impossible sign that it repairs. Many laws are tried on many joints, and the best
of many useless ones looks useful, so the level is divided by the number of tests (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.friction_laws.held_out_cells import Division
from pivident.friction_laws.law_scores import LawScore
from pivident.validation.held_out.segment_sums import effective_rows

#: Chance that any joint's law is changed where no law differs from the present one.
LEVEL = 0.05

#: Chance that a normal variable is more than one standard deviation above its mean.
ONE_SIGMA = 0.159


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
        from scipy.stats import t

        if self.std == 0.0:
            return 0.0 if self.mean < 0.0 else 1.0
        return float(t.cdf(self.mean / self.std, self.cells - 1.0))


def difference(a: LawScore, b: LawScore) -> Difference:
    """Error of law a minus that of b."""
    return Difference.of(a.errors - b.errors)


def balanced_difference(a: LawScore, b: LawScore) -> Difference:
    """(a - b)/(a + b) of the errors of laws a and b, each cell with the same weight."""
    size = a.errors + b.errors
    return Difference.of((a.errors - b.errors) / np.where(size > 0.0, size, 1.0))


def worse_directions(a: LawScore, b: LawScore, divisions: Sequence[Division]) -> tuple[str, ...]:
    """Directions in which law a is worse than b.

    By more than a standard error, if there is one direction; the chance that a law as good as b is
    called worse stays the same if there are several.
    """
    names = list(dict.fromkeys(d.name for d in divisions))
    found = []
    for name in names:
        own = [k for k, d in enumerate(divisions) if d.name == name]
        held_out = np.any([divisions[k].held_out for k in own], axis=0)
        d = Difference.of((b.held_out[own] - a.held_out[own]).sum(axis=0)[held_out])
        if d.chance() < ONE_SIGMA / len(names):
            found.append(name)
    return tuple(found)


def judged(
    new: Sequence[LawScore], current: LawScore, divisions: Sequence[Division], tests: int
) -> list[LawScore]:
    """Laws with the reason why they may not replace the current one; without one, they may.

    An impossible sign that the current law has, too, is no reason yet: it shows that a term is
    missing, and the term that repairs it need not be significant.

    ``tests``: number of changes tried on all joints.
    """
    made = []
    for s in new:
        measures = difference(s, current), balanced_difference(s, current)
        chance = len(measures) * min(d.chance() for d in measures)
        worse = worse_directions(s, current, divisions)
        repairs = bool(current.impossible_terms) and not s.impossible_terms
        if s.impossible_terms - current.impossible_terms:
            verdict = f"impossible sign: {', '.join(s.impossible)}"
        elif s.at_bound:
            verdict = f"not determined: {', '.join(s.at_bound).replace('_', ' ')} at its bound"
        elif s.rms >= current.rms or all(d.mean >= -d.std for d in measures):
            verdict = "no gain beyond a standard error"
        elif s.unknowns > current.unknowns and not repairs and chance > LEVEL / tests:
            verdict = "no significant gain"
        elif s.bic >= current.bic:
            verdict = "gain too small for its unknowns"
        elif worse:
            verdict = f"worse on {', '.join(worse)}"
        else:
            verdict = ""
        made.append(replace(s, verdict=verdict))
    return made


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
