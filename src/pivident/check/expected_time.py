"""How long an identification takes, from `pivident identify` to the report.

With n samples in all, J joints, P parameters, B held-out blocks and u = n J P,

    T = T₀ + Σ_methods (1 + B) (f + c u) + l n J + (t + s u) + (r + d J M),

that is: the start; one fit of each of M methods to everything and one without each block, in
seconds f and per sample, joint and parameter c; a control law that has to be found; the tests of
residuals and instruments; the report. The constants are processor times measured on a two-core
machine of 2.5 GHz, of `pivident identify` with the report, caches filled:

| problem | samples, joints, parameters | measured [s] | T [s] |
|---|---|---|---|
| TIAGo, 100 Hz, `ls` | 6174 × 5, 40 | 11 to 12 | 11 |
| EMPS, 1 kHz, four methods | 24,841 × 1, 4 | 14 | 13 |
| simulated UR10e, 500 Hz, `ls` and `piv`, law to be found | 27,082 × 6, 58 | 28 to 40 | 35 |
| TX40, 5 kHz, four methods | 37,250 × 6, 34 | 37 | 40 |
"""

from __future__ import annotations

from collections.abc import Iterable

from pivident.compiled import is_compiled
from pivident.estimation.methods import LeastSquares, Method
from pivident.estimation.problem import Problem

#: T₀: libraries, robot and records [s].
START = 3.0

#: f and c of least squares: seconds of one fit, and per sample, joint and parameter [s].
LEAST_SQUARES = (0.08, 5e-8)

#: … of methods that simulate the loop.
WITH_LOOP = (0.15, 1.3e-7)

#: l: a control law that has to be found, per sample and joint [s].
LAW = 6e-5

#: t and s: tests of residuals and instruments [s].
TESTS = (4.0, 3e-7)

#: r and d: the report, and its figures for each joint and method [s].
REPORT = (1.0, 0.26)

#: Processor time to compile what least squares needs, and what the simulated loop needs too [s].
COMPILING = (12.0, 25.0)


def expected_time(
    problem: Problem, methods: Iterable[Method], folds: int, *, law_unknown: bool
) -> float:
    """Processor time of an identification without compiling [s], about right to a factor of two."""
    samples = sum(recording.samples for recording in problem.recordings)
    joints, methods = problem.robot.size, list(methods)
    unit = float(samples * joints * len(problem.names))
    fits = sum(fixed + slope * unit for fixed, slope in map(_of_method, methods))
    total = START + (1 + folds) * fits
    total += LAW * samples * joints if law_unknown else 0.0
    total += TESTS[0] + TESTS[1] * unit
    return total + REPORT[0] + REPORT[1] * joints * len(methods)


def _of_method(method: Method) -> tuple[float, float]:
    """Seconds f of a fit, and c per sample, joint and parameter [s]."""
    return LEAST_SQUARES if isinstance(method, LeastSquares) else WITH_LOOP


def first_run(methods: Iterable[Method]) -> float:
    """Processor time to compile what is not in the caches yet [s]."""
    from pivident.dynamics.regressor_kernels import observe
    from pivident.simulation.loop_kernel import run_loop

    simulated = any(not isinstance(method, LeastSquares) for method in methods)
    missing = 0.0 if is_compiled(observe) else COMPILING[0]
    return missing + (COMPILING[1] if simulated and not is_compiled(run_loop) else 0.0)
