"""Scales: degrees or radians, amperes or newton metres, motor or joint side.

With a description that has masses, the torque of each joint is

    τ_j = a_g g_j(q) + a_i (M(q) ddq + c(q, dq))_j + friction,

five terms or so. Both factors are 1 where description and log agree. A factor that gravity and
inertia share is a gain: a torque constant, a gear ratio, a sign.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.logs.torque_scale import scale_sentences
from pivident.data.recording.checks import check_within_reach
from pivident.foundation.errors import PositionsBeyondLimits
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, Topic
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.repair import Gain, Repair, in_unit, setting
from pivident.foundation.text.sentences import capital
from pivident.judgement.audit.blocked_fit import CLEAR, blocked_fit, jackknife, orthonormal
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.flange_load import FlangeLoad, flange_load
from pivident.judgement.audit.inverse_model import BEYOND, InverseModel, inverse_model_of
from pivident.judgement.audit.spoilt_checks import COMPARISONS
from pivident.judgement.audit.timing import Timing
from pivident.robot.description import Robot

#: What these checks look at, and the units of positions and torques.
SCALE, POSITIONS, TORQUES = (
    Topic("scale", "Units and gains"),
    ("recording", "units", "q"),
    ("recording", "units", "tau"),
)

ASSUMED = FindingKind(SCALE, "assumed", TORQUES)
REACH = FindingKind(SCALE, "reach", POSITIONS, spoils=COMPARISONS, reports=(PositionsBeyondLimits,))
TOO_FAST = FindingKind(SCALE, "speed", POSITIONS, spoils=COMPARISONS)
ANGLE_UNIT = FindingKind(SCALE, "angle unit", POSITIONS, reservation=True, spoils=COMPARISONS)
JOINT_ANGLE_UNIT = FindingKind(
    SCALE, "joint angle unit", POSITIONS, reservation=True, spoils=COMPARISONS
)
SIDE = FindingKind(SCALE, "side", ("recording", "side"), spoils=COMPARISONS)
GAIN = FindingKind(SCALE, "gain", TORQUES, reservation=True)
LOAD = FindingKind(SCALE, "load", ("robot", "model"), reservation=True)

#: A gain that differs from 1 by this factor gets a warning, by that one it is wrong.
WARNING, ERROR = 1.3, 3.0

#: Evidence that says whether a factor is one of all torques.
MEDIAN = "median of all joints"

#: Relative standard error above which a factor is not used.
BLUNT = 0.2

#: Share of a joint's described torque that friction and a rotor of its own must leave open.
OWN = 1e-2

#: Correlation of a torque with that of the description, both without friction, from which on they
#: have one shape: a gain changes the scale of a torque, a wrong body its shape.
ALIKE = 0.95

#: Correlation below which their factor says nothing.
UNLIKE = 0.8

#: A gain is within this factor of a gear ratio if it comes from it.
NEAR = 1.4

#: Another unit of the positions must leave at most this share of the error.
BETTER = 0.5

#: Factors between units of angles, the unit that was taken and the one that is meant.
ANGLES = ((np.pi / 180.0, "rad", "deg"), (180.0 / np.pi, "deg", "rad"))

#: What a joint may be turned at most, and its least range, for a unit to be possible [rad].
FARTHEST, LEAST = 20.0, 0.05

#: Times the rated speed that a joint may be logged to have.
MAX_SPEED_RATIO = 3.0


@dataclass(frozen=True, eq=False)
class Scale:
    """Factors between log and description."""

    findings: tuple[Finding, ...]
    factors: np.ndarray  # torque of the log per torque of the description, or NaN
    standard_errors: np.ndarray  # of the factors
    likeness: np.ndarray  # correlation of both torques, without friction, or NaN
    #: Of the torque that the joint's own parameters explain, noise apart: their shapes, or NaN.
    shape: np.ndarray


class PositionUnitCheck(LogCheck):
    """The unit of the positions; they are taken in the one that fits much better.

    ``one_by_one``: whether single joints may have another unit than the others.
    """

    name = "position unit"

    def __init__(self, one_by_one: bool = True) -> None:
        self.one_by_one = one_by_one

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        another = another_position_unit(seen.log, seen.model, self.one_by_one)
        return seen if another is None else seen.after(self.name, [another[0]], None, another[1])


class ScaleCheck(LogCheck):
    """The torques beside those of the description, and a load that it lacks."""

    name = "scale"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        scale = check_scale(seen.log, seen.model, seen.results["power"].right)
        return seen.after(self.name, scale.findings, scale)


def check_assumed(log: Log) -> list[Finding]:
    """Assumed scales of the torque; a factor of 1 to the description confirms nothing then."""
    return [ASSUMED.finding("warning", sentence) for sentence in scale_sentences(log.torque_scale)]


def check_positions(
    log: Log, timing: Timing, model: InverseModel
) -> tuple[list[Finding], InverseModel | None]:
    """Whether the positions can be what they are said to be, and a model in the right unit."""
    findings = check_reach(log, timing)
    better = another_position_unit(log, model)
    if better is None:
        return findings, None if findings else model
    finding, other = better
    return [*findings, finding], other


def check_scale(log: Log, model: InverseModel, signs_right: Container[int] = ()) -> Scale:
    """Compare the torques of a log with those of the robot's description.

    ``signs_right``: joints whose friction shows that their sign is right.
    """
    joints = model.robot.size
    factors, standard_errors, likeness, shape = np.full((4, joints), np.nan)
    tau = model.tau()
    described = any(np.any(link.inertia) for link in model.robot.tree.links)
    for j in range(joints):
        if described and model.usable(j):
            factors[j], standard_errors[j], likeness[j], shape[j] = _gain(model, j, tau[:, j])
    blunt = ~(standard_errors < BLUNT * np.abs(factors))
    factors[blunt] = np.nan
    found = Scale((), factors, standard_errors, likeness, shape)
    findings = list(_gain_findings(log, model, found, signs_right))
    if any(f.severity != "ok" for f in findings):
        load = flange_load(model, factors)
        commands = [j for j in range(joints) if j in log.commands]
        if load is not None and _gains_agree(load, commands, np.isfinite(factors)):
            fine = [f for f in findings if f.severity == "ok"]
            findings = [*fine, _load_finding(model.robot, load)]
    return replace(found, findings=tuple(findings))


def _gains_agree(load: FlangeLoad, commands: list[int], judged: np.ndarray) -> bool:
    """Whether all torques are those of description and load, but for one and the same factor.

    A command has no gain to agree; ``judged``: joints that have one without a load, (joints,).
    """
    factors = load.factors[judged]
    typical = float(np.median(factors))
    relative, spread = factors / typical, load.standard_errors[judged] / abs(typical)
    near = (relative > 1.0 / WARNING) & (relative < WARNING)
    agree = bool(np.all(near | (np.abs(relative - 1.0) < CLEAR * spread)))
    # masses that are too small are as likely as a body too much, but for one scale that is right
    limit = ERROR if load.mass > 0.0 else WARNING
    return not commands and 1.0 / limit < typical < limit and agree


def _load_finding(robot: Robot, load: FlangeLoad) -> Finding:
    """A body on the last link, or the lack of one, explains what looked like gains."""
    last = robot.joints[-1].name
    half, is_lacking = 2 * load.standard_error, load.mass > 0.0
    low, high = load.mass - half, load.mass + half
    typical = float(np.median(load.factors))
    scale = "the scale of the torques is right"
    if not 1.0 / WARNING < typical < WARNING:
        scale = f"all torques are about {typical:.2g} times those of the description"
    fact, tool = ("lacks", "a tool") if is_lacking else ("has too much:", "a tool that was not on")
    text = (
        f"The description {fact} {plus_minus(abs(load.mass), half)} kg on the link of {last}, "
        f"perhaps {tool}. {'With' if is_lacking else 'Without'} it {scale} (2σ of the fit, if the "
        "masses of the description are exact)."
    )
    change = "Add its mass, centre of mass and inertia to" if is_lacking else "Take it out of"
    step = (
        f"{change} the link of {last} in the robot's file. Left as it is, the estimate is that of "
        "the arm as it moved, which is right for its torques."
    )
    evidence = {
        "mass": Quantity(load.mass, "kg", interval=(low, high)),
        MEDIAN: Quantity(typical, bound=WARNING),
    }
    return LOAD.finding("warning", text, last, step, evidence)


def check_reach(log: Log, timing: Timing) -> list[Finding]:
    """Positions and speeds that the robot cannot have."""
    findings: list[Finding] = []
    robot, q = log.robot, log.channels["q"]
    if robot is None or q.shape[1] != robot.size:
        return findings
    finite = q[np.isfinite(q).all(axis=1)]
    for j, joint in enumerate(robot.joints):
        try:
            check_within_reach("q", finite, _only(robot, j))
        except PositionsBeyondLimits as error:
            bound = error.limits[int(error.position > error.limits[1])]
            step = capital(error.advice)
            evidence = {"position": Quantity(error.position, error.unit, bound=bound)}
            repairs = [in_unit("q", error.likely_unit), _MOTOR_SIDE] if error.likely_unit else []
            findings.append(
                REACH.finding(
                    "error", f"{error.fact}.", joint.name, step, evidence, repairs=repairs
                )
            )
            continue
        if joint.rated_speed is None or not timing.rate or len(finite) < 100:
            continue
        fastest = float(np.quantile(np.abs(np.diff(finite[:, j])), 0.999)) * timing.rate
        unit = "rad/s" if joint.kind == "revolute" else "m/s"
        if fastest > MAX_SPEED_RATIO * joint.rated_speed:
            text = (
                f"{joint.name} would move at {fastest:.3g} {unit}; it is rated for "
                f"{joint.rated_speed:.3g} {unit}."
            )
            step = "Check the unit of the positions, the reduction and the sampling rate."
            evidence = {"speed": Quantity(fastest, unit, bound=MAX_SPEED_RATIO * joint.rated_speed)}
            findings.append(TOO_FAST.finding("error", text, joint.name, step, evidence))
    return findings


def _only(robot: Robot, joint: int) -> Robot:
    """A stand-in that has the limits of one joint only."""
    bare = [
        j if k == joint else replace(j, position_limits=None) for k, j in enumerate(robot.joints)
    ]
    return replace(robot, joints=tuple(bare))


def another_position_unit(
    log: Log, model: InverseModel, one_by_one: bool = True
) -> tuple[Finding, InverseModel] | None:
    """A unit of the positions that fits much better, degrees for radians or the reverse."""
    here = _total_error(model)
    if not any(joint.kind == "revolute" for joint in model.robot.joints):
        return None
    if log.side == "motor":
        return _joint_side_already(log, model)
    for factor, said, meant in ANGLES:
        farthest, most = np.abs(model.q).max(), np.ptp(model.q, axis=0).max()
        if farthest * factor > FARTHEST or most * factor < LEAST:
            continue
        if _total_error(model.roughly(factor, apart=1)) > here:
            continue
        other = inverse_model_of(log, model.signals, factor)
        there = _total_error(other)
        if there < BETTER * here:
            text = (
                f"The positions seem to be in {meant} where {said} was taken: the inverse model "
                f"then leaves {100 * there:.3g} % of the torque instead of {100 * here:.3g} %."
            )
            step = f'Set units = {{q = "{meant}"}} under [recording].'
            evidence = {"unexplained": Quantity(100 * here, "%", bound=100 * here * BETTER)}
            repairs = [in_unit("q", meant)]
            return ANGLE_UNIT.finding("error", text, "q", step, evidence, repairs=repairs), other
    return _joint_in_another_unit(log, model) if one_by_one else None


def _joint_in_another_unit(log: Log, model: InverseModel) -> tuple[Finding, InverseModel] | None:
    """A single joint in degrees beside others in radians, or the reverse.

    Its own torque must be explained much better, and those of all joints together no worse. The
    loops of a mechanism do not close with another angle of one joint.
    """
    robot, least, found = model.robot, _total_error(model), None
    if robot.constraints is not None:
        return None
    rough = model.roughly()
    for j, (factor, said, meant) in product(range(robot.size), ANGLES):
        q = model.q[:, j] * factor
        joint = robot.joints[j]
        if joint.kind != "revolute" or joint.motion != "driven" or not model.usable(j):
            continue
        if np.abs(q).max() > FARTHEST or np.ptp(q) < LEAST:
            continue
        scale = np.ones(robot.size)
        scale[j] = factor
        bound = BEYOND * BETTER * rough.relative_errors[j]
        if model.roughly(scale).relative_error(j, rough.tau()[:, j]) > bound:
            continue
        other = inverse_model_of(log, model.signals, scale)
        here, there = float(model.relative_errors[j]), float(other.relative_errors[j])
        if there < BETTER * here and (total := _total_error(other)) < least:
            least, found = total, (j, said, meant, here, there, other)
    if found is None:
        return None
    j, said, meant, here, there, other = found
    name = robot.joints[j].name
    text = (
        f"The positions of {name} seem to be in {meant} where {said} was taken: the inverse model "
        f"then leaves {100 * there:.3g} % of its torque instead of {100 * here:.3g} %."
    )
    step = f'Give {name} its own unit, "{meant}", in a list q = [...] of units under [recording].'
    evidence = {"unexplained": Quantity(100 * here, "%", bound=100 * here * BETTER)}
    return JOINT_ANGLE_UNIT.finding("error", text, name, step, evidence), other


def _joint_side_already(log: Log, model: InverseModel) -> tuple[Finding, InverseModel] | None:
    """Positions that were divided by a gear ratio although they are of the joint side."""
    here = _total_error(model)
    ratio = np.abs(np.diag(model.robot.transmission.reduction))
    other = inverse_model_of(log, model.signals, ratio)
    there = _total_error(other)
    if not there < BETTER * here:
        return None
    text = (
        "The positions seem to be of the joint side, but were divided by the gear ratios: the "
        f"inverse model leaves {100 * there:.3g} % of the torque without that, instead of "
        f"{100 * here:.3g} %."
    )
    step = 'Set side = {q = "joint"} under [recording].'
    evidence = {"unexplained": Quantity(100 * here, "%", bound=100 * here * BETTER)}
    repairs = [_on_side("q", "joint")]
    return SIDE.finding("error", text, "q", step, evidence, repairs=repairs), other


#: Positions and torques of the motors.
_MOTOR_SIDE = setting("side", value="motor", words='Change the side of the gear: side = "motor".')


def _on_side(channel: str, side: str) -> Repair:
    """Another side of the gear for a channel."""
    words = f'Change the side of the gear: side = {{{channel} = "{side}"}}.'
    return setting("side", channel, value=side, words=words)


def _total_error(model: InverseModel) -> float:
    """Geometric mean of the joints' relative errors."""
    usable = [j for j in range(model.robot.size) if model.usable(j)]
    errors = model.relative_errors[usable]
    return float(np.exp(np.mean(np.log(np.maximum(errors, 1e-6))))) if usable else 1.0


