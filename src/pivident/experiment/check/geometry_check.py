"""Whether the robot is described as it stands and turns: gravity, zeros and senses of the joints.

The inverse model of each joint has parameters of its own, which make good a part of a wrong
geometry. What they cannot make good shows where another geometry leaves far less of the torque:
another direction of gravity, a joint that turns the other way, a zero a quarter or half turn away.

Whether the log shows a law that compensates gravity while the file states one that does not.

For each joint the torque is fitted twice by least squares: with what a law makes of error and
speed, an integrator and a constant included, and with the columns of gravity at the measured
position besides. A law that compensates gravity leaves a static torque that follows the posture,
and next to nothing once gravity is among the columns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.logs.log import Log
from pivident.estimation.control_law.law_gravity import GravityColumns, gravity_columns
from pivident.experiment.check.gains_check import CONTROLLER
from pivident.experiment.check.remark import usable_rows
from pivident.experiment.file_keys import ControllerEntry
from pivident.foundation.errors import PividentError
from pivident.foundation.text.finding import Finding, FindingKind, Topic
from pivident.foundation.text.repair import Edit, Repair, Reversed, Shifted
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import (
    BEYOND,
    InverseModel,
    build_inverse_model,
    inverse_model_of,
)
from pivident.judgement.audit.timing import Timing
from pivident.robot.description import STANDARD_GRAVITY, Robot

#: What this check looks at.
GEOMETRY = Topic("geometry")

GRAVITY = FindingKind(GEOMETRY, "gravity", ("robot", "gravity"))
SENSE = FindingKind(GEOMETRY, "sense", ("recording", "columns", "q"))
ZERO = FindingKind(GEOMETRY, "zero", ("recording", "position_offset"))

#: Relative error up to which no geometry is doubted.
SMALL = 0.015

#: Factor by which all joints' errors together must shrink, and by which one of them may grow.
BETTER, WORSE = 6.0, 1.3

#: Explanations are alike where their gains differ by less: a turned base of an upright arm is a
#: turned zero of its first joint.
ALIKE = 0.5

#: Rate that is enough for the comparison [Hz].
RATE = 400.0

DIRECTIONS = {"+x": (0, 1), "-x": (0, -1), "+y": (1, 1), "-y": (1, -1), "+z": (2, 1), "-z": (2, -1)}


class GeometryCheck(LogCheck):
    """Gravity, zeros and senses of the description."""

    name = "geometry"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        return seen.after(self.name, check_geometry(seen.log, seen.timing, seen.model))


def check_geometry(log: Log, timing: Timing, model: InverseModel) -> list[Finding]:
    """Another geometry that explains the torque far better."""
    errors = model.relative_errors[np.isfinite(model.relative_errors)]
    if not errors.size or errors.max() < SMALL or log.robot is None or not timing.rate:
        return []
    try:
        trials = _Trials.of(*_thinned(log, timing))
    except (PividentError, np.linalg.LinAlgError):
        return []
    explanations: list[tuple[float, Finding]] = []
    for candidate in candidates(log.robot):
        there = trials.errors(candidate)
        if there is None:
            continue
        found, here = candidate.finding, trials.here
        factor = _gain(here, there)
        if factor > np.log(BETTER):
            share = f"{100 * _mean(there):.2g} % of the torque instead of {100 * _mean(here):.2g} %"
            sentence = f"{found.message}: the inverse model leaves {share}."
            explanations.append((factor, replace(found, message=sentence)))
    if not explanations:
        return []
    explanations.sort(key=lambda pair: -pair[0])
    (most, best), *others = explanations
    alike = [finding for factor, finding in others if factor > most - ALIKE][:2]
    step = " Or also: ".join([best.next_step, *(f"{r.message} {r.next_step}" for r in alike)])
    repairs = [repair for finding in (best, *alike) for repair in finding.repairs]
    return [replace(best, next_step=step, repairs=tuple(repairs))]


def _mean(errors: np.ndarray) -> float:
    """Geometric mean."""
    return float(np.exp(np.nanmean(np.log(np.maximum(errors, 1e-6)))))


def _thinned(log: Log, timing: Timing) -> tuple[Log, Timing]:
    """The log at a rate that is enough."""
    assert timing.rate, "the caller has asked for it"
    step = max(1, int(timing.rate // RATE))
    channels = {kind: values[::step] for kind, values in log.channels.items()}
    clocks = {name: t[::step] for name, t in log.clocks.items()}
    thin = replace(log, channels=channels, clocks=clocks, logged={}, columns={})
    return thin, replace(timing, rate=timing.rate / step)


@dataclass(frozen=True, eq=False)
class Geometry:
    """Another geometry.

    Attributes:
        robot: the robot, with another gravity where that is it.
        scale: of the positions, and of the torques too, shape (joints,); -1: the other sense.
        shift: what is added to the positions [rad or m], shape (joints,).
        finding: what is to be said if it is the right one.
    """

    robot: Robot
    scale: np.ndarray
    shift: np.ndarray
    finding: Finding


@dataclass(frozen=True, eq=False)
class _Trials:
    """The model of the geometry as described, to which every other one is held."""

    log: Log
    model: InverseModel
    rough: np.ndarray  # relative error of each joint on few rows and rough columns, (joints,)

    @classmethod
    def of(cls, log: Log, timing: Timing) -> _Trials:
        model = build_inverse_model(log, timing)
        return cls(log, model, model.roughly().relative_errors)

    @property
    def here(self) -> np.ndarray:
        """Relative error of each joint, shape (joints,)."""
        return self.model.relative_errors

    def errors(self, geometry: Geometry) -> np.ndarray | None:
        """Relative error of each joint; None where it cannot be the right one, or be had."""
        reading, subject = (geometry.scale, geometry.shift), geometry.finding.subject
        try:
            rough = self.model.roughly(*reading, geometry.robot)
            bounds = BEYOND * (WORSE * self.rough + 1e-3)
            roughly = _within(rough, bounds, subject)
            # a geometry wins by `BETTER`: by its root on few rows, it may still
            if roughly is None or _gain(self.rough, roughly) < 0.5 * np.log(BETTER):
                return None
            log = replace(self.log, robot=geometry.robot)
            model = inverse_model_of(log, self.model.signals, *reading)
        except (PividentError, np.linalg.LinAlgError):
            return None
        return _within(model, WORSE * self.here + 1e-3, subject)


def _within(model: InverseModel, bounds: np.ndarray, subject: str) -> np.ndarray | None:
    """Relative error of each joint; None where one is above its bound.

    The joint that a geometry is about is asked first, then those with the lowest bounds: most of
    the geometries that are not the right one are out with a single joint. The sense of a torque
    changes nothing of the share of it that its joint's columns explain.
    """
    tau, names = model.tau(), model.robot.joint_names
    errors = np.full(len(names), np.nan)
    for j in sorted(range(len(names)), key=lambda j: (names[j] != subject, bounds[j])):
        errors[j] = model.relative_error(j, tau[:, j])
        if errors[j] > bounds[j]:
            return None
    return errors


def _gain(here: np.ndarray, there: np.ndarray) -> float:
    """Logarithm by which other errors are smaller, all joints together."""
    return float(np.nansum(np.log(np.maximum(here, 1e-6) / np.maximum(there, 1e-6))))


def candidates(robot: Robot) -> Iterator[Geometry]:
    """Other geometries of a robot."""
    as_is, nowhere = np.ones(robot.size), np.zeros(robot.size)
    for name, (axis, sign) in DIRECTIONS.items():
        gravity = np.zeros(3)
        gravity[axis] = sign * STANDARD_GRAVITY
        if np.allclose(gravity, robot.gravity, atol=0.5):
            continue
        listed = ", ".join(f"{g:g}" for g in gravity)
        text = f"Gravity seems to point along {name} of the base frame"
        step = f"The arm may be mounted on a wall or a ceiling: gravity = [{listed}] under [robot]."
        down = Edit(("robot", "gravity"), [float(g) for g in gravity])
        words = f"Change the direction of gravity: gravity = [{listed}]."
        said = GRAVITY.finding("error", text, "", step, repairs=[Repair((down,), words)])
        yield Geometry(robot.with_gravity(gravity), as_is, nowhere, said)
    for j, joint in enumerate(robot.joints):
        alone = np.eye(robot.size)[j]
        text = f"{joint.name} seems to turn in the opposite direction to the description"
        step = (
            "Reverse its axis in the description, or the signs of both its position and its "
            "torque in the log."
        )
        other_way = Repair((Reversed(channel="", joints=(joint.name,)),))
        said = SENSE.finding("error", text, joint.name, step, repairs=[other_way])
        yield Geometry(robot, as_is - 2.0 * alone, nowhere, said)
        if joint.kind != "revolute":
            continue
        for degrees in (90, -90, 180):
            angle = float(np.radians(degrees))
            shifted = Repair((Shifted(offsets=((joint.name, float(f"{angle:.4f}")),)),))
            said = ZERO.finding(
                "error",
                f"The zero of {joint.name} seems to be {abs(degrees)}° away from that in the "
                "description",
                joint.name,
                f"Set position_offset to {angle:.4f} rad for it (radians, as added to the logged "
                "position), or change the description.",
                repairs=[shifted],
            )
            yield Geometry(robot, as_is, angle * alone, said)


FEED_FORWARD = FindingKind(CONTROLLER, "gravity", ("controller",))

#: Share of the torque's variance that a law without gravity stays below, and that one with gravity
#: explains.
INCOMPLETE, COMPLETE = 0.98, 0.999

#: Fewest samples that are judged.
MIN_ROWS = 500


def check_gravity(log: Log, timing: Timing, entry: ControllerEntry) -> list[Finding]:
    """Joints whose torque needs gravity in the law that the file states without it."""
    given = [log.channels.get(c) for c in ("q", "q_ref", "tau")]
    if log.robot is None or log.robot.constraints is not None:
        return []
    if entry.feed_forward != "none" or not timing.rate or not timing.regular:
        return []
    if any(x is None or x.shape[1] != log.robot.size for x in given):
        return []
    rows = usable_rows(*(x for x in given if x is not None))
    if len(rows) < MIN_ROWS:
        return []
    q, q_ref, tau = (x[rows] for x in given if x is not None)
    found = []
    for j, columns in enumerate(gravity_columns(log.robot)):
        if columns.parameters:
            shares = _explained(q, q_ref[:, j], tau[:, j], timing.rate, columns)
            if shares[0] < INCOMPLETE and shares[1] > COMPLETE:
                found.append((log.joint_names[j], *shares))
    if not found:
        return []
    name, without, with_gravity = found[0]
    text = (
        f"Error and speed explain {100 * without:.3g} % of the torque of {name}, with gravity "
        f"at the measured position {100 * with_gravity:.4g} %: the controller of "
        f"{', '.join(own[0] for own in found)} compensates gravity, which the file does not "
        "state."
    )
    step = (
        'Set feed_forward = "gravity_measured" ("gravity" at the reference) if the '
        'controller uses the masses of the description; with controller = "identify" law and '
        "gravity model are identified from the log."
    )
    edit = Edit(("controller", "feed_forward"), "gravity_measured")
    words = 'Declare that the controller compensates gravity: feed_forward = "gravity_measured".'
    return [FEED_FORWARD.finding("warning", text, name, step, repairs=[Repair((edit,), words)])]


def _explained(
    q: np.ndarray, q_ref: np.ndarray, tau: np.ndarray, rate: float, columns: GravityColumns
) -> tuple[float, float]:
    """Shares of the torque's variance that a law explains, without gravity and with it."""
    own = q[:, columns.joint]
    error = q_ref - own
    law = [error, np.gradient(own) * rate, np.gradient(q_ref) * rate, np.cumsum(error) / rate]
    law += [np.diff(error, prepend=error[:1]) * rate, np.ones_like(error)]
    plain = np.column_stack(law)
    return _share(plain, tau), _share(np.column_stack([plain, columns.at(q)]), tau)


def _share(phi: np.ndarray, tau: np.ndarray) -> float:
    """Share of the variance of τ that least squares on the columns explains."""
    scale = np.maximum(np.linalg.norm(phi, axis=0), 1e-300)
    gains = np.linalg.lstsq(phi / scale, tau, rcond=None)[0]
    return 1.0 - float(np.var(tau - phi / scale @ gains) / max(np.var(tau), 1e-300))
