"""Published benchmark systems of continuous-time identification, with known truth.

Each is a transfer function, an input, a signal-to-noise ratio 10 log10(var x/var ξ) and a noise
model; :meth:`Benchmark.record` makes one record of it from a seed and :meth:`Benchmark.bound` the
smallest standard errors of an unbiased estimator. Where the source does not print the input or the
ratio, ours is stated here.

* ``RAO_GARNIER``: two modes, 2 rad/s and 20 rad/s, and a right half-plane zero; CONTSID.
* ``RIVBJ``: modes at 1 rad/s and 60 rad/s, ARMA noise; CAPTAIN's ``rivbjdem2`` (its input and
  ratio are not printed: a PRBS of nine stages with a clock of ten samples, 10 dB).
* ``DELAYED_LAG``, ``NON_MINIMUM_PHASE``, ``COLOURED``: delays of 8 s; CONTSID's demonstrations
  of TDSRIVC, TFSRIVC and TFRIVC. The noise of the last has a double root at 0.99.
* ``CLOSED_LOOP``: a plant under PI control, the reference added at its input; CONTSID, Gilson,
  Garnier, Young and Van den Hof (2008). The controller is sampled here (backward Euler), so that
  the zero-order hold is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter, max_len_seq

from pivident.linear.model import Structure
from pivident.linear.refined_iv import iv_step, linearised
from pivident.linear.sampled_data import SampledData, continuous_response, delayed
from pivident.linear.state_variable_filter import discretised_chain
from pivident.signals.arma import Noise


@dataclass(frozen=True, eq=False)
class BenchmarkRecord:
    """One record, arrays of shape (samples,)."""

    u: np.ndarray  # input of the plant
    x: np.ndarray  # noise-free output, given that input's noise-free part
    y: np.ndarray  # measured output
    external: np.ndarray | None  # the signal that enters the loop; None in open loop


@dataclass(frozen=True)
class Benchmark:
    """A system to identify, (C.3)."""

    name: str
    numerator: tuple[float, ...]  # B, highest power of p first
    denominator: tuple[float, ...]  # A, monic
    dt: float  # [s]
    stages: int  # of the shift register of the PRBS of ±1
    clock: int  # samples for which it holds each value
    samples: int  # of a record; the PRBS is cut or repeated
    ratio: float  # signal-to-noise ratio [dB]
    delay: int = 0  # of the input [samples]
    ar: tuple[float, ...] = (1.0,)  # D of the noise C/D e
    ma: tuple[float, ...] = (1.0,)  # C
    gains: tuple[float, float] | None = None  # K_p, K_i [1/s] of the PI controller; None: open loop

    @property
    def orders(self) -> tuple[int, int]:
        """Degrees of numerator and denominator."""
        return len(self.numerator) - 1, len(self.denominator) - 1

    @property
    def theta(self) -> np.ndarray:
        """True parameters in the order of ``LinearEstimate.theta``."""
        return np.r_[self.denominator[1:], self.numerator]

    def record(self, seed: int) -> BenchmarkRecord:
        """A record with the noise of this seed."""
        rng = np.random.default_rng(seed)
        e = rng.normal(size=self.samples + 1000)
        noise = self._innovation_std() * lfilter(self.ma, self.ar, e)[1000:]
        source = self._source()
        if self.gains is None:
            x = self._noise_free(source)
            return BenchmarkRecord(source, x, x + noise, None)
        u, y = self._loop(source, noise)
        return BenchmarkRecord(u, y - noise, y, source)

    def bound(self) -> np.ndarray:
        """Standard errors by (C4) at the true parameters, shape (parameters,)."""
        source = self._source()
        u = source if self.gains is None else self._loop(source, np.zeros(self.samples))[0]
        structure = Structure((self.orders[0],), (self.orders[1],), (self.delay,), "zoh")
        rows = delayed(u, self.delay)[None]
        data = SampledData(rows, rows, self._noise_free(u), self.dt)
        noise = Noise(np.array(self.ar), np.array(self.ma), 1.0)
        _, inverse = iv_step(linearised(data, structure, self.theta).whitened(noise))
        return self._innovation_std() * np.sqrt(np.diag(inverse))

    def _noise_free(self, u: np.ndarray) -> np.ndarray:
        return continuous_response(
            np.array(self.numerator),
            np.array(self.denominator),
            delayed(u, self.delay),
            self.dt,
            "zoh",
        )

    def _source(self) -> np.ndarray:
        """The PRBS."""
        sequence = np.repeat(2.0 * max_len_seq(self.stages)[0] - 1.0, self.clock)
        return np.resize(sequence, self.samples)

    def _innovation_std(self) -> float:
        """Standard deviation of e that gives the ratio."""
        source = self._source()
        if self.gains is None:
            x = self._noise_free(source)
        else:
            x = self._loop(source, np.zeros(self.samples))[1]
        impulse = lfilter(self.ma, self.ar, np.r_[1.0, np.zeros(self.samples)])
        return float(np.std(x) * 10 ** (-self.ratio / 20) / np.linalg.norm(impulse))

    def _loop(self, source: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """u_k = r_k - K_p y_k - K_i Σ y dt on the exact discretisation of the plant."""
        assert self.gains is not None
        proportional, integral = self.gains
        phi, gamma, _, units = discretised_chain(np.array(self.denominator), self.dt, "zoh")
        output = np.zeros(len(gamma))
        output[-len(self.numerator) :] = np.array(self.numerator) * units[-len(self.numerator) :]
        state, summed = np.zeros(len(gamma)), 0.0
        u, y = np.empty(self.samples), np.empty(self.samples)
        for k in range(self.samples):
            y[k] = output @ state + noise[k]
            summed += y[k] * self.dt
            u[k] = source[k] - proportional * y[k] - integral * summed
            state = phi @ state + gamma * u[k]
        return u, y


RAO_GARNIER = Benchmark(
    "RG", (-6400.0, 1600.0), (1.0, 5.0, 408.0, 416.0, 1600.0), 0.01, 10, 7, 7161, 10.0
)
RIVBJ = Benchmark(
    "CAP",
    (-120.0, -1560.0, 3600.0),
    (1.0, 30.2, 3607.0, 750.0, 3600.0),
    0.005,
    9,
    10,
    5000,
    10.0,
    delay=7,
    ar=(1.0, -1.4, 0.7),
    ma=(1.0, 0.5),
)
DELAYED_LAG = Benchmark("C2a", (12.0,), (1.0, 4.0, 4.0), 0.1, 8, 20, 5100, 15.0, delay=80)
NON_MINIMUM_PHASE = Benchmark("C2b", (-4.0, 0.5), (1.0, 1.0, 4.0), 0.1, 8, 5, 1275, 15.0, delay=80)
COLOURED = Benchmark(
    "C2c",
    (4.0,),
    (1.0, 2.8, 4.0),
    0.1,
    8,
    5,
    1275,
    15.0,
    delay=80,
    ar=(1.0, -1.98, 0.9802),
    ma=(1.0, 0.2679),
)
CLOSED_LOOP = Benchmark(
    "CL", (1.0, 1.0), (1.0, 0.5, 1.0), 0.005, 4, 500, 7501, 10.0, gains=(10.0, 15.0)
)
