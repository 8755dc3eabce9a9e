"""Friction that grows with the load: its column depends on the parameters that are sought.

The load of a joint is the torque of inertia, gravity and springs, Φ_r θ_r. Estimators take it from
their last estimate and go on until it stands still; the first one does without that friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.equation_record import accumulate
from pivident.estimation.full_rate import records_without_instruments
from pivident.estimation.inner_signals import with_inner
from pivident.estimation.kinematics import Kinematics
from pivident.estimation.normal_equations import weighted_solution
from pivident.estimation.problem import Problem
from pivident.signals.prefilter import Prefilter

#: Change of an estimate, in standard deviations, below which its load has settled; and relative to
#: its size, for records without noise.
SETTLED, SETTLED_RELATIVE = 0.01, 1e-12

#: Estimates after which a load that does not settle is given up.
MAX_PASSES = 30


def estimate_without_load(
    problem: Problem, kinematics: Sequence[Kinematics], limits: Sequence[np.ndarray]
) -> np.ndarray | None:
    """Least squares without the friction that grows with the load: what makes the first load.

    Args:
        problem: robot, recordings, parameters.
        kinematics: one for each recording.
        limits: speeds below which a joint's samples are excluded, likewise.

    Returns:
        Parameters, shape (parameters,), zero for the friction left out; None where no column
        depends on the load.
    """
    if not problem.regressor.depends_on_load:
        return None
    others = np.flatnonzero(~problem.regressor.load_parameters)
    parameters = [problem.regressor.parameters[k] for k in others]
    regressor = Regressor.build(problem.robot, parameters)
    known = [with_inner(regressor, k) for k in kinematics]
    filters = [Prefilter()] * problem.robot.size
    records = records_without_instruments(known, limits)
    sums = accumulate(regressor, records, filters, by_window=False)
    names = [problem.names[k] for k in others]
    theta = np.zeros(len(problem.names))
    theta[others] = weighted_solution(sums, names, np.zeros(others.size), 1.0)[0].theta
    return theta


def has_settled(theta: np.ndarray, last: np.ndarray, std: np.ndarray) -> bool:
    """Whether an estimate changed so little that its load stands still.

    Args:
        theta: parameters, shape (parameters,).
        last: those that made the load.
        std: standard deviations of the estimate.
    """
    return bool((np.abs(theta - last) <= SETTLED * std + SETTLED_RELATIVE * np.abs(theta)).all())
