"""What one unit of the logged torque is worth: held against gravity and inertia of the robot.

A log says "effort" or "current" and means N m, amperes, or a number of the drive. Where the
robot's description has masses, one factor for each joint follows from them, see
`pivident.judgement.audit.description_factors`; it is as good as these masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.logs.recognition.presets import Preset
from pivident.data.logs.torque_scale import ASSUMED, MASSES
from pivident.data.logs.units import COMMAND, TORQUE
from pivident.estimation.drives.log_units import KNOWN_WITHIN
from pivident.estimation.normal_equations import JointSums
from pivident.experiment.check.torque_side import TorqueSideEvidence, torque_side_evidence
from pivident.experiment.init.assumption import Question, Sureness
from pivident.foundation.errors import PividentError
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.sentences import listed
from pivident.judgement.audit.description_factors import BLUNT, description_factors
from pivident.judgement.audit.examination import Examination, in_turn
from pivident.judgement.audit.flange_load import FlangeLoad, flange_load
from pivident.judgement.audit.friction_drift import FrictionDrift, friction_drifts
from pivident.judgement.audit.gain_ratios import gain_ratios, sums_of
from pivident.judgement.audit.gravity import NO_GRAVITY
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.log_checks import CHECKS
from pivident.judgement.audit.scale import ALIKE, ANGLE_UNIT, UNLIKE, PositionUnitCheck
from pivident.judgement.audit.timing import check_timing
from pivident.robot.description import Robot

#: Factor between log and description up to which an unnamed torque passes for N m.
NEAR_ONE = 2.0

#: A factor is within this factor of a gear ratio if it comes from it.
NEAR_RATIO = 1.4

#: Relative difference below which a gain of the log is that of the description.
SAME_GAIN = 0.01

#: Share by which the masses of descriptions are wrong themselves: on arms whose torques are known,
#: well determined factors lie so far from one. A gain that is known to this is as good as they are.
MASSES_WITHIN = 0.1

#: Rows below which nothing is compared.
MIN_ROWS = 10

#: Words with which a question for the unit is answered.
ANSWERS = ("N m", "A", "unknown scale")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Log against description."""

    factors: np.ndarray  # logged torque per torque of the description, NaN where it is not known
    standard_errors: np.ndarray  # of the factors
    reversed: tuple[int, ...] = ()  # joints whose friction would give energy
    right: tuple[int, ...] = ()  # joints whose friction clearly takes energy
    angle_unit: bool = False  # whether positions in the other angle unit fit much better
    errors: np.ndarray | None = None  # share of each joint's torque that no parameters explain
    trouble: str = ""  # why nothing could be compared, or empty
    load: FlangeLoad | None = None  # on the flange, not in the description
    torque_side: TorqueSideEvidence | None = None  # what the log shows of rotors and drives
    no_gravity: str = ""  # how the log shows that its torques hold no gravity, or empty
    warmed: tuple[FrictionDrift, ...] = ()  # joints whose friction follows the logged temperature
    drifted: tuple[FrictionDrift, ...] = ()  # joints whose friction follows time
    #: Correlation of both torques, without friction and noise; NaN where it is not known.
    shape: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sums: Sequence[JointSums] = ()  # of the joints' equations

    @property
    def is_gain(self) -> np.ndarray:
        """Joints whose factor is known well enough to be written as a gain, shape (joints,).

        Written, a gain may be wrong by its interval, and the torques that other joints' parameters
        predict for its joint with it. That must not be more than what no parameters explain of
        them, or than the masses are wrong anyway. A gain changes the scale of a torque: where that
        has another shape than the description's, another body makes the factor.
        """
        left = np.zeros(len(self.factors)) if self.errors is None else self.errors
        half = 2.0 * self.standard_errors / np.abs(self.factors)
        unlike = np.abs(self.shape) < UNLIKE if len(self.shape) else False
        return (half <= np.clip(left, MASSES_WITHIN, KNOWN_WITHIN)) & ~unlike


@dataclass(frozen=True)
class TorqueUnit:
    """The unit of the torque channel."""

    value: Any  # as an experiment file says it
    sure: Sureness  # how sure it is
    seen: str
    correct: str  # how to correct it
    motor_side: bool = False  # whether the torques are those of the motors
    question: Question | None = None  # what to ask, where somebody may know better


