"""Distance to the reference, among parameters that explain the torque equally well.

Base parameters do not determine all standard ones. With P the pseudo-inertia of a link and P₀ that
of the reference,

    entropic:   tr(P₀⁻¹P) - log det(P₀⁻¹P) - 4   ≥ 0     (Lee, Wensing, Park 2020)
    euclidean:  ½ ‖P₀^-½ P P₀^-½ - 1‖²

summed over the links. Both are independent of units and frames; the first grows without bound as
a link degenerates, and is the Kullback-Leibler divergence of two densities. ``none`` selects the
point whose smallest eigenvalue of P₀^-½ P P₀^-½ is largest (at most one).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pivident.models.consistency.cone_program import Requirement
from pivident.models.consistency.pseudo_inertia import BASIS, triangle
from pivident.models.consistency.reference import Reference

Prior = Literal["entropic", "euclidean", "none"]
PRIORS: tuple[str, ...] = get_args(Prior)

#: Weight of the Euclidean prior beside the smallest eigenvalue, with the prior ``none``.
TIES = 1e-4


@dataclass(frozen=True, eq=False)
class PriorTerms:
    """Objective of a prior, in unknowns u = (standard parameters, further ones)."""

    quadratic: np.ndarray  # H, shape (n, n)
    linear: np.ndarray  # c, shape (n,)
    requirements: list[Requirement]  # conditions on the further unknowns


def prior_terms(
    prior: str,
    reference: Reference,
    links: np.ndarray,
    slope: np.ndarray,
    start: np.ndarray,
    others: np.ndarray,
) -> PriorTerms:
    """Objective of a prior for links that are φ = slope · v + start.

    ``others``, further standard parameters, contribute ½ ((φ - φ₀)/scale)².
    """
    rest = slope[others] / reference.scales[others, None]
    error = (start[others] - reference.values[others]) / reference.scales[others]
    quadratic, linear = rest.T @ rest, rest.T @ error
    if prior == "entropic":
        return _entropic(reference, links, slope, start, quadratic, linear)
    for i, place in enumerate(links):
        image = triangle(reference.scaled(i, BASIS)).T
        matrix = image @ slope[place]
        quadratic = quadratic + matrix.T @ matrix
        linear = linear + matrix.T @ (image @ start[place] - triangle(np.eye(4)))
    if prior == "euclidean":
        return PriorTerms(quadratic, linear, [])
    return _most_interior(reference, links, slope, start, quadratic, linear)


def _entropic(
    reference: Reference,
    links: np.ndarray,
    slope: np.ndarray,
    start: np.ndarray,
    quadratic: np.ndarray,
    linear: np.ndarray,
) -> PriorTerms:
    """Tr P̃ - Σ t with t ≤ log Z_ii, Z lower triangular and [[P̃, Z], [Zᵀ, diag Z]] ≥ 0.

    The largest such Π Z_ii is det P̃ (Ben-Tal, Nemirovski).
    """
    own = slope.shape[1]
    per_link = 14  # ten entries of Z, four logarithms
    size = own + per_link * len(links)
    wide_quadratic, wide_linear = np.zeros((size, size)), np.zeros(size)
    wide_quadratic[:own, :own], wide_linear[:own] = quadratic, linear
    rows, columns = np.tril_indices(4)
    diagonal = np.flatnonzero(rows == columns)
    requirements = []
    for i, place in enumerate(links):
        image = reference.scaled(i, BASIS)  # (10, 4, 4)
        entries = own + per_link * i + np.arange(10)
        logs = own + per_link * i + 10 + np.arange(4)
        wide_linear[:own] += np.trace(image, axis1=1, axis2=2) @ slope[place]
        wide_linear[logs] = -1.0
        block = np.zeros((own + 10, 8, 8))
        block[:own, :4, :4] = np.tensordot(slope[place], image, axes=(0, 0))
        block[own + np.arange(10), rows, 4 + columns] = 1.0
        block[own + np.arange(10), 4 + columns, rows] = 1.0
        block[own + diagonal, 4 + rows[diagonal], 4 + rows[diagonal]] = 1.0
        offset = np.zeros((8, 8))
        offset[:4, :4] = np.tensordot(start[place], image, axes=(0, 0))
        unknowns = np.r_[np.arange(own), entries]
        requirements.append(
            Requirement("semidefinite", 8, triangle(block).T, triangle(offset), unknowns)
        )
        for k, log in zip(diagonal, logs, strict=True):
            # (t, 1, Z_kk) in the exponential cone: exp(t) ≤ Z_kk
            matrix = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
            requirements.append(
                Requirement(
                    "exponential", 3, matrix, np.array([0.0, 1.0, 0.0]), np.array([log, entries[k]])
                )
            )
    return PriorTerms(wide_quadratic, wide_linear, requirements)


def _most_interior(
    reference: Reference,
    links: np.ndarray,
    slope: np.ndarray,
    start: np.ndarray,
    quadratic: np.ndarray,
    linear: np.ndarray,
) -> PriorTerms:
    """Largest s ≤ 1 with P̃ ≥ s 1 for all links; a weak Euclidean pull decides ties."""
    own = slope.shape[1]
    wide_quadratic, wide_linear = np.zeros((own + 1, own + 1)), np.zeros(own + 1)
    wide_quadratic[:own, :own] = TIES * quadratic
    wide_linear[:own] = TIES * linear
    wide_linear[own] = -1.0
    unknowns = np.arange(own + 1)
    requirements = [Requirement("nonnegative", 1, np.array([[-1.0]]), np.ones(1), np.array([own]))]
    for i, place in enumerate(links):
        image = triangle(reference.scaled(i, BASIS)).T
        matrix = np.c_[image @ slope[place], -triangle(np.eye(4))]
        requirements.append(Requirement("semidefinite", 4, matrix, image @ start[place], unknowns))
    return PriorTerms(wide_quadratic, wide_linear, requirements)
