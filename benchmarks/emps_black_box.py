# /// script
# requires-python = ">=3.11"
# dependencies = ["pivident", "nfoursid==1.0.2", "sysidentpy==0.9.0"]
# ///
"""EMPS in open loop by models that know no mechanics: a linear state space and a NARX model.

The protocol is that of `emps_leaderboard`: fitted to the training record alone, structures chosen
by its halves, the test record simulated once from its first 20 samples. The estimators are those of
kept libraries, which pivident itself does not need: subspace identification (PO-MOESP) of
``nfoursid``, forward regression with orthogonal least squares (FROLS) of ``sysidentpy``.

What a model is given. Input: the mean force over each interval. Output, one of

    position    q at the ends of the intervals
    speed       its mean over each interval, (q_(k+1) - q_k)/T, whose sum is the position again

A position integrates, and an estimate may put the integrator beside one; which output, interval T
and size is chosen on the training record:

1. Each structure of `state_spaces` or `narx_models` is fitted to one half, and simulated over the
   other from the first 20 samples there; the reverse; root mean square of both runs.
2. Of each kind that with the smallest error is fitted to the whole training record, and scored. It
   is refused, and the next one taken, if on that record, which is twice as long, it then leaves
   more than twice what it left on the halves: its terms are others with each record.
   (With hundreds of structures and two halves, of which a standard error has one degree of freedom,
   the rule of one standard error would accept whatever does better on one half by chance.)

The start is that of the line or the parabola through the 20 given samples, another choice of the
halves; the past is its tangent there under their mean force.

    PIVIDENT_DATA=FOLDER python -m benchmarks.emps_black_box [--score]

in an environment of its own: ``python -m venv FOLDER``, and there ``pip install`` of what the head
of this file names.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from time import process_time
from typing import Any, Protocol

import numpy as np
from benchmarks.open_loop_model import GIVEN, Stretch, rms
from scipy.signal import dlsim

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.signals.cubic_spline import cubic_spline

#: Outputs that a model can be given, and samples of the record in an interval.
OUTPUTS, INTERVALS = ("speed", "position"), (5, 10, 20, 50, 100, 200)

#: Degrees of the polynomial through the given samples.
STARTS = (1, 2)

#: Orders of a state space, and block rows of its Hankel matrices.
ORDERS, BLOCK_ROWS = (1, 2, 3, 4, 6, 8), (10, 20, 40)

#: Degrees of the polynomial of a NARX model, its lags and its terms.
DEGREES, LAGS, TERMS = (1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 6, 8, 12, 16)

#: Samples of the model before the first one that its start may need, and all that it is given.
BEFORE = 4
AROUND = np.arange(-BEFORE, 2)

#: Structures of each kind that are shown.
SHOWN = 10

#: Length of the record in halves: a drift grows with it.
LONGER = 2.0

#: Distance from the given samples at which a simulation counts as diverged [m].
TOO_FAR = 100.0


@dataclass(frozen=True)
class Sampling:
    """What a model is given of a record.

    Attributes:
        output: "position" or "speed".
        interval: samples of the record from one sample of the model to the next.
        degree: of the polynomial through the given samples that sets the start.
    """

    output: str
    interval: int
    degree: int

    def inputs(self, record: Recording, stretch: Stretch) -> np.ndarray:
        """Mean force over each interval, the last one filled up, shape (samples,) [N]."""
        force = record.tau[slice(*stretch), 0]
        missing = -len(force) % self.interval
        return np.pad(force, (0, missing), mode="edge").reshape(-1, self.interval).mean(axis=1)

    def outputs(self, position: np.ndarray, rate: float) -> np.ndarray:
        """Output of each whole interval, shape (samples,) [m or m/s]."""
        ends = position[:: self.interval]
        return ends if self.output == "position" else np.diff(ends) * rate / self.interval

    def positions(
        self, simulated: np.ndarray, first: float, rate: float, samples: int
    ) -> np.ndarray:
        """Positions at the samples of a record from simulated outputs, shape (samples,) [m]."""
        if self.output == "speed":
            steps = np.cumsum(simulated) * self.interval / rate
            simulated = first + np.concatenate([[0.0], steps])
        at = np.arange(len(simulated)) * float(self.interval)
        return cubic_spline(at, simulated[:, None])(np.minimum(np.arange(samples), at[-1]))[:, 0]

    def __str__(self) -> str:
        return f"{self.output}, {self.interval} ms, start of degree {self.degree}"

    def around(self, curve: np.ndarray, rate: float) -> np.ndarray:
        """Outputs at the samples ``AROUND`` the start of a motion.

        Args:
            curve: (acceleration / 2, speed, position) at the start [m/s², m/s, m].
            rate: of the record [Hz].
        """
        times = np.append(AROUND, AROUND[-1] + 1) * self.interval / rate
        ends = curve[2] + curve[1] * times + np.where(times > 0.0, curve[0] * times**2, 0.0)
        return ends[:-1] if self.output == "position" else np.diff(ends) * rate / self.interval


class Fitted(Protocol):
    """A model with values."""

    def simulate(self, u: np.ndarray, y: np.ndarray, u_past: float) -> np.ndarray:
        """Outputs under inputs.

        Args:
            u: inputs, shape (samples,).
            y: outputs at the samples ``AROUND`` the start.
            u_past: input before the first sample.
        """


class Structure(Protocol):
    """A model without values."""

    @property
    def sampling(self) -> Sampling:
        """What it is given."""

    @property
    def title(self) -> str:
        """What it is called."""

    @property
    def names(self) -> tuple[str, ...]:
        """Its coefficients."""

    def fit(self, u: np.ndarray, y: np.ndarray) -> Fitted:
        """Values from inputs and outputs, shape (samples,) each."""


@dataclass(frozen=True)
class StateSpace:
    """A linear model x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k), of deviations from means."""

    sampling: Sampling
    order: int
    block_rows: int

    @property
    def title(self) -> str:
        """Order, block rows and what it is given."""
        return f"order {self.order}, {self.block_rows} block rows, {self.sampling}"

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients of its transfer function, and the force at which it rests."""
        poles = (f"a{k}" for k in range(1, self.order + 1))
        zeros = (f"b{k}" for k in range(self.order + 1))
        return (*poles, *zeros, "offset")

    def fit(self, u: np.ndarray, y: np.ndarray) -> Fitted:
        """Subspace identification."""
        from nfoursid.nfoursid import NFourSID
        from pandas import DataFrame

        means, sizes = (u.mean(), y.mean()), (u.std(), y.std())
        frame = DataFrame({"u": (u - means[0]) / sizes[0], "y": (y - means[1]) / sizes[1]})
        subspace = NFourSID(frame, ["y"], ["u"], self.block_rows)
        subspace.subspace_identification()
        found, _ = subspace.system_identification(self.order)
        matrices = (found.a, found.b, found.c, found.d)
        return LinearModel(matrices, means, sizes)


