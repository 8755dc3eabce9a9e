"""The record, identified by MuJoCo's toolbox `mujoco.sysid` as its documentation does it.

Gauss–Newton with box bounds on finite differences, whose rollouts run in threads. Unknown are the
ten inertial parameters of every body (log-Cholesky), armature, damping and frictionloss; the gains
and the initial state are known. The model is the one that made the record.

    pip install "mujoco[sysid]"
"""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import numpy as np

from .arm import DEFAULT_TIME, STEP, Bodies, Chain, mjcf
from .record import ENCODER, SPEED, TORQUE, Record

#: Threads of its rollouts.
THREADS = 2

#: Singular values of its scaled Jacobian, relative to the largest, from which on a direction counts
#: as determined: what its finite differences resolve.
DETERMINED = 1e-6

#: Channels of a residual: q, dq, tau of the sensors.
RESIDUALS: dict[str, tuple[str, ...]] = {
    "positions": ("q",),
    "positions, speeds": ("q", "dq"),
    "positions, torques": ("q", "tau"),
    "positions, speeds, torques": ("q", "dq", "tau"),
}


@dataclass(frozen=True, eq=False)
class PeerFit:
    """What it found.

    Attributes:
        names: of its parameters, in the order of the next two.
        values: their values, shape (parameters,).
        half: half widths of their 95 % intervals, as its report computes them.
        jacobian: derivatives of its residual at the estimate, shape (residuals, parameters).
        variance: of its residual.
        bodies: the identified arm.
        wall: time [s].
        processor: processor time of all threads [s].
        simulations: rollouts.
        passes: iterations.
        squares: half the sum of the squares of its residual, what it minimises.
        at_bound: parameters that its report finds at a bound.
        bodies_of: the arm of other values.
    """

    names: tuple[str, ...]
    values: np.ndarray
    half: np.ndarray
    jacobian: np.ndarray
    variance: float
    bodies: Bodies
    wall: float
    processor: float
    simulations: int
    passes: int
    squares: float
    at_bound: tuple[str, ...]
    bodies_of: Callable[[np.ndarray], Bodies]

    @property
    def scaled_singular_values(self) -> np.ndarray:
        """Of the Jacobian with columns of unit length, the largest first."""
        scale = np.maximum(np.linalg.norm(self.jacobian, axis=0), 1e-300)
        return np.linalg.svd(self.jacobian / scale, compute_uv=False)

    def half_of(self, function: Callable[[Bodies], np.ndarray]) -> np.ndarray:
        """Half widths of functions of its estimate, by the delta method.

        s √diag(G (JᵀJ)⁺ Gᵀ), G by central differences: its report has no such intervals.
        """
        columns = []
        for k, value in enumerate(self.values.tolist()):
            step = 1e-6 * max(1.0, abs(value))
            ends = []
            for sign in (1.0, -1.0):
                moved = self.values.copy()
                moved[k] += sign * step
                ends.append(function(self.bodies_of(moved)))
            columns.append((ends[0] - ends[1]) / (2.0 * step))
        scale = np.maximum(np.linalg.norm(self.jacobian, axis=0), 1e-300)
        _, size, axes = np.linalg.svd(self.jacobian / scale, full_matrices=False)
        kept = size > DETERMINED * size[0]
        along = (np.column_stack(columns) / scale) @ axes[kept].T / size[kept]
        return 1.96 * np.sqrt(self.variance * (along**2).sum(axis=1))


def identified(
    record: Record,
    start: Bodies,
    channels: tuple[str, ...],
    *,
    weighted: bool,
    friction: bool,
    friction_time: float = DEFAULT_TIME,
    max_iterations: int = 100,
    **options: Any,
) -> PeerFit:
    """Fit the arm to a record.

    ``channels``: see `RESIDUALS`; ``weighted``: by the true noise in place of each signal's size,
    its default; ``friction``: whether frictionloss is sought; ``options``: of its optimiser.
    """
    import mujoco
    from mujoco import sysid

    text = mjcf(start, friction_time)
    spec = mujoco.MjSpec.from_string(text)
    model = spec.compile()
    times = STEP * np.arange(1, len(record.u) + 1)
    # sensors of a rollout show the state before the step, and it drops the last control
    sensors = np.hstack([record.q, record.dq, record.torque])[:-1]
    data = mujoco.MjData(model)
    data.qpos[:] = record.start
    sequences = sysid.ModelSequences(
        "arm", spec, "run", sysid.create_initial_state(model, data.qpos, data.qvel, data.act),
        sysid.TimeSeries(times - STEP, record.u),
        sysid.TimeSeries.from_names(times[:-1], sensors, model),
    )  # fmt: skip
    wanted = [f"{name}_{channel}" for channel in channels for name in start.chain.joints]
    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        n_threads=THREADS,
        enabled_observations=[(name, sysid.SignalType.MjSensor) for name in wanted],
        **({"modify_residual": _weighted(channels)} if weighted else {}),
    )
    counted = _Counted(residual)
    parameters = unknowns(spec, model, start.chain.joints, friction)
    wall, processor = perf_counter(), process_time()
    with redirect_stdout(io.StringIO()):  # its optimiser prints a line for each iteration
        found, result = sysid.optimize(
            parameters, counted, verbose=False, max_iters=max_iterations, **options
        )
    wall, processor = perf_counter() - wall, process_time() - processor
    left, _, _ = residual(result.x, found)
    errors = np.concatenate([np.ravel(own) for own in left])
    _, half = sysid.calculate_intervals([errors], result.jac)
    low, high = parameters.get_bounds()
    near = np.minimum(np.ravel(result.x) - low, high - np.ravel(result.x)) < 1e-3 * (high - low)
    names = tuple(parameters.get_non_frozen_parameter_names())

    def bodies_of(values: np.ndarray) -> Bodies:
        found.update_from_vector(values)
        return bodies_in(sysid.apply_param_modifiers(found, spec), start.chain)

    return PeerFit(
        names,
        np.ravel(result.x),
        np.ravel(half),
        result.jac,
        float(errors @ errors) / (errors.size - len(names)),
        bodies_of(np.ravel(result.x)),
        wall,
        processor,
        counted.rollouts,
        counted.jacobians,
        float(0.5 * errors @ errors),
        tuple(name for name, yes in zip(names, near, strict=True) if yes),
        bodies_of,
    )


