"""Why a loop cannot be simulated, found by changing one thing at a time until it can.

What users get wrong, each with its trial: rotors that the description lacks, nominal inertias, the
sign and the unit of gains, the rate of the control loop. Each is simulated up to where the record
diverged and a second beyond. The first change of the robot that makes this possible is the cause
that is named; of the changes of the law, the one whose motion is nearest to the measured one.

The inertia that a description lacks is reported by itself, too. A URDF has no place for rotors.
Behind a gear of ratio r a rotor counts r² times, at the wrist more than the link it turns; without
it the controller's gains, which were tuned on the machine, act on a much lighter arm, and the
sampled loop of that arm diverges.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import ExperimentError, PividentError, SimulationFailed
from pivident.loop.simulation.joint_loop import JointFeedback, JointLoop, joint_feedbacks

#: How much longer than until it diverged a loop has to be simulated [s].
LONGER = 1.0

#: Factors of the gains that are tried: those of common units, and others in between.
GAIN_FACTORS = (np.pi / 180.0, 180.0 / np.pi, 0.1, 10.0, 0.3, 3.0)

#: Factors of the control rate that are tried.
RATE_FACTORS = (2, 4, 10)


@dataclass(frozen=True, eq=False)
class Trial:
    """A change, and the sentence that names the cause if the loop can be simulated with it."""

    problem: Problem
    theta: np.ndarray
    cause: str
    of_law: bool = True


def divergence_cause(problem: Problem, error: SimulationFailed) -> list[str]:
    """The cause in a sentence with the next step; that none was found, otherwise.

    Args:
        problem: what was simulated from its initial values.
        error: how that ended.
    """
    shorter = _until(problem, error.time)
    described = missing_inertia(problem)
    away: dict[str, float] = {}
    for trial in _trials(shorter, described):
        away[trial.cause] = _away(trial)
        if not trial.of_law and np.isfinite(away[trial.cause]):
            return [trial.cause]
    nearest = min(away, key=away.__getitem__)
    if np.isfinite(away[nearest]):
        return [nearest]
    advice = (
        "Neither rotors, inertias, gains nor rate make the loop one that can be simulated: the "
        "law has another form, or reference and torque belong to another one. "
        'instruments = "response" or "virtual" do without it'
    )
    return [*described, advice]


def _until(problem: Problem, time: float) -> Problem:
    """The records up to a little after the instant at which the loop diverged."""
    parts = []
    for own in problem.recordings:
        samples = int((time + LONGER) * own.rate)
        parts.append(own.part(0, samples) if 100 < samples < own.samples else own)
    return replace(problem, recordings=tuple(parts))


def _trials(problem: Problem, described: list[str]) -> Iterator[Trial]:
    """All changes, the most frequent cause first."""
    nominal, fitted = problem.initial_values(), _least_squares(problem)
    if fitted is not None:
        rotors = np.array([name.startswith("ia") for name in problem.names])
        with_rotors = np.where(rotors, np.maximum(fitted, nominal), nominal)
        lacking = "; ".join(described) if described else "the nominal rotor inertias are too small"
        yield Trial(
            problem,
            with_rotors,
            f"With the rotor inertia of least squares the loop can be simulated: {lacking}",
            of_law=False,
        )
        yield Trial(
            problem,
            fitted,
            "With the estimate of least squares the loop can be simulated: the nominal values of "
            f"{_farthest(problem, nominal, fitted)} are far from it. Use piv, which starts from "
            "least squares, or enter its estimate under initial",
            of_law=False,
        )
        nominal = fitted
    loop = problem.loop
    assert loop is not None
    turned = replace(loop, drive_gain=-np.asarray(loop.drive_gain, float))
    yield Trial(
        replace(problem, loop=turned),
        nominal,
        "With torque of the other sign the loop can be simulated: check the sign of drive_gain and "
        "of the torque",
    )
    for times in RATE_FACTORS:
        faster = tuple(
            replace(own, control_rate=times * own.control_rate) for own in problem.recordings
        )
        rate = faster[0].control_rate
        yield Trial(
            replace(problem, recordings=faster),
            nominal,
            f"With a control rate of {rate:g} Hz the loop can be simulated: the controller runs "
            "faster than the log; enter its rate as control_rate under [recording]",
        )
    for factor in GAIN_FACTORS:
        gain = factor * np.asarray(loop.drive_gain, float)
        yield Trial(
            replace(problem, loop=replace(loop, drive_gain=gain)),
            nominal,
            f"With gains {factor:.3g} times as large the loop can be simulated: check their unit "
            "(N m per rad on the joint side) and drive_gain",
        )


def _least_squares(problem: Problem) -> np.ndarray | None:
    """Of least squares, nominal where records show nothing; None where it cannot."""
    try:
        found = identify(replace(problem, loop=None), LeastSquares(signals=RandomWalk()))
    except PividentError:
        return None
    values = dict(zip(problem.names, problem.initial_values(), strict=True))
    return np.array(list((values | dict(zip(found.names, found.theta, strict=True))).values()))


def _farthest(problem: Problem, nominal: np.ndarray, fitted: np.ndarray) -> str:
    """The inertias that differ most from their nominal values."""
    inertial = [k for k, name in enumerate(problem.names) if name[:2] in ("zz", "ia", "xx", "yy")]
    ratio = np.abs(fitted - nominal) / np.maximum(np.abs(nominal), 1e-3 * np.abs(fitted).max())
    worst = sorted(inertial, key=lambda k: -ratio[k])[:3]
    return (
        ", ".join(f"{problem.names[k]} ({nominal[k]:.3g} for {fitted[k]:.3g})" for k in worst)
        or "the parameters"
    )


def _away(trial: Trial) -> float:
    """Rms of simulated less measured positions over each joint's range; ∞ if it diverges."""
    try:
        auxiliary = AuxiliaryModel(trial.problem, differences=True, torque=False)
        motions = auxiliary.simulate(trial.theta)
    except SimulationFailed:
        return np.inf
    shares = [
        np.mean((motion.q.T - own.q) ** 2, axis=0) / np.maximum(np.ptp(own.q, axis=0), 1e-9) ** 2
        for motion, own in zip(motions, trial.problem.recordings, strict=True)
    ]
    return float(np.sqrt(np.mean(shares)))


