"""The friction torque of a record: τ minus the rigid part of an estimate.

An estimate splits the torque into rigid part, friction and residual,

    τ = Φ_rigid θ_rigid + Φ_friction θ_friction + ε,     τ_f = τ - Φ_rigid θ_rigid,

so the friction torque is that of the estimate's own law *plus* the residual: where the law is
wrong, the residual is the part it misses. The friction of a coupling between motors depends on two
speeds; it is subtracted with the rigid part, so that the rest belongs to one joint.

The load as a *state* is smoothed: acceleration noise faster than the motion enters the load and,
with the opposite sign, τ_f, and would look like friction that depends on load.

The rigid parameters were estimated together with a law that may be wrong and may have absorbed some
of its error. The standard error of the rigid torque is kept as ``load_std``; a torque that depends
on position alone is indistinguishable from gravity in any case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identification import Identification
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import LOW_SPEED, Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.judgement.validation.held_out.prediction import motion_band
from pivident.loop.motion.motion import Kinematics

#: Samples on which the standard error of the rigid torque is computed.
STANDARD_ERROR_SAMPLES = 500


@dataclass(frozen=True, eq=False)
class FrictionTorque:
    """Friction torque of one joint with its states, at the full rate; arrays (samples,).

    Recordings follow each other; ``record`` separates them.
    """

    name: str  # name of the joint
    torque_unit: str  # N m or N
    position_unit: str  # rad or m
    rate: float  # sampling rate [Hz]
    t: np.ndarray  # time since the first sample of its recording [s]
    q: np.ndarray  # position [rad or m]
    dq: np.ndarray  # speed [rad/s or m/s]
    ddq: np.ndarray  # acceleration, smoothed like the load [rad/s² or m/s²]
    # torque of the rigid part: inertia, gravity, couplings of inertia, smoothed [torque_unit]
    load: np.ndarray
    tau: np.ndarray  # friction torque, own friction of the estimate plus residual [torque_unit]
    law: np.ndarray  # own friction of the estimate alone [torque_unit]
    record: np.ndarray  # number of the recording
    moving: np.ndarray  # whether the joint is faster than ``standstill``
    standstill: float  # speed below which the joint counts as standing still [rad/s or m/s]
    band: float  # half-power frequency of load and acceleration [Hz]
    load_std: float  # rms standard error of ``load`` by the estimate's covariance [torque_unit]

    @property
    def direction(self) -> np.ndarray:
        """Direction of motion, -1 or 1; 0 at standstill."""
        return np.where(self.moving, np.sign(self.dq), 0.0)

    @property
    def level(self) -> float:
        """Mean of |τ_f| in motion [torque_unit], the scale of all percentages."""
        return float(np.mean(np.abs(self.tau[self.moving]))) if self.moving.any() else 0.0

    def pieces(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """A signal split by recording, NaN where the joint stands still."""
        values = np.where(self.moving, values, np.nan)
        return tuple(values[self.record == k] for k in np.unique(self.record))


def friction_torques(
    problem: Problem,
    identification: Identification,
    standstill: float | None = None,
    band: float | None = None,
) -> tuple[FrictionTorque, ...]:
    """Friction torque of every joint on all recordings, motion smoothed at the full rate.

    ``standstill`` is a share of the rated speed (None: 1 %), ``band`` the half-power frequency of
    load and acceleration [Hz] (None: the highest frequency of the motion, 20 Hz).
    """
    rigid = np.where([p.carries_load for p in identification.parameters], identification.theta, 0.0)
    regressor = regressor_of(identification.robot, identification.parameters)
    records = _kinematics(problem, identification)
    slow = _standstill(problem, standstill)
    band = min(motion_band(r) for r in problem.recordings) if band is None else band
    parts = []
    for k in records:
        q, dq, ddq = (x[:, k.start : k.stop].T for x in (k.q, k.dq, k.ddq))
        load = regressor.torque(q, dq, ddq, rigid)
        coupled = regressor.torque(q, dq, ddq, _coupling_theta(identification))
        law = identification.predict(q, dq, ddq) - load - coupled
        tau = k.tau[:, k.start : k.stop].T - load - coupled
        load, ddq = (_smoothed(x, k.recording.rate, band) for x in (load, ddq))
        parts.append((q, dq, ddq, load, tau, law))
    q, dq, ddq, load, tau, law = (np.concatenate(x) for x in zip(*parts, strict=True))
    record = np.repeat(np.arange(len(records)), [k.stop - k.start for k in records])
    t = np.concatenate([np.arange(k.start, k.stop) / k.recording.rate for k in records])
    load_std = _rigid_standard_error(identification, regressor, q, dq, ddq)
    return tuple(
        FrictionTorque(
            name=joint.name,
            torque_unit=joint.torque_unit,
            position_unit=joint.position_unit,
            rate=records[0].recording.rate,
            t=t,
            q=q[:, j],
            dq=dq[:, j],
            ddq=ddq[:, j],
            load=load[:, j],
            tau=tau[:, j],
            law=law[:, j],
            record=record,
            moving=np.abs(dq[:, j]) > slow[j],
            standstill=float(slow[j]),
            band=band,
            load_std=float(load_std[j]),
        )
        for j, joint in enumerate(problem.robot.joints)
    )


def _smoothed(x: np.ndarray, rate: float, band: float) -> np.ndarray:
    """Smoothed along time by a Gaussian window with half power at ``band`` [Hz]."""
    from scipy.ndimage import gaussian_filter1d

    width = np.sqrt(np.log(2.0)) / (2.0 * np.pi * band) * rate
    return gaussian_filter1d(x, width, axis=0, mode="nearest")


def _coupling_theta(found: Identification) -> np.ndarray:
    """The estimate with everything but the friction of couplings set to zero."""
    coupled = [p.coupling is not None and not p.carries_load for p in found.parameters]
    return np.where(coupled, found.theta, 0.0)


def _kinematics(problem: Problem, found: Identification) -> list[Kinematics]:
    """Motion and aligned torque at the full rate, the estimate's own where it has them."""
    if found.equations is not None and len(found.equations.records) == len(problem.recordings):
        if found.equations.full_rate:
            return [r.kinematics for r in found.equations.records]
    return [estimate_kinematics(recording, RandomWalk()) for recording in problem.recordings]


def _standstill(problem: Problem, share: float | None) -> np.ndarray:
    """Speeds that count as standstill, the largest over the recordings, shape (joints,)."""
    slow = np.max([problem.low_speeds(r) for r in problem.recordings], axis=0)
    return slow if share is None else slow * (share / LOW_SPEED)


def _rigid_standard_error(
    found: Identification, regressor: Regressor, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> np.ndarray:
    """Rms standard error of the rigid torque of each joint, on evenly spaced samples."""
    at = np.unique(np.linspace(0, len(q) - 1, STANDARD_ERROR_SAMPLES).astype(int))
    phi = regressor.matrix(q[at], dq[at], ddq[at])
    phi[:, :, [not p.carries_load for p in found.parameters]] = 0.0
    variance = np.einsum("nja,ab,njb->nj", phi, found.robust_covariance, phi, optimize=True)
    return np.sqrt(np.maximum(variance.mean(axis=0), 0.0))