def undecided_signs(found: Comparison) -> list[int]:
    """Joints of which neither gravity nor friction tells the sign."""
    decided = {*found.reversed, *found.right, *np.flatnonzero(np.isfinite(found.factors)).tolist()}
    return [j for j in range(len(found.factors)) if j not in decided]


def reversed_signs(found: Comparison) -> list[int]:
    """Joints whose torque has the other sign; the undecided ones follow where all others have."""
    wrong = [
        j
        for j, factor in enumerate(found.factors)
        if factor < 0 or (j in found.reversed and not factor > 0)
    ]
    undecided = undecided_signs(found)
    follow = bool(wrong) and len(wrong) + len(undecided) == len(found.factors)
    return sorted([*wrong, *undecided]) if follow else wrong


def _signs_text(robot: Robot, found: Comparison, wrong: list[int]) -> str:
    """Which signs are reversed and why, and which nothing decides."""
    undecided = undecided_signs(found)
    shown = [robot.joints[j].name for j in wrong if j not in undecided]
    text = f"the sign of {', '.join(shown)} is reversed, as gravity or friction show"
    if undecided:
        names = ", ".join(robot.joints[j].name for j in undecided)
        taken = "that of the others" if set(undecided) <= set(wrong) else "as logged"
        text += f"; nothing tells that of {names}, which is taken {taken}"
    return text


def without_torque(robot: Robot) -> Comparison:
    """What a log without torque says against the description: nothing."""
    nothing = np.full(robot.size, np.nan)
    return Comparison(nothing, nothing, trouble="the log has no torque")


def compare(
    robot: Robot,
    q: np.ndarray,
    tau: np.ndarray,
    seconds: np.ndarray,
    temperature: np.ndarray | None = None,
) -> Comparison:
    """Hold torque and motion against the robot's description.

    Args:
        robot: the description.
        q: positions, shape (samples, joints) [rad or m].
        tau: torques as logged, of the same shape.
        seconds: stamps, shape (samples,) [s].
        temperature: of the motors, shape (samples, joints), where it is logged.
    """
    log = Log(
        "log",
        robot.joint_names,
        {},
        {"t": seconds},
        logged={"q": q, "tau": tau},
        channels={"q": q, "tau": tau},
        robot=robot,
    )
    nothing = np.full(robot.size, np.nan)
    if len(seconds) < MIN_ROWS:
        seen = f"{len(seconds)} rows have positions and torques of all joints while they move"
        return Comparison(nothing, nothing, trouble=seen)
    try:
        timing = check_timing(log)
        if not timing.rate:
            return Comparison(nothing, nothing, trouble="the sampling rate could not be determined")
        model = build_inverse_model(log, timing)
        checks = (PositionUnitCheck(), CHECKS["gravity"], CHECKS["power"])
        examined = in_turn(Examination(log, timing, model), checks)
        if any(finding.declared is ANGLE_UNIT for finding in examined.findings):
            return Comparison(nothing, nothing, angle_unit=True)
        model, power = examined.model, examined.results["power"]
        scale = description_factors(log, model, power.right)
        factors, standard_errors = scale.factors, scale.standard_errors
        side = torque_side_evidence(log, timing, model)
        load = flange_load(model, factors)
        if load is not None:
            factors, standard_errors = load.factors.copy(), load.standard_errors.copy()
            factors[~(standard_errors < BLUNT * np.abs(factors))] = np.nan
    except (PividentError, np.linalg.LinAlgError) as error:
        return Comparison(nothing, nothing, trouble=str(error))
    reversed_ = tuple(j for j in power.reversed if not factors[j] > 0)
    return Comparison(
        factors,
        standard_errors,
        reversed_,
        power.right,
        errors=model.relative_errors.copy(),
        load=load,
        torque_side=side,
        no_gravity=next((f.message for f in examined.findings if f.declared is NO_GRAVITY), ""),
        warmed=() if temperature is None else friction_drifts(model, temperature),
        drifted=friction_drifts(model, seconds) if temperature is None else (),
        shape=scale.shape if load is None else np.full(robot.size, np.nan),
        sums=sums_of(model),
    )