@dataclass(frozen=True)
class LinearModel:
    """Matrices A, B, C, D of inputs and outputs in their sizes, around their means."""

    matrices: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    means: tuple[float, float]
    sizes: tuple[float, float]

    def simulate(self, u: np.ndarray, y: np.ndarray, u_past: float) -> np.ndarray:
        """Outputs from the smallest state whose first two are those of the given samples."""
        a, b, c, d = self.matrices
        own = (u - self.means[0]) / self.sizes[0]
        wanted = (y[BEFORE:] - self.means[1]) / self.sizes[1]
        wanted = wanted - [d[0, 0] * own[0], (c @ b)[0, 0] * own[0] + d[0, 0] * own[1]]
        state = np.linalg.pinv(np.vstack([c, c @ a])) @ wanted
        made = dlsim((a, b, c, d, 1.0), own[:, None], x0=state)[1][:, 0]
        return self.means[1] + self.sizes[1] * made


@dataclass(frozen=True)
class Narx:
    """A polynomial y(k) = f(y(k-1), …, y(k-n), u(k-1), …, u(k-n)) of few terms.

    Of a mean speed the first input is that over its own interval, and n of them likewise.
    """

    sampling: Sampling
    degree: int
    lags: int
    terms: int

    @property
    def title(self) -> str:
        """Degree, lags, terms and what it is given."""
        return f"degree {self.degree}, {self.lags} lags, {self.terms} terms, {self.sampling}"

    @property
    def names(self) -> tuple[str, ...]:
        """One coefficient for each term."""
        return tuple(f"c{k}" for k in range(1, self.terms + 1))

    def fit(self, u: np.ndarray, y: np.ndarray) -> Fitted:
        """Terms by forward regression, coefficients by least squares, of the next output."""
        from sysidentpy.basis_function import Polynomial
        from sysidentpy.model_structure_selection import FROLS
        from sysidentpy.parameter_estimation import LeastSquares

        model = FROLS(
            ylag=self.lags, xlag=self.lags, n_terms=self.terms, order_selection=False,
            estimator=LeastSquares(), basis_function=Polynomial(degree=self.degree),
        )  # fmt: skip
        sizes, ahead = (u.std(), y.std()), self.sampling.output == "speed"
        own = u[ahead:] / sizes[0]
        made = y[: len(y) - ahead] / sizes[1]
        model.fit(X=own[: len(made), None], y=made[:, None])
        return Polynomials(model, sizes, self.lags, ahead)


@dataclass(frozen=True)
class Polynomials:
    """A fitted NARX model of inputs and outputs in their sizes."""

    model: Any
    sizes: tuple[float, float]
    lags: int
    ahead: bool

    def simulate(self, u: np.ndarray, y: np.ndarray, u_past: float) -> np.ndarray:
        """Outputs that are fed back; before the first one those of the given samples."""
        own = np.concatenate([np.full(self.lags, u_past), u])
        own = np.append(own[1:], own[-1]) if self.ahead else own
        before = y[BEFORE - self.lags : BEFORE] / self.sizes[1]
        made = self.model.predict(X=own[:, None] / self.sizes[0], y=before[:, None])
        return self.sizes[1] * made[self.lags :, 0]


