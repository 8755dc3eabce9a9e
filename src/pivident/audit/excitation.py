"""What the motion excites: rank and condition, weak parameters, and the motion they would need.

W stacks the equations of all joints, each divided by its residual, with columns scaled to unit
length. With σ_k the standard error that a parameter would have, and φ_k its column in motions
that use all of the robot's limits, rms(φ_k) σ_k is the torque that nobody could predict because of
it. A parameter is weak if that is a large share of the torque.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.audit.inverse_model import OVERSAMPLING, InverseModel
from pivident.dynamics.parameters import Parameter, nominal_values
from pivident.motion.wanted_motion import FullMotion, MotionLimits, motions_for
from pivident.text.finding import Finding, Quantity, Severity

#: Singular values below this, relative to the largest one, count as zero.
RANK = 1e-6

#: Condition of the scaled matrix above which errors of the model are magnified too much.
CONDITION = 1e4

#: Share of the torque in full motion that one parameter may leave open.
WEAK = 0.2

#: Share of a column in full motion below which the parameter was hardly excited.
UNUSED = 2e-3


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
    motion = (np.concatenate([getattr(m, name) for m in models]) for name in ("q", "dq", "ddq"))
    limits = MotionLimits.of(models[0].robot, *motion)
    motions = FullMotion.within(models[0].robot, limits)
    full, needed = _sizes(models[0], motions, theta)
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
        limits.used,
    )

    def advice(parameters: Sequence[Parameter]) -> list[str]:
        wanted = [str(motion) for motion in motions_for(parameters, motions, limits)]
        return [f"{text[0].upper()}{text[1:]}." for text in wanted]

    unseen = _sparse(vectors[:, ~seen])
    return replace(found, findings=tuple(_findings(models, found, unseen, advice)))


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


def _sizes(
    model: InverseModel, motions: FullMotion, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rms in motions within all limits: of each column, and of each joint's torque."""
    base = model.base
    full, described = (
        motions.columns(base.parameters),
        base.values(nominal_values(model.robot, base.standard)),
    )
    # Of fit and description the smaller: neither can be trusted where the motion is poor.
    torques = full @ np.column_stack([theta, described])
    columns = np.sqrt(np.mean(full**2, axis=0).max(axis=0))
    return columns, np.sqrt(np.mean(torques**2, axis=0)).min(axis=1)


def _findings(
    models: Sequence[InverseModel],
    found: Excitation,
    unseen: list[np.ndarray],
    advice: Callable[[Sequence[Parameter]], list[str]],
) -> list[Finding]:
    """Rank, directions that were not seen, weak parameters and the use of the limits.

    ``advice``: gives the motion that each of some parameters would need.
    """
    model, names, parameters = models[0], found.names, models[0].base.parameters
    rank, condition = found.rank, found.condition
    open_torque, used = found.open_torque, found.used
    who = "The motion separates"
    if len(models) > 1:
        who = f"The motions of all {len(models)} recordings together separate"
    text = f"{who} {rank} of {len(names)} base parameters; condition {condition:.4g}."
    bad = rank < len(names)
    severity: Severity = "error" if bad else "warning" if condition > CONDITION else "ok"
    named = {k for vector in unseen for k in np.flatnonzero(np.abs(vector) > 0.3)}
    weak = (open_torque > WEAK) | (used < UNUSED)
    chosen = [int(k) for k in np.argsort(-open_torque) if weak[k] and k not in named]
    step = ""
    if severity != "ok":
        more = "Add motions as below" if unseen or chosen else "Let `pivident excite` add a motion"
        step = f"{more}, or name fewer parameters under [identify]."
    evidence = {"condition": Quantity(condition, bound=CONDITION)}
    findings = [Finding(severity, "excitation", "rank", text, next_step=step, evidence=evidence)]
    groups = [_largest(vector) for vector in unseen]
    steps = advice([parameters[group[0]] for group in groups])
    for group, step in zip(groups, steps, strict=True):
        listed = ", ".join(names[k] for k in group)
        kind, words = "inseparable", f"{listed} cannot be separated"
        if len(group) == 1:
            kind, words = "no effect", f"{listed} has no effect"
        findings.append(
            Finding("error", "excitation", kind, f"{words} in this motion.", listed, step)
        )
    for k, step in zip(chosen, advice([parameters[k] for k in chosen]), strict=True):
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
                step,
                evidence={"open torque": Quantity(share, "%", bound=100 * WEAK)},
            )
        )
    for j, joint in enumerate(model.robot.joints):
        shares = ", ".join(
            f"{100 * r:.3g} % of its {what}"
            for r, what in zip(
                found.ranges[j], ("range", "rated speed", "usual acceleration"), strict=True
            )
        )
        findings.append(
            Finding("ok", "excitation", "used", f"{joint.name} uses {shares}.", joint.name)
        )
    return findings


def _largest(vector: np.ndarray) -> list[int]:
    """At most four parameters that a direction is made of above all, the largest one first."""
    size = np.abs(vector)
    return [int(k) for k in np.argsort(-size)[:4] if size[k] > 0.3 * size.max()]