def torque_unit(
    robot: Robot,
    found: Comparison,
    named: str | None,
    is_current: bool,
    answer: str | None,
    gain: tuple[str, np.ndarray] | None = None,
    preset: Preset | None = None,
) -> TorqueUnit:
    """The unit of the logged torques; ``gain``: of a constant of the log, with its name.

    ``preset``: of the logger; where the data contradict what it says, they decide.
    """
    named = answer if answer in ("N m", "A") else named
    kind = "current" if is_current else "effort"
    if named in COMMAND or (is_current and named not in TORQUE) or answer == ANSWERS[2]:
        unit = named if named in COMMAND else ("A" if is_current else "command")
        return _command(robot, found, str(unit), f"the columns hold a {kind}", gain, preset)
    if gain is not None and answer is None:
        return _command(robot, found, "command", "no name says a unit", gain)
    factors = found.factors
    known = np.isfinite(factors)
    ratios = np.abs(np.diag(robot.transmission.reduction))
    through_gear = factors * ratios
    if (
        known.any()
        and ratios[known].min() > 2.0
        and np.all(np.abs(np.log(np.abs(through_gear[known]))) < np.log(NEAR_RATIO))
    ):
        seen = (
            f"torques are 1/{np.median(ratios[known]):.3g} of those of the links: before the gear"
        )
        return TorqueUnit("N m", "likely", seen, 'Set side = "joint" if they are not.', True)
    if named in TORQUE:
        if preset is not None and preset.unit in TORQUE:
            by = f"the preset {preset.name} says"
            near = not known.any() or _most_may_be_one(factors[known], found.standard_errors[known])
            if not near:
                text = "the scale of the torque is not that of the robot's masses, although the "
                text += f"preset {preset.name} says N m: the data decide"
                return _command(robot, found, "command", text, gain)
            return _newton_metres(robot, found, "N m", "likely", f"as {by}")
        return _newton_metres(robot, found, str(named), "certain", f"the names say {named}")
    by = "" if preset is None else f"the preset {preset.name} says"
    said = f", although {by} {preset.unit}: the data decide" if preset else ""
    if known.any() and _most_may_be_one(factors[known], found.standard_errors[known]):
        if preset is not None and preset.unit in TORQUE:
            return _newton_metres(robot, found, "N m", "likely", f"as {by}")
        contradicted = said if preset is not None and preset.unit in COMMAND else ""
        return _newton_metres(robot, found, "N m", "likely", f"no unit in the names{contradicted}")
    if preset is not None and preset.unit in COMMAND:
        return _command(robot, found, preset.unit, f"{preset.unit}, as {by}", gain, preset)
    if preset is not None and preset.unit in TORQUE and not known.any():
        return _newton_metres(robot, found, "N m", "likely", f"as {by}")
    if not known.any():
        seen = "no unit in the names, and nothing in the robot's description gives the scale"
        if found.trouble:
            seen += f" ({found.trouble})"
        correct = 'Name the unit: "N m", "N" for sliding joints, or {unit = "A", gain = …}.'
        question = Question("unit of tau", "In what unit are the torques?", ANSWERS)
        value = {"unit": "N m", "scale": ASSUMED}
        return TorqueUnit(value, "assumed", seen, correct, question=question)
    contradicted = said if preset is not None and preset.unit in TORQUE else ""
    seen = f"the scale of the torque is not that of the robot's masses{contradicted}"
    return _command(robot, found, "command", seen, gain)


def _most_may_be_one(factors: np.ndarray, standard_errors: np.ndarray) -> bool:
    """Whether most factors are near one, or may be by their two standard errors.

    Another unit shows on all joints; a link that the description has wrong, on its own.
    """
    off = np.abs(np.log(np.abs(factors)))
    near = off < np.log(NEAR_ONE) + 2.0 * standard_errors / np.abs(factors)
    return bool(near.mean() > 0.5)


def _newton_metres(
    robot: Robot, found: Comparison, unit: str, sure: Sureness, reason: str
) -> TorqueUnit:
    """N m, with the sign turned where gravity and friction say so."""
    wrong, scale = reversed_signs(found), TORQUE[unit]
    if wrong:
        value: Any = [-scale if j in wrong else scale for j in range(robot.size)]
        reason += f"; {_signs_text(robot, found, wrong)}"
        sure = "assumed" if undecided_signs(found) else "likely"
    else:
        value = _sliding(robot, unit)
    correct = 'Factors to N m by joint, {unit = "A", gain = …} or "N m" are possible.'
    return TorqueUnit(value, sure, f"{reason}; {_factors_text(robot, found)}", correct)


