"""Score tests of causes: what the residual has of the torque that each would add.

With the columns D of a cause beside Φ and the instruments (Z, D_z),

    (θ, δ) = (Yᵀ X)⁻¹ Yᵀ τ,    Y = (Z, D_z), X = (Φ, D)

δ is the size of the cause and θ the estimate with it corrected. The covariance of both comes from a
jackknife over windows of time, which allows for any correlation of the residual; Hotelling's T² of
δ has an F distribution with as many degrees of freedom as the windows leave. Causes are many, so
the significance is multiplied by their number (Bonferroni). Then the cause with which blocks that
were not fitted are predicted best is corrected and the others are tested again, until none is left
that is significant and helps to predict them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.covariance.windows import OVERLAP, degrees_of_freedom
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.cause_sums import CauseSums
from pivident.judgement.model_errors.column_tests import Normal, Partition, Parts, column_tests

#: Share of a cause's columns that Φ must leave for it to be told from the parameters.
DISTINCT = 1e-12

#: Largest significance, all causes together, at which a cause is named.
LEVEL = 1e-3

#: Causes that are named one after the other.
MOST_CAUSES = 12


@dataclass(frozen=True, eq=False)
class Score:
    """What a cause explains of the residual.

    Attributes:
        cause: the cause.
        size: δ in its unit, shape (columns,); zero for columns that others hide.
        covariance: of δ.
        significance: probability of as large a size by chance, for this cause alone.
        explained: share of the residual's sum of squares in the band that goes with it.
        unseen: the same on blocks that were not fitted, each by the others.
        shift: change of each parameter by correcting it, shape (parameters,).
    """

    cause: Cause
    size: np.ndarray
    covariance: np.ndarray
    significance: float
    explained: float
    unseen: float
    shift: np.ndarray

    @property
    def std(self) -> np.ndarray:
        """Standard errors of δ, shape (columns,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, eq=False)
class Fit:
    """The estimate with some columns."""

    theta: np.ndarray  # of these columns
    residual: float  # weighted sum of squares
    unseen: float  # the same on blocks that were not fitted


