"""What is held out while laws are compared, and the estimates from what is left.

The motion is cut into cells of equal length. With several recordings each of them is held out in
turn, because a law has to fit the next motion. With one recording, contiguous blocks are held out
in turn, and then the cells in which a joint is fastest, slowest, most and least loaded, and the
first and last ones, between which a machine warms up: a law that only interpolates fails there.
Beside a held-out cell a gap is left out over which noise and model error forget each other.

Least squares and instrumental variables on a training set, for many laws of one joint.

The parameters that stay have the same equations whatever the law. With K, r their normal equations
over the training set, and C, B, D, s the blocks that the law's terms add,

    (D - B K⁻¹ C) θ_law = s - B K⁻¹ r,    θ_rest = K⁻¹ (r - C θ_law)

so that K is inverted once and a law costs the size of its terms.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.sentences import listed
from pivident.judgement.validation.held_out.folds import moving_part
from pivident.judgement.validation.held_out.segment_sums import Segments, SegmentSums
from pivident.studies.friction_laws.filtered_rows import LastPass

#: Cells of all recordings together, if the motion is long enough.
CELLS = 40
#: Shortest cell, in gaps.
SHORTEST = 5.0
#: Share of the cells that is held out at either end of speed, load and time.
ENDS = 1.0 / 3.0
#: A joint moves in a recording if its mean speed there is above this share of the largest one.
MOVES = 0.1
#: Fewest contiguous blocks that are held out in turn.
MIN_FOLDS = 3
_RCOND = 1e-12


@dataclass(frozen=True, eq=False)
class Division:
    """Cells that are held out together."""

    name: str  # of the direction in which they differ from the fitted ones
    held_out: np.ndarray  # True for cells that are, shape (cells,)


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of all recordings, in order."""

    segments: Segments
    record: np.ndarray  # recording of each cell, shape (cells,)
    names: tuple[str, ...]  # of the recordings
    folds: int  # contiguous blocks of a single recording
    gap: float  # between held-out and fitted cells [s]

    @classmethod
    def of(cls, problem: Problem, last: LastPass, folds: int, gap: float) -> Cells:
        """Cut the moving part of all recordings.

        Raises:
            IdentificationError: too few blocks, or blocks without samples.
        """
        if folds < MIN_FOLDS:
            raise IdentificationError(
                f"folds is {folds}", advice=f"laws are compared on at least {MIN_FOLDS} blocks"
            )
        records = last.equations.records
        moving = [moving_part(problem, r.kinematics) for r in records]
        recordings = [r.kinematics.recording for r in records]
        counts = _counts(np.ptp(moving, axis=1) / [r.rate for r in recordings], folds, gap)
        labels, first = [], 0
        for record, (start, stop), count in zip(records, moving, counts, strict=True):
            half = 0.5 * gap * record.kinematics.recording.rate
            labels.append(_labels(record.sample_numbers, start, stop, count, half, first))
            first += count
        if not np.isin(2 * np.arange(first), np.concatenate(labels)).all():
            raise IdentificationError(
                f"{folds} blocks with gaps of {gap:.2g} s leave no samples in some blocks",
                advice="use fewer",
            )
        names = tuple(f"recording {k + 1}, {r.name}" for k, r in enumerate(recordings))
        owner = np.repeat(np.arange(len(records)), counts)
        return cls(Segments(tuple(labels), first), owner, names, folds, gap)

    def in_words(self, alone: Sequence[str]) -> str:
        """What is held out; ``alone``: joints that move in one recording only."""
        parts = (
            f"{self.folds} blocks of the motion in turn, then the thirds in which a joint is "
            "slowest, fastest, least and most loaded, the first and the last"
        )
        if len(self.names) == 1:
            return parts
        whole = f"each of {len(self.names)} recordings in turn"
        return f"{whole}; of {listed(alone)}, which move in one only, {parts}" if alone else whole

    def divisions(self, speed: np.ndarray, load: np.ndarray) -> list[Division]:
        """What is held out for one joint.

        Args:
            speed: mean size of the joint's speed in each cell, shape (cells,).
            load: likewise of the torque that it carries.
        """
        own = [self.record == number for number in range(len(self.names))]
        mean = np.array([speed[cells].mean() for cells in own])
        if np.sum(mean > MOVES * mean.max()) > 1:
            return [Division(name, cells) for name, cells in zip(self.names, own, strict=True)]
        order = np.arange(self.record.size)
        block = order * self.folds // order.size
        made = [Division("blocks in turn", block == k) for k in range(self.folds)]
        for values, low, high in (
            (speed, "slowest part", "fastest part"),
            (load, "least loaded part", "most loaded part"),
            (order, "first part", "last part"),
        ):
            rank = np.argsort(np.argsort(values, kind="stable"))
            count = round(ENDS * order.size)
            made += [Division(low, rank < count), Division(high, rank >= order.size - count)]
        return [d for d in made if d.held_out.any()]  # of few cells some blocks have none

    def thinned(self, steps: Sequence[int]) -> Segments:
        """Segments of every so many rows of each recording."""
        labels = [own[::step] for own, step in zip(self.segments.labels, steps, strict=True)]
        return Segments(tuple(labels), self.segments.cells)

    def by_cell(self, values: Sequence[np.ndarray], reduce) -> np.ndarray:
        """A number of each cell from the values on the rows of each recording, shape (cells,)."""
        found = np.zeros(self.segments.cells)
        for number, own in enumerate(values):
            for label, span in self.segments.parts(number):
                if label % 2 == 0:
                    found[label // 2] = reduce(own[span])
        return found


def _counts(seconds: np.ndarray, folds: int, gap: float) -> np.ndarray:
    """Cells of each recording; of a single one a multiple of the folds."""
    if seconds.size == 1:
        finer = min(seconds[0] / max(SHORTEST * gap, 1e-12), CELLS) // folds
        return np.array([folds * max(int(finer), 1)])
    shares = CELLS * seconds / seconds.sum()
    longest = np.maximum(seconds / max(SHORTEST * gap, 1e-12), 1.0)
    return np.maximum(np.minimum(shares, longest).round().astype(int), 1)


def _labels(
    sample: np.ndarray, start: int, stop: int, count: int, half: float, first: int
) -> np.ndarray:
    """Segment of each row of one recording, whose cells are numbered from ``first``."""
    borders = np.linspace(start, stop, count + 1)
    cell = np.clip(np.searchsorted(borders, sample, side="right") - 1, 0, count - 1)
    label = 2 * (first + cell)
    for number, border in enumerate(borders[1:-1]):
        label[np.abs(sample - border) < half] = 2 * (first + number) + 1
    return np.where((sample >= start) & (sample < stop), label, -1)


@dataclass(frozen=True, eq=False)
class _Rest:
    """Normal equations of the parameters that stay, solved."""

    inverse: np.ndarray  # K⁻¹
    solution: np.ndarray  # K⁻¹ r

    @classmethod
    def of(cls, gram: np.ndarray, right: np.ndarray) -> _Rest:
        scale = np.sqrt(np.abs(np.diag(gram)))
        scale = np.where(scale > 0.0, scale, 1.0)
        scaled = gram / np.outer(scale, scale)
        inverse = np.linalg.pinv(scaled, rcond=_RCOND) / np.outer(scale, scale)
        return cls(inverse, inverse @ right)


class TrainingSet:
    """Some segments of the motion, on which laws of one joint are fitted.

    ``others`` are the weighted sums of all other joints, ``fixed`` those of the joint's columns
    that stay, ``columns`` where these are among the parameters that stay, ``which`` the segments,
    ``lam`` the variance by which the joint is weighted.
    """

    def __init__(
        self,
        others: SegmentSums,
        fixed: SegmentSums,
        columns: np.ndarray,
        which: np.ndarray,
        lam: float,
        weight_power: float,
    ) -> None:
        self.columns, self.which, self.lam = columns, which, lam
        self.weight = lam**weight_power
        self.size, self.fixed = others.ft.shape[1], columns.size
        self._right = self._total(others.ft, fixed.ft, lam)
        self._ff = self._zf = _Rest.of(self._gram(others.ff, fixed.ff, lam), self._right)
        if fixed.zf is not fixed.ff:
            right = self._total(others.zt, fixed.zt, self.weight)
            self._zf = _Rest.of(self._gram(others.zf, fixed.zf, self.weight), right)
        self._tt = float(others.tt[which].sum() + fixed.tt[which].sum() / lam)

    def criterion(self, sums: SegmentSums) -> float:
        """Weighted squares of the least-squares fit with a law."""
        theta = self._solution(sums.ff, sums.ft, self._ff, self.lam)
        law = sums.ft[self.which, self.fixed :].sum(axis=0) / self.lam
        n = self.size
        return float(self._tt - theta[:n] @ self._right - theta[n:] @ law)

    def solve(self, sums: SegmentSums) -> np.ndarray:
        """Parameters that stay, then those of the law."""
        return self._solution(sums.zf, sums.zt, self._zf, self.weight)

    def estimate(self, sums: SegmentSums) -> tuple[np.ndarray, np.ndarray]:
        """The same, and the standard errors of the law's parameters for white residuals."""
        theta = self.solve(sums)
        _, _, schur = self._blocks(sums.ff, self._ff, self.lam)
        own = np.r_[theta[self.columns], theta[self.size :]]
        left = sums.squares(own)[self.which].sum() / max(sums.rows[self.which].sum(), 1.0)
        covariance = np.linalg.pinv(schur, hermitian=True) * left / self.lam
        return theta, np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def _solution(
        self, gram: np.ndarray, right: np.ndarray, rest: _Rest, weight: float
    ) -> np.ndarray:
        above, below, schur = self._blocks(gram, rest, weight)
        law = right[self.which, self.fixed :].sum(axis=0) / weight
        # a term without effect on the training set may have one on the rest of the motion
        scale = np.sqrt(np.abs(np.diagonal(gram.sum(axis=0))[self.fixed :]) / weight)
        scale = np.where(scale > 0.0, scale, 1.0)
        law = (law - below @ rest.solution[self.columns]) / scale
        law = np.linalg.lstsq(schur / np.outer(scale, scale), law, rcond=_RCOND)[0] / scale
        theta = rest.solution - rest.inverse[:, self.columns] @ (above @ law)
        return np.r_[theta, law]

    def _blocks(
        self, gram: np.ndarray, rest: _Rest, weight: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """C and B on the joint's own columns, and D - B K⁻¹ C."""
        total = gram[self.which].sum(axis=0) / weight
        k = self.fixed
        above, below = total[:k, k:], total[k:, :k]
        inverse = rest.inverse[np.ix_(self.columns, self.columns)]
        return above, below, total[k:, k:] - below @ inverse @ above

    def _gram(self, others: np.ndarray, own: np.ndarray, weight: float) -> np.ndarray:
        gram = others[self.which].sum(axis=0)
        gram[np.ix_(self.columns, self.columns)] += own[self.which].sum(axis=0) / weight
        return gram

    def _total(self, others: np.ndarray, own: np.ndarray, weight: float) -> np.ndarray:
        right = others[self.which].sum(axis=0)
        right[self.columns] += own[self.which].sum(axis=0) / weight
        return right


def weighted_sums(
    last: LastPass,
    without: Collection[int],
    count: int,
    rest: np.ndarray,
    by_joint: Sequence[SegmentSums],
) -> SegmentSums:
    """Weighted sums of all joints but some on the parameters ``rest``, in ``count`` segments."""
    eq, n, size = last.equations, count, rest.size
    place = np.full(eq.size, -1)
    place[rest] = np.arange(size)
    total = SegmentSums(
        np.zeros((n, size, size)), np.zeros((n, size, size)), np.zeros((n, size)),
        np.zeros((n, size)), np.zeros(n), np.zeros(n),
    )  # fmt: skip
    for i, sums in enumerate(by_joint):
        if i in without:
            continue
        own, lam = place[eq.regressor.columns_of(i)], float(eq.variance[i])
        total.zf[:, own[:, None], own] += sums.zf / lam**eq.weight_power
        total.zt[:, own] += sums.zt / lam**eq.weight_power
        total.ff[:, own[:, None], own] += sums.ff / lam
        total.ft[:, own] += sums.ft / lam
        total.tt += sums.tt / lam
    return total
