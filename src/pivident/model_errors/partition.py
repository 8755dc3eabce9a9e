"""Normal equations in two parts: columns that stay, and others that join them in turn.

With G and r split into the columns B that stay and the others C,

    G_BB θ = r_B,    P = G_BB⁻¹ G_BC,    S = G_CC - G_CB P,    e = r_C - G_CB θ

columns K of C that join get δ = S_KK⁻¹ e_K and change the others to θ - P_K δ, so that one inverse
serves all of them. G is what is left of all rows without those of one part, G = G_all - G_part. Of
S, which has all columns against all, only the columns of one cause are ever asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Singular values below this share of the largest count as zero.
RCOND = 1e-14


@dataclass(frozen=True, eq=False)
class Normal:
    """G and r, for one part or several: leading axes are kept."""

    gram: np.ndarray  # of all rows, shape (columns, columns)
    right: np.ndarray  # likewise, shape (columns,)
    gram_part: np.ndarray | None = None  # of those left out, shape (…, columns, columns)
    right_part: np.ndarray | None = None  # likewise, shape (…, columns)

    def of(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Some entries of G, by indices that are broadcast."""
        whole = self.gram[rows, columns]
        return whole if self.gram_part is None else whole - self.gram_part[..., rows, columns]

    def right_of(self, columns: np.ndarray) -> np.ndarray:
        """Some entries of r."""
        whole = self.right[columns]
        return whole if self.right_part is None else whole - self.right_part[..., columns]


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
        """S_KK of some of the other columns, by their places among them, shape (…, K, K)."""
        own = self.others[columns]
        known = self.cross[..., columns, :] @ self.projection[..., columns]
        return np.asarray(self.normal.of(own[:, None], own) - known)

    def schur_diagonal(self, columns: np.ndarray) -> np.ndarray:
        """S_kk of each of them, shape (…, K)."""
        own = self.others[columns]
        rows, projected = self.cross[..., columns, :], self.projection[..., columns]
        return np.asarray(
            self.normal.of(own, own) - np.einsum("...ki,...ik->...k", rows, projected)
        )

    def joined(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ and δ with some of the other columns, by their places among them."""
        delta = np.linalg.solve(self.schur(columns), self.rest[..., columns, None])[..., 0]
        change = np.einsum("...ij,...j->...i", self.projection[..., columns], delta)
        return self.theta - change, delta

    def solved(self, own: np.ndarray, right: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """δ for another right side, of the columns that stay and of some others."""
        left = np.einsum("...ij,...j->...i", self.inverse, own)
        rest = right - np.einsum("...ij,...j->...i", self.cross[..., columns, :], left)
        return np.asarray(np.linalg.solve(self.schur(columns), rest[..., None])[..., 0])