def state_spaces() -> list[Structure]:
    """Linear models that are tried."""
    samplings = [Sampling(*own) for own in product(OUTPUTS, INTERVALS, STARTS)]
    return [StateSpace(*own) for own in product(samplings, ORDERS, BLOCK_ROWS)]


def narx_models() -> list[Structure]:
    """NARX models that are tried: no more terms than the polynomial has."""
    samplings = [Sampling(*own) for own in product(OUTPUTS, INTERVALS, STARTS)]
    tried = [Narx(*own) for own in product(samplings, DEGREES, LAGS, TERMS)]
    return [own for own in tried if own.terms <= _terms(own.degree, 2 * own.lags)]


def _terms(degree: int, variables: int) -> int:
    """Terms of a polynomial of so many variables."""
    count = 1
    for k in range(1, degree + 1):
        count = count * (variables + k) // k
    return count


def fitted(structure: Structure, record: Recording, stretch: Stretch) -> Fitted:
    """A structure fitted to a stretch of a record."""
    sampling = structure.sampling
    y = sampling.outputs(record.q[slice(*stretch), 0], record.rate)
    return structure.fit(sampling.inputs(record, stretch)[: len(y)], y)


def errors(structure: Structure, model: Fitted, record: Recording, stretch: Stretch) -> np.ndarray:
    """Simulated less measured position [mm], shape (samples,)."""
    sampling, rate = structure.sampling, record.rate
    measured = record.q[slice(*stretch), 0]
    curve = np.polyfit(np.arange(GIVEN) / rate, measured[:GIVEN], sampling.degree)
    u = sampling.inputs(record, stretch)
    if sampling.output == "position":
        u = np.append(u, u[-1])
    curve = np.pad(curve, (2 - sampling.degree, 0))
    u_past = float(record.tau[stretch.start : stretch.start + GIVEN, 0].mean())
    y = model.simulate(u, sampling.around(curve, rate), u_past)
    y = np.clip(np.nan_to_num(y, nan=TOO_FAR), -TOO_FAR, TOO_FAR)
    return 1e3 * (sampling.positions(y, float(curve[2]), rate, len(measured)) - measured)


def held_out(structure: Structure, record: Recording) -> np.ndarray:
    """Error on the second and the first half, fitted to the other [mm], (2,); inf: no model."""
    middle, end = len(record.q) // 2, len(record.q)
    halves = [Stretch(0, middle), Stretch(middle, end)]
    try:
        return np.array(
            [
                rms(errors(structure, fitted(structure, record, own), record, other)[GIVEN:])
                for own, other in (halves, halves[::-1])
            ]
        )
    except (np.linalg.LinAlgError, ValueError, OverflowError):
        return np.full(2, np.inf)


def choose(
    kind: str, structures: Sequence[Structure], record: Recording
) -> tuple[Structure, list[Structure]]:
    """The structure with the smallest held-out error that the whole record bears out.

    Result: what was chosen, and the ``SHOWN`` ones with the smallest errors, which are printed.
    """
    tried = [(held_out(own, record), own) for own in structures]
    tried.sort(key=lambda trial: rms(trial[0]))
    print(f"{kind}, {len(tried)} structures: held-out error, that of each half [mm]")
    for each, own in tried[:SHOWN]:
        print(f"  {own.title:70} {rms(each):8.2f}   {each[0]:8.2f} {each[1]:8.2f}", flush=True)
    chosen = next(own for each, own in tried if score(own, record, record) <= LONGER * rms(each))
    return chosen, [own for _, own in tried[:SHOWN]]


def score(structure: Structure, fitted_to: Recording, record: Recording) -> float:
    """Error of one free run over a record after its given samples [mm]."""
    model = fitted(structure, fitted_to, Stretch(0, len(fitted_to.q)))
    return rms(errors(structure, model, record, Stretch(0, len(record.q)))[GIVEN:])


def repeated(train: Recording, test: Recording) -> float:
    """Score of no model at all: the positions of one record in place of those of the other [mm]."""
    return 1e3 * rms((train.q - test.q)[GIVEN:])


def main(scored: bool) -> None:
    """Choose each kind on the training record; then, if asked, open the test record and score.

    The scores of those that were not chosen show how much of the chosen one's is luck.
    """
    train = load_emps()
    kinds = {"linear state space": state_spaces(), "NARX": narx_models()}
    found = {kind: choose(kind, structures, train) for kind, structures in kinds.items()}
    records = [train, load_emps_pulses()] if scored else [train]
    print("kind, coefficients, training record, test record [mm], processor time of the fit [s]")
    for kind, (chosen, first) in found.items():
        for own in dict.fromkeys([chosen, *first]):
            begin = process_time()
            fitted(own, train, Stretch(0, len(train.q)))
            time = process_time() - begin
            shown = " ".join(f"{score(own, train, record):8.2f}" for record in records)
            mark = "→" if own is chosen else " "
            print(f"{mark} {kind:20} {len(own.names):3} {shown} {time:8.3f}   {own.title}")
    if scored:
        print(f"positions of the training record, replayed: {repeated(*records):.3f} mm")


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # of structures that diverge
    main(scored="--score" in sys.argv)