def _sliding(robot: Robot, unit: str) -> Any:
    """N m for turning joints, N for sliding ones."""
    if all(joint.kind == "revolute" for joint in robot.joints):
        return unit
    force = unit.replace(" m", "").replace("Nm", "N")
    force = force if force in TORQUE else "N"
    torque = f"{unit} m" if unit == force else unit
    return [torque if joint.kind == "revolute" else force for joint in robot.joints]


def _command(
    robot: Robot,
    found: Comparison,
    unit: str,
    reason: str,
    in_log: tuple[str, np.ndarray] | None = None,
    preset: Preset | None = None,
) -> TorqueUnit:
    """A drive command with the gain of the description, of the log, or of the robot's masses.

    Before the masses come published gains of the robot, where these do not contradict them.
    """
    given = robot.transmission.gain_given
    if given is not None and np.all(given):
        seen = f"{reason}; the robot's description has drive gains"
        if in_log is not None:
            own, described = np.asarray(in_log[1]), robot.transmission.drive_gain
            near = np.all(np.abs(own / described - 1.0) < SAME_GAIN)
            seen += f", {'as' if near else 'other than'} {in_log[0]!r} in the log, "
            seen += listed([f"{g:.5g}" for g in own])
        return TorqueUnit(unit, "likely", seen, "They are under drive_gain of [robot].", True)
    if in_log is not None:
        name, own = in_log
        value = [{"unit": unit, "gain": float(f"{gain:.10g}")} for gain in own]
        seen = f"{reason}; the log holds {name!r}, taken for N m (N) per unit of it"
        correct = "Compare it with the drive's data: torque constant times gear ratio."
        return TorqueUnit(value, "assumed", seen, correct)
    gains, ratios, assumed = gains_of(robot, found, COMMAND[unit])
    published = None if preset is None else preset.gains_of(robot.name, robot.size)
    if published is not None:
        times = np.delete(np.abs(gains) / np.array(published[0]), [*ratios, *assumed])
        if not times.size or np.median(np.abs(np.log(times))) < np.log(NEAR_RATIO):
            return _published(robot, found, unit, reason, published, times)
        reason += f", and the masses contradict the gains of {published[1]}: the data decide"
    by_masses = [j for j in range(robot.size) if j not in {*ratios, *assumed}]
    value = [
        {
            "unit": unit,
            "gain": float(f"{gain:.4g}"),
            "scale": ASSUMED if j in assumed or not by_masses else MASSES,
        }
        for j, gain in enumerate(gains)
    ]
    if not by_masses:
        seen = f"{reason}, and N m per unit can be taken neither from the robot's description nor "
        seen += f"from its masses: all torques and parameters are in units of {unit} until gains "
        seen += f"are set{_listed_gains(robot, found, gains, ratios, assumed)}"
        correct = "Set gain = N m per unit for each joint, on the joint side, and leave scale out."
        return TorqueUnit(value, "assumed", seen, correct)
    seen = f"{reason}; N m per unit follow from the masses of the robot's description, whose own "
    seen += "errors come on top"
    seen += _listed_gains(robot, found, gains, ratios, assumed) + _load_text(robot, found)
    if wrong := reversed_signs(found):
        seen += f"; {_signs_text(robot, found, wrong)}"
    correct = (
        "Write the drives' own gains, torque constant times gear ratio, where you know them, and "
        "leave scale out; errors in per cent do not depend on them, parameters do."
    )
    question = None
    if unit == "command":
        question = Question("unit of tau", "In what unit are the torques?", ANSWERS)
    return TorqueUnit(value, "assumed", seen, correct, question=question)


