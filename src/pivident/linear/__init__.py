"""Linear models from sampled data: continuous and discrete time, with noise models.

Useful without a robot. Continuous time: `srivc`, `rivc`; discrete time: `arx`, `sriv`, `riv`;
noise alone: `ar`, `arma`; orders: `select_orders`. All return a `LinearEstimate` (noise
models a `Noise`), whose polynomials have the highest power first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
