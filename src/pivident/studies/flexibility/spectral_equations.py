"""Linear equations of a record as equations of its spectrum, solved with instruments.

Every signal of y = Φθ + e is multiplied by the same taper and transformed; the equations then hold
at each frequency by itself, where e is nearly independent of its neighbours with the spectral
matrix S(f) of the equations' residuals. With instruments Z that have no noise,

    θ = Re(Σ Zᴴ S⁻¹ Φ)⁻¹ Re(Σ Zᴴ S⁻¹ y),     P = ½ A⁻¹ Re(Σ Zᴴ S⁻¹ Z) A⁻ᵀ,   A = Re(Σ Zᴴ S⁻¹ Φ)

In time the estimate is θ = (ZᵀΦ)⁻¹Zᵀy; without block b of n consecutive ones it is θ_b. The
standard error √((n-1)/n Σ (θ_b - mean θ_b)²) includes model error and needs no model of e.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

#: Bins on each side over which a residual's spectrum is averaged.
HALF_WIDTH = 20

#: Share of the record over which the taper rises and falls, together.
TAPER = 0.1


@dataclass(frozen=True, eq=False)
class Spectra:
    """Tapered spectra of one record."""

    frequency: np.ndarray  # shape (bins,) [Hz]
    phi: np.ndarray  # regressors, shape (bins, equations, parameters)
    y: np.ndarray  # left-hand sides, shape (bins, equations)


def taper(samples: int) -> np.ndarray:
    """Tukey's window with unit mean square, shape (samples,)."""
    from scipy.signal.windows import tukey

    window = tukey(samples, TAPER)
    return window / np.sqrt(np.mean(window**2))


def tapered_spectra(columns: np.ndarray, rate: float, low: float, high: float) -> np.ndarray:
    """Spectra of columns between two frequencies, shape (bins, columns)."""
    frequency = np.fft.rfftfreq(len(columns), 1 / rate)
    kept = (frequency >= low) & (frequency <= high)
    window = taper(len(columns))[:, None]
    return np.fft.rfft(window * columns, axis=0)[kept] / np.sqrt(len(columns))


def residual_spectrum(e: np.ndarray) -> np.ndarray:
    """Spectral matrices (bins, equations, equations) of residuals, averaged over neighbours."""
    from scipy.ndimage import uniform_filter1d

    raw = e[:, :, None] * e[:, None, :].conj()
    size = 2 * HALF_WIDTH + 1
    smooth = uniform_filter1d(raw.real, size, axis=0) + 1j * uniform_filter1d(
        raw.imag, size, axis=0
    )
    trace = np.einsum("fii->f", smooth).real[:, None, None]
    return smooth + 1e-12 * trace * np.eye(e.shape[1])


def solve(spectra: Spectra, z: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ and its covariance from instruments Z and weights S⁻¹ (bins, equations, equations)."""
    # The mean has one degree of freedom, a complex number two.
    weights = weights * np.where(spectra.frequency == 0.0, 0.5, 1.0)[:, None, None]
    weighted = np.einsum("fep,feg->fgp", z.conj(), weights)
    a = np.einsum("fgp,fgq->pq", weighted, spectra.phi).real
    b = np.einsum("fgp,fg->p", weighted, spectra.y).real
    meat = np.einsum("fgp,fgq->pq", weighted, z).real
    scale = 1 / np.sqrt(np.maximum(np.diag(meat), 1e-300))
    inverse = np.linalg.inv(a * np.outer(scale, scale))
    theta = scale * (inverse @ (scale * b))
    covariance = 0.5 * inverse @ (meat * np.outer(scale, scale)) @ inverse.T
    # Tapering correlates neighbouring bins, so the effective number of bins is smaller.
    fewer = np.mean(taper(4096) ** 4)
    return theta, fewer * covariance * np.outer(scale, scale)


#: Blocks of the jackknife, and the 97.5 % point of Student's t with one degree fewer.
BLOCKS, STUDENT = 10, 2.262


def solve_with_jackknife(
    phi: np.ndarray, z: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(ZᵀΦ)⁻¹Zᵀy of all samples, (parameters,), and without each block, (blocks, parameters)."""
    bounds = np.linspace(0, len(y), BLOCKS + 1).astype(int)
    parts = [slice(a, b) for a, b in pairwise(bounds)]
    scale = np.maximum(np.linalg.norm(phi, axis=0), 1e-300)
    phi, z = phi / scale, z / np.maximum(np.linalg.norm(z, axis=0), 1e-300)
    moments = np.array([z[p].T @ phi[p] for p in parts])
    right = np.array([z[p].T @ y[p] for p in parts])
    whole, all_right = moments.sum(axis=0), right.sum(axis=0)
    theta = np.linalg.lstsq(whole, all_right, rcond=1e-10)[0] / scale
    without = [
        np.linalg.lstsq(whole - m, all_right - r, rcond=1e-10)[0] / scale
        for m, r in zip(moments, right, strict=True)
    ]
    return theta, np.array(without)


def jackknife_standard_error(replicates: np.ndarray) -> float:
    """Standard error from the estimates without each block."""
    n = len(replicates)
    return float(np.sqrt((n - 1) / n * np.sum((replicates - replicates.mean()) ** 2)))