def _gain(model: InverseModel, j: int, tau: np.ndarray) -> tuple[float, float, float, float]:
    """One factor for gravity and inertia together, how far the two disagree, likeness and shape.

    A rotor that the description lacks takes its part of the inertia. The standard error is that of
    the fit, or half the distance between gravity's factor and inertia's where both are known: a
    wrong description is not a wrong gain.
    """
    rows = model.moving[:, j]
    parameters = model.base.parameters
    friction = [
        k for k, index in enumerate(model.own[j]) if parameters[index].friction is not None
        or parameters[index].coupling is not None
    ]  # fmt: skip
    both = np.column_stack([model.gravity[rows, j], model.inertial[rows, j]])
    size = np.linalg.norm(both, axis=0)
    if not size.max():
        return (np.nan,) * 4
    own = model.columns[j][rows][:, friction]
    if model.robot.rotor_inertia[j] == 0.0 and model.robot.size > 1:
        # Not described, it would pass for the link's inertia; of a single axis the two are one.
        own = np.column_stack([own, model.ddq[rows, j]])
    rest = orthonormal(own)[0]
    block, y = model.block[rows], tau[rows]
    together = both.sum(axis=1)
    if share_apart(together, rest) < OWN:
        return (np.nan,) * 4
    fit = blocked_fit(np.column_stack([together / np.linalg.norm(together), rest]), y, block)
    factor = float(fit.estimate[0] / np.linalg.norm(together))
    standard_error = float(jackknife(fit.replicates[:, :1])[0] / np.linalg.norm(together))
    if size.min() > 0.05 * size.max() and share_apart(both[:, 1], rest) > OWN:
        split = blocked_fit(np.column_stack([both / size, rest]), y, block)
        apart = split.estimate[:2] / size
        spread = jackknife(split.replicates[:, :2]) / size
        if np.all(spread < BLUNT * np.abs(apart)):
            standard_error = max(standard_error, float(abs(apart[0] - apart[1])) / 4.0)
    described, measured = (_without(column, rest) for column in (together, y))
    sizes = float(np.linalg.norm(described) * np.linalg.norm(measured))
    likeness = float(described @ measured) / max(sizes, 1e-300)
    explained = _without(model.bases[j] @ (model.bases[j].T @ measured), rest)
    sizes = float(np.linalg.norm(described) * np.linalg.norm(explained))
    return factor, standard_error, likeness, float(described @ explained) / max(sizes, 1e-300)


