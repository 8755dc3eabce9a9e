"""Search for a law's constants on the whole record; every point that is visited is evaluated."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pivident.friction_laws.shape_constants import ShapeConstant
from pivident.robot.friction import FrictionLaw

#: Evaluations of the search for each constant, after the grid.
EVALUATIONS = 25

#: The criterion at values of the constants.
Criterion = Callable[[Sequence[float]], float]


def search_constants(
    law: FrictionLaw,
    constants: Sequence[ShapeConstant],
    evaluate: Callable[[FrictionLaw], float],
) -> None:
    """The best point of grids along each constant, then Nelder and Mead's simplex from there.

    Args:
        law: the law with any constants.
        constants: which are searched, with their bounds.
        evaluate: the criterion of a law with constants; it is called with each point.
    """

    def criterion(values: Sequence[float]) -> float:
        return evaluate(
            law.with_shapes({c.name: v for c, v in zip(constants, values, strict=True)})
        )

    _descend(constants, _grid(constants, criterion), criterion)


def _grid(constants: Sequence[ShapeConstant], criterion: Criterion) -> list[float]:
    """The best point of the grids, constant by constant."""
    best = [c.value for c in constants]
    lowest = np.inf
    for _ in range(1 if len(constants) == 1 else 2):
        for i, c in enumerate(constants):
            for value in c.grid():
                trial = [*best]
                trial[i] = float(value)
                found = criterion(trial)
                if found < lowest:
                    best, lowest = trial, found
    return best


def _descend(
    constants: Sequence[ShapeConstant], start: Sequence[float], criterion: Criterion
) -> None:
    """Nelder and Mead's simplex from the best point of the grids."""
    from scipy.optimize import minimize

    u = np.array([c.coordinate(v) for c, v in zip(constants, start, strict=True)])
    steps = np.array([0.5 * c.span / (len(c.grid()) - 1) for c in constants])
    inward = np.where(u + steps > [c.coordinate(c.high) for c in constants], -1.0, 1.0)
    simplex = np.vstack([u, u + np.diag(inward * steps)])
    minimize(
        lambda x: criterion([c.at(float(v)) for c, v in zip(constants, x, strict=True)]),
        u,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": EVALUATIONS * len(constants),
            "xatol": 1e-3,
            "fatol": 1e-3,
        },
    )
