"""Normal equations in two parts: columns that stay, and others that join them in turn.

With G and r split into the columns B that stay and the others C,

    G_BB θ = r_B,    P = G_BB⁻¹ G_BC,    S = G_CC - G_CB P,    e = r_C - G_CB θ

columns K of C that join get δ = S_KK⁻¹ e_K and change the others to θ - P_K δ, so that one inverse
serves all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Singular values below this share of the largest count as zero.
RCOND = 1e-14


@dataclass(frozen=True, eq=False)
class Partition:
    """The parts, for one or several G and r: leading axes are kept."""

    inverse: np.ndarray  # G_BB⁻¹, shape (…, B, B)
    cross: np.ndarray  # G_CB, shape (…, C, B)
    projection: np.ndarray  # P, shape (…, B, C)
    schur: np.ndarray  # S, shape (…, C, C)
    theta: np.ndarray  # θ, shape (…, B)
    rest: np.ndarray  # e, shape (…, C)

    @classmethod
    def of(
        cls, gram: np.ndarray, right: np.ndarray, stay: np.ndarray, scale: np.ndarray
    ) -> Partition:
        """Of G, shape (…, columns, columns), and r, shape (…, columns).

        ``stay``: which columns are B, shape (columns,); ``scale``: size of each column, likewise.
        """
        own, others = np.flatnonzero(stay), np.flatnonzero(~stay)
        outer = np.outer(scale[own], scale[own])
        block = gram[..., own[:, None], own]
        inverse = np.linalg.pinv(block / outer, rcond=RCOND) / outer
        cross = gram[..., others[:, None], own]
        projection = inverse @ gram[..., own[:, None], others]
        theta = np.einsum("...ij,...j->...i", inverse, right[..., own])
        return cls(
            inverse,
            cross,
            projection,
            gram[..., others[:, None], others] - cross @ projection,
            theta,
            right[..., others] - np.einsum("...ij,...j->...i", cross, theta),
        )

    def joined(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ and δ with some of the other columns, by their places among them."""
        grid = self.schur[..., columns[:, None], columns]
        delta = np.linalg.solve(grid, self.rest[..., columns, None])[..., 0]
        change = np.einsum("...ij,...j->...i", self.projection[..., columns], delta)
        return self.theta - change, delta

    def solved(self, own: np.ndarray, right: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """δ for another right side, of the columns that stay and of some others."""
        left = np.einsum("...ij,...j->...i", self.inverse, own)
        rest = right - np.einsum("...ij,...j->...i", self.cross[..., columns, :], left)
        grid = self.schur[..., columns[:, None], columns]
        return np.asarray(np.linalg.solve(grid, rest[..., None])[..., 0])
