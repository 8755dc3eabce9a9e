"""What is given: robot, recordings, control loop, parameters to estimate, mask, torque or none.

A ``Problem`` is method-free: the same one goes to ``identify`` with LS, IV and PIV.

What positions alone cannot tell, and which methods make sense of them.

A torque computed from the control law, τ = C (q_ref - q), holds nothing that reference, position
and gains do not. Scaling the gains scales it, and with it inertia, friction and gravity alike: the
motion stays the same. The encoder noise is in it as it is in the regressor, so least squares is
biased by construction.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from pivident.data.logs.torque_scale import OUTPUT_UNIT, is_ratio
from pivident.data.recording.checks import check_torques, check_within_reach
from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.data.recording.usable_samples import filled
from pivident.dynamics.base_parameters import BaseParameters, base_parameters, parameter_index
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.dynamics.separation import KIND
from pivident.estimation.known_parameters import Equalities, KnownParameters, Priors
from pivident.estimation.restrictions import Restrictions
from pivident.foundation.errors import ExperimentError, IdentificationError, concerning
from pivident.foundation.text.display import Printed
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.sentences import listed
from pivident.loop.motion.law_torque import with_law_torque
from pivident.loop.motion.motion import SpeedLimits
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PythonController
from pivident.robot.description import Robot
from pivident.robot.naming import nearest

#: Share of the rated speed below which rows are excluded.
LOW_SPEED = 0.01
#: Fields of a problem that nothing is known beforehand of.
NOTHING_KNOWN: dict[str, Any] = {"fixed": {}, "bounds": {}, "priors": (), "constraints": ()}
#: Topic of the findings.
TOPIC = "without torque"
#: What every result of such a log says.
_SCALE = Finding(
    "warning",
    TOPIC,
    "scale",
    "No torque was logged. Positions cannot tell the common scale of inertias, friction, gravity "
    "and gains: it is that of the declared gains. If these are all 10 % too large, so are all "
    "parameters, and no test of this record shows it; their intervals do not contain it.",
    next_step="Compare a parameter with a known mass or inertia before you use their sizes.",
)
#: The same where the law feeds torques of the description forward, which are in N m by themselves.
_FED_SCALE = replace(
    _SCALE,
    message="No torque was logged. The scale of inertias, friction and gravity is that of the "
    "declared gains and of the description, whose torques the law feeds forward. If all of these "
    "are 10 % too large, so are all parameters, and no test of this record shows it; their "
    "intervals do not contain it.",
)
#: The same where the drive gain is not known.
_RATIO = Finding(
    "warning",
    TOPIC,
    "ratio",
    "No torque was logged, and the drive gain is not known. Positions cannot tell the common scale "
    "of inertias, friction, gravity and gains: every parameter is a ratio to the drive gain, the "
    "same for all joints. Ratios between parameters hold, their sizes in SI units are not known.",
    next_step="Write drive_gain, the joint torque per unit of the law's output, under "
    "[controller]; one known mass or inertia gives it as that value over its estimate.",
)
#: What least squares of a computed torque says.
BIASED = Finding(
    "warning",
    TOPIC,
    "biased",
    "Least squares is biased here by construction: the torque was computed from the measured "
    "positions, so their noise is in it and in the regressor alike, multiplied by the gains.",
    next_step="Compare with cloe.",
)
#: The same of instrumental variables.
EQUATION_ERROR = Finding(
    "warning",
    TOPIC,
    "equation error",
    "The torque was computed from the measured positions and contains their noise, multiplied by "
    "the gains. Instruments are free of it only where they come from the reference alone.",
    next_step="Compare with cloe.",
)


def rated_speeds(robot: Robot, recording: Recording) -> np.ndarray:
    """Rated speeds; where one is not known, the fastest motion of the record, shape (joints,)."""
    rated = robot.rated_speeds
    for j in np.flatnonzero(~np.isfinite(rated)):
        rated[j] = np.abs(np.diff(recording.q[:, j])).max() * recording.rate
    return rated


def scale_findings(loop: Loop | None, recordings: Sequence[Recording]) -> tuple[Finding, ...]:
    """What results of recordings whose torque is that of the law have to say.

    Args:
        loop: the loop, or None.
        recordings: the runs.

    Returns:
        Findings; none where every torque was measured.
    """
    computed = [r for r in recordings if r.torque_source == "law"]
    if loop is None or not computed:
        return ()
    known = _SCALE if loop.feed_forward == "none" else _FED_SCALE
    found = [known if loop.gain_known else _RATIO]
    first = computed[0]
    assert first.q_ref is not None, "the torque was computed from it"
    if not isinstance(loop.controller, PythonController):
        law = loop.controller.law(first.rate, first.q_ref[:1], None)
        if joints := [n for n, k in zip(first.joint_names, law.integral_gain, strict=True) if k]:
            found.append(_integrator(joints))
    return tuple(found)


def _integrator(joints: Sequence[str]) -> Finding:
    """What a law that integrates leaves open."""
    text = (
        f"The control law of {listed(joints)} integrates, and what its integrator held at the "
        "first sample was not logged: the computed torque may lack a constant in each recording, "
        "which gravity and offsets take up."
    )
    step = "Begin the log before the controller is switched on, or take the offsets for that."
    return Finding("warning", TOPIC, "integrator", text, next_step=step)


@dataclass(frozen=True, eq=False)
class Problem(Printed):
    """Robot, recordings and loop: everything but the method.

    Attributes:
        robot: the robot; for torques of sensors behind the gears without its rotors and drives,
            see `Robot.with_link_torques`.
        recordings: one run or several that share the parameters, their joints found by name, see
            `pivident.data.recording.joint_order`. Those without torque get that of the loop's known
            control law.
        loop: the control loop, from which IV and PIV make their instruments; None: they take them
            from the record itself.
        parameters: names of the base parameters to estimate (with or without the trailing
            ``r``); None: all of them.
        mask: rows of a joint slower than this share of its rated speed are excluded; ``auto``:
            1 %, for at standstill dry friction follows no law. None or 0: all rows are used.
        initial: starting values by parameter name; base parameters not named start at their
            nominal value, frictions at zero.
        fixed: values by parameter name that are not estimated but known; ``description``: those
            that the robot's description knows of the parameters that are not among
            ``parameters``, which otherwise are zero.
        bounds: least and largest value by parameter name, None for none, as in ``(0, None)``.
        priors: expected value and standard deviation by parameter name, or several of them as a
            `Prior` with a covariance; they count as further measurements.
        weights: what samples count: a number by joint name, an array of shape (samples, joints), or
            one such array for each recording, as the ``weights`` of `Recording`, where they are
            kept. Zero leaves a sample out.
        without_equation: names of joints whose motion counts, but whose torque does not.
        constraints: linear equations, each as coefficients by parameter name and their value:
            ``({"zz1r": 1.0, "ia1": -2.0}, 0.0)``.
        reference_temperature: that friction belongs to where it is corrected for the temperature of
            the recordings [°C or K, as theirs]; None: their mean.
        without_loop: why there is no loop, a sentence, where one was looked for.
        findings: what was decided about the model beforehand; every result repeats it.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,), loop, fixed={"fc1": 4.0})
        >>> problem
        <Problem of 'planar 2R': 13 parameters, 1 recording, loop with PD>
        >>> result = pv.identify(problem, "piv")
        >>> result.params["fc1"], result.bse["fc1"]
        (4.0, 0.0)
    """

    robot: Robot
    recordings: Sequence[Recording]
    loop: Loop | None = None
    parameters: tuple[str, ...] | None = None
    mask: Literal["auto"] | float | None = "auto"
    initial: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float] | Literal["description"] = field(default_factory=dict, kw_only=True)
    bounds: Mapping[str, tuple[float | None, float | None]] = field(
        default_factory=dict, kw_only=True
    )
    priors: Priors = field(default=(), kw_only=True)
    constraints: Equalities = field(default=(), kw_only=True)
    weights: Mapping[str, float] | Sequence[ArrayLike] | np.ndarray | None = field(
        default=None, kw_only=True
    )
    without_equation: tuple[str, ...] = field(default=(), kw_only=True)
    reference_temperature: float | None = field(default=None, kw_only=True)
    without_loop: str = ""
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.recordings, Iterable) or isinstance(self.recordings, str):
            object.__setattr__(self, "recordings", (self.recordings,))
        object.__setattr__(self, "recordings", tuple(self.recordings))
        self._check_kinds()
        if not self.recordings:
            raise IdentificationError("no recording given", advice="at least one is needed")
        object.__setattr__(self, "robot", _robot_of_torques(self.robot, self.recordings))
        matched = tuple(in_order_of(self.robot, recording) for recording in self.recordings)
        object.__setattr__(self, "recordings", matched)
        for recording in self.recordings:
            check_within_reach("q", recording.q, self.robot)
            if recording.q_ref is not None:
                check_within_reach("q_ref", recording.q_ref, self.robot)
        if self.loop is not None:
            self.loop.controller.check(self.robot.size - self.robot.base_joints)
        self._weigh_samples()
        check_torques(self.recordings, self.robot)
        self._complete_torques()
        if isinstance(self.mask, (int, float)) and not 0 <= self.mask < 1:
            raise ExperimentError(f"mask is a share of the rated speed, 0 to 1, not {self.mask}")
        base = base_parameters(self.robot)
        object.__setattr__(self, "base", base)
        self._settle_known(base)
        object.__setattr__(
            self,
            "regressor",
            regressor_of(self.robot, [base.parameters[k] for k in self.selection]),
        )
        self.initial_values()  # unknown names are refused now, not after minutes of work

    def _check_kinds(self) -> None:
        """Refuse names and laws where robots, recordings and loops are needed."""
        if not isinstance(self.robot, Robot):
            raise ExperimentError(
                f"robot is {self.robot!r}",
                advice=f"give a Robot, such as load_robot({str(self.robot)!r})",
            )
        if self.loop is not None and not isinstance(self.loop, Loop):
            law = type(self.loop).__name__
            raise ExperimentError(
                f"loop is of type {law}", advice=f"wrap a control law, Loop({law}(…))"
            )
        for recording in self.recordings:
            if not isinstance(recording, Recording):
                raise ExperimentError(
                    f"{recording!r} is not a recording",
                    advice="load_recording reads one from a log",
                )

    def _weigh_samples(self) -> None:
        """Weights and equations that are left out, as the recordings have them."""
        joints = self.robot.joint_names
        given = self.without_equation
        alone = (given,) if isinstance(given, str) else tuple(given)
        if strangers := [name for name in alone if name not in joints]:
            raise ExperimentError(
                f"there is no joint {strangers[0]!r}", advice=nearest(strangers[0], joints)
            ).about("without_equation")
        if set(alone) == set(joints):
            raise ExperimentError("no joint has an equation", advice="keep at least one").about(
                "without_equation"
            )
        object.__setattr__(self, "without_equation", alone)
        if not alone and self.weights is None:
            return
        silent = np.array([name in alone for name in joints])
        with concerning("weights"):
            weights = _weights(self.weights, self.recordings, joints)
        recordings = []
        for recording, own in zip(self.recordings, weights, strict=True):
            valid = np.ones(recording.q.shape, bool) if recording.valid is None else recording.valid
            tau = recording.tau
            if own is not None and not own.all():
                gone = own == 0.0
                valid, own = valid & ~gone, np.where(gone, 1.0, own)
                # or filters would carry what is wrong there into the samples beside it
                tau = filled(np.where(gone & valid.any(axis=0), np.nan, tau), False)
            own = recording.weights if own is None or (own == 1.0).all() else own
            recordings.append(replace(recording, tau=tau, valid=valid & ~silent, weights=own))
        object.__setattr__(self, "recordings", tuple(recordings))
        object.__setattr__(self, "weights", None)

    def _complete_torques(self) -> None:
        """The torque of the control law where none was logged, and what that leaves open."""
        made = tuple(with_law_torque(self.robot, self.loop, r) for r in self.recordings)
        open_ = scale_findings(self.loop, made)
        findings = (*self.findings, *(f for f in open_ if f not in self.findings))
        object.__setattr__(self, "recordings", made)
        object.__setattr__(self, "findings", findings)

    def _settle_known(self, base: BaseParameters) -> None:
        """The parameters by their names in the robot's order, and what is known of them."""
        with concerning("parameters"):
            chosen = _selection(base, self.parameters)
        fixed = self.fixed
        if isinstance(fixed, str):
            with concerning("fixed"):
                fixed = _described(base, self.robot, chosen, fixed)
        known = KnownParameters.of(base, fixed, self.bounds, self.priors, self.constraints)
        own = {base.names[k] for k in chosen} | known.fixed.keys()
        if strangers := sorted(known.names - own):
            raise ExperimentError(
                f"{listed(strangers)} should be restricted, but {strangers[0]} is not among the "
                "parameters to estimate",
                advice="name it under parameters, or leave out what is said of it",
            ).about("parameters")
        object.__setattr__(
            self, "selection", tuple(k for k, n in enumerate(base.names) if n in own)
        )
        object.__setattr__(self, "known", known)
        for name in ("fixed", "bounds", "priors", "constraints"):
            object.__setattr__(self, name, getattr(known, name))
        object.__setattr__(self, "restrictions", known.restrictions(self.names))

    def estimating(self, names: Sequence[str], findings: Sequence[Finding] = ()) -> Problem:
        """The problem of fewer parameters, with what is known of those that are left.

        Args:
            names: of the parameters to estimate; those that are fixed stay.
            findings: what is to be said of it.

        Raises:
            ExperimentError: a parameter that is left out stands in a constraint or has a prior.
        """
        kept = {self.base.names[parameter_index(self.base, name)] for name in names}
        gone = set(self.names) - kept - self.known.fixed.keys()
        known = self.known.without(gone)
        if (
            len(known.priors) < len(self.known.priors)
            or known.constraints != self.known.constraints
        ):
            raise ExperimentError(
                f"{listed(sorted(gone))} should be left out, but a prior or a constraint is about "
                "them",
                advice="leave that out, or take a motion that separates them",
            )
        findings = (*self.findings, *findings)
        return replace(self, parameters=tuple(names), bounds=known.bounds, findings=findings)

    base: BaseParameters = field(init=False, repr=False)
    known: KnownParameters = field(init=False, repr=False)
    restrictions: Restrictions = field(init=False, repr=False)
    selection: tuple[int, ...] = field(init=False, repr=False)
    regressor: Regressor = field(init=False, repr=False)

    def __repr__(self) -> str:
        records = f"{len(self.recordings)} recording{'s' * (len(self.recordings) != 1)}"
        law = "no loop" if self.loop is None else f"loop with {type(self.loop.controller).__name__}"
        return (
            f"<Problem of {self.robot.name!r}: {len(self.selection)} parameters, {records}, {law}>"
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the estimated parameters."""
        return tuple(self.base.names[k] for k in self.selection)

    @cached_property
    def expressions(self) -> tuple[str, ...]:
        """Their groups written out."""
        return tuple(self.base.expressions[k] for k in self.selection)

    @cached_property
    def silent_joints(self) -> tuple[str, ...]:
        """Joints without an equation: no recording has a torque of them that counts."""
        heard = np.zeros(self.robot.size, bool)
        for recording in self.recordings:
            heard |= True if recording.valid is None else recording.valid.any(axis=0)
        return tuple(n for n, own in zip(self.robot.joint_names, heard, strict=True) if not own)

    @cached_property
    def varying(self) -> np.ndarray:
        """Which parameters are estimated rather than fixed, shape (parameters,)."""
        return ~self.restrictions.is_fixed

    @property
    def reads_counts(self) -> bool:
        """Whether the control law is known to read whole counts of some joint."""
        joints = self.robot.size - self.robot.base_joints
        return self.loop is not None and bool(self.loop.counts(joints).any())

    def speed_limits(self, recording: Recording) -> SpeedLimits:
        """Speeds below which samples of a recording are excluded."""
        share = LOW_SPEED if self.mask == "auto" else self.mask or 0.0
        joints = share * rated_speeds(self.robot, recording)
        if self.robot.constraints is None:  # feet that stand bring the friction of their legs along
            joints[: self.robot.base_joints] = 0.0
        return SpeedLimits(joints, self.robot.couplings)

    def low_speeds(self, recording: Recording) -> np.ndarray:
        """Speed in a recording that counts as standstill [rad/s or m/s], shape (joints,).

        Below zero for the joints of a measured base, which have no friction that would hold them.
        """
        speeds = LOW_SPEED * rated_speeds(self.robot, recording)
        speeds[: self.robot.base_joints] = -1.0
        return speeds

    def initial_values(self) -> np.ndarray:
        """Start of the iteration: nominal inertias, zero friction, then ``initial`` by name.

        Raises:
            ExperimentError: names an unknown parameter and the nearest known one.
        """
        nominal = nominal_values(self.robot, self.base.standard)
        for k, p in enumerate(self.base.standard):
            if p.friction is not None or p.coupling is not None:
                nominal[k] = 0.0
        values = self.base.values(nominal)
        with concerning("initial"):
            for name, value in self.initial.items():
                values[parameter_index(self.base, name)] = float(value)
        values, known = values[list(self.selection)], self.restrictions
        values = np.clip(values, known.low, known.high)
        values[known.is_fixed] = known.freedom.offset[known.is_fixed]
        return values


def _robot_of_torques(robot: Robot, recordings: Sequence[Recording]) -> Robot:
    """The robot as the sensors of the recordings feel it."""
    if all(recording.torque_side == robot.torque_side for recording in recordings):
        return robot
    motor = next((r.name for r in recordings if r.torque_side == "motor"), None)
    if motor is None:
        return robot.with_link_torques()
    others = "other recordings are" if robot.torque_side == "motor" else f"{robot.name!r} is"
    raise ExperimentError(
        f"recording {motor!r} has torques of the motors, but {others} of sensors behind the gears",
        advice='set torque_side = "link" in every recording, or in none',
    )


def _weights(
    given: Any, recordings: Sequence[Recording], joints: Sequence[str]
) -> list[np.ndarray | None]:
    """Weights of the samples of each recording, shape (samples, joints), None for all one."""
    if given is None:
        return [None] * len(recordings)
    if isinstance(given, Mapping):
        if strangers := [name for name in given if name not in joints]:
            raise ExperimentError(
                f"there is no joint {strangers[0]!r}", advice=nearest(strangers[0], joints)
            )
        row = np.array([float(given.get(name, 1.0)) for name in joints])
        return [np.broadcast_to(row, recording.q.shape) for recording in recordings]
    own = [given] if isinstance(given, np.ndarray) and given.ndim == 2 else list(given)
    if len(own) != len(recordings):
        raise ExperimentError(
            f"there are weights for {len(own)} recordings, and {len(recordings)} recordings",
            advice="give an array of shape (samples, joints) for each, or a number by joint name",
        )
    found: list[np.ndarray | None] = []
    for recording, weights in zip(recordings, own, strict=True):
        array = None if weights is None else np.asarray(weights, float)
        if array is not None and array.shape != recording.q.shape:
            raise ExperimentError(
                f"weights of recording {recording.name!r} have shape {array.shape}",
                advice=f"its samples have shape {recording.q.shape}",
            )
        found.append(array)
    return found


def taken_as_zero(problem: Problem) -> tuple[Finding, ...]:
    """What the description knows of parameters that the problem leaves out, for their results.

    Those that the motion does not separate are not among them: others hold their part.
    """
    held = {n for f in problem.findings if f.kind == KIND for n in f.subject.split(", ")}
    values = problem.base.values(nominal_values(problem.robot, problem.base.standard))
    gone = [
        f"{name} ({value:.4g} {parameter.unit})"
        for name, value, parameter in zip(
            problem.base.names, values, problem.base.parameters, strict=True
        )
        if value and name not in problem.names and name not in held
    ]
    if not gone:
        return ()
    text = (
        f"Parameters that are not estimated are taken as zero. The description knows of them: "
        f"{listed(gone)}."
    )
    step = 'To take the description\'s values set fixed = "description".'
    return (Finding("note", "parameters", "taken as zero", text, next_step=step),)


def _described(
    base: BaseParameters, robot: Robot, chosen: Sequence[int], word: str
) -> dict[str, float]:
    """What the description knows of the parameters that are not chosen, zeros left out."""
    if word != "description":
        raise ExperimentError(
            f"fixed is {word!r}", advice='give values by parameter name, or "description"'
        )
    if len(chosen) == len(base):
        raise ExperimentError(
            "the description's values are those of parameters that are not estimated, but all are",
            advice="name the parameters to estimate",
        )
    values = base.values(nominal_values(robot, base.standard))
    return {n: float(values[k]) for k, n in enumerate(base.names) if k not in chosen and values[k]}


def torque_units(problem: Problem) -> list[str]:
    """N m or N, for each joint; that of the controller's output where no drive gain is known."""
    if any(is_ratio(recording.torque_scale) for recording in problem.recordings):
        return [OUTPUT_UNIT] * problem.robot.size
    return [joint.torque_unit for joint in problem.robot.joints]


def position_units(problem: Problem) -> list[str]:
    """Unit of each joint's position, rad or m."""
    return [joint.position_unit for joint in problem.robot.joints]


def _selection(base: BaseParameters, names: Sequence[str] | None) -> tuple[int, ...]:
    """Indices of the chosen base parameters, in the base set's order."""
    if names is None:
        return tuple(range(len(base)))
    chosen = [parameter_index(base, name) for name in names]
    if len(set(chosen)) != len(chosen):
        twice = next(name for name in names if chosen.count(parameter_index(base, name)) > 1)
        raise ExperimentError(f"parameter {twice!r} is asked for twice")
    if not chosen:
        raise ExperimentError(
            "the list of parameters is empty", advice="leave it out to estimate all"
        )
    return tuple(sorted(chosen))
