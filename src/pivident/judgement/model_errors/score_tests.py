"""Score tests of causes: what the residual has of the torque that each would add.

With the residual e = τ - Φθ̂ of an estimate, its instruments Z and the columns D of a cause on the
motion that makes them,

    (θ, δ) = (Xᵀ X)⁻¹ Xᵀ (e + Zθ̂),    X = (Z, D)

δ is the size of the cause and θ the estimate with it corrected. Without instruments Z is Φ. The
covariance of both comes from a jackknife over windows of time, which allows for any correlation of
the residual; Hotelling's T² of δ has an F distribution with as many degrees of freedom as the
windows leave. Causes are many, so the significance is multiplied by their number (Bonferroni). Then
the cause with which blocks that were not fitted are predicted best is corrected and the others are
tested again, until none is left that is significant and helps to predict them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.covariance.windows import degrees_of_freedom
from pivident.foundation.distributions import fisher
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.cause_sums import CauseSums, InstrumentalSums, JointRows
from pivident.judgement.model_errors.column_tests import ColumnTests, Normal, Partition, inverse_of

#: Share of a cause's columns that Φ must leave for it to be told from the parameters.
DISTINCT = 1e-12

#: Largest significance, all causes together, at which a cause is named.
LEVEL = 1e-3

#: Columns that are tested together: more would only take more memory.
TOGETHER = 128

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


@dataclass(frozen=True, eq=False)
class Group:
    """Causes of as many columns each, and what they explain.

    Attributes:
        numbers: of the causes, shape (causes,).
        made: the solutions with each.
        explained: as of a `Score`, shape (causes,), and so ``unseen``.
    """

    numbers: np.ndarray
    made: ColumnTests
    explained: np.ndarray
    unseen: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> Group:
        """Some of the causes: a mask, or their places."""
        return Group(
            self.numbers[chosen], self.made[chosen], self.explained[chosen], self.unseen[chosen]
        )


@dataclass(frozen=True, eq=False)
class Beside:
    """What causes explain beside those that are corrected.

    Attributes:
        stay: which columns are those of the model and of the corrected causes, shape (columns,).
        base: the estimate with these.
        groups: the other causes.
        scores: their tests, as far as these were asked for.
    """

    stay: np.ndarray
    base: Fit
    groups: tuple[Group, ...]
    scores: dict[int, Score] = field(default_factory=dict)


class ScoreTests:
    """Score tests of many causes on one set of sums.

    ``first``: each cause's first column; ``tried``: causes among which one is to be significant;
    ``measured``: makes rows of some causes on the measured motion, None where that makes all.
    """

    def __init__(
        self,
        sums: CauseSums,
        causes: Sequence[Cause],
        first: np.ndarray,
        tried: int,
        measured: Callable[[Sequence[Cause]], list[list[JointRows]]] | None = None,
    ) -> None:
        self.sums, self.causes, self.first, self.tried = sums, causes, first, tried
        self.measured = measured
        self.xx = sums.blocks.total
        every = np.arange(first[-1])
        self.scale = np.sqrt(np.maximum(self.xx.of(every, every)[0], 1e-300))
        self.freedom = degrees_of_freedom(sums.lengths)
        self._known_columns: dict[tuple[int, ...], np.ndarray] = {}
        self._known_shares: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
        self._known_beside: dict[tuple[int, ...], Beside] = {}

    def columns(self, chosen: Sequence[int]) -> np.ndarray:
        """Indices of the model's columns and of those of some causes that others do not hide."""
        if not chosen:
            return np.arange(self.sums.parameters)
        key = tuple(chosen)
        if key not in self._known_columns:
            before = self.columns(chosen[:-1])
            self._stay(before)
            self._known_columns[key] = np.r_[before, self._distinct(before, self.of(chosen[-1]))]
        return self._known_columns[key]

    def _stay(self, columns: np.ndarray) -> None:
        """Columns that all others are to be tested beside."""
        if not self.sums.windows.stays(columns).all():
            self.sums.stay(columns)
            self.xx = self.sums.blocks.total

    def of(self, number: int) -> np.ndarray:
        """Indices of all columns of a cause."""
        return np.arange(self.first[number], self.first[number + 1])

    def fit(self, columns: np.ndarray) -> Fit:
        """θ and δ, and the residual on fitted and on unseen blocks."""
        theta, squares = self._estimate(columns), self.sums.squares
        xx, xt = self.xx.of(columns[:, None], columns)[0], self.xx.tau[0, columns]
        blocks = self.sums.blocks.of(columns[:, None], columns), self.sums.blocks.tau[:, columns]
        without = self._solve(xx - blocks[0], xt - blocks[1], columns)
        unseen = sum(map(_squares, without, *blocks, squares))
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
        """(Xᵀ X)⁻¹ Xᵀ τ."""
        gram, right = self.xx.of(columns[:, None], columns)[0], self.xx.tau[0, columns]
        return self._solve(gram, right, columns)

    def covariance(self, columns: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Of all of them, by the jackknife over windows, shape (columns, columns)."""
        windows = self.sums.windows.of(columns[:, None], columns)
        scores = self.sums.windows.tau[:, columns] - windows @ theta
        return jackknife_of(windows, scores, windows.sum(axis=0)).covariance

    def sizes(self, numbers: Sequence[int]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """δ of each of some causes and its covariance, beside those before it.

        By the instruments, where there are such: (Xᵀ X_m)⁻¹ Xᵀ τ with X_m on the measured motion.
        """
        estimate = self._estimates(numbers)
        for k, number in enumerate(numbers):
            columns = self.columns(numbers[: k + 1])
            own = np.flatnonzero(np.isin(columns, self.of(number)))
            theta, covariance = estimate(columns)
            found = theta[own], covariance[np.ix_(own, own)]
            yield self._on_all_columns(number, columns[own], *found)

    def _estimates(
        self, numbers: Sequence[int]
    ) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """What gives θ and δ of columns of the model and of some causes, and their covariance."""
        if self.measured is None or not numbers:
            return self._by_themselves
        every = np.r_[np.arange(self.sums.parameters), *map(self.of, numbers)]
        rows = self.measured([self.causes[k] for k in numbers])
        return InstrumentalSums(self.sums, rows, every).estimate

    def _by_themselves(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        theta = self.fit(columns).theta
        return theta, self.covariance(columns, theta)

    def estimate(self, numbers: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """θ and δ of all columns of some causes that are shown, and their covariance; likewise."""
        return self._estimates(numbers)(self.columns(numbers))

    def sensitivity(self, columns: np.ndarray) -> np.ndarray:
        """-∂θ/∂δ = (Zᵀ Z)⁻¹ Zᵀ D, shape (parameters, columns of the causes)."""
        n = self.sums.parameters
        own, others = columns[:n], columns[n:]
        scale = self.scale[own]
        gram = self.xx.of(own[:, None], own)[0] / np.outer(scale, scale)
        cross = self.xx.of(own[:, None], others)[0] / scale[:, None]
        return np.asarray(inverse_of(gram) @ cross / scale[:, None])

    def all_scores(
        self, corrected: Sequence[int], share: float | None = None
    ) -> tuple[Fit, dict[int, Score]]:
        """The estimate with some causes corrected, and the tests of others beside them.

        Causes of several columns are among them only where they explain what they at least have to.

        Args:
            corrected: numbers of the causes.
            share: only those that explain at least this share of what the best one explains of
                blocks that were not fitted; None: all.
        """
        beside = self._beside(corrected)
        most = max((float(group.unseen.max()) for group in beside.groups), default=0.0)
        least = -np.inf if share is None else share * most
        tested = np.array(list(beside.scores), int)
        asked = [
            group[(group.unseen >= least) & ~np.isin(group.numbers, tested)]
            for group in beside.groups
        ]
        columns = np.unique(
            np.concatenate([np.zeros(0, int), *(x.made.own.ravel() for x in asked)])
        )
        if columns.size:
            normal = Normal(self.xx, self.sums.windows)
            windows = Partition.of(normal, beside.stay, self.scale, columns)
            for group in asked:
                beside.scores.update(self._group_scores(group, beside.base, windows))
        kept = {k: score for k, score in sorted(beside.scores.items()) if score.unseen >= least}
        return beside.base, kept

    def _beside(self, corrected: Sequence[int]) -> Beside:
        """What others explain beside some causes; that of the last ones is kept."""
        key = tuple(corrected)
        if key not in self._known_beside:
            stay = np.zeros(self.scale.size, bool)
            stay[self.columns(corrected)] = True
            self._stay(np.flatnonzero(stay))
            own = np.flatnonzero(stay)
            base, blocks = self.fit(own), Normal(self.xx, self.sums.blocks)
            whole = Partition.of(Normal(self.xx), stay, self.scale)
            without = Partition.of(blocks, stay, self.scale)
            groups = (
                part
                for numbers, columns in self._groups(own, corrected)
                for part in self._explained(numbers, columns, base, whole, without, own)
            )
            made = Beside(stay, base, tuple(group for group in groups if group.numbers.size))
            self._known_beside = {key: made}
        return self._known_beside[key]

    def _explained(
        self,
        numbers: np.ndarray,
        columns: np.ndarray,
        base: Fit,
        whole: Partition,
        without: Partition,
        stay: np.ndarray,
    ) -> Iterator[Group]:
        """What causes by number explain, of several columns without those that explain too little.

        ``columns``: of each cause, shape (causes, n).
        """
        single = columns.shape[1] == 1
        least = np.array([-np.inf if single else self.causes[k].least for k in numbers])
        try:
            made = ColumnTests.of(self.sums, whole, stay, columns)
            explained = 1.0 - made.residual(self.xx) / max(base.residual, 1e-300)
            some = np.flatnonzero(explained >= least)
            unseen = 1.0 - made[some].unseen(without) / max(base.unseen, 1e-300)
            helps = unseen > least[some]
            some = some[helps]
            yield Group(numbers[some], made[some], explained[some], unseen[helps])
        except np.linalg.LinAlgError:  # all that is known of one lies within one block
            if len(columns) > 1:
                k = len(columns) // 2
                yield from self._explained(numbers[:k], columns[:k], base, whole, without, stay)
                yield from self._explained(numbers[k:], columns[k:], base, whole, without, stay)

    def _groups(
        self, stay: np.ndarray, corrected: Sequence[int]
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Causes with the columns that others do not hide, as many of each together.

        Numbers of the causes, shape (causes,), and indices of their columns, shape (causes, n).
        """
        kept = self._kept(stay, self._shown) if corrected else self._shown
        for size, numbers in _by_size(kept, corrected):
            most = max(1, TOGETHER // size)
            for some in np.split(numbers, range(most, numbers.size, most)):
                yield some, np.array([kept[k] for k in some])

    @cached_property
    def _shown(self) -> list[np.ndarray]:
        """Columns of each cause that the model does not hide; nor do others bring them back."""
        every = [self.of(k) for k in range(len(self.causes))]
        return self._kept(np.arange(self.sums.parameters), every)

    def _kept(self, stay: np.ndarray, columns: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Those of some columns of each cause that the columns that stay do not hide."""
        kept = list(columns)
        for size, numbers in _by_size(columns):
            own = np.array([columns[k] for k in numbers])
            hidden = self._smallest(stay, own) <= DISTINCT  # else that of each part is larger
            for k in numbers[hidden]:
                kept[k] = self._distinct(stay, kept[k]) if size > 1 else kept[k][:0]
        return kept

    def _group_scores(self, group: Group, base: Fit, windows: Partition) -> dict[int, Score]:
        """The tests of causes by number.

        ``windows``: normal equations without each window.
        """
        made = group.made
        try:
            covariance = made.covariance(windows)
            solved = np.linalg.solve(covariance, made.size[..., None])[..., 0]
        except np.linalg.LinAlgError:  # all that is known of one lies within one window
            k = group.numbers.size // 2
            if k == 0:
                return {}
            first, second = (
                self._group_scores(group[part], base, windows)
                for part in (np.arange(k), np.arange(k, group.numbers.size))
            )
            return first | second
        n, size = self.sums.parameters, made.own.shape[1]
        left = self.freedom - size + 1.0
        statistic = np.sum(made.size * solved, axis=1) / size
        significance = fisher.sf(statistic * left / self.freedom, size, left)
        return {
            number: Score(
                self.causes[number],
                *self._on_all_columns(number, made.own[k], made.size[k], covariance[k]),
                float(significance[k]),
                float(group.explained[k]),
                float(group.unseen[k]),
                made.theta[k, :n] - base.theta[:n],
            )
            for k, number in enumerate(group.numbers.tolist())
        }

    def _on_all_columns(
        self, number: int, own: np.ndarray, size: np.ndarray, covariance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """δ and its covariance on all columns of a cause, zero for those that others hide."""
        whole = self.of(number)
        every, square = np.zeros(whole.size), np.zeros((whole.size, whole.size))
        known = own - whole[0]
        every[known], square[np.ix_(known, known)] = size, covariance
        return every, square

    def _distinct(self, stay: np.ndarray, own: np.ndarray) -> np.ndarray:
        """The columns of a cause of which enough is left beside the others, one after the other."""
        kept: list[int] = []
        for k in range(own.size):
            if self._smallest(stay, own[[*kept, k]]) > DISTINCT:
                kept.append(k)
        return own[kept]

    def _smallest(self, stay: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Smallest eigenvalue of what others leave of the columns of each cause, of unit length.

        ``own``: indices, shape (…, n).
        """
        scale = self.scale[own]
        cross, share = (np.moveaxis(x[:, own], 0, -2) for x in self._shares(stay))
        rest = self.xx.of(own[..., :, None], own[..., None, :])[0] - cross.swapaxes(-1, -2) @ share
        unit = rest / (scale[..., :, None] * scale[..., None, :])
        return np.asarray(np.linalg.eigvalsh(unit)[..., 0])

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
            self._known_shares[key] = cross, share
        return self._known_shares[key]

    def _solve(self, gram: np.ndarray, right: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """θ of normal equations; leading axes are kept."""
        scale = self.scale[columns]
        inverse = inverse_of(gram / np.outer(scale, scale))
        return np.asarray(np.einsum("...ij,...j->...i", inverse, right / scale) / scale)


def _by_size(
    columns: Sequence[np.ndarray], without: Sequence[int] = ()
) -> Iterator[tuple[int, np.ndarray]]:
    """Numbers of the causes by that of their columns, as far as they have any."""
    sizes = np.array([own.size for own in columns])
    sizes[list(without)] = 0
    for size in np.unique(sizes[sizes > 0]).tolist():
        yield size, np.flatnonzero(sizes == size)


def _squares(theta: np.ndarray, xx: np.ndarray, xt: np.ndarray, tt: float) -> float:
    """‖τ - Xθ‖² from the sums."""
    return max(float(tt - 2.0 * theta @ xt + theta @ xx @ theta), 0.0)
