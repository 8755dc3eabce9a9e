"""Unknowns besides the gains, and known quantities: payload, trusted gains and parameters.

    θ_g = M_g x + b_g

Under load 0 (none) M holds the estimated base parameters and b the trusted ones. Under load 1 the
unknown parts of the payload and the change of friction join M, the known parts of the payload b.
A payload also changes base parameters that were left out as zero; they are in b then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.drives.known_payload import Payload
from pivident.errors import ExperimentError
from pivident.estimation.problem import Problem
from pivident.recording.recording import Recording
from pivident.robot.description import INERTIAL
from pivident.robot.naming import nearest


@dataclass(frozen=True)
class Trusted:
    """A number that is assumed known: a gain, or a parameter from a drawing."""

    value: float  # gain in N m per unit of the log, or base parameter in SI
    std: float = 0.0  # standard deviation; zero: exact


@dataclass(frozen=True, eq=False)
class GainUnknowns:
    """Maps from the unknowns to the parameters of each load, and their known parts.

    ``wide`` is the problem with the recordings under load, and with the parameters that a payload
    changes besides the estimated ones. ``directions`` has for each number that is known with an
    uncertainty its standard deviation and the derivative of b_g of each load.
    """

    wide: Problem
    loads: tuple[int, ...]  # of each recording: 0 none, 1 the payload
    maps: tuple[np.ndarray, ...]  # M_g of each load, (parameters, unknowns)
    offsets: tuple[np.ndarray, ...]  # b_g of each load, (parameters,)
    directions: tuple[tuple[float, tuple[np.ndarray, ...]], ...]
    trusted_gains: Mapping[int, Trusted] = field(default_factory=dict)  # by index of the joint


def gain_unknowns(
    problem: Problem,
    payload: Payload | None,
    loaded: Sequence[Recording],
    trusted_gains: Mapping[str, Trusted | float],
    trusted_parameters: Mapping[str, Trusted | float],
    friction_under_load: bool,
) -> GainUnknowns:
    """Separate known from unknown quantities; names are of joints and of base parameters."""
    if (payload is None) != (not loaded):
        raise ExperimentError(
            "a payload and the recordings taken with it belong together",
            advice="give both or neither",
        )
    base = problem.base
    columns = np.zeros((len(base), len(INERTIAL)))
    if payload is not None:
        columns = payload.base_columns(base)
    kept = sorted({*problem.selection, *np.flatnonzero(np.abs(columns).sum(axis=1)).tolist()})
    names = [base.names[k] for k in kept]
    wide = replace(problem, recordings=(*problem.recordings, *loaded), parameters=tuple(names))
    loads = (0,) * len(problem.recordings) + (1,) * len(loaded)

    trusted = {_place(name, wide): _as_trusted(v) for name, v in trusted_parameters.items()}
    free = [i for i, k in enumerate(kept) if k in problem.selection and i not in trusted]
    unloaded = np.eye(len(kept))[:, free]
    known = np.zeros(len(kept))
    directions = []
    for i, number in trusted.items():
        known[i] = number.value
        unit = np.eye(len(kept))[i]
        directions.append((number.std, (unit, unit) if loaded else (unit,)))
    maps, offsets = [unloaded], [known]
    if payload is not None:
        columns = columns[kept]
        # friction under load: the change with respect to no load
        friction = [
            i for i in free if friction_under_load and not wide.regressor.parameters[i].carries_load
        ]
        estimated = columns[:, [INERTIAL.index(name) for name in payload.unknown()]]
        more = np.hstack([np.eye(len(kept))[:, friction], _independent(estimated)])
        maps = [np.hstack([unloaded, np.zeros_like(more)]), np.hstack([unloaded, more])]
        added = columns @ payload.known()
        offsets = [known, known + added]
        if payload.mass_std > 0:
            nothing_known = np.zeros(len(kept))
            directions.append((payload.mass_std, (nothing_known, columns @ payload.per_mass())))
    gains = {}
    for name, given in trusted_gains.items():
        if name not in problem.robot.joint_names:
            raise ExperimentError(
                f"a gain is trusted of joint {name!r}",
                advice=nearest(name, problem.robot.joint_names),
            )
        gains[problem.robot.joint_names.index(name)] = _as_trusted(given)
    return GainUnknowns(wide, loads, tuple(maps), tuple(offsets), tuple(directions), gains)


def _place(name: str, problem: Problem) -> int:
    """Column of a base parameter by name."""
    for i, parameter in enumerate(problem.regressor.parameters):
        if name.lower() in (parameter.name.lower(), problem.names[i].lower()):
            return i
    raise ExperimentError(f"a parameter {name!r} is trusted", advice=nearest(name, problem.names))


def _as_trusted(number: Trusted | float) -> Trusted:
    """A bare number is exact."""
    made = number if isinstance(number, Trusted) else Trusted(float(number))
    if not (np.isfinite(made.value) and made.value != 0 and made.std >= 0):
        raise ExperimentError(
            f"{made.value} ± {made.std} cannot be trusted",
            advice="give a number other than 0 and a standard deviation that is not negative",
        )
    return made


def _independent(columns: np.ndarray) -> np.ndarray:
    """A basis of the columns: indistinguishable parts of a payload are one unknown."""
    if columns.shape[1] == 0:
        return columns
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, values > 1e-10 * max(values[0], 1e-300)]
