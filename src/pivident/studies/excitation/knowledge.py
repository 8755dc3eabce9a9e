"""What is known before a motion is designed: values, their covariance, the noise to expect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identification import Identification
from pivident.estimation.solved_equations import EquationNoise
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot
from pivident.studies.excitation.information import assumed_noise
from pivident.studies.excitation.limits import JointLimits

#: Noise of the torque where no result gives it: this share of the largest torque, in so many
#: independent rows per second.
NOISE_SHARE, NOISE_RATE = 0.01, 40.0

#: A parameter matters from the size on at which its torque reaches this share of the largest one.
SIGNIFICANT = 0.01

#: Random states in the limits at which columns are measured.
STATES = 200


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known of a robot.

    Attributes:
        base: its base parameters.
        regressor: their observation matrix.
        values: present values, NaN where none is known, shape (base,).
        significant: size of each parameter from which on its torque is noticeable, shape (base,).
        covariance: covariance of ``values``, or None.
        earlier: information of the earlier records, shape (base, base).
        noise: noise of the equations to expect.
        noise_words: where it comes from, one sentence.
        notes: reservations, complete sentences.
    """

    base: BaseParameters
    regressor: Regressor
    values: np.ndarray
    significant: np.ndarray
    covariance: np.ndarray | None
    earlier: np.ndarray
    noise: EquationNoise
    noise_words: str
    notes: tuple[str, ...]

    @property
    def has_masses(self) -> bool:
        """Whether any inertial parameter has a value, so that torques can be computed."""
        inertial = np.array([p.is_inertial for p in self.base.parameters])
        return bool(np.isfinite(self.values[inertial]).any())

    @property
    def model_values(self) -> np.ndarray:
        """Values for torques: zero where none is known, shape (base,)."""
        return np.nan_to_num(self.values)


def knowledge(
    robot: Robot,
    limits: JointLimits,
    after: Sequence[Identification] = (),
    torque_noise: np.ndarray | None = None,
) -> Knowledge:
    """What a description and earlier results say about a robot.

    Args:
        robot: the robot.
        limits: of its joints.
        after: earlier results, the last one first; their information adds up, values and noise are
            those of the first one.
        torque_noise: standard deviation of the torque where no result gives it, in rows that are
            independent at 40 Hz, shape (joints,) [N m or N]; None: a share of the largest torques.

    Raises:
        ExperimentError: a result of another robot.
    """
    base = base_parameters(robot)
    regressor = regressor_of(robot, base.parameters)
    notes: list[str] = []
    values = base.values(nominal_values(robot, base.standard))
    values = np.where(values == 0.0, np.nan, values)
    covariance, earlier = None, np.zeros((len(base), len(base)))
    for result in after:
        earlier += _information_of(base, result)
    if after:
        values = _values_of(base, after[0], values)
        covariance = _covariance_of(base, after[0])
    lengths = _column_lengths(regressor, limits)
    torque, known_torque = _largest_torques(robot, limits, lengths, values)
    noise = _noise_of(after[0]) if after else None
    if noise is not None:
        words = f"Noise as {after[0].method} found it."
    elif torque_noise is not None:
        noise = assumed_noise(torque_noise, NOISE_RATE)
        words = f"Noise as given, in {NOISE_RATE:g} independent rows per second."
    else:
        noise = assumed_noise(NOISE_SHARE * torque, NOISE_RATE)
        each = ", ".join(
            f"{joint.name} {NOISE_SHARE * size:.2g} {joint.torque_unit}"
            for joint, size in zip(robot.joints, torque, strict=True)
        )
        words = (
            f"The noise is assumed: {100 * NOISE_SHARE:g} % of the largest torque of each joint, "
            f"in {NOISE_RATE:g} independent rows per second ({each}). Standard errors are as good "
            "as that; their ratios hold for any noise of one share of all torques."
        )
        if unknown := [robot.joint_names[j] for j in np.flatnonzero(~known_torque)]:
            notes.append(
                f"Neither a torque limit nor a mass is known of {listed(unknown)}: their largest "
                "torque is taken as 1, so that standard errors mean nothing but their ratios. Give "
                "torque_noise, or the torque limits."
            )
        if after:
            notes.append(
                "The earlier result does not hold its noise, because it was written by an older "
                "version; identify again for standard errors that rest on the noise of your robot."
            )
    with np.errstate(divide="ignore"):
        significant = SIGNIFICANT * (torque[:, None] / lengths).min(axis=0)
    return Knowledge(
        base, regressor, values, significant, covariance, earlier, noise, words, tuple(notes)
    )