def _published(
    robot: Robot,
    found: Comparison,
    unit: str,
    reason: str,
    published: tuple[Sequence[float], str],
    ratios: np.ndarray,
) -> TorqueUnit:
    """A drive command with the published gains of a robot, their signs as the log shows them."""
    wrong = reversed_signs(found)
    value = [
        {"unit": unit, "gain": -gain if j in wrong else gain} for j, gain in enumerate(published[0])
    ]
    seen = f"{reason}; N m per {unit} of {published[1]}"
    if ratios.size:
        listed_ratios = listed([f"{ratio:.3g}" for ratio in ratios])
        seen += f"; gravity and inertia of the description ask for {listed_ratios} times as much"
    if wrong:
        seen += f"; {_signs_text(robot, found, wrong)}"
    correct = "Your own drives' gains, torque constant times gear ratio, are better."
    return TorqueUnit(value, "likely", seen, correct)


def gains_of(
    robot: Robot, found: Comparison, unit: float
) -> tuple[np.ndarray, list[int], list[int]]:
    """N m per unit by joint; joints whose gain follows from that of others, and those without any.

    The last get the typical gain of those that the masses give.
    """
    known, wrong = found.is_gain, reversed_signs(found)
    size = np.where(known, 1.0 / np.abs(found.factors * unit), np.nan)
    signs = np.where(np.isin(np.arange(robot.size), wrong), -1.0, 1.0)
    ratios: list[int] = []
    gains = np.array(size)
    if found.sums and not known.all():
        shared = gain_ratios(found.sums, signs, size * unit)
        ratios = np.flatnonzero(shared.connected & ~known).tolist()
        gains[ratios] = np.abs(shared.gains[ratios]) / unit
    assumed = [j for j in range(robot.size) if not known[j] and j not in ratios]
    for j in assumed:
        gains[j] = _typical_gain(robot, size, j, 1.0 / unit)
    return signs * gains, ratios, assumed


def _listed_gains(
    robot: Robot, found: Comparison, gains: np.ndarray, ratios: list[int], assumed: list[int]
) -> str:
    """Each joint's gain with what it rests on, in brackets; empty where nothing is known of any."""
    if not np.isfinite(found.factors).any() and not ratios:
        return ""
    texts = []
    for j, joint in enumerate(robot.joints):
        half = 200.0 * found.standard_errors[j] / abs(found.factors[j])
        like = abs(found.shape[j]) if len(found.shape) else np.nan
        shape = f"the torque has another shape than that of the description, correlation {like:.2f}"
        if j in ratios or j in assumed:
            why = ""
            if np.isfinite(half):
                why = f" (its masses leave ± {half:.2g} %{'; ' + shape if like < UNLIKE else ''})"
            whence = "by what it shares with the others" if j in ratios else "unknown"
            value = f"{gains[j]:.3g} " if j in ratios else ""
            texts.append(f"{joint.name} {value}{whence}{why}")
        else:
            doubt = f" ({shape}: a body that it lacks may make this gain)" if like < ALIKE else ""
            texts.append(f"{joint.name} {gains[j]:.3g} ± {half:.1g} %{doubt}")
    return f" ({', '.join(texts)})"


def _typical_gain(robot: Robot, gains: np.ndarray, j: int, default: float) -> float:
    """Median gain of the joints of the same kind, or of others in proportion to their limits."""
    joints = robot.joints
    same = [gains[k] for k in range(robot.size) if joints[k].kind == joints[j].kind]
    if np.isfinite(same).any():
        return float(np.nanmedian(same))
    limits = np.array([joint.torque_limit or np.nan for joint in joints])
    shares = gains / limits * limits[j]
    return float(np.nanmedian(shares)) if np.isfinite(shares).any() else default


def _factors_text(robot: Robot, found: Comparison) -> str:
    """How the torques compare with those of the description."""
    known = [j for j in range(robot.size) if np.isfinite(found.factors[j])]
    if not known:
        return "not compared with the description" + (
            f" ({found.trouble})" if found.trouble else ""
        )
    texts = [
        f"{robot.joints[j].name} {plus_minus(found.factors[j], 2 * found.standard_errors[j])}"
        for j in known
    ]
    return f"times the torque of the robot's masses: {', '.join(texts)}" + _load_text(robot, found)


def _load_text(robot: Robot, found: Comparison) -> str:
    """The body on the flange, where there is one."""
    if found.load is None:
        return ""
    mass = plus_minus(found.load.mass, 2 * found.load.standard_error)
    return (
        f"; beside a body of {mass} kg on the link of {robot.joints[-1].name} that the "
        "description lacks, such as a tool"
    )
