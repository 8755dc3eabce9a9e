"""The friction of all joints of a record: torque, functions, maps and findings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.studies.friction.effects import FrictionFinding, findings
from pivident.studies.friction.friction_map import (
    FrictionMap,
    FrictionPlane,
    friction_map,
    friction_plane,
)
from pivident.studies.friction.friction_torque import FrictionTorque, friction_torques
from pivident.studies.friction.held_out_friction import HeldOut, constant_law_error, held_out_error
from pivident.studies.friction.ripple_lines import Ripple
from pivident.studies.friction.state_dependent import (
    StateDependence,
    StateDependentFit,
    fit_state_dependent,
)

#: Smallest bandwidths of the functions of speed and load, as shares of their ranges.
OF_SPEED, OF_LOAD = 0.03, 0.05

#: Noise-to-variance ratio of a straight line.
STRAIGHT = 1e-8

#: Points of the function of position, which may repeat many times over its range.
POINTS_OF_POSITION = 121


@dataclass(frozen=True, eq=False)
class JointFriction:
    """The friction of one joint."""

    torque: FrictionTorque  # its friction torque with states
    # functions of speed (``positive``, ``negative``), ``position``, ``load``, ``time``
    fit: StateDependentFit
    held_out: HeldOut  # their errors on held-out motion
    # binned maps by state; friction against the motion and in each direction, after subtracting
    # the other functions
    maps: dict[str, FrictionMap]
    plane: FrictionPlane  # residual of the functions of speed, over speed and position
    findings: tuple[FrictionFinding, ...]

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.torque.name


@dataclass(frozen=True, eq=False)
class FrictionStudy(Displayed):
    """The friction of a record.

    Attributes:
        robot: name of the robot.
        method: estimate whose rigid part was taken off.
        recordings: names of the recordings.
        joints: the joints that could be examined.
        left_out: why others could not, by joint.
        ripple: lines over position, where they were searched.
    """

    robot: str  # name of the robot
    method: str  # estimate whose rigid part was subtracted
    recordings: tuple[str, ...]  # names of the recordings
    joints: tuple[JointFriction, ...]  # joints with enough motion
    left_out: dict[str, str]  # reason for each other joint
    ripple: Ripple | None = None  # lines over position, if searched for


def study_friction(
    problem: Problem,
    identification: Identification,
    *,
    standstill: float | None = None,
    bins: int = 24,
    progress: Callable[[str], None] | None = None,
) -> FrictionStudy:
    """Estimate the friction of every joint as functions, before a law is chosen for it.

    Args:
        problem: the problem that was identified.
        identification: an estimate by any method; its rigid part is subtracted.
        standstill: share of the rated speed that counts as standstill; None: 1 %.
        bins: number of bins of every map.
        progress: called with one line for each joint.

    Returns:
        Maps of friction over speed, position and load for each joint, with their findings.

    Raises:
        IdentificationError: no joint moves enough.
    """
    say = progress or (lambda line: None)
    joints, left_out = [], {}
    for torque in friction_torques(problem, identification, standstill):
        say(f"friction of {torque.name}")
        try:
            joints.append(joint_friction(torque, bins))
        except IdentificationError as error:
            left_out[torque.name] = str(error)
    if not joints:
        name, reason = next(iter(left_out.items()))
        raise IdentificationError(
            "no joint's friction can be estimated", advice=f"{name}: {reason}"
        )
    return FrictionStudy(
        robot=problem.robot.name,
        method=identification.method,
        recordings=tuple(r.name for r in problem.recordings),
        joints=tuple(joints),
        left_out=left_out,
    )


def friction_terms(torque: FrictionTorque) -> list[StateDependence]:
    """The model of a joint's friction torque.

        τ_f = p₊(|dq|) [dq > 0] + p₋(|dq|) [dq < 0] + p₂(q) + p₃(load) sign(dq) + p₄(t) sign(dq)

    with a straight line over time: a free function of time would fit any error correlated in time.
    Terms whose state does not vary, and directions in which the joint never moves, are left out.
    """
    d, speed = torque.direction, np.abs(torque.dq)
    one = np.where(torque.moving, 1.0, 0.0)
    terms = [
        StateDependence("positive", speed, np.where(d > 0, 1.0, 0.0), narrowest=OF_SPEED),
        StateDependence("negative", speed, np.where(d < 0, 1.0, 0.0), narrowest=OF_SPEED),
        StateDependence("position", torque.q, one, centred=True, points=POINTS_OF_POSITION),
    ]
    loaded = float(np.std(torque.load[torque.moving])) if torque.moving.any() else 0.0
    if loaded > 1e-9 * max(torque.level, 1e-300):
        terms.append(StateDependence("load", torque.load, d, centred=True, narrowest=OF_LOAD))
    terms.append(StateDependence("time", elapsed(torque), d, nvr=STRAIGHT, centred=True, points=11))
    return terms


def joint_friction(torque: FrictionTorque, bins: int = 24) -> JointFriction:
    """Functions, maps and findings of one joint."""
    for sign, words in ((1.0, "forwards"), (-1.0, "backwards")):
        if not (torque.direction == sign).any():
            raise IdentificationError(
                f"{torque.name} never moves {words} faster than {torque.standstill:.3g} "
                f"{torque.position_unit}/s: use a record that moves it both ways"
            )
    terms = friction_terms(torque)
    fit = fit_state_dependent(
        torque.tau,
        terms,
        used=torque.moving,
        record=torque.record,
        expected=torque.tau - torque.law,
    )
    held_out = _held_out(torque, terms, fit)
    residual = np.where(torque.moving, fit.residual, 0.0)
    return JointFriction(
        torque=torque,
        fit=fit,
        held_out=held_out,
        maps=_maps(torque, fit, residual, bins),
        plane=_plane(torque, fit, residual),
        findings=findings(torque, fit, held_out),
    )


def _held_out(
    torque: FrictionTorque, terms: list[StateDependence], fit: StateDependentFit
) -> HeldOut:
    """Errors with and without each term."""
    speed = [t for t in terms if not t.centred]
    others = [t.name for t in terms if t.centred]
    by_term = {
        name: held_out_error(torque, [t for t in terms if t.name != name], fit) for name in others
    }
    return HeldOut(
        band=torque.band,
        constant=constant_law_error(torque, fit.correlation),
        speed=held_out_error(torque, speed, fit),
        by_term=by_term,
        full=held_out_error(torque, terms, fit),
    )


def _maps(
    torque: FrictionTorque, fit: StateDependentFit, residual: np.ndarray, bins: int
) -> dict[str, FrictionMap]:
    """One-dimensional maps: partial residuals over each state."""
    d = torque.direction
    parts = {p.name: p.contribution for p in fit.parameters}
    speed = parts["positive"] + parts["negative"]
    unit, per = torque.position_unit, f"{torque.position_unit}/s"
    zero = np.zeros(residual.size)

    def mapped(values, state, name, state_unit, used, **options) -> FrictionMap:
        return friction_map(
            values, state, name=name, unit=state_unit, used=used, record=torque.record,
            correlation=fit.correlation, bins=bins, **options,
        )  # fmt: skip

    against = d * (residual + speed)
    position = residual + parts.get("position", zero)
    load = d * (residual + parts.get("load", zero))
    drift = d * (residual + parts["time"])
    return {
        "speed, forwards": mapped(against, np.abs(torque.dq), "speed", per, d > 0),
        "speed, backwards": mapped(against, np.abs(torque.dq), "speed", per, d < 0),
        "position, forwards": mapped(position, torque.q, "position", unit, d > 0),
        "position, backwards": mapped(position, torque.q, "position", unit, d < 0),
        "load": mapped(load, torque.load, "load", torque.torque_unit, torque.moving),
        "acceleration": mapped(residual, torque.ddq, "acceleration", f"{unit}/s²", torque.moving),
        "time": mapped(drift, elapsed(torque), "time", "s", torque.moving, whole_passes=False),
    }


def _plane(torque: FrictionTorque, fit: StateDependentFit, residual: np.ndarray) -> FrictionPlane:
    """Residual of the functions of speed, over signed speed and position."""
    position = fit["position"].contribution if "position" in fit else 0.0
    return friction_plane(
        residual + position, torque.dq, torque.q, used=torque.moving, record=torque.record,
        correlation=fit.correlation,
    )  # fmt: skip


def elapsed(torque: FrictionTorque) -> np.ndarray:
    """Time over all recordings, one after the other [s], shape (samples,)."""
    ends = [torque.t[torque.record == k].max() for k in np.unique(torque.record)]
    starts = np.concatenate([[0.0], np.cumsum(ends)[:-1]])
    return torque.t + starts[torque.record]
