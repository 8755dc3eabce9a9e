"""Records of the twin of the paper's experiment, and pivident's form on them, for a comparison."""

from dataclasses import dataclass, replace
from unittest import mock

import numpy as np

from pivident.estimation import noise_identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import PividentError
from pivident.studies.many.study.bench import Bench
from pivident.studies.paper.experiment import condition
from tests.independent.arm import NAMES
from tests.independent.identification import Estimate
from tests.independent.loop import Record
from tests.independent.reading import Reading

FORM = "piv-as-printed"

#: Noise models until one is kept. Pivident keeps the second; both are given a third, because
#: the second estimate may still be far from the last, and a model from it makes much of little.
NOISE_MODELS = 3

#: What pivident's form as printed chooses where the text is open, all samples in use: the proper
#: part of the controller is inverted, noise models of the orders of the first, weights from
#: the estimate's own residual, accelerations on the sample, memories of the filters left out, and
#: an auxiliary model that starts as measured and in which no friction drives the arm.
AS_PIVIDENT = Reading(
    slopes="centred",
    weak_integral=True,
    fit="burg",
    max_order=150,
    noise_fits=NOISE_MODELS,
    keep_orders=True,
    variance_of="this",
    margins=(0.01, 0.01),
    forget=1e-4,
    begins="measured",
    accelerations="instant",
    dissipative=True,
)


@dataclass(frozen=True)
class Twin:
    """One record of the twin: for pivident, for the second implementation, and its truth."""

    problem: Problem
    record: Record
    truth: np.ndarray
    start: np.ndarray
    bench: Bench

    def by_pivident(self) -> Estimate:
        """Pivident's form as printed on all samples, in the order of `NAMES`."""
        method = replace(self.bench.scenario.methods[FORM], max_iterations=20, tolerance=1e-4)
        problem = replace(self.problem, mask=None)
        try:
            with mock.patch.object(noise_identification, "DECIDES_MODELS", NOISE_MODELS):
                found = identify(problem, method)
        except PividentError as failure:
            nothing = np.full(len(NAMES), np.nan)
            return Estimate(nothing, nothing, 0, (), str(failure))
        own = [name.lower().removesuffix("r") for name in found.names]
        order = [own.index(name.lower()) for name in NAMES]
        end = "converged" if found.converged else f"no convergence in {found.iterations} iterations"
        return Estimate(found.theta[order], found.method_std[order], found.iterations, (), end)


def twin(bench: Bench, run: int) -> Twin:
    """A record of a bench by its number."""
    problem, law = bench.problem(run), bench.scenario.content.controller
    made, gain = problem.recordings[0], np.atleast_1d(bench.loop.drive_gain)
    signals = (np.ascontiguousarray(x) for x in (made.q_ref, made.dq_ref, made.q, made.tau))
    gains = (np.array(x) * gain for x in (law.kp, law.kd, law.ki))
    record = Record(float(made.rate), *signals, *gains, law.derivative_time)
    return Twin(problem, record, ordered(bench.truth), ordered(bench.start(0)), bench)


def bench_of(reading: str) -> Bench:
    """The bench of a reading of "3600 points per revolution": joint, motor or log."""
    return Bench(condition(reading))


def ordered(values: dict[str, float]) -> np.ndarray:
    """Values by pivident's names in the order of `NAMES`."""
    lower = {name.lower(): value for name, value in values.items()}
    return np.array([lower[name.lower()] for name in NAMES])
