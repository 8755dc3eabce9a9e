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
    def of(cls, normal: Normal, stay: np.ndarray, scale: np.ndarray) -> Partition:
        """Of G and r.

        ``stay``: which columns are B, shape (columns,); ``scale``: size of each column, likewise.
        """
        own, others = np.flatnonzero(stay), np.flatnonzero(~stay)
        outer = np.outer(scale[own], scale[own])
        inverse = np.linalg.pinv(normal.of(own[:, None], own) / outer, rcond=RCOND) / outer
        cross = normal.of(others[:, None], own)
        theta = np.einsum("...ij,...j->...i", inverse, normal.right_of(own))
        return cls(
            normal,
            others,
            inverse,
            cross,
            inverse @ normal.of(own[:, None], others),
            theta,
            normal.right_of(others) - np.einsum("...ij,...j->...i", cross, theta),
        )

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
class Parts:
    """Normal equations of all rows, and those that leave out one window or one block."""

    all: Partition
    without_window: Partition
    without_block: Partition


@dataclass(frozen=True, eq=False)
class ColumnTests:
    """Tests of causes of n columns each; results have the causes as their first axis.

    Attributes:
        sums: of the rows.
        parts: normal equations of the columns that stay and of all others.
        stay: indices of the columns that stay, shape (stay,).
        own: indices of each cause's columns, shape (causes, n).
        place: places of these among the others, likewise.
        theta: estimates of the columns that stay beside each cause, shape (causes, stay).
        size: δ, shape (causes, n).
    """

    sums: CauseSums
    parts: Parts
    stay: np.ndarray
    own: np.ndarray
    place: np.ndarray
    theta: np.ndarray
    size: np.ndarray

    @classmethod
    def of(
        cls, sums: CauseSums, parts: Parts, stay: np.ndarray, own: np.ndarray, others: np.ndarray
    ) -> ColumnTests:
        """Solve for each cause.

        ``others``: all columns that do not stay, ascending.

        Raises:
            LinAlgError: one of the causes is not shown.
        """
        place = np.searchsorted(others, own)
        return cls(sums, parts, stay, own, place, *parts.all.joined(place))

    def __getitem__(self, chosen: np.ndarray) -> ColumnTests:
        """Some of the causes: a mask, or their places."""
        names = "own", "place", "theta", "size"
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    @property
    def residual(self) -> np.ndarray:
        """Weighted sum of squares with each cause, shape (causes,)."""
        return _squares(
            self.parts.without_block.normal.whole, self.sums.squares.sum(keepdims=True), self.stay,
            self.own, self.theta[None], self.size[None],
        )[0]  # fmt: skip

    @property
    def unseen(self) -> np.ndarray:
        """The same on blocks that were not fitted, each predicted from the others.

        Raises:
            LinAlgError: one of the causes is shown in one block alone.
        """
        made = self.parts.without_block.joined(self.place)
        each = _squares(self.sums.blocks, self.sums.squares, self.stay, self.own, *made)
        return np.asarray(each.sum(axis=0))

    @property
    def covariance(self) -> np.ndarray:
        """Of δ, by the jackknife over windows, shape (causes, n, n).

        Raises:
            LinAlgError: all that is known of a cause lies within one window.
        """
        windows, without, stay, own = (
            self.sums.windows, self.parts.without_window, self.stay, self.own,
        )  # fmt: skip
        inside, alone = windows.of(stay[:, None], stay), windows.of(own[:, :, None], own[:, None])
        across = windows.of(own[:, :, None], stay)
        beside = np.moveaxis(windows.of(stay[:, None, None], own), 1, 2)
        theta, size = self.theta[:, :, None], self.size[:, :, None]
        scores = windows.tau[:, None, stay, None] - inside[:, None] @ theta - beside @ size
        rest = windows.tau[:, own, None] - across @ theta - alone @ size
        rest = rest - without.cross[:, self.place] @ (without.inverse[:, None] @ scores)
        steps = np.linalg.solve(without.schur(self.place), rest)[..., 0]
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