def _without(column: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """What orthonormal others do not make up of a column."""
    return column - rest @ (rest.T @ column)


def share_apart(column: np.ndarray, rest: np.ndarray) -> float:
    """Share of a column that orthonormal others do not make up."""
    left = _without(column, rest)
    return float(np.linalg.norm(left) / max(float(np.linalg.norm(column)), 1e-300))


def _gain_findings(
    log: Log, model: InverseModel, found: Scale, signs_right: Container[int]
) -> Iterator[Finding]:
    reduction = np.abs(np.diag(model.robot.transmission.reduction))
    for j, joint in enumerate(model.robot.joints):
        a, standard_error = float(found.factors[j]), float(found.standard_errors[j])
        if not np.isfinite(a):
            continue
        interval = (a - 2 * standard_error, a + 2 * standard_error)
        text = (
            f"The torque of {joint.name} is {plus_minus(a, 2 * standard_error)} times that of the "
            "description."
        )
        severity, step, repairs = _judged_gain(a, standard_error, float(reduction[j]))
        alike, sign_is_right = abs(found.likeness[j]), a < 0 and j in signs_right
        if severity == "error" and (alike < ALIKE or sign_is_right):
            # A wrong body leaves the estimate as it is, which needs right torques only.
            severity, step, repairs = "warning", _wrong_body(joint.name, sign_is_right), []
        elif severity == "warning" and alike < UNLIKE:
            severity, step, repairs = "ok", "", []
        if j in log.commands:
            unit = "N m" if joint.kind == "revolute" else "N"
            severity = "warning"
            low, high = sorted((1 / interval[0], 1 / interval[1]))
            text = (
                f"{joint.name} was logged as a drive command without a gain; the description "
                f"suggests {1 / a:.4g} {unit} per unit (between {low:.3g} and {high:.3g})."
            )
            step = f"If that is right, write gain = {1 / a:.4g} beside the unit of tau."
            repairs = [Repair((Gain(gains=((joint.name, float(f"{1 / a:.4g}")),)),))]
        bound = ERROR if severity == "error" else WARNING
        evidence = {
            "factor": Quantity(a, bound=bound, interval=interval),
            MEDIAN: Quantity(float(np.nanmedian(found.factors)), bound=WARNING),
        }
        yield GAIN.finding(severity, text, joint.name, step, evidence, repairs=repairs)


def _wrong_body(joint: str, sign_is_right: bool) -> str:
    """What to do where friction, or the shape of the torque, speaks against the masses."""
    shape = "It has another shape, so that this is no gain alone"
    why = "Friction shows that its sign is right" if sign_is_right else shape
    return (
        f"{why}: the mass or the centre of mass of the link of {joint}, or of what it carries, "
        "seems to be wrong in the description; check also the gain and the gear ratio."
    )


def _judged_gain(
    a: float, standard_error: float, ratio: float
) -> tuple[Severity, str, list[Repair]]:
    """Severity of a factor, what may explain it, and what would set that right."""
    if abs(a - 1.0) < CLEAR * standard_error or 1.0 / WARNING < a < WARNING:
        return "ok", "", []
    if a < 0:
        return "error", "The sign of the torque, of the position or of gravity is reversed.", []
    for candidate, side, cause in (
        (1.0 / ratio, "motor", "The torque may be that of the motor"),
        (ratio, "joint", "The torque may be of the joint side already"),
    ):
        if ratio > 2.0 and 1.0 / NEAR < a / candidate < NEAR:
            step = f'{cause}: set side = {{tau = "{side}"}}.'
            return "error", step, [_on_side("tau", side)]
    step = "Check drive gain, gear ratio and unit of the torque, or the masses of the description."
    return ("error" if not 1.0 / ERROR < a < ERROR else "warning"), step, []
