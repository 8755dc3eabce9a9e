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

    ``gram``: with columns of about unit length; by elimination where rounding left it indefinite.
    """
    try:
        half = np.linalg.inv(np.linalg.cholesky(gram))
    except np.linalg.LinAlgError:
        return np.linalg.inv(gram)
    return half.T @ half


def white_noise_covariance(gram: np.ndarray, scale: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """N (Nᵀ (Σ_j Z_jᵀ Z_j/λ_j + Λ) N)⁻¹ Nᵀ, (P-31), solved with columns of equal size.

    ``gram``: Nᵀ (Σ_j Z_jᵀ Z_j/λ_j + Λ) N; ``scale``: product of the sizes of its columns,
    likewise (free, free); ``basis``: N, the identity where nothing is known beforehand.
    """
    return basis @ (inverse_gram(gram / scale) / scale) @ basis.T


def rounded_away(matrix: np.ndarray) -> np.ndarray:
    """The covariance that a matrix P stands for: (P + Pᵀ)/2 without negative eigenvalues.

    Those of the correlations D⁻¹ P D⁻¹, D² = diag |P|, become zero, and standard errors stay. A
    variance that rounding made negative takes its size, which is that of what is not known. What is
    a covariance stays as it is to the last bit, and a matrix that is not finite too.
    """
    matrix = np.asarray(matrix, dtype=float)
    if not matrix.size or not np.isfinite(matrix).all():
        return matrix
    symmetric, variance = 0.5 * matrix + 0.5 * matrix.T, np.abs(np.diag(matrix))
    std = np.sqrt(variance)
    scale = np.where(std > 0.0, std, 1.0)
    correlations = symmetric / scale / scale[:, None]
    sound = (np.diag(matrix) > 0.0) | ~symmetric.any(axis=0)
    if sound.all() and np.linalg.eigvalsh(correlations)[0] >= -ROUNDING:
        return matrix if (matrix == matrix.T).all() else symmetric
    correlations[:, std == 0.0] = correlations[std == 0.0] = 0.0
    np.fill_diagonal(correlations, std > 0.0)
    values, vectors = np.linalg.eigh(correlations)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    root /= np.maximum(np.linalg.norm(root, axis=1), 1e-300)[:, None]
    made = (root @ root.T) * np.outer(std, std)
    np.fill_diagonal(made, variance)
    return 0.5 * made + 0.5 * made.T
