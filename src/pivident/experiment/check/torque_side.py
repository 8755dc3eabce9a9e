"""Whether torques are those of motors or of sensors behind the gears, as the log shows it.

A motor moves its rotor and rubs in its drive as well as it moves the links; a sensor behind the
gear feels the links and their bearings alone. So a model with rotors and friction is fitted to
all joints together,

    τ_j = Φ_j(q, dq, ddq) θ + ia_j ddq_j + fv_j dq_j + fc_j s(dq_j) + off_j,

and two shares are taken of each joint: that of the rotor in all that the joint accelerates,
ia_j/M_jj(q), with M of the same estimate, and that of friction in the rms torque. Behind a gear the
rotor's share is a third to nearly all, without one it is zero. Standard errors are those of a
jackknife over stretches of time. The first joints of an arm say nothing about their rotors, which
turn like their links.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.data.logs.log import Log
from pivident.dynamics.forward import mass_matrix
from pivident.foundation.errors import PividentError
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.repair import setting
from pivident.judgement.audit.blocked_fit import jackknife
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import InverseModel, build_inverse_model
from pivident.judgement.audit.timing import Timing
from pivident.robot.description import Robot, TorqueSide
from pivident.robot.friction import DEFAULT_FRICTION

TORQUE_SIDE = FindingKind(Topic("scale"), "torque side", ("recording", "torque_side"))

#: Share of rotors, over all joints, that says that there are none …
NO_ROTORS = 0.05

#: … and that is more than what errors of the accelerations leave of none neither over all joints
#: by two standard errors nor in one by three, …
NOTHING = 0.01

#: … if in so many joints at least it is below this by two standard errors, …
FEWEST, MAX_SHARE = 2, 0.25

#: … and friction is less than this share of the rms torque in most joints, as no drive's is.
MAX_FRICTION = 0.6

#: Friction in the rms torque of so many joints that no drive with gears has.
NO_FRICTION = 0.03

#: Share of a joint's rotor that, by three standard errors, is there for certain.
MIN_SHARE = 0.1

#: Postures at which inertias are taken.
POSTURES = 50


@dataclass(frozen=True, eq=False)
class TorqueSideEvidence:
    """Shares of rotors and friction by joint, with standard errors; NaN where they are not known.

    The first of each is the estimate, shape (joints,); ``pooled`` is the share of rotors over all
    joints, weighted by their standard errors, and its own standard error.
    """

    joint_names: tuple[str, ...]
    rotor: np.ndarray
    rotor_errors: np.ndarray
    friction: np.ndarray
    pooled: tuple[float, float]

    @property
    def side(self) -> TorqueSide | Literal["unknown"]:
        """What the shares say."""
        without = int((self.rotor + 2.0 * self.rotor_errors < MAX_SHARE).sum())
        if len(self.with_rotor) > without:
            return "motor"
        share, error = self.pooled
        no_rotors = share + 2.0 * error < NO_ROTORS and share - 2.0 * error < NOTHING
        no_rotors = no_rotors and not (self.rotor - 3.0 * self.rotor_errors > NOTHING).any()
        little = np.nanmedian(self.friction) < MAX_FRICTION
        if no_rotors and without >= FEWEST and little:
            return "link"
        # the rotor of a joint that hardly carries anything is what noise makes of it: more joints
        # without friction outweigh it, if over all joints rotors are not what they would be
        free = int((self.friction < NO_FRICTION).sum())
        outweighs = free > len(self.with_rotor) and share + 2.0 * error < MAX_SHARE
        is_free = free >= FEWEST and (not self.with_rotor or outweighs)
        most = 2 * free > len(self.friction) and outweighs
        is_none = share - (3.0 if most else 2.0) * error < NOTHING
        return "link" if is_free and is_none else "unknown"

    @property
    def with_rotor(self) -> tuple[str, ...]:
        """Joints that certainly move a rotor."""
        certain = self.rotor - 3.0 * self.rotor_errors > MIN_SHARE
        return tuple(n for n, has in zip(self.joint_names, certain, strict=True) if has)

    def __str__(self) -> str:
        share, error = (100.0 * x for x in self.pooled)
        known = [
            f"{name} {plus_minus(100.0 * x, 200.0 * s)}"
            for name, x, s in zip(self.joint_names, self.rotor, self.rotor_errors, strict=True)
            if np.isfinite(x)
        ]
        low, high = 100.0 * np.nanmin(self.friction), 100.0 * np.nanmax(self.friction)
        return ", ".join(
            [
                *[
                    f"rotors take {plus_minus(share, 2.0 * error)} % of what the joints accelerate "
                    f"({', '.join(known)})"
                ]
                * bool(known),
                f"friction takes {low:.2g} to {high:.2g} % of their rms torques",
            ]
        )


def torque_side_evidence(log: Log, timing: Timing, model: InverseModel) -> TorqueSideEvidence:
    """Fit rotors and friction of all joints.

    ``model``: the rows of the log that were compared before, with the faults found made good.
    """
    if not _has_rotors_and_friction(model.robot):
        robot = replace(model.robot, torque_side="motor", couplings=(), friction_nominal={})
        robot = robot.with_friction(DEFAULT_FRICTION)
        model = replace(build_inverse_model(replace(log, robot=robot), timing), shift=model.shift)
    robot, parameters = model.robot, model.base.parameters
    estimates = _replicates(model)
    postures = model.q[np.linspace(0, len(model.q) - 1, POSTURES).astype(int)]
    rotor = np.full((len(estimates), robot.size), np.nan)
    places = [(robot.places.index(p.joint), k) for k, p in enumerate(parameters) if p.stem == "ia"]
    for theta, shares in zip(estimates, rotor, strict=True):
        inertia = mass_matrix(robot, parameters, theta, postures).mean(axis=0).diagonal()
        for joint, k in places:
            shares[joint] = theta[k] / inertia[joint] if inertia[joint] else np.nan
    errors = jackknife(rotor[1:])
    weights = np.nan_to_num(1.0 / np.maximum(errors, 1e-6) ** 2)
    total = max(float(weights.sum()), 1e-300)
    pooled = np.nan_to_num(rotor) @ weights / total
    return TorqueSideEvidence(
        robot.joint_names,
        rotor[0],
        errors,
        _friction_shares(model, estimates[0]),
        (float(pooled[0]), float(jackknife(pooled[1:, None])[0])) if places else (np.nan, np.nan),
    )


@dataclass(frozen=True)
class TorqueSideCheck(LogCheck):
    """The declared side of the torques.

    Attributes:
        declared: ``motor`` or ``link``.
    """

    name = "torque side"
    declared: TorqueSide

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        findings = check_torque_side(seen.log, seen.timing, seen.model, self.declared)
        return seen.after(self.name, findings)


def check_torque_side(
    log: Log, timing: Timing, model: InverseModel, declared: TorqueSide
) -> list[Finding]:
    """A declared side that the log contradicts."""
    try:
        found = torque_side_evidence(log, timing, model)
    except (PividentError, np.linalg.LinAlgError):
        return []
    if found.side in (declared, "unknown"):
        return []
    share, error = (100.0 * x for x in found.pooled)
    interval = (share - 2.0 * error, share + 2.0 * error)
    evidence = {"rotors": Quantity(share, "%", interval=interval)}
    if declared == "motor":
        text = f"The torques seem to be those of sensors behind the gears: {found}."
        step = (
            'If they are, set torque_side = "link" under [recording]; rotors and friction of the '
            "drives are then no part of the model."
        )
        words = 'Declare what the torque measures: torque_side = "link".'
        repairs = [setting("torque_side", value="link", words=words)]
        return [TORQUE_SIDE.finding("warning", text, "", step, evidence, repairs=repairs)]
    text = (
        'torque_side = "link" says that the torques are those of sensors behind the gears, but '
        f"these move the rotors of {', '.join(found.with_rotor)}: {found}."
    )
    step = 'They seem to be torques of the motors: remove torque_side = "link".'
    repairs = [setting("torque_side")]
    return [TORQUE_SIDE.finding("error", text, "", step, evidence, repairs=repairs)]


def _has_rotors_and_friction(robot: Robot) -> bool:
    """Whether a model holds what is looked for, and no more than that."""
    laws = ({term.stem for term in joint.friction.terms} for joint in robot.joints)
    usual = all({"fv", "fc"} <= stems <= {"fv", "fc", "off"} for stems in laws)
    return robot.torque_side == "motor" and not robot.couplings and usual


def _replicates(model: InverseModel) -> np.ndarray:
    """θ of all joints' rows, then without each stretch of time, shape (1 + stretches, base).

    A joint's rows weigh as its own equation fits.
    """
    tau, size = model.tau(), len(model.base)
    stretches = np.unique(model.block)
    gram, right = np.zeros((len(stretches), size, size)), np.zeros((len(stretches), size))
    for j, own in enumerate(model.own):
        rows = model.moving[:, j]
        basis, y, block = model.bases[j], tau[rows, j], model.block[rows]
        rest = y - basis @ (basis.T @ y)
        scale = 1.0 / max(float(np.sqrt(np.mean(rest**2))), 1e-12) if y.size else 0.0
        columns, y = scale * model.columns[j][rows], scale * y
        for k, stretch in enumerate(stretches):
            part = block == stretch
            gram[k][np.ix_(own, own)] += columns[part].T @ columns[part]
            right[k, own] += columns[part].T @ y[part]
    unit = 1.0 / np.sqrt(np.maximum(gram.sum(axis=0).diagonal(), 1e-300))
    gram, right = gram * np.outer(unit, unit), right * unit
    whole, sums = gram.sum(axis=0), right.sum(axis=0)
    systems = [(whole, sums), *((whole - g, sums - r) for g, r in zip(gram, right, strict=True))]
    return np.array([unit * np.linalg.lstsq(g, r, rcond=1e-12)[0] for g, r in systems])


def _friction_shares(model: InverseModel, theta: np.ndarray) -> np.ndarray:
    """Rms of each joint's friction over that of its torque, shape (joints,); NaN without motion."""
    parameters, tau = model.base.parameters, model.tau()
    shares = np.full(model.robot.size, np.nan)
    for j, own in enumerate(model.own):
        rows = model.moving[:, j]
        terms = [
            k
            for k, index in enumerate(own)
            if (law := parameters[index].friction) is not None and law.is_dissipative
        ]
        if rows.any():
            friction = model.columns[j][rows][:, terms] @ theta[own[terms]]
            size = max(float(np.linalg.norm(tau[rows, j])), 1e-300)
            shares[j] = float(np.linalg.norm(friction)) / size
    return shares
