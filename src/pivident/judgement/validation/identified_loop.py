"""The closed loop that an identified model makes with its control law, joint by joint.

J_j is M_jj(q, θ̂) over the postures of the record, so it is a range rather than a number; since M
is linear in θ its standard error follows from the covariance, and so does that of the bandwidth
f_dyn:

    J_j(q) = Σ_k θ_k ∂M_jj/∂θ_k,      var f = gᵀ P g,      g = ∂f/∂J ∂J/∂θ + ∂f/∂F_v ∂F_v/∂θ

The paper's rule of thumb wants the low-pass of the positions at 5 f_dyn or more, so that it leaves
the motion alone; the parallel decimation customarily keeps 2 f_dyn (Gautier, Janot and Vandanjon
2013: 50 Hz and 20 Hz for a loop of 10 Hz). The smoother's counterpart is (A13), f50 ≥ f_dyn ·
1000^(1/2m): at most a thousandth of the motion is lost.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identification import Identification
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed
from pivident.loop.simulation.controllers import PythonController
from pivident.loop.simulation.joint_loop import JointFeedback, JointLoop, joint_feedbacks
from pivident.signals.random_walk_model import required_f50

#: The low-pass of the positions at so many bandwidths, and what the decimation keeps.
LOWPASS_FACTOR, DECIMATION_FACTOR = 5.0, 2.0

#: Standard errors on each side of an interval.
_HALF = 2.0

#: Inertias between lowest and highest at which a band is evaluated.
_INERTIAS = 9

#: Parameters that make the viscous friction of a joint.
_VISCOUS = ("fv", "fvm")


@dataclass(frozen=True, eq=False)
class IdentifiedJointLoop(Displayed):
    """One joint in its loop, with what is uncertain about it.

    Attributes:
        name: joint.
        inertia_unit: kg m² or kg.
        inertia: over the postures of the record.
        viscous: F_v [N m s/rad or N s/m], at least zero.
        viscous_std: its standard error.
        loop: at the mean inertia; None: there is none that could be drawn.
        bandwidth_std: standard error of its bandwidth from the covariance [Hz].
        slowest: bandwidth at the largest inertia less 2σ of the parameters [Hz].
        fastest: bandwidth at the smallest inertia plus 2σ [Hz].
        reason: why there is no loop or no bandwidth, a sentence; empty where there is one.
    """

    name: str
    inertia_unit: str
    inertia: InertiaRange
    viscous: float
    viscous_std: float
    loop: JointLoop | None
    bandwidth_std: float = np.nan
    slowest: float = np.nan
    fastest: float = np.nan
    reason: str = ""

    @property
    def bandwidth(self) -> float:
        """f_dyn at the mean inertia [Hz], NaN where there is none."""
        return self.loop.bandwidth if self.loop is not None and not self.reason else np.nan

    def band(self, quantity: str, frequency: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest gain over the postures, inertias widened by 2σ.

        Args:
            quantity: ``plant``, ``sensitivity`` or ``complementary``.
            frequency: frequencies [Hz], shape (points,).
        """
        assert self.loop is not None
        gains = [
            np.abs(getattr(_with_inertia(self.loop, j), quantity)(frequency))
            for j in np.linspace(*_widened(self.inertia), _INERTIAS)
        ]
        return np.min(gains, axis=0), np.max(gains, axis=0)


@dataclass(frozen=True, eq=False)
class IdentifiedLoop(Displayed):
    """The loops of all joints.

    Attributes:
        joints: one for each joint; empty where the law cannot be drawn.
        rate: control rate [Hz].
        delay: of the drive [s].
        reason: why there are none, a sentence; empty where there are.
        notes: what the linear loops leave out, whole sentences.
    """

    joints: tuple[IdentifiedJointLoop, ...]
    rate: float
    delay: float
    reason: str = ""
    notes: tuple[str, ...] = ()

    @property
    def fastest(self) -> IdentifiedJointLoop | None:
        """The joint of the largest bandwidth, which decides about common filters."""
        known = [j for j in self.joints if np.isfinite(j.bandwidth)]
        return max(known, key=lambda j: j.bandwidth) if known else None


