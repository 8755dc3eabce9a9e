"""Tests of causes of as many columns each, many at once, each beside the same columns that stay.

Every array has the causes as an axis of its own, before that of their columns, so that a score test
takes a few products for all of them together.

The normal equations are in two parts, columns that stay, and others that join them in turn. With G
and r split into the columns B that stay and the others C,

    G_BB θ = r_B,    P = G_BB⁻¹ G_BC,    S = G_CC - G_CB P,    e = r_C - G_CB θ

columns K of C that join get δ = S_KK⁻¹ e_K and change the others to θ - P_K δ, so that one inverse
serves all causes. G is what is left of all rows without those of one part, G = G_all - G_part. Of
S, which has all columns against all, only the columns of one cause are ever asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.judgement.model_errors.cause_sums import CauseSums, Products

#: Singular values below this share of the largest count as zero.
RCOND = 1e-14

#: Condition numbers below which the inverse is taken, a tenth of the work of singular values.
WELL_CONDITIONED = 1e8


def inverse_of(grams: np.ndarray) -> np.ndarray:
    """Inverse of each matrix, or the pseudo-inverse where one is badly conditioned."""
    try:
        inverse = np.linalg.inv(grams)
        condition = np.linalg.norm(grams, 1, (-2, -1)) * np.linalg.norm(inverse, 1, (-2, -1))
        if np.all(condition < WELL_CONDITIONED):
            return np.asarray(inverse)
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.pinv(grams, rcond=RCOND))


@dataclass(frozen=True, eq=False)
class Normal:
    """G and r, for one part or several: leading axes are kept."""

    whole: Products  # of all rows, one part
    parts: Products | None = None  # of those left out in turn

    def of(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Some entries of G, by indices that are broadcast."""
        whole = self.whole.of(rows, columns)[0]
        return whole if self.parts is None else whole - self.parts.of(rows, columns)

    def right_of(self, columns: np.ndarray) -> np.ndarray:
        """Some entries of r."""
        whole = self.whole.tau[0, columns]
        return np.asarray(whole if self.parts is None else whole - self.parts.tau[:, columns])