def _places(base: BaseParameters, result: Identification) -> list[int]:
    """Places of a result's parameters among the base parameters."""
    if result.robot.joint_names != base.robot.joint_names:
        raise ExperimentError(
            "the earlier result is of another robot, with the joints "
            f"{listed(result.robot.joint_names)}",
            advice=f"this one has {listed(base.robot.joint_names)}",
        ).about("after")
    known = {name: k for k, name in enumerate(base.names)}
    foreign = [name for name in result.names if name not in known]
    if foreign:
        raise ExperimentError(
            f"the earlier result has parameters that this robot has not: {listed(foreign)}",
            advice="design for the robot and friction law of the result, by naming the result "
            "itself",
        ).about("after")
    return [known[name] for name in result.names]


def _information_of(base: BaseParameters, result: Identification) -> np.ndarray:
    """P⁻¹ of an earlier estimate, at its places."""
    places = _places(base, result)
    out = np.zeros((len(base), len(base)))
    std = result.method_std
    if np.isfinite(result.covariance).all() and (std > 0.0).all():
        correlation = result.covariance / np.outer(std, std)
        inverse = np.linalg.pinv(correlation, rcond=1e-12, hermitian=True)
        out[np.ix_(places, places)] = inverse / np.outer(std, std)
    return out


def _noise_of(result: Identification) -> EquationNoise | None:
    """Noise of a result's equations, as large as the standard errors that it reports.

    What its prefilters leave of the residual may still be correlated, by model error for instance.
    Then the reported standard errors are larger than those of white residuals, and those of the
    next record will be, by the same factor: that of the joint, in geometric mean.
    """
    noise = result.equation_noise
    if noise is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.log(result.method_std / result.formula_std)
    joints = np.array([p.joint for p in result.parameters])
    known = np.isfinite(excess)
    whole = float(excess[known].mean()) if known.any() else 0.0
    filters = []
    for j, prefilter in enumerate(noise.filters):
        own = known & (joints == j)
        factor = float(np.exp(excess[own].mean() if own.any() else whole))
        filters.append(replace(prefilter, variance=prefilter.variance * factor**2))
    return replace(noise, filters=tuple(filters))


def _values_of(base: BaseParameters, result: Identification, nominal: np.ndarray) -> np.ndarray:
    values = nominal.copy()
    values[_places(base, result)] = result.theta
    return values


def _covariance_of(base: BaseParameters, result: Identification) -> np.ndarray | None:
    """Covariance of the values; parameters that were not estimated have none."""
    if not np.isfinite(result.covariance).all():
        return None
    places = _places(base, result)
    out = np.zeros((len(base), len(base)))
    out[np.ix_(places, places)] = result.covariance
    return out


def _column_lengths(regressor: Regressor, limits: JointLimits) -> np.ndarray:
    """Rms of each column by joint in random states within the limits, shape (joints, base)."""
    rng = np.random.default_rng(1991)
    shape = (STATES, limits.low.size)
    q = rng.uniform(limits.low, limits.high, shape)
    dq = rng.uniform(-limits.speed, limits.speed, shape)
    ddq = rng.uniform(-limits.acceleration, limits.acceleration, shape)
    matrix = regressor.matrix(q, dq, ddq, inner=regressor.levels(dq.T))
    return np.sqrt(np.mean(matrix**2, axis=0))


def _largest_torques(
    robot: Robot, limits: JointLimits, lengths: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Largest torque of each joint [N m or N], and whether it is known, each (joints,).

    By the limit of the description, else by that of the user, who may allow less than the noise of
    the drive scales with, else by the values.
    """
    described = np.array(
        [np.nan if j.torque_limit is None else j.torque_limit for j in robot.joints]
    )
    limit = np.where(np.isfinite(described), described, limits.torque)
    of_values = np.sqrt(((lengths * np.nan_to_num(values)) ** 2).sum(axis=1))
    torque = np.where(np.isfinite(limit), limit, of_values)
    return np.where(torque > 0.0, torque, 1.0), torque > 0.0
