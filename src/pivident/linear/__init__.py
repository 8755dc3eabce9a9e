"""Linear models from sampled data: continuous and discrete time, with noise models.

Useful without a robot. Continuous time: `srivc`, `rivc`; discrete time: `arx`, `sriv`, `riv`;
noise alone: `ar`, `arma`; orders: `select_orders`. All return a `LinearEstimate` (noise
models a `Noise`), whose polynomials have the highest power first.

Example:
    >>> from scipy.signal import lfilter
    >>> rng, pole = np.random.default_rng(1), np.exp(-0.02)
    >>> u = np.sign(rng.normal(size=400)).repeat(10)
    >>> y = lfilter([0.0, 2.0 * (1.0 - pole)], [1.0, -pole], u)  # 4/(p + 2), sampled at 100 Hz
    >>> y += rng.normal(scale=0.1, size=y.size)
    >>> model = pv.linear.srivc(u, y, 0.01, numerator_order=0, denominator_order=1)
    >>> model.numerator.round(1), model.denominator.round(1)
    (array([4.]), array([1., 2.]))
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
