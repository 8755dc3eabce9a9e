"""Short records of one joint whose regressors, instruments and residual are known."""

import numpy as np
from scipy.signal import lfilter

from pivident.estimation.covariance.windows import windows_of
from pivident.judgement.validation.moment_sums import MomentSums

NAMES = ("ia1", "fv1", "off1")
THETA = np.array([1.2, 5.0, 0.5])


def motion(rng, samples):
    """Acceleration, speed and one, of a random motion, (samples, 3)."""
    pole = 0.9 * np.exp(0.15j)
    shape = np.real(np.poly([pole, pole.conjugate()]))
    dq = lfilter([0.2], shape, rng.standard_normal(samples + 101))[100:]
    return np.column_stack([10 * np.diff(dq), dq[1:], np.ones(samples)])


def rows(rng, samples=1500, correlation=0.0, shared=0.0, invalid=0.0, relevant=True):
    """Φ, Z, τ, X: regressors may share the residual, the first of X may know it."""
    z = motion(rng, samples)
    error = lfilter([1.0], [1.0, -correlation], rng.standard_normal(samples))
    phi = z.copy()
    phi[:, :2] += 0.3 * rng.standard_normal((samples, 2)) + shared * error[:, None]
    extra = np.roll(z[:, :2], 5, axis=0) + 0.2 * rng.standard_normal((samples, 2))
    extra[:, 0] += invalid * error
    return phi, z if relevant else motion(rng, samples), phi @ THETA + error, extra


def sums_of(phi, z, tau, extra=None):
    """Sums of one record: regressors, instruments, torque and further instruments, by sample."""
    (windows,) = windows_of([tau.size])
    more = 0 if extra is None else extra.shape[1]
    sums = MomentSums.empty(phi.shape[1], more, [windows])
    x = None if extra is None else np.ascontiguousarray(extra.T)
    shares = list(windows.shares(slice(0, tau.size)))
    columns = np.arange(phi.shape[1])
    sums.add(columns, phi.T, z.T, x, tau, tau.size, shares, np.arange(more))
    return sums