def identified_loop(identification: Identification) -> IdentifiedLoop | None:
    """Plants, sensitivities and bandwidths of the identified model in the loop it was found with.

    Args:
        identification: result of a method that simulated a loop, as ``identify`` returned it.

    Returns:
        The loops; None where the result has no loop, signals or equations (least squares, or
        loaded from a file).
    """
    loop, equations = identification.loop, identification.equations
    if loop is None or equations is None or not identification.recordings:
        return None
    recording = equations.records[0].kinematics.recording
    rate, delay, n = recording.control_rate, recording.drive_delay, identification.robot.size
    if identification.robot.base_joints:
        return IdentifiedLoop((), rate, delay, "Loops on a measured base are not drawn.")
    try:
        feedbacks = joint_feedbacks(loop.controller, rate, n)
    except ExperimentError as error:
        return IdentifiedLoop((), rate, delay, f"The loop cannot be drawn: {error}.")
    gains = np.broadcast_to(np.asarray(loop.drive_gain, float), (n,))
    inertias = tuple(inertia_ranges(identification))
    viscous = _viscous_slopes(identification)
    joints = tuple(
        _joint(identification, j, inertias[j], viscous[j], feedbacks[j], float(gains[j]), delay)
        for j in range(n)
    )
    return IdentifiedLoop(joints, rate, delay, notes=tuple(_notes(identification)))


def _viscous_slopes(identification: Identification) -> np.ndarray:
    """∂F_v/∂θ of every joint, from the torque at unit speed, shape (joints, parameters)."""
    robot, parameters = identification.robot, identification.parameters
    n = robot.size
    slopes = np.zeros((n, len(parameters)))
    still, q = np.zeros((n, n)), np.tile(identification.recordings[0].q[0], (n, 1))
    for k, p in enumerate(parameters):
        if p.stem in _VISCOUS:
            torque = regressor_of(robot, (p,)).torque(q, np.eye(n), still, np.ones(1))
            slopes[:, k] = np.diag(torque)
    return slopes


def _joint(
    identification: Identification,
    j: int,
    inertia: InertiaRange,
    viscous_slope: np.ndarray,
    feedback: JointFeedback,
    gain: float,
    delay: float,
) -> IdentifiedJointLoop:
    """One joint in its loop; where there is none to draw, why."""
    joint = identification.robot.joints[j]
    unit = "kg m²" if joint.kind == "revolute" else "kg"
    viscous = max(float(viscous_slope @ identification.theta), 0.0)
    viscous_std = _standard_error(identification, viscous_slope)
    if not inertia.mean > 0.0:
        reason = f"the identified inertia, {inertia.mean:.3g} {unit} in the mean, is not positive"
        return IdentifiedJointLoop(
            joint.name, unit, inertia, viscous, viscous_std, None, reason=reason
        )
    loop = JointLoop(inertia.mean, viscous, feedback, gain, delay)
    reason = ""
    if not loop.is_stable:
        reason = "the sampled linear loop is not stable at the mean inertia"
    elif not np.isfinite(loop.bandwidth):
        reason = "the law does not keep the joint on its reference at any frequency"
    if reason:
        return IdentifiedJointLoop(
            joint.name, unit, inertia, viscous, viscous_std, loop, reason=reason
        )
    along_inertia, along_viscous = loop.bandwidth_slopes()
    slope = along_inertia * inertia.slope + along_viscous * viscous_slope
    lowest, highest = _widened(inertia)
    return IdentifiedJointLoop(
        joint.name,
        unit,
        inertia,
        viscous,
        viscous_std,
        loop,
        _standard_error(identification, slope),
        slowest=_with_inertia(loop, highest).bandwidth,
        fastest=_with_inertia(loop, lowest).bandwidth,
    )


