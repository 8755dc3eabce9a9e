"""What the motion excites: rank and condition, weak parameters, and the motion they would need.

W stacks the equations of all joints, each divided by its residual, with columns scaled to unit
length. With σ_k the standard error that a parameter would have, and φ_k its column in motions
that use all of the robot's limits, rms(φ_k) σ_k is the torque that nobody could predict because of
it. A parameter is weak if that is a large share of the torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.audit.inverse_model import OVERSAMPLING, InverseModel
from pivident.dynamics.parameters import Parameter, nominal_values
from pivident.dynamics.robot_regressor import closing_states, moving_joints, regressor_of
from pivident.text.finding import Finding, Quantity, Severity

#: Singular values below this, relative to the largest one, count as zero.
RANK = 1e-6

#: Condition of the scaled matrix above which errors of the model are magnified too much.
CONDITION = 1e4

#: Share of the torque in full motion that one parameter may leave open.
WEAK = 0.2

#: Share of a column in full motion below which the parameter was hardly excited.
UNUSED = 2e-3

#: Time in which a joint reaches its rated speed, for want of a rated acceleration [s].
RISE = 0.15

#: Use of a joint's range below which more of it is recommended.
LITTLE = 0.5

QUANTITIES = ("posture", "speed", "acceleration")


@dataclass(frozen=True, eq=False)
class Excitation:
    """How well a motion determines the base parameters."""

    findings: tuple[Finding, ...]
    names: tuple[str, ...]  # of the base parameters
    rank: int  # numerical rank of the scaled observation matrix
    condition: float
    singular_values: np.ndarray  # relative to the largest one
    open_torque: np.ndarray  # share of the torque in full motion that each parameter leaves open
    used: np.ndarray  # share of its column in full motion that the log has, by parameter
    ranges: np.ndarray  # used of position range, speed, acceleration, (joints, 3)


def check_excitation(models: Sequence[InverseModel]) -> Excitation:
    """Judge the motion of one log, or of several that are identified together."""
    base = models[0].base
    size = len(base)
    gram, right, rows = np.zeros((size, size)), np.zeros(size), 0
    torque, noise = np.full(size, 1e-12), np.full(size, np.inf)
    for model in models:
        rows += _add_equations(model, gram, right, torque, noise)
    length = np.sqrt(np.diag(gram))
    scale = 1.0 / np.where(length > 0, length, 1.0)
    values, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    singular = np.sqrt(np.clip(values, 0.0, None))
    largest = singular[-1] if singular[-1] > 0 else 1.0
    seen = singular > RANK * largest
    condition = float(largest / singular[seen][0]) if seen.any() else np.inf
    inverse = (vectors[:, seen] / singular[seen]) ** 2
    # Rows follow each other faster than the band has new values.
    standard_error = np.sqrt(inverse.sum(axis=1) * OVERSAMPLING / 2.0) * scale
    standard_error[length == 0] = np.inf
    theta = scale * (vectors[:, seen] @ ((vectors[:, seen].T @ (scale * right)) / values[seen]))
    full, parts, needed = _full_motion(models, theta)
    for own, most in zip(models[0].own, needed, strict=True):
        torque[own] = np.maximum(torque[own], most)
    found = Excitation(
        (),
        base.names,
        int(seen.sum()),
        condition,
        singular[::-1] / largest,
        standard_error * full / torque,
        length / np.sqrt(max(rows, 1)) / np.maximum(full / noise, 1e-300),
        _ranges(models),
    )
    unseen = _sparse(vectors[:, ~seen])
    return replace(found, findings=tuple(_findings(models, found, unseen, parts)))


def _sparse(null: np.ndarray) -> list[np.ndarray]:
    """A basis of the unseen directions with few parameters in each: one belongs to it alone."""
    from scipy.linalg import qr

    if not null.shape[1]:
        return []
    pivots = qr(null.T, pivoting=True, mode="r")[1][: null.shape[1]]
    return list(np.linalg.solve(null[pivots].T, null.T))


def _noise(model: InverseModel) -> np.ndarray:
    """Residual of each joint's own equation [N m or N]."""
    tau = model.tau()
    size = np.sqrt(np.mean(tau**2, axis=0))
    errors = np.where(np.isfinite(model.relative_errors), model.relative_errors, 1.0)
    return np.maximum(size * np.maximum(errors, 1e-6), 1e-12)