class ScoreTests:
    """Score tests of many causes on one set of sums.

    ``first``: each cause's first column; ``tried``: causes among which one is to be significant.
    """

    def __init__(
        self, sums: CauseSums, causes: Sequence[Cause], first: np.ndarray, tried: int
    ) -> None:
        self.sums, self.causes, self.first, self.tried = sums, causes, first, tried
        self.yx, self.xx = sums.windows.total, sums.blocks.total
        every = np.arange(first[-1])
        self.scale = np.sqrt(np.maximum(self.xx.of(every, every)[0], 1e-300))
        self.freedom = degrees_of_freedom(sums.lengths)
        self._known_shares: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def columns(self, chosen: Sequence[int]) -> np.ndarray:
        """Indices of the model's columns and of those of some causes that others do not hide."""
        kept = np.arange(self.sums.parameters)
        for number, k in enumerate(chosen):
            kept = np.r_[kept, self._distinct(kept, self.of(k))]
            if number < len(chosen) - 1:
                self._stay(kept)
        return kept

    def _stay(self, columns: np.ndarray) -> None:
        """Columns that all others are to be tested beside."""
        if not self.sums.windows.stays(columns).all():
            self.sums.stay(columns)
            self.yx, self.xx = self.sums.windows.total, self.sums.blocks.total

    def of(self, number: int) -> np.ndarray:
        """Indices of all columns of a cause."""
        return np.arange(self.first[number], self.first[number + 1])

    def fit(self, columns: np.ndarray) -> Fit:
        """θ and δ, and the residual on fitted and on unseen blocks."""
        theta, squares = self._estimate(columns), self.sums.squares
        xx, xt = self.xx.of(columns[:, None], columns)[0], self.xx.tau[0, columns]
        blocks = self.sums.blocks.of(columns[:, None], columns), self.sums.blocks.tau[:, columns]
        unseen = 0.0
        for x, tau, square in zip(*blocks, squares, strict=True):
            own = self._solve(xx - x, xt - tau, columns)
            unseen += _squares(own, x, tau, square)
        return Fit(theta, _squares(theta, xx, xt, float(squares.sum())), unseen)

    def torques(self, corrected: Sequence[int], number: int) -> np.ndarray:
        """Torque that goes with a cause beside those that are corrected, shape (joints,).

        The root of what it takes from the residual's sum of squares, over that of the torque's.
        """
        before, after = (
            self.sums.joint_squares(columns, self._estimate(columns))
            for columns in (self.columns(corrected), self.columns([*corrected, number]))
        )
        taken, torque = np.maximum(before - after, 0.0), self.sums.torque_squares
        return np.asarray(np.sqrt(taken / np.maximum(torque, 1e-300)))

    def _estimate(self, columns: np.ndarray) -> np.ndarray:
        """(Yᵀ X)⁻¹ Yᵀ τ."""
        gram, right = self.yx.of(columns[:, None], columns)[0], self.yx.tau[0, columns]
        return self._solve(gram, right, columns)

    def covariance(self, columns: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Of all of them, by the jackknife over windows, shape (columns, columns)."""
        windows = self.sums.windows.of(columns[:, None], columns)
        scores = self.sums.windows.tau[:, columns] - windows @ theta
        return jackknife_of(windows, scores, windows.sum(axis=0)).covariance

    def sensitivity(self, columns: np.ndarray) -> np.ndarray:
        """-∂θ/∂δ = (Zᵀ Φ)⁻¹ Zᵀ D, shape (parameters, columns of the causes)."""
        n = self.sums.parameters
        own, others = columns[:n], columns[n:]
        scale = self.scale[own]
        gram = self.yx.of(own[:, None], own)[0] / np.outer(scale, scale)
        cross = self.yx.of(own[:, None], others)[0] / scale[:, None]
        return np.asarray(np.linalg.lstsq(gram, cross, rcond=1e-14)[0] / scale[:, None])

    def all_scores(self, corrected: Sequence[int]) -> tuple[Fit, dict[int, Score]]:
        """The estimate with some causes corrected, and the tests of others beside them.

        Causes of several columns are among them only where they explain what they at least have to.
        """
        stay = np.zeros(self.scale.size, bool)
        stay[self.columns(corrected)] = True
        self._stay(np.flatnonzero(stay))
        own, others = np.flatnonzero(stay), np.flatnonzero(~stay)
        base = self.fit(own)
        windows, blocks = self.sums.windows, self.sums.blocks
        parts = Parts(
            Partition.of(Normal(self.yx), stay, self.scale),
            Partition.of(Normal(self.yx, windows), stay, self.scale),
            Partition.of(Normal(self.xx, blocks), stay, self.scale),
        )
        found = self._single_scores(base, parts, own, others, corrected)
        for number, cause in enumerate(self.causes):
            if number not in corrected and cause.count > 1:
                score = self._score(number, base, parts, own, others)
                if score is not None:
                    found[number] = score
        return base, found

    def _single_scores(
        self,
        base: Fit,
        parts: Parts,
        stay: np.ndarray,
        others: np.ndarray,
        corrected: Sequence[int],
    ) -> dict[int, Score]:
        """The tests of all causes of one column that the columns that stay do not hide."""
        from scipy.stats import t

        rest = self._projected(stay)
        numbers = [
            k
            for k, cause in enumerate(self.causes)
            if cause.count == 1
            and k not in corrected
            and rest[self.first[k]] > DISTINCT * self.scale[self.first[k]] ** 2
        ]
        if not numbers:
            return {}
        made = column_tests(self.sums, parts, stay, self.first[numbers], others)
        clear = np.abs(made.size) / np.sqrt(np.maximum(made.variance, 1e-300))
        significance = 2.0 * t.sf(clear, self.freedom)
        n = self.sums.parameters
        return {
            number: Score(
                self.causes[number],
                made.size[k : k + 1],
                made.variance[k].reshape(1, 1),
                float(significance[k]),
                1.0 - float(made.residual[k]) / max(base.residual, 1e-300),
                1.0 - float(made.unseen[k]) / max(base.unseen, 1e-300),
                made.theta[:n, k] - base.theta[:n],
            )
            for k, number in enumerate(numbers)
        }

    def _score(
        self, number: int, base: Fit, parts: Parts, stay: np.ndarray, others: np.ndarray
    ) -> Score | None:
        """The test of one cause; None: the columns that stay hide it, or it explains too little."""
        from scipy.stats import f

        whole, least = self.of(number), self.causes[number].least
        own = self._distinct(stay, whole)
        if not own.size:
            return None
        place, columns = np.searchsorted(others, own), np.r_[stay, own]
        try:
            theta, size = parts.all.joined(place)
            residual = _squares(
                np.r_[theta, size],
                self.xx.of(columns[:, None], columns)[0],
                self.xx.tau[0, columns],
                float(self.sums.squares.sum()),
            )
            explained = 1.0 - residual / max(base.residual, 1e-300)
            if explained < least:
                return None
            unseen = 1.0 - self._unseen(parts, stay, own, place) / max(base.unseen, 1e-300)
            if unseen <= least:
                return None
            covariance = self._covariance_of(parts, stay, own, place, np.r_[theta, size])
            statistic = float(size @ np.linalg.solve(covariance, size)) / own.size
        except np.linalg.LinAlgError:  # all that is known of it lies within one window
            return None
        left = self.freedom - own.size + 1.0
        significance = float(f.sf(statistic * left / self.freedom, own.size, left))
        n = self.sums.parameters
        every, square = np.zeros(whole.size), np.zeros((whole.size, whole.size))
        known = own - whole[0]
        every[known], square[np.ix_(known, known)] = size, covariance
        return Score(
            self.causes[number],
            every,
            square,
            significance,
            explained,
            unseen,
            theta[:n] - base.theta[:n],
        )

    def _covariance_of(
        self,
        parts: Parts,
        stay: np.ndarray,
        own: np.ndarray,
        place: np.ndarray,
        theta: np.ndarray,
    ) -> np.ndarray:
        """The part of :meth:`covariance` that belongs to a cause, shape (own, own)."""
        windows, columns = self.sums.windows, np.r_[stay, own]
        scores = windows.tau[:, columns] - windows.of(columns[:, None], columns) @ theta
        split = stay.size
        steps = parts.without_window.solved(scores[:, :split], scores[:, split:], place)
        return np.asarray(steps.T @ steps / OVERLAP)

    def _unseen(self, parts: Parts, stay: np.ndarray, own: np.ndarray, place: np.ndarray) -> float:
        """Sum of squares on the blocks, each predicted from the others."""
        blocks, columns = self.sums.blocks, np.r_[stay, own]
        theta = np.concatenate(parts.without_block.joined(place), axis=1)
        gram = blocks.of(columns[:, None], columns)
        fitted = np.einsum("bi,bij,bj->b", theta, gram, theta, optimize=True)
        crossed = np.einsum("bi,bi->b", theta, blocks.tau[:, columns])
        return float(np.sum(np.maximum(self.sums.squares - 2.0 * crossed + fitted, 0.0)))

    def _distinct(self, stay: np.ndarray, own: np.ndarray) -> np.ndarray:
        """The columns of a cause of which enough is left beside the others, one after the other."""
        scale = self.scale[own]
        rest = self._projected(stay, own) / np.outer(scale, scale)
        if np.linalg.eigvalsh(rest)[0] > DISTINCT:  # then that of each part is larger still
            return own
        kept: list[int] = []
        for k in range(own.size):
            lowest = np.linalg.eigvalsh(rest[np.ix_([*kept, k], [*kept, k])])[0]
            if lowest > DISTINCT:
                kept.append(k)
        return own[kept]

    def _projected(self, stay: np.ndarray, own: np.ndarray | None = None) -> np.ndarray:
        """Xᵀ X without what lies in the space of the columns that stay.

        Of some columns, or the diagonal of all.
        """
        cross, share = self._shares(stay)
        if own is None:
            return np.asarray(self.scale**2 - np.einsum("ij,ij->j", cross, share))
        return np.asarray(self.xx.of(own[:, None], own)[0] - cross[:, own].T @ share[:, own])

    def _shares(self, stay: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Products of the columns that stay, scaled, with all, and what they take of each."""
        key = stay.tobytes()
        if key not in self._known_shares:
            scale, every = self.scale[stay], np.arange(self.scale.size)
            gram = self.xx.of(stay[:, None], stay)[0] / np.outer(scale, scale)
            cross = self.xx.of(stay[:, None], every)[0] / scale[:, None]
            inverse = np.linalg.pinv(gram, rcond=1e-13)
            share = inverse @ cross
            for _ in range(2):  # refined: of a column that is there already rounding is left
                share += inverse @ (cross - gram @ share)
            self._known_shares = {key: (cross, share)}
        return self._known_shares[key]

    def _solve(self, gram: np.ndarray, right: np.ndarray, columns: np.ndarray) -> np.ndarray:
        scale = self.scale[columns]
        solved = np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=1e-14)[0]
        return np.asarray(solved / scale)


def _squares(theta: np.ndarray, xx: np.ndarray, xt: np.ndarray, tt: float) -> float:
    """‖τ - Xθ‖² from the sums."""
    return max(float(tt - 2.0 * theta @ xt + theta @ xx @ theta), 0.0)
