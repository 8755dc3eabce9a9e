"""A flexible joint from multisines at several postures, its constants fitted to all together.

A multisine that repeats has lines, and what differs between its periods is noise: the mean over
them gives speed Y_k, torque U_k and signs S_k of friction on each line k, the scatter their noise
(Wernholt and Gunnarsson 2006 to 2008). With Z of `impedance_fit` the constants minimise

    Σ_p Σ_k |Y_pk - (U_pk - (fc + H fc_l) S_pk)/Z_p|² / σ²_pk

over the lines of all recordings p (Wernholt and Moberg 2011, who weight the logarithm of Y/U; as it
stands here noise of the torque makes no bias in the loop). Motor inertia, stiffness, damping and
friction are those of all recordings, the load's inertia is that of each posture: what the postures
change is the load alone, which separates stiffness from inertias better than any single one.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.literature.whole_periods import (
    WholePeriods,
    derivatives_on_lines,
    torque_on_lines,
    whole_periods,
)
from pivident.foundation.errors import IdentificationError
from pivident.studies.flexibility.frequency_response import EXCITED, LocalSpectra
from pivident.studies.flexibility.impedance_fit import (
    fit_flexible,
    fit_rigid,
    flexible_errors,
    flexible_parts,
    least_squares_fit,
    periodic_load_speed,
)
from pivident.studies.flexibility.measured import Measured
from pivident.studies.flexibility.resonance import CLEARLY_BETTER, FRICTION_SHARE, MIN_BINS

#: Lines on each side over which the noise is averaged.
NEIGHBOURS = 5

#: Speeds are low-passed at this share of the sampling rate.
SPEED = 0.1

#: Largest number of fits in which load's speed and constants come to agree, and the change in
#: standard errors at which they do.
MAX_STEPS, SETTLED = 8, 0.1

#: Constants that all postures share: logarithms of the first three.
SHARED = ("motor_inertia", "stiffness", "damping", "fv", "fv_l", "fc", "fc_l")


@dataclass(frozen=True, eq=False)
class MultisineEstimate:
    """A flexible joint at one or several postures, each number with its 95 % interval."""

    joint: str  # name of the joint
    recordings: tuple[str, ...]  # names of the runs
    motor_inertia: Measured  # Jm [kg m²]
    stiffness: Measured  # k [N m/rad]
    damping: Measured  # d [N m s/rad]
    load_inertia: tuple[Measured, ...]  # Jl at the posture of each run [kg m²]
    antiresonance: tuple[Measured, ...]  # √(k/Jl)/2π there [Hz]
    gain: float  # twice the log-likelihood of the flexible over that of rigid joints
    misfit: float  # cost over the number of lines; about 1 if the model holds
    periods: tuple[int, ...]  # periods of each run that were averaged
    # for each run frequency [Hz], |Y/U| measured and fitted [rad/s per N m], shape (3, lines)
    responses: tuple[np.ndarray, ...] = field(repr=False)


@dataclass(frozen=True, eq=False)
class _Run:
    """One recording with the place of its periods."""

    recording: Recording
    joint: int
    places: WholePeriods
    band: tuple[float, float]
    gamma: float

    def spectra(self, known: np.ndarray | None) -> LocalSpectra:
        """Excited lines; ``known``: constants that tell the load's speed from the motor's."""
        j, places = slice(self.joint, self.joint + 1), self.places
        rate = self.recording.rate
        whole = slice(places.start, places.start + places.count * places.length)
        q, tau = self.recording.q.T[j, whole], self.recording.tau.T[j, whole]
        speed = derivatives_on_lines(q, rate, np.array([SPEED * rate]))[1]
        torque = torque_on_lines(tau, self.recording)
        periods = np.concatenate([speed, torque]).reshape(2, places.count, places.length)
        lines = np.fft.rfft(periods, axis=2) / np.sqrt(places.length)
        frequency = np.fft.rfftfreq(places.length, 1.0 / rate)
        mean = lines.mean(axis=1)
        noise = _scatter(lines - mean[:, None])
        power = np.abs(mean) ** 2
        signs = self._signs(periods[0].mean(axis=0), known)
        strong = np.all(power > EXCITED * np.einsum("kss->sk", noise).real, axis=0)
        kept = strong & (frequency >= self.band[0]) & (frequency <= self.band[1])
        x = mean[:, kept].T
        return LocalSpectra(
            frequency[kept], x, signs[:, kept].T, x, noise[kept], np.ones(len(x), bool)
        )

    def _signs(self, speed: np.ndarray, known: np.ndarray | None) -> np.ndarray:
        """Spectra of the signs of friction from the mean speed of a period, (signs, lines)."""
        speeds = [speed]
        if known is not None:
            speeds.append(periodic_load_speed(speed, self.recording.rate, known, self.gamma))
        signs = 2.0 / np.pi * np.arctan(self.gamma * np.stack(speeds))
        return np.fft.rfft(signs, axis=1) / np.sqrt(len(speed))


def identify_multisine(
    recordings: Sequence[Recording],
    joint: int = 0,
    *,
    postures: Sequence[Hashable] | None = None,
    period: float | None = None,
    transient: int = 1,
    lowest: float = 1.0,
    highest: float | None = None,
    gamma: float = 150.0,
) -> MultisineEstimate:
    """Stiffness, damping and inertias of one joint from multisines, with the motor's encoder alone.

    Args:
        recordings: runs in which a multisine repeats; other joints stand still.
        joint: index of the joint.
        postures: a label for each run; runs of one label share the load's inertia. None: each has
            its own.
        period: length of a period [s]; None: from the reference, or else the positions.
        transient: periods at the start that are left out.
        lowest: lowest frequency used [Hz].
        highest: highest frequency [Hz]; None: a tenth of the sampling rate.
        gamma: slope of the smoothed sign of friction [s/rad].

    Returns:
        The constants with their intervals.

    Raises:
        IdentificationError: a run has no whole periods or too few excited lines, or there is no
            resonance among them; says what to do.
        RecordingError: one has no measured torque.
    """
    labels = list(range(len(recordings))) if postures is None else list(postures)
    if len(labels) != len(recordings) or not recordings:
        raise IdentificationError(
            f"{len(labels)} postures for {len(recordings)} recordings",
            advice="give each of them a label",
        )
    runs = []
    for recording in recordings:
        recording.require_torque("stiffness is identified")
        top = 0.1 * recording.rate if highest is None else highest
        places = whole_periods(recording, period, transient)
        runs.append(_Run(recording, joint, places, (lowest, top), gamma))
    names = list(dict.fromkeys(labels))
    own = np.array([names.index(label) for label in labels])
    spectra = [run.spectra(None) for run in runs]
    for run, found in zip(runs, spectra, strict=True):
        _check_excited(run, found)
    rigid = [fit_rigid(s) for s in spectra]
    single = [fit_flexible(s, r[0], None)[0] for s, r in zip(spectra, rigid, strict=True)]
    theta, cost, covariance = _pooled_fit(spectra, own, _start(single, own))
    gain = 2.0 * (sum(r[1] for r in rigid) - cost)
    if gain < CLEARLY_BETTER:
        raise IdentificationError(
            f"joint {recordings[0].joint_names[joint]!r} is rigid up to "
            f"{max(s.frequency[-1] for s in spectra):.3g} Hz, the highest line that is excited",
            advice="give the multisine more lines above that",
        )
    for _ in range(MAX_STEPS):
        pairs = zip(runs, own.tolist(), strict=True)
        spectra = [run.spectra(_of_posture(theta, posture)) for run, posture in pairs]
        last = theta
        theta, cost, covariance = _pooled_fit(spectra, own, last)
        if np.all(np.abs(theta - last) < SETTLED * np.sqrt(np.diag(covariance))):
            break
    moved = FRICTION_SHARE * (theta - last)
    covariance = covariance + np.outer(moved, moved)
    return _estimate(runs, spectra, own, theta, covariance, gain, cost)


def _scatter(left: np.ndarray) -> np.ndarray:
    """Noise of a mean over periods, from (signals, periods, lines); (lines, signals, signals)."""
    from scipy.ndimage import uniform_filter1d

    count = left.shape[1]
    raw = np.einsum("spk,tpk->kst", left, left.conj()) / (count * (count - 1))
    size = 2 * NEIGHBOURS + 1
    parts = [uniform_filter1d(part, size, axis=0) for part in (raw.real, raw.imag)]
    return parts[0] + 1j * parts[1]


def _check_excited(run: _Run, spectra: LocalSpectra) -> None:
    """Refuse a run with too few lines above the noise."""
    if len(spectra.frequency) < MIN_BINS:
        raise IdentificationError(
            f"recording {run.recording.name!r} has {len(spectra.frequency)} lines above its noise "
            f"from {run.band[0]:g} to {run.band[1]:g} Hz",
            advice=f"at least {MIN_BINS} are needed: let the multisine have more lines, or make "
            "it larger or longer",
        )


def _of_posture(theta: np.ndarray, posture: int) -> np.ndarray:
    """Parameters of `impedance_fit` at one posture."""
    motor, stiffness, damping, *friction = theta[: len(SHARED)]
    load = theta[len(SHARED) + posture]
    omega = 0.5 * (stiffness - load)
    return np.array([motor, load, omega, damping - np.log(2.0) - omega - load, *friction])


def _start(single: Sequence[np.ndarray], own: np.ndarray) -> np.ndarray:
    """Medians of the single fits."""
    each = np.array(single)
    stiffness = 2.0 * each[:, 2] + each[:, 1]
    damping = each[:, 3] + np.log(2.0) + each[:, 2] + each[:, 1]
    shared = np.median(np.column_stack([each[:, 0], stiffness, damping, each[:, 4:]]), axis=0)
    loads = [np.median(shared[1] - 2.0 * each[own == p, 2]) for p in range(int(own.max()) + 1)]
    return np.append(shared, loads)


def _pooled_fit(
    spectra: Sequence[LocalSpectra], own: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, float, np.ndarray]:
    """Constants of all postures, cost and covariance."""

    def residual(theta: np.ndarray) -> np.ndarray:
        pairs = zip(spectra, own.tolist(), strict=True)
        return np.concatenate([flexible_errors(s, _of_posture(theta, p)) for s, p in pairs])

    return least_squares_fit(residual, start)


def _estimate(
    runs: Sequence[_Run],
    spectra: Sequence[LocalSpectra],
    own: np.ndarray,
    theta: np.ndarray,
    covariance: np.ndarray,
    gain: float,
    cost: float,
) -> MultisineEstimate:
    """The result; intervals of positive numbers through their logarithms."""

    def positive(gradient: np.ndarray, shift: float, unit: str) -> Measured:
        std = float(np.sqrt(gradient @ covariance @ gradient))
        log = float(gradient @ theta) + shift
        value, low, high = np.exp([log, log - 1.96 * std, log + 1.96 * std]).tolist()
        return Measured(value, low, high, unit)

    unit = np.eye(theta.size)
    loads = [unit[len(SHARED) + p] for p in own.tolist()]
    responses = []
    for s, posture in zip(spectra, own.tolist(), strict=True):
        fitted = flexible_parts(s.frequency, _of_posture(theta, posture))[0]
        responses.append(np.vstack([s.frequency, np.abs(s.x[:, 0] / s.x[:, 1]), np.abs(fitted)]))
    lines = sum(len(s.frequency) for s in spectra)
    return MultisineEstimate(
        joint=runs[0].recording.joint_names[runs[0].joint],
        recordings=tuple(run.recording.name for run in runs),
        motor_inertia=positive(unit[0], 0.0, "kg m²"),
        stiffness=positive(unit[1], 0.0, "N m/rad"),
        damping=positive(unit[2], 0.0, "N m s/rad"),
        load_inertia=tuple(positive(load, 0.0, "kg m²") for load in loads),
        antiresonance=tuple(
            positive(0.5 * (unit[1] - load), -np.log(2.0 * np.pi), "Hz") for load in loads
        ),
        gain=gain,
        misfit=cost / lines,
        periods=tuple(run.places.count for run in runs),
        responses=tuple(responses),
    )
