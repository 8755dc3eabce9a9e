"""Results on disk that differ in ways which are known."""

from dataclasses import replace

import numpy as np

from tests.synthetic_identification import synthetic_identification


def result(seed, method="IDIM-PIV", record=None, **changes):
    """An identification of its own record; ``changes`` are factors by parameter name."""
    made = synthetic_identification(
        method, seed=seed, sources={"log.csv": f"{seed if record is None else record:064x}"}
    )
    theta = made.theta.copy()
    for name, factor in changes.items():
        theta[made.names.index(name)] *= factor
    return replace(made, judged=None, theta=theta)


def without(identification, *names):
    """The same estimate without some parameters."""
    kept = np.array([name not in names for name in identification.names])

    def chosen(values):
        return tuple(v for v, keep in zip(values, kept, strict=True) if keep)

    block = np.ix_(kept, kept)
    return replace(
        identification,
        parameters=chosen(identification.parameters),
        names=chosen(identification.names),
        expressions=chosen(identification.expressions),
        judged=None,
        theta=identification.theta[kept],
        covariance=identification.covariance[block],
        robust_covariance=identification.robust_covariance[block],
        formula_covariance=identification.formula_covariance[block],
        history=tuple(replace(h, theta=h.theta[kept]) for h in identification.history),
    )
