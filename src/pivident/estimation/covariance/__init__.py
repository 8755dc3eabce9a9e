"""Covariances of an estimate, and what rounding may not make of them.

The inverse of a Gram matrix of condition number κ² is symmetric to about κ²ε of its standard errors
only, and products with it have negative eigenvalues of that size. Neither is a property of the
estimate: an `Identification` takes its covariances through :func:`rounded_away`.
"""

from __future__ import annotations

import numpy as np

#: Most negative eigenvalue of correlations that stays: the rounding of eigenvalues themselves.
ROUNDING = 1e-10


def inverse_gram(gram: np.ndarray) -> np.ndarray:
    """G⁻¹ = L⁻ᵀ L⁻¹ with G = L Lᵀ, positive definite however large its condition number is.

    Args:
        gram: G, with columns of about unit length, shape (parameters, parameters).

    Returns:
        The inverse, likewise; by elimination where rounding left G indefinite.
    """
    try:
        half = np.linalg.inv(np.linalg.cholesky(gram))
    except np.linalg.LinAlgError:
        return np.linalg.inv(gram)
    return half.T @ half


def rounded_away(matrix: np.ndarray) -> np.ndarray:
    """The covariance that a matrix stands for: (P + Pᵀ)/2 without negative eigenvalues.

    Eigenvalues of the correlations D⁻¹ P D⁻¹, D² = diag |P|, that are negative become zero, and
    standard errors stay. A variance that rounding made negative takes its size, which is that of
    the rounding and hence of what is not known. What is a covariance stays as it is to the last
    bit, and a matrix that is not finite too.

    Args:
        matrix: P, shape (parameters, parameters).

    Returns:
        A symmetric, positive semidefinite matrix, likewise.
    """
    matrix = np.asarray(matrix, dtype=float)
    if not matrix.size or not np.isfinite(matrix).all():
        return matrix
    symmetric = 0.5 * matrix + 0.5 * matrix.T
    std = np.sqrt(np.abs(np.diag(matrix)))
    scale = np.where(std > 0.0, std, 1.0)
    correlations = symmetric / scale / scale[:, None]
    values, vectors = np.linalg.eigh(correlations)
    sound = (np.diag(matrix) > 0.0) | ~symmetric.any(axis=0)
    if values[0] >= -ROUNDING and sound.all():
        return matrix if (matrix == matrix.T).all() else symmetric
    correlations[:, std == 0.0] = correlations[std == 0.0] = 0.0
    np.fill_diagonal(correlations, std > 0.0)
    values, vectors = np.linalg.eigh(correlations)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    root /= np.maximum(np.linalg.norm(root, axis=1), 1e-300)[:, None]
    made = (root @ root.T) * np.outer(std, std)
    np.fill_diagonal(made, np.abs(np.diag(matrix)))
    return 0.5 * made + 0.5 * made.T