def _add_equations(
    model: InverseModel, gram: np.ndarray, right: np.ndarray, torque: np.ndarray, noise: np.ndarray
) -> int:
    """Add the weighted equations of one log to WᵀW and Wᵀτ; gram (parameters, parameters)."""
    residual, rows, tau = _noise(model), 0, model.tau()
    size = np.sqrt(np.mean(tau**2, axis=0))
    for j, columns in enumerate(model.columns):
        moving = columns[model.moving[:, j]] / residual[j]
        own = model.own[j]
        gram[np.ix_(own, own)] += moving.T @ moving
        torque[own] = np.maximum(torque[own], size[j])
        right[own] += moving.T @ (tau[model.moving[:, j], j] / residual[j])
        noise[own] = np.minimum(noise[own], residual[j])
        rows = max(rows, len(moving))
    return rows


def _full_motion(models: Sequence[InverseModel], theta: np.ndarray) -> tuple[np.ndarray, ...]:
    """Rms in motions within all limits: of each column, of its three parts, and of each torque."""
    robot, positions = models[0].robot, np.concatenate([model.q for model in models])
    rng = np.random.default_rng(1988)
    low, high = np.array(
        [
            j.position_limits or (float(q.min()) - 0.5, float(q.max()) + 0.5)
            for j, q in zip(robot.joints, positions.T, strict=True)
        ]
    ).T
    speed = _top_speed(models)
    samples = 400
    q = rng.uniform(low, high, (samples, robot.size))
    dq = rng.uniform(-speed, speed, (samples, robot.size))
    ddq = rng.uniform(-speed, speed, (samples, robot.size)) / RISE
    q, dq, ddq = closing_states(robot, q, dq, ddq)
    still = np.zeros_like(q)
    regressor = regressor_of(robot, models[0].base.parameters)

    def rms(phi: np.ndarray) -> np.ndarray:
        return np.sqrt(np.mean(phi**2, axis=0).max(axis=0))

    # friction with memory or load shows in steady motion, not at random states
    level, none = regressor.levels(dq.T), regressor.levels(still.T)
    rest = regressor.matrix(q, still, still, inner=none)
    parts = np.column_stack(
        [
            rms(rest - rest.mean(axis=0)),
            rms(regressor.matrix(q, dq, still, inner=level) - rest),
            rms(regressor.matrix(q, still, ddq, inner=none) - rest),
        ]
    )
    full, base = regressor.matrix(q, dq, ddq, inner=level), models[0].base
    described = base.values(nominal_values(robot, base.standard))
    # Of fit and description the smaller: neither can be trusted where the motion is poor.
    torques = full @ np.column_stack([theta, described])
    return rms(full), parts, np.sqrt(np.mean(torques**2, axis=0)).min(axis=1)


def _top_speed(models: Sequence[InverseModel]) -> np.ndarray:
    """Rated speeds; the fastest motion where one is not known."""
    rated = models[0].robot.rated_speeds
    fastest = np.max([np.abs(model.dq).max(axis=0) for model in models], axis=0)
    speed = np.where(np.isfinite(rated), rated, fastest)
    return np.where(speed > 0, speed, 1.0)


def _ranges(models: Sequence[InverseModel]) -> np.ndarray:
    """Share of the limits that the motion used, shape (joints, 3)."""
    speed = _top_speed(models)
    span = [
        np.ptp(joint.position_limits)
        if joint.position_limits
        else (np.pi if joint.kind == "revolute" else 1.0)
        for joint in models[0].robot.joints
    ]
    q, dq, ddq = (np.concatenate([getattr(m, n) for m in models]) for n in ("q", "dq", "ddq"))
    return np.column_stack(
        [
            np.ptp(q, axis=0) / np.array(span),
            np.abs(dq).max(axis=0) / speed,
            np.abs(ddq).max(axis=0) / (speed / RISE),
        ]
    )