def unknowns(spec: Any, model: Any, joints: tuple[str, ...], friction: bool) -> Any:
    """Its parameters, with bounds that hold the truth."""
    from mujoco import sysid

    parameters = sysid.ParameterDict()
    for name in joints:
        parameters.add(
            sysid.body_inertia_param(
                spec, model, f"{name}_link", sysid.InertiaType.Pseudo,
                stretch_bound_mult=np.array([0.02, 50.0]), modifier=_body_modifier(f"{name}_link"),
            )
        )  # fmt: skip
    for attribute in ("armature", "damping", *(("frictionloss",) if friction else ())):
        for name in joints:
            value = float(np.ravel(getattr(spec.joint(name), attribute))[0])
            parameters.add(
                sysid.Parameter(
                    f"{name}_{attribute}", value, 0.1 * value, 10.0 * value,
                    modifier=_joint_modifier(name, attribute),
                )
            )  # fmt: skip
    return parameters


def _body_modifier(name: str) -> Callable[[Any, Any], None]:
    """Inertial parameters of one body from their log-Cholesky form.

    That of the toolbox itself fails with MuJoCo 4.0.0 once a second body is sought (it leaves no
    orientation beside ``fullinertia``), and compiles the model once more for each body.
    """
    from mujoco import sysid

    def modify(spec: Any, parameter: Any) -> None:
        pi = sysid.model_modifier.pi_from_theta(parameter.value)
        body, centre = spec.body(name), pi[1:4] / pi[0]
        i = pi[4:].reshape(3, 3) - pi[0] * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        body.mass, body.ipos = pi[0], centre
        full = np.array([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
        body.inertia[:], body.iquat[:] = 0.0, (1.0, 0.0, 0.0, 0.0)
        body.fullinertia[:] = full.reshape(np.shape(body.fullinertia))
        body.explicitinertial = True

    return modify


def _joint_modifier(name: str, attribute: str) -> Callable[[Any, Any], None]:
    def modify(spec: Any, parameter: Any) -> None:
        joint, value = spec.joint(name), float(parameter.value[0])
        old = getattr(joint, attribute)
        setattr(joint, attribute, value if np.ndim(old) == 0 else [value, 0.0, 0.0])

    return modify


def _weighted(channels: tuple[str, ...]) -> Callable[..., Any]:
    """Errors over the standard deviations of their noise, for its ``modify_residual``."""
    n = len(TORQUE)
    noise = {"q": np.full(n, ENCODER), "dq": np.full(n, SPEED), "tau": TORQUE}
    std = np.concatenate([noise[own] for own in channels])
    columns = [n * ("q", "dq", "tau").index(own) + j for own in channels for j in range(n)]

    def residual(params, predicted, measured, model, return_all, **rest):
        return (measured.data - predicted.data)[:, columns] / std, predicted, measured

    return residual


class _Counted:
    """A residual that counts its rollouts and Jacobians."""

    def __init__(self, residual: Callable[..., Any]) -> None:
        self.residual, self.rollouts, self.jacobians = residual, 0, 0

    def __call__(self, x: np.ndarray, parameters: Any, **rest: Any) -> Any:
        columns = x.shape[1] if x.ndim > 1 else 1
        self.rollouts += columns
        self.jacobians += columns > 1
        return self.residual(x, parameters, **rest)


def bodies_in(model: Any, chain: Chain) -> Bodies:
    """The arm in a compiled model."""
    import mujoco

    index = [model.body(f"{name}_link").id for name in chain.joints]
    full = []
    for b in index:
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, model.body_iquat[b])
        axes = axes.reshape(3, 3)
        i = axes @ np.diag(model.body_inertia[b]) @ axes.T
        full.append([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
    return Bodies(
        chain, model.body_mass[index].copy(), model.body_ipos[index].copy(), np.array(full),
        model.dof_armature.copy(), model.dof_damping.copy(), model.dof_frictionloss.copy(),
    )  # fmt: skip
