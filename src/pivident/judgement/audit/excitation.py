"""What the motion excites: rank and condition, weak parameters, and the motion they would need.

W stacks the equations of all joints, each divided by its residual, with columns scaled to unit
length. With σ_k the standard error that a parameter would have, and φ_k its column in motions
that use all of the robot's limits, rms(φ_k) σ_k is the torque that nobody could predict because of
it. A parameter is weak if that is a large share of the torque.

Before that: joints whose torque no parameters explain, whatever the motion excites.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.parameters import Parameter, nominal_values
from pivident.dynamics.separation import LeftOut, left_out, preferred, sentence
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, Topic
from pivident.foundation.text.sentences import capital
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import OVERSAMPLING, InverseModel
from pivident.loop.motion.wanted_motion import FullMotion, MotionLimits, motions_for

#: What this check looks at, and where the parameters are chosen.
EXCITATION, CHOICE = Topic("excitation", "Excitation"), ("identify", "parameters")

RANK = FindingKind(EXCITATION, "rank", CHOICE)
WEAK_PARAMETER = FindingKind(EXCITATION, "weak", CHOICE)
USED = FindingKind(EXCITATION, "used", CHOICE)
UNEXPLAINED_TORQUE = FindingKind(Topic("model", "Inverse model"), "unexplained", ("robot",))

#: Share of a joint's torque that its inverse model may leave unexplained.
UNEXPLAINED = 0.5

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


class ExcitationCheck(LogCheck):
    """What the motion tells about the parameters."""

    name = "excitation"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        excitation = check_excitation([seen.model])
        return seen.after(self.name, excitation.findings, excitation)


def check_excitation(models: Sequence[InverseModel]) -> Excitation:
    """Judge the motion of one log, or of several that are identified together."""
    base = models[0].base
    size = len(base)
    gram, right, rows = np.zeros((size, size)), np.zeros(size), 0
    torque, noise, square = np.full(size, 1e-12), np.full(size, np.inf), np.zeros(size)
    for model in models:
        rows += _add_equations(model, gram, right, torque, noise, square)
    length = np.sqrt(np.diag(gram))
    scale = 1.0 / np.where(length > 0, length, 1.0)
    gram *= np.outer(scale, scale)
    order = preferred(base, range(size))
    out = left_out(gram, np.sqrt(square), order)
    kept = np.setdiff1d(np.arange(size), list(out))
    values, vectors = np.linalg.eigh(gram[np.ix_(kept, kept)])
    values = np.maximum(values, 1e-300)
    # Rows follow each other faster than the band has new values.
    error = np.sqrt((vectors**2 / values).sum(axis=1) * OVERSAMPLING / 2.0)
    standard_error, theta = np.full(size, np.inf), np.zeros(size)
    standard_error[kept] = error * scale[kept]
    theta[kept] = scale[kept] * (vectors @ (vectors.T @ (scale * right)[kept] / values))
    singular = np.sqrt(np.clip(np.linalg.eigvalsh(gram), 0.0, None))
    motion = (np.concatenate([getattr(m, name) for m in models]) for name in ("q", "dq", "ddq"))
    limits = MotionLimits.of(models[0].robot, *motion)
    motions = FullMotion.within(models[0].robot, limits)
    full, needed, never = _in_full_motion(models[0], motions, theta, order)
    for own, most in zip(models[0].own, needed, strict=True):
        torque[own] = np.maximum(torque[own], most)
    found = Excitation(
        (),
        base.names,
        len(kept),
        float(np.sqrt(values[-1] / values[0])) if kept.size else np.inf,
        singular[::-1] / (singular[-1] or 1.0),
        standard_error * full / torque,
        length / np.sqrt(max(rows, 1)) / np.maximum(full / noise, 1e-300),
        limits.used,
    )

    def advice(parameters: Sequence[Parameter]) -> list[str]:
        wanted = [str(motion) for motion in motions_for(parameters, motions, limits)]
        return [f"{capital(text)}." for text in wanted]

    step = ""
    if out:
        possible = [base.parameters[k] for k in out if k not in never]
        step = " ".join(dict.fromkeys(advice(possible)))
        lost = [found.names[k] for k in out if k in never]
        if lost:
            step += f" No motion within the robot's limits separates {', '.join(lost)}."
    return replace(found, findings=tuple(_findings(models, found, out, step.strip(), advice)))


def _noise(model: InverseModel) -> np.ndarray:
    """Residual of each joint's own equation [N m or N]."""
    tau = model.tau()
    size = np.sqrt(np.mean(tau**2, axis=0))
    errors = np.where(np.isfinite(model.relative_errors), model.relative_errors, 1.0)
    return np.maximum(size * np.maximum(errors, 1e-6), 1e-12)