def _widened(inertia: InertiaRange) -> tuple[float, float]:
    """The range with 2σ of the parameters on both sides, above zero."""
    std = np.nan_to_num(inertia.std)
    low, high = inertia.lowest - _HALF * std[0], inertia.highest + _HALF * std[2]
    return max(low, 0.02 * inertia.mean), high


def _with_inertia(loop: JointLoop, inertia: float) -> JointLoop:
    return JointLoop(inertia, loop.viscous, loop.feedback, loop.drive_gain, loop.delay)


def _notes(identification: Identification) -> Iterator[str]:
    """What the linear loops leave out."""
    loop = identification.loop
    assert loop is not None
    if isinstance(loop.controller, PythonController):
        yield "The controller is a Python function; the loop drawn is that of its linear law."
    if np.isfinite(np.asarray(loop.limit, float)).any():
        yield "The controller's output is limited; the loop drawn is that below the limit."
    if loop.reference == "smoothed":
        yield (
            "The law is a virtual one: this is the loop that was simulated, not the machine's. Its "
            "bandwidth says nothing about the motion of the record."
        )


def disagreement(used: float, wanted: float, spread: float = 0.0, tolerance: float = 1.5) -> int:
    """-1 where a frequency is clearly lower than a rule of thumb wants, 1 clearly higher, else 0.

    ``used``: frequency that was used [Hz]; ``wanted``: frequency of the rule [Hz]; ``spread``: half
    the interval of that [Hz]; nothing within it is clear.
    """
    if used * tolerance < wanted - spread:
        return -1
    return 1 if used > (wanted + spread) * tolerance else 0


def too_slow_smoothers(
    loop: IdentifiedLoop, f50: Sequence[float], order: int
) -> list[tuple[str, float, float]]:
    """Joints whose smoother takes more than a thousandth of the motion up to f_dyn.

    ``f50``: half-power frequencies of the smoothers [Hz], one per joint; NaN without one. Result:
    name, f50 and the f50 that (A13) wants [Hz].
    """
    return [
        (joint.name, float(own), wanted)
        for joint, own in zip(loop.joints, f50, strict=True)
        if own < (wanted := required_f50(joint.bandwidth, order))
    ]


#: Postures of the record at which the inertia is taken.
POSTURES = 300


@dataclass(frozen=True, eq=False)
class InertiaRange:
    """Inertia of one joint over the postures of a record, M_jj."""

    lowest: float  # smallest [kg m² or kg]
    mean: float  # mean over the postures
    highest: float  # largest
    #: Standard error of each of the three, from the covariance of the estimate, shape (3,).
    std: np.ndarray
    slope: np.ndarray  # ∂(mean)/∂θ, shape (parameters,)


def inertia_ranges(identification: Identification) -> Iterator[InertiaRange]:
    """M_jj of every joint over the postures of the fitted recordings, with standard errors."""
    postures = np.concatenate([r.q for r in identification.recordings])
    chosen = np.linspace(0, len(postures) - 1, min(POSTURES, len(postures))).round().astype(int)
    postures = np.ascontiguousarray(postures[chosen])
    robot, parameters = identification.robot, identification.parameters
    slopes = np.zeros((len(parameters), len(postures), robot.size))
    for k, p in enumerate(parameters):
        if p.is_inertial or p.stem in ("ia", "iam"):
            mass = mass_matrix(robot, (p,), np.ones(1), postures)
            slopes[k] = np.diagonal(mass, axis1=1, axis2=2)
    inertia = np.einsum("k,ksj->sj", identification.theta, slopes)
    for j in range(robot.size):
        own = inertia[:, j]
        mean = slopes[:, :, j].mean(axis=1)
        gradients = [slopes[:, own.argmin(), j], mean, slopes[:, own.argmax(), j]]
        std = np.array([_standard_error(identification, g) for g in gradients])
        yield InertiaRange(float(own.min()), float(own.mean()), float(own.max()), std, mean)


def _standard_error(identification: Identification, slope: np.ndarray) -> float:
    """√(gᵀ P g)."""
    return float(np.sqrt(max(slope @ identification.covariance @ slope, 0.0)))