def _findings(
    models: Sequence[InverseModel], found: Excitation, unseen: list[np.ndarray], parts: np.ndarray
) -> list[Finding]:
    """Rank, directions that were not seen, weak parameters and the use of the limits."""
    model, names, parameters = models[0], found.names, models[0].base.parameters
    rank, condition, ranges = found.rank, found.condition, found.ranges
    open_torque, used = found.open_torque, found.used
    who = "The motion separates"
    if len(models) > 1:
        who = f"The motions of all {len(models)} recordings together separate"
    text = f"{who} {rank} of {len(names)} base parameters; condition {condition:.4g}."
    bad = rank < len(names)
    severity: Severity = "error" if bad else "warning" if condition > CONDITION else "ok"
    step = ""
    if severity != "ok":
        step = "Add motions as below, or name fewer parameters under [identify]."
    evidence = {"condition": Quantity(condition, bound=CONDITION)}
    findings = [Finding(severity, "excitation", "rank", text, next_step=step, evidence=evidence)]
    for vector in unseen:
        first = np.argsort(-np.abs(vector))[:4]
        group = [int(k) for k in first if abs(vector[k]) > 0.3 * np.abs(vector).max()]
        listed = ", ".join(names[k] for k in group)
        kind, words = "inseparable", f"{listed} cannot be separated"
        if len(group) == 1:
            kind, words = "no effect", f"{listed} has no effect"
        advice = _motion(model, parameters[group[0]], parts[group[0]], ranges)
        findings.append(
            Finding("error", "excitation", kind, f"{words} in this motion.", listed, advice)
        )
    named = {k for vector in unseen for k in np.flatnonzero(np.abs(vector) > 0.3)}
    for k in np.argsort(-open_torque):
        if k in named or not (open_torque[k] > WEAK or used[k] < UNUSED):
            continue
        share = 100 * float(open_torque[k])
        findings.append(
            Finding(
                "warning" if open_torque[k] > WEAK else "ok",
                "excitation",
                "weak",
                f"{names[k]} is poorly excited: it alone leaves {share:.3g} % of the torque of "
                f"full motion undetermined; its column in the log is {100 * used[k]:.2g} % of that "
                "in full motion.",
                names[k],
                _motion(model, parameters[k], parts[k], ranges),
                evidence={"open torque": Quantity(share, "%", bound=100 * WEAK)},
            )
        )
    for j, joint in enumerate(model.robot.joints):
        shares = ", ".join(
            f"{100 * r:.3g} % of its {what}"
            for r, what in zip(
                ranges[j], ("range", "rated speed", "usual acceleration"), strict=True
            )
        )
        findings.append(
            Finding("ok", "excitation", "used", f"{joint.name} uses {shares}.", joint.name)
        )
    return findings


def _motion(
    model: InverseModel, parameter: Parameter, parts: np.ndarray, ranges: np.ndarray
) -> str:
    """The motion in which a parameter acts most, and the joints that have room for it."""
    joints = moving_joints(model.robot, parameter)
    own = [j for j, place in enumerate(model.robot.places) if place == parameter.joint]
    quantity = int(np.argmax(parts))
    lazy = [j for j in joints if ranges[j, quantity] < LITTLE] or own or joints
    names = ", ".join(model.robot.joints[j].name for j in lazy)
    if parameter.friction is not None and parameter.friction.depends_on_position:
        return f"Move {names} slowly through more of its range."
    return {
        "posture": f"Let {names} hold more postures against gravity, with slow moves between them.",
        "speed": f"Move {names} faster, in both directions, together with the preceding joints.",
        "acceleration": f"Accelerate {names} harder, in different postures.",
    }[QUANTITIES[quantity]]