def _add_equations(
    model: InverseModel,
    gram: np.ndarray,
    right: np.ndarray,
    torque: np.ndarray,
    noise: np.ndarray,
    square: np.ndarray,
) -> int:
    """Add the weighted equations of one log to WᵀW and Wᵀτ; gram (parameters, parameters).

    ``square``: of the torque that each parameter acts on, in residuals, shape (parameters,).
    """
    residual, rows, tau = _noise(model), 0, model.tau()
    size = np.sqrt(np.mean(tau**2, axis=0))
    for j, columns in enumerate(model.columns):
        moving = columns[model.moving[:, j]] / residual[j]
        own = model.own[j]
        gram[np.ix_(own, own)] += moving.T @ moving
        torque[own] = np.maximum(torque[own], size[j])
        square[own] += np.sum((tau[model.moving[:, j], j] / residual[j]) ** 2)
        right[own] += moving.T @ (tau[model.moving[:, j], j] / residual[j])
        noise[own] = np.minimum(noise[own], residual[j])
        rows = max(rows, len(moving))
    return rows


def _in_full_motion(
    model: InverseModel, motions: FullMotion, theta: np.ndarray, order: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, set[int]]:
    """In motions within all limits the rms of each column and of each joint's torque.

    Also the parameters that are not separated there either.
    """
    base, residual = model.base, _noise(model)
    full, described = (
        motions.columns(base.parameters),
        base.values(nominal_values(model.robot, base.standard)),
    )
    # Of fit and description the smaller: neither can be trusted where the motion is poor.
    torques = full @ np.column_stack([theta, described])
    columns = np.sqrt(np.mean(full**2, axis=0).max(axis=0))
    needed = np.sqrt(np.mean(torques**2, axis=0)).min(axis=1)
    rows = (full / residual[:, None]).reshape(-1, len(base))
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    acts = (full != 0.0).any(axis=0)
    torque = np.sqrt(len(full) * ((needed / residual) ** 2) @ acts)
    return columns, needed, set(left_out(rows.T @ rows, torque, order))


def _findings(
    models: Sequence[InverseModel],
    found: Excitation,
    out: LeftOut,
    separating: str,
    advice: Callable[[Sequence[Parameter]], list[str]],
) -> list[Finding]:
    """Rank, parameters that are not separated, weak ones and the use of the limits.

    ``out``: what is left out; ``separating``: what would separate it; ``advice``: gives the motion
    that each of some parameters would need.
    """
    model, names, parameters = models[0], found.names, models[0].base.parameters
    rank, condition = found.rank, found.condition
    open_torque, used = found.open_torque, found.used
    who = "The motion separates"
    if len(models) > 1:
        who = f"The motions of all {len(models)} recordings together separate"
    text = f"{who} {rank} of {len(names)} base parameters; condition {condition:.4g}."
    severity: Severity = "warning" if condition > CONDITION else "ok"
    weak = (open_torque > WEAK) | (used < UNUSED)
    chosen = [int(k) for k in np.argsort(-open_torque) if weak[k] and k not in out]
    step = ""
    if severity != "ok":
        more = "Add motions as below" if chosen else "Let `pivident excite` add a motion"
        step = f"{more}, or name fewer parameters under [identify]."
    evidence = {"condition": Quantity(condition, bound=CONDITION)}
    findings = [RANK.finding(severity, text, "", step, evidence)]
    if out:
        findings = [replace(sentence(out, names, separating), topic=EXCITATION.name, place=CHOICE)]
    for k, step in zip(chosen, advice([parameters[k] for k in chosen]), strict=True):
        share = 100 * float(open_torque[k])
        findings.append(
            WEAK_PARAMETER.finding(
                "warning" if open_torque[k] > WEAK else "ok",
                f"{names[k]} is poorly excited: it alone leaves {share:.3g} % of the torque of "
                f"full motion undetermined; its column in the log is {100 * used[k]:.2g} % of that "
                "in full motion.",
                names[k],
                step,
                {"open torque": Quantity(share, "%", bound=100 * WEAK)},
            )
        )
    for j, joint in enumerate(model.robot.joints):
        shares = ", ".join(
            f"{100 * r:.3g} % of its {what}"
            for r, what in zip(
                found.ranges[j], ("range", "rated speed", "usual acceleration"), strict=True
            )
        )
        findings.append(USED.finding("ok", f"{joint.name} uses {shares}.", joint.name))
    return findings


class UnexplainedCheck(LogCheck):
    """The share of each torque that no parameters explain."""

    name = "model"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        return seen.after(self.name, check_unexplained(seen.model))


def check_unexplained(model: InverseModel) -> Iterator[Finding]:
    """Joints whose torque the inverse model does not explain."""
    for joint, error in zip(model.robot.joints, model.relative_errors, strict=True):
        if not error <= UNEXPLAINED:
            share = "nothing" if not np.isfinite(error) else f"{100 * (1 - error):.3g} %"
            text = f"The inverse model explains {share} of the torque of {joint.name}."
            step = "Check the column, the geometry and the friction law of this joint."
            evidence = {"unexplained": Quantity(100 * float(error), "%", bound=100 * UNEXPLAINED)}
            yield UNEXPLAINED_TORQUE.finding("warning", text, joint.name, step, evidence)
