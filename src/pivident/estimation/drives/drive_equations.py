"""Equations of the drives in the unit of the log, and what is unknown and known in them.

A log holds commands c (amperes, volts, or torques by a declared gain). With the transmission's
coupling of motors B (identity without couplings) and one unknown gain κ_m for each motor,

    tau = B (κ ∘ c),      (B⁻¹ Φ θ)_m = κ_m c_m      for each motor m,

so that a row belongs to one motor, and a gain to one row. Where the log is in N m already, κ is
the ratio of the true gain to the declared one.

The sums over samples that `pivident.estimation.normal_equations` computes for each row are
sufficient for every estimator of the gains.

Unknowns besides the gains, and known quantities: payload, trusted gains and parameters.

    θ_g = M_g x + b_g

Under load 0 (none) M holds the estimated base parameters and b the trusted ones. Under load 1 the
unknown parts of the payload and the change of friction join M, the known parts of the payload b.
A payload also changes base parameters that were left out as zero; they are in b then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.full_rate import BLOCK, valid_samples
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError, IdentificationError, require_known
from pivident.loop.motion.motion import (
    Kinematics,
    SimulatedMotion,
    SpeedLimits,
    packed_stretch,
    with_inner,
)
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.naming import nearest
from pivident.robot.transmission import Transmission

#: Windows of time of each record for the sandwich. All drives together have many more unknowns than
#: one identification, and with fewer windows the standard errors are too small.
WINDOWS = 60


@dataclass(frozen=True, eq=False)
class DriveRecord:
    """One recording in the drive equations."""

    kinematics: Kinematics  # motion, and commands (as torques) at the same instants
    limits: SpeedLimits  # speeds below which samples are excluded
    load: int = 0  # carried by the robot: 0 none, 1 the payload
    motion: SimulatedMotion | None = None  # simulated, for instruments; None: least squares


def motor_coupling(transmission: Transmission) -> np.ndarray:
    """B (joints, joints): joint torques of commands referred to each motor's own joint.

    From tau = Nᵀ tau_motor, B = Nᵀ diag(N)⁻¹; the identity where no motor drives a second joint.
    """
    return transmission.reduction.T / np.diag(transmission.reduction)


def drive_columns(robot: Robot, regressor: Regressor) -> list[np.ndarray]:
    """Parameters that act on each motor: those of all joints in its row."""
    rows = np.linalg.inv(motor_coupling(robot.transmission))
    return [
        np.unique(np.concatenate([regressor.columns_of(int(j)) for j in np.flatnonzero(rows[m])]))
        for m in range(robot.size)
    ]


def drive_sums(
    robot: Robot, regressor: Regressor, records: Sequence[DriveRecord]
) -> list[list[JointSums]]:
    """Sums of each motor's rows, ``sums[load][motor]``; ``tau`` of the sums is the command c."""
    columns = drive_columns(robot, regressor)
    rows = np.linalg.inv(motor_coupling(robot.transmission))
    windows = [
        Windows(r.kinematics.q.shape[1], WINDOWS, k * WINDOWS) for k, r in enumerate(records)
    ]
    count = sum(w.count for w in windows)
    loads = 1 + max(r.load for r in records)
    sums = [
        [
            JointSums.empty(name, own, count)
            for name, own in zip(robot.joint_names, columns, strict=True)
        ]
        for _ in range(loads)
    ]
    for record, own in zip(records, windows, strict=True):
        k = with_inner(regressor, record.kinematics)
        motion = None if record.motion is None else with_inner(regressor, record.motion)
        valid = valid_samples(k, k.dq if motion is None else motion.dq, record.limits)
        commands = rows @ k.tau
        for start in range(0, own.samples, BLOCK):
            span = slice(start, min(start + BLOCK, own.samples))
            shares = list(own.shares(span))
            phi = packed_stretch(regressor, k, span)
            z = phi if motion is None else packed_stretch(regressor, motion, span)
            for m in range(robot.size):
                sums[record.load][m].add(
                    motor_rows(regressor, rows[m], columns[m], phi),
                    None if motion is None else motor_rows(regressor, rows[m], columns[m], z),
                    commands[m, span],
                    motor_valid_samples(rows[m], valid[:, span]),
                    shares,
                )
    return sums


def motor_rows(
    regressor: Regressor, row: np.ndarray, columns: np.ndarray, packed: np.ndarray
) -> np.ndarray:
    """Rows of one motor, Σ_j (B⁻¹)_mj Φ_j, shape (columns, samples)."""
    joints = np.flatnonzero(row)
    offsets = regressor.offsets
    if joints.size == 1 and row[joints[0]] == 1.0:
        return packed[offsets[joints[0]] : offsets[joints[0] + 1]]
    made = np.zeros((columns.size, packed.shape[1]))
    for j in joints:
        place = np.searchsorted(columns, regressor.columns_of(int(j)))
        made[place] += row[j] * packed[offsets[j] : offsets[j + 1]]
    return made


def motor_valid_samples(row: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Samples of a motor that are valid for all its joints, True = used, shape (samples,)."""
    return np.all(valid[np.flatnonzero(row)], axis=0, out=np.empty(valid.shape[1], dtype=bool))


def refuse_load_friction(regressor: Regressor) -> None:
    """Refuse laws whose columns depend on the torque, which the gains are to determine."""
    if regressor.depends_on_load:
        names = [p.name for p in regressor.parameters if p.friction and p.friction.depends_on_load]
        raise IdentificationError(
            f"load-dependent friction ({', '.join(names)}) needs the torque in N m, whose gain is "
            "unknown here",
            advice="identify the gains with a law without load first",
        )


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
    columns = (
        np.zeros((len(base), len(INERTIAL))) if payload is None else payload.base_columns(base)
    )
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
        offsets = [known, known + columns @ payload.known()]
        if payload.mass_std > 0:
            nothing_known = np.zeros(len(kept))
            directions.append((payload.mass_std, (nothing_known, columns @ payload.per_mass())))
    gains = {}
    for name, given in trusted_gains.items():
        require_known(
            name, problem.robot.joint_names, f"a gain is trusted of joint {name!r}", ExperimentError
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