@dataclass(frozen=True, eq=False)
class Partition:
    """The parts, for one or several G and r: leading axes are kept."""

    normal: Normal
    others: np.ndarray  # indices of C, shape (C,)
    inverse: np.ndarray  # G_BB⁻¹, shape (…, B, B)
    cross: np.ndarray  # G_CB, shape (…, C, B)
    projection: np.ndarray  # P, shape (…, B, C)
    theta: np.ndarray  # θ, shape (…, B)
    rest: np.ndarray  # e, shape (…, C)

    @classmethod
    def of(
        cls,
        normal: Normal,
        stay: np.ndarray,
        scale: np.ndarray,
        others: np.ndarray | None = None,
    ) -> Partition:
        """Of G and r.

        ``stay``: which columns are B, shape (columns,); ``scale``: size of each column, likewise;
        ``others``: indices of C, ascending; None: all that do not stay.
        """
        own = np.flatnonzero(stay)
        others = np.flatnonzero(~stay) if others is None else others
        outer = np.outer(scale[own], scale[own])
        inverse = inverse_of(normal.of(own[:, None], own) / outer) / outer
        beside = normal.of(own[:, None], others)
        cross = beside.swapaxes(-1, -2)
        theta = np.einsum("...ij,...j->...i", inverse, normal.right_of(own))
        return cls(
            normal,
            others,
            inverse,
            cross,
            inverse @ beside,
            theta,
            normal.right_of(others) - np.einsum("...ij,...j->...i", cross, theta),
        )

    def place_of(self, columns: np.ndarray) -> np.ndarray:
        """Places of some columns among the others."""
        return np.searchsorted(self.others, columns)

    def schur(self, columns: np.ndarray) -> np.ndarray:
        """S_KK of some of the other columns, by their places among them, shape (…, K, K).

        ``columns``: of one cause, shape (K,), or of several, shape (causes, K), and so the result.
        """
        own = self.others[columns]
        known = self.cross[..., columns, :] @ self._projection(columns)
        return np.asarray(self.normal.of(own[..., :, None], own[..., None, :]) - known)

    def joined(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ and δ with some of the other columns, by their places among them, likewise."""
        delta = np.linalg.solve(self.schur(columns), self.rest[..., columns, None])
        theta = np.expand_dims(self.theta, tuple(range(-columns.ndim, -1)))
        return theta - (self._projection(columns) @ delta)[..., 0], delta[..., 0]

    def _projection(self, columns: np.ndarray) -> np.ndarray:
        """P_K, shape (…, B, K)."""
        return np.moveaxis(self.projection[..., columns], -1 - columns.ndim, -2)


@dataclass(frozen=True, eq=False)
class ColumnTests:
    """Tests of causes of n columns each; results have the causes as their first axis.

    Attributes:
        sums: of the rows.
        stay: indices of the columns that stay, shape (stay,).
        own: indices of each cause's columns, shape (causes, n).
        theta: estimates of the columns that stay beside each cause, shape (causes, stay).
        size: δ, shape (causes, n).
    """

    sums: CauseSums
    stay: np.ndarray
    own: np.ndarray
    theta: np.ndarray
    size: np.ndarray

    @classmethod
    def of(
        cls, sums: CauseSums, whole: Partition, stay: np.ndarray, own: np.ndarray
    ) -> ColumnTests:
        """Solve for each cause.

        ``whole``: normal equations of all rows.

        Raises:
            LinAlgError: one of the causes is not shown.
        """
        return cls(sums, stay, own, *whole.joined(whole.place_of(own)))

    def __getitem__(self, chosen: np.ndarray) -> ColumnTests:
        """Some of the causes: a mask, or their places."""
        return replace(self, own=self.own[chosen], theta=self.theta[chosen], size=self.size[chosen])

    def residual(self, whole: Products) -> np.ndarray:
        """Weighted sum of squares with each cause, shape (causes,); ``whole``: of all blocks."""
        total = self.sums.squares.sum(keepdims=True)
        return _squares(whole, total, self.stay, self.own, self.theta[None], self.size[None])[0]

    def unseen(self, without: Partition) -> np.ndarray:
        """The same on blocks that were not fitted, each predicted from the others.

        ``without``: normal equations without each block.

        Raises:
            LinAlgError: one of the causes is shown in one block alone.
        """
        made = without.joined(without.place_of(self.own))
        each = _squares(self.sums.blocks, self.sums.squares, self.stay, self.own, *made)
        return np.asarray(each.sum(axis=0))

    def covariance(self, without: Partition) -> np.ndarray:
        """Of δ, by the jackknife over windows, shape (causes, n, n).

        ``without``: normal equations without each window.

        Raises:
            LinAlgError: all that is known of a cause lies within one window.
        """
        windows, stay, own, place = (
            self.sums.windows, self.stay, self.own, without.place_of(self.own),
        )  # fmt: skip
        inside, alone = windows.of(stay[:, None], stay), windows.of(own[:, :, None], own[:, None])
        across = windows.of(own[:, :, None], stay)
        beside = np.moveaxis(windows.of(stay[:, None, None], own), 1, 2)
        theta, size = self.theta[:, :, None], self.size[:, :, None]
        scores = windows.tau[:, None, stay] - self.theta @ inside.swapaxes(1, 2)
        scores = (scores - (beside @ size)[..., 0]) @ without.inverse.swapaxes(1, 2)
        rest = windows.tau[:, own, None] - across @ theta - alone @ size
        rest = rest - without.cross[:, place] @ scores[..., None]
        steps = np.linalg.solve(without.schur(place), rest)[..., 0]
        return np.einsum("wki,wkj->kij", steps, steps) / OVERLAP


def _squares(
    products: Products,
    squares: np.ndarray,
    stay: np.ndarray,
    own: np.ndarray,
    theta: np.ndarray,
    size: np.ndarray,
) -> np.ndarray:
    """‖τ - Xθ - D δ‖² of each part of the rows, shape (parts, causes).

    ``theta`` and ``size``: of each part, or one for all parts, whose number is the first axis.
    """
    inside = products.of(stay[:, None], stay)
    beside = np.moveaxis(products.of(stay[:, None, None], own), 1, 2)
    alone = products.of(own[:, :, None], own[:, None])
    with_cause, of_cause = ((x @ size[..., None])[..., 0] for x in (beside, alone))
    of_stay = theta * (theta @ inside + 2.0 * (with_cause - products.tau[:, None, stay]))
    of_cause = size * (of_cause - 2.0 * products.tau[:, own])
    return np.maximum(squares[:, None] + of_stay.sum(axis=-1) + of_cause.sum(axis=-1), 0.0)
