"""How well an estimate predicts measured torques, joint by joint.

The motion is smoothed once, in the same way for every estimate that is judged; then τ - Φ(q̂)θ is
scored twice: as it is, with all the noise of the logged torque, and low-passed on both sides, where
the motion is and the noise mostly is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import LOW_SPEED, rated_speeds
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import percent
from pivident.loop.motion.motion import MOTION_BAND, SpeedLimits, measured_samples
from pivident.robot.description import Robot
from pivident.robot.measured_base import BASE_JOINTS
from pivident.signals.bandpass import butterworth

#: Order of the low-pass, run forwards and backwards.
ORDER = 4

#: Periods of the band after which the low-pass has forgotten what was there, to twelve digits.
REACH = 12.0

#: The noise level is read between the motion's band and so many times it.
BEYOND = 1.5

#: Error in the band above which a model is a poor one [%], where noise and standstill are not most
#: of it: good models of real arms miss 4 to 6 %.
POOR = 15.0

#: Error of one joint's torque that explains less than three quarters of its power [%].
JOINT_MISSES = 50.0

#: Share of an rms error that is most of its power.
MOSTLY = 0.71


#: Errors over some ``samples``, such as those of predicted torques.
Errors = TypeVar("Errors", bound=Any)


class Predictor(Protocol):
    """Whatever predicts a robot's torques: an identification, or its consistent form."""

    @property
    def robot(self) -> Robot:
        """The robot."""

    def predict(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Torque, shape (samples, joints) [N m or N]."""


@dataclass(frozen=True, eq=False)
class PredictionError(Displayed):
    """Torque errors of all joints over some samples; arrays (joints,)."""

    joint_names: tuple[str, ...]  # names of the joints
    units: tuple[str, ...]  # N m or N
    rms: np.ndarray  # rms error, all frequencies [unit]
    torque: np.ndarray  # rms of the measured torque, all frequencies [unit]
    rms_in_band: np.ndarray  # rms error below ``band`` [unit]
    torque_in_band: np.ndarray  # rms of the measured torque below ``band`` [unit]
    #: The part of ``rms_in_band`` that the noise level just beyond the band would give, continued
    #: to zero frequency [unit]; an upper bound where model error reaches beyond the band.
    noise_in_band: np.ndarray
    #: The part of ``rms_in_band`` of samples at which the joint stands [unit]: dry friction then
    #: holds it with any torque up to its own, which no law predicts.
    rest_in_band: np.ndarray
    band: float  # highest frequency of the motion [Hz]
    samples: int  # number of samples

    @property
    def relative(self) -> np.ndarray:
        """100 rms/torque of each joint, all frequencies [%]."""
        return 100.0 * self.rms / np.maximum(self.torque, 1e-300)

    @property
    def relative_in_band(self) -> np.ndarray:
        """100 rms/torque of each joint, below ``band`` [%]."""
        return 100.0 * self.rms_in_band / np.maximum(self.torque_in_band, 1e-300)

    @property
    def moving_in_band(self) -> np.ndarray:
        """The same without what standstill adds to the error [%]."""
        moving = np.sqrt(np.maximum(self.rms_in_band**2 - self.rest_in_band**2, 0.0))
        return 100.0 * moving / np.maximum(self.torque_in_band, 1e-300)

    @property
    def total_moving_in_band(self) -> float:
        """Error over all joints, below ``band``, without what standstill adds to it [%]."""
        return self._total(self.moving_in_band * self.torque_in_band / 100.0, self.torque_in_band)

    @property
    def typical_moving_in_band(self) -> float:
        """Geometric mean of the joints' errors without standstill [%]; no gain changes it."""
        return float(np.exp(np.mean(np.log(np.maximum(self.moving_in_band, 1e-4)))))

    @property
    def model_error_in_band(self) -> float:
        """Error over all joints, below ``band``, that neither noise nor standstill explains [%]."""
        explained = self.rest_in_band**2 + self.noise_in_band**2
        left = np.sqrt(np.maximum(self.rms_in_band**2 - explained, 0.0))
        return self._total(left, self.torque_in_band)

    @property
    def is_poor(self) -> bool:
        """Whether the model misses much of the torque, and noise and standstill are not why."""
        whole = self.total_in_band
        return whole > POOR and self.model_error_in_band > MOSTLY * whole

    @property
    def total(self) -> float:
        """Error over all joints, all frequencies, see :func:`total_error` [%]."""
        return self._total(self.rms, self.torque)

    @property
    def total_in_band(self) -> float:
        """Error over all joints, below ``band`` [%]."""
        return self._total(self.rms_in_band, self.torque_in_band)

    def _total(self, rms: np.ndarray, size: np.ndarray) -> float:
        """Force and moment on a measured base count as vectors: an axis may feel nothing."""
        if tuple(self.joint_names[: len(BASE_JOINTS)]) == BASE_JOINTS:
            rms, size = rms.copy(), size.copy()
            for values in (rms, size):
                for part in (slice(0, 3), slice(3, 6)):
                    values[part] = np.sqrt(np.mean(values[part] ** 2))
        return total_error(rms, size, self.units)


def total_error(rms: np.ndarray, size: np.ndarray, units: Sequence[str]) -> float:
    """‖e‖/‖τ‖ over all joints [%]; where units are mixed, the rms of the joints' own ratios.

    ``rms``: of the errors, shape (joints,).
    """
    if len(set(units)) == 1:
        return 100.0 * float(np.linalg.norm(rms) / max(float(np.linalg.norm(size)), 1e-300))
    return 100.0 * float(np.sqrt(np.mean((rms / np.maximum(size, 1e-300)) ** 2)))


def at_rest(error: PredictionError, joint: int | None = None) -> str:
    """Clause on an error that is half as large without standstill or less; else empty.

    ``joint``: which; None: all together.
    """
    whole, moving, held = error.total_in_band, error.total_moving_in_band, "a joint"
    if joint is not None:
        whole, moving, held = error.relative_in_band[joint], error.moving_in_band[joint], "it"
    if moving > 0.5 * whole:
        return ""
    return (
        f" ({percent(moving)} without standstill, where dry friction holds {held} with any torque)"
    )


def pooled(errors: Sequence[Errors]) -> Errors:
    """One error of several stretches: squares are averaged over all samples."""
    first, weights = errors[0], [e.samples for e in errors]
    means = {
        name: np.sqrt(np.average([vars(e)[name] ** 2 for e in errors], axis=0, weights=weights))
        for name, value in vars(first).items()
        if isinstance(value, np.ndarray)
    }
    return replace(first, samples=sum(weights), **means)


def motion_band(recording: Recording) -> float:
    """Highest frequency of the motion that is scored: 20 Hz, or an eighth of a low rate [Hz]."""
    return min(MOTION_BAND, recording.rate / 8.0)


class Judge:
    """Measured motion and torque of one recording.

    ``band``: highest frequency of the motion [Hz]; None: see :func:`motion_band`.
    """

    def __init__(self, recording: Recording, band: float | None = None) -> None:
        self.recording = recording
        self.band = motion_band(recording) if band is None else band
        self.kinematics = estimate_kinematics(recording, RandomWalk())

    @cached_property
    def torque_in_band(self) -> np.ndarray:
        """Measured torque below ``band``, shape (samples, joints) [N m or N]."""
        return butterworth(self.kinematics.tau.T, self.recording.rate, self.band)

    def residual(self, found: Predictor, span: slice = slice(None)) -> np.ndarray:
        """τ - Φ(q̂)θ, zero where it is not known, shape (samples, joints) [N m or N]."""
        motion = (x.T for x in self.kinematics.stretch(span))
        residual = self.kinematics.tau[:, span].T - found.predict(*motion)
        return np.where(self._measured[span], residual, 0.0)

    def score(self, found: Predictor, spans: Sequence[slice]) -> list[PredictionError]:
        """Errors of an estimate on stretches of the recording."""
        around = self._around(found.robot, spans)
        residual = self.residual(found, around)
        low = self.in_band(residual)
        return [self.error(found.robot, residual, low, span, around.start) for span in spans]

    def _around(self, robot: Robot, spans: Sequence[slice]) -> slice:
        """Samples that errors on stretches depend on: the low-pass reaches beyond their ends.

        Friction with memory depends on all that was before.
        """
        reach = int(np.ceil(REACH * self.recording.rate / self.band))
        own = [self._usable(span) for span in spans]
        remembers = any(t.has_memory for joint in robot.tree.joints for t in joint.friction.terms)
        first = 0 if remembers else max(min(s.start for s in own) - reach, 0)
        return slice(first, min(max(s.stop for s in own) + reach, self.recording.samples))

    @cached_property
    def _measured(self) -> np.ndarray:
        """Where motion and torque were measured, shape (samples, joints)."""
        return np.broadcast_to(measured_samples(self.kinematics), self.kinematics.q.shape).T

    def in_band(self, residual: np.ndarray) -> np.ndarray:
        """A residual below ``band``, shape (samples, joints) [N m or N]."""
        return butterworth(residual, self.recording.rate, self.band)

    def _usable(self, span: slice) -> slice:
        start = max(span.start, self.kinematics.start)
        return slice(start, max(min(span.stop, self.kinematics.stop), start + 1))

    def error(
        self, robot: Robot, residual: np.ndarray, low: np.ndarray, span: slice, first: int = 0
    ) -> PredictionError:
        """Errors on one stretch.

        Args:
            robot: that of the estimate.
            residual: τ - Φ(q̂)θ from a sample on, shape (samples, joints).
            low: the same below ``band``.
            span: samples of the recording.
            first: sample with which ``residual`` and ``low`` begin.
        """
        span = self._usable(span)
        own = slice(span.start - first, span.stop - first)
        residual, low, valid = residual[own], low[own], self._measured[span]
        level = level_beyond(residual, self.recording.rate, self.band)
        known = np.sqrt(np.maximum(valid.mean(axis=0), 1.0 / len(valid)))
        return PredictionError(
            joint_names=self.recording.joint_names,
            units=tuple(joint.torque_unit for joint in robot.joints),
            rms=_rms(residual) / known,
            torque=_rms(self.kinematics.tau.T[span]),
            rms_in_band=_rms(low) / known,
            torque_in_band=_rms(self.torque_in_band[span]),
            noise_in_band=np.sqrt(level * _width(self.band)),
            rest_in_band=_rms(np.where(self.resting(robot, span), low, 0.0)),
            band=self.band,
            samples=span.stop - span.start,
        )

    def resting(self, robot: Robot, span: slice) -> np.ndarray:
        """Samples slower than the estimate's, and what the low-pass mixes them with, likewise.

        Args:
            robot: whose couplings say what else moves a joint.
            span: samples of the recording.

        Returns:
            Shape (samples, joints).
        """
        slow = LOW_SPEED * rated_speeds(robot, self.recording)
        still = ~SpeedLimits(slow, robot.couplings).moving(self.kinematics.dq[:, span])
        return within(still.T, round(0.5 * self.recording.rate / self.band))


def within(chosen: np.ndarray, reach: int) -> np.ndarray:
    """Samples with a chosen one at most ``reach`` samples away, shape (samples, joints)."""
    count = np.concatenate((np.zeros((1, chosen.shape[1]), int), np.cumsum(chosen, axis=0)))
    k = np.arange(len(chosen))
    return count[np.minimum(k + reach + 1, len(chosen))] > count[np.maximum(k - reach, 0)]


def level_beyond(x: np.ndarray, rate: float, band: float) -> np.ndarray:
    """Mean power density of x between band and 1.5 band, shape (joints,) [unit²/Hz].

    ``x``: shape (samples, joints); ``band``: highest frequency of the motion [Hz].
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(len(x)) / len(x))
    spectrum = np.abs(np.fft.rfft((x - x.mean(axis=0)) * window[:, None], axis=0)) ** 2
    frequency = np.arange(len(spectrum)) * rate / len(x)
    beyond = (frequency >= band) & (frequency <= BEYOND * band)
    if not beyond.any():
        return np.full(x.shape[1], np.nan)
    both = np.where((frequency > 0.0) & (frequency < 0.5 * rate), 2.0, 1.0)[beyond, None]
    return (both * spectrum[beyond]).mean(axis=0) / (rate * np.sum(window**2))


def _width(band: float) -> float:
    """∫ of the low-pass's power gain (1 + (f/band)^2n)⁻² over all frequencies [Hz]."""
    order = 2 * ORDER
    return band * np.pi / order / np.sin(np.pi / order) * (1.0 - 1.0 / order)


def _rms(x: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(x**2, axis=0))


@dataclass(frozen=True, eq=False)
class ReplayError:
    """Errors of a simulated loop over some samples; arrays (joints,)."""

    joint_names: tuple[str, ...]  # names of the joints
    position_units: tuple[str, ...]  # rad or m
    torque_units: tuple[str, ...]  # N m or N
    position: np.ndarray  # rms of simulated minus measured positions [rad or m]
    torque: np.ndarray  # rms of simulated minus measured torques [N m or N]
    torque_size: np.ndarray  # rms of the measured torques [N m or N]
    samples: int  # number of samples

    @property
    def relative(self) -> np.ndarray:
        """100 torque error/torque of each joint [%]."""
        return 100.0 * self.torque / np.maximum(self.torque_size, 1e-300)

    @property
    def total(self) -> float:
        """Torque error over all joints [%]."""
        driven = self.torque_size > 0.0  # without the joints of a measured base
        units = [unit for unit, own in zip(self.torque_units, driven, strict=True) if own]
        return total_error(self.torque[driven], self.torque_size[driven], units)


@dataclass(frozen=True, eq=False)
class SimulationError:
    """Errors of simulated positions over some samples."""

    loop: str  # closed or open
    joint_names: tuple[str, ...]  # names of the joints
    units: tuple[str, ...]  # rad or m
    position: np.ndarray  # rms of simulated minus measured positions, shape (joints,) [rad or m]
    samples: int  # number of samples

    @classmethod
    def of(cls, replay: ReplayError) -> SimulationError:
        """Those of a replayed closed loop."""
        return cls(
            "closed", replay.joint_names, replay.position_units, replay.position, replay.samples
        )