#: Largest inertia that is tried, relative to that of the links, and how many there are.
REACH, TRIED = 1e4, 81


def missing_inertia(problem: Problem) -> list[str]:
    """What the robot's description lacks, one sentence for links and one for rotors."""
    return [*_links(problem), *_rotors(problem)]


def _links(problem: Problem) -> list[str]:
    """Links without a nominal inertia."""
    tree = problem.robot.tree
    empty = [
        f"{link.name!r} (joint {joint.name!r})"
        for joint, link in zip(tree.joints, tree.links, strict=True)
        if link.is_body and not link.inertia.any()
    ]
    if not empty:
        return []
    return [
        f"the nominal inertia of link {', '.join(empty)} is zero and the simulation starts from "
        "it: give <inertial> in the URDF or link in the table, rotor_inertia under [robot], or "
        "initial values from a least-squares run"
    ]


def _rotors(problem: Problem) -> list[str]:
    """Rotors without a nominal inertia, and how much inertia their loops need."""
    robot = problem.robot
    if robot.torque_side == "link":
        return []  # they are no part of its model
    without = [
        j
        for j in range(robot.size)
        if robot.rotor_inertia[j] == 0.0
        and robot.links[j].inertia.any()
        and not _starts_elsewhere(problem, j)
    ]
    if not without:
        return []
    names = ", ".join(repr(robot.joints[j].name) for j in without)
    table = ", ".join(f"{robot.joints[j].name} = …" for j in without)
    text = (
        f"the rotor inertia of {names} is zero in the robot's description, and the simulation "
        f"starts from it: give rotor_inertia = {{{table}}} under [robot], in kg m² on the joint "
        "side, the motor's times the gear ratio squared; a least-squares run (-m ls) estimates "
        "it as ia"
    )
    wanted = _wanted(problem, without)
    if wanted:
        text += f". With these gains {'; '.join(wanted)}"
    return [text]


def _starts_elsewhere(problem: Problem, j: int) -> bool:
    """Whether an initial value stands for the rotor of a joint, alone or in a group."""
    name = f"ia{problem.robot.label(problem.robot.places[j])}"
    rotor = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    given = {name.lower().removesuffix("r") for name in problem.initial}
    return any(
        head.name.lower() in given and rotor.search(group)
        for head, group in zip(problem.base.parameters, problem.base.expressions, strict=True)
    )


def _wanted(problem: Problem, joints: list[int]) -> list[str]:
    """How much inertia is missing at least where the linear loop of the bare links is unstable.

    The inertia against which a drive works, with the other joints free, is 1/(M⁻¹)_jj.
    """
    loop, recording, robot = problem.loop, problem.recordings[0], problem.robot
    assert loop is not None, "a simulation has one"
    if robot.base_joints:
        return []  # whose mass matrix is not that of the arm alone
    try:
        feedbacks = joint_feedbacks(loop.controller, recording.control_rate, robot.size)
        mass = mass_matrix(
            robot, problem.regressor.parameters, problem.initial_values(), recording.q[:1]
        )[0]
        own = 1.0 / np.diag(np.linalg.inv(mass))
    except (ExperimentError, np.linalg.LinAlgError):
        return []  # a law that is a function, or a link without any inertia
    gains = np.broadcast_to(np.asarray(loop.drive_gain, float), (robot.size,))
    found = []
    for j in joints:
        least = _least_inertia(own[j], feedbacks[j], float(gains[j]), recording.drive_delay)
        if least > own[j]:
            unit = "kg m²" if robot.joints[j].kind == "revolute" else "kg"
            found.append(
                f"the loop of {robot.joints[j].name!r} is unstable at {recording.control_rate:.5g} "
                f"Hz below about {least:.2g} {unit}, of which its links give {own[j]:.2g} {unit}"
            )
    return found


def _least_inertia(links: float, feedback: JointFeedback, gain: float, delay: float) -> float:
    """Smallest inertia at or above that of the links with which the loop is stable.

    NaN where there is none.
    """
    if not links > 0.0:
        return np.nan
    for inertia in links * np.geomspace(1.0, REACH, TRIED):
        if JointLoop(float(inertia), 0.0, feedback, gain, delay).is_stable:
            return float(inertia)
    return np.nan
