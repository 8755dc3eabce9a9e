"""DIDIM with prefilters: the observation matrix itself comes from the simulated loop.

Gautier, Janot and Vandanjon (2013) fit the measured torque with the motion that the loop makes of
reference, control law and parameters (*direct and inverse dynamic identification models*), a
closed-loop output error method that needs no measured positions:

    θ ← (Σ Φ(q_s)ᵀ L_jᵀ L_j Φ(q_s))⁻¹ Σ Φ(q_s)ᵀ L_jᵀ L_j τ,    q_s simulated with the θ before

Here L_j is the prefilter of IDIM-PIV: the torque carries the encoder noise that the controller
has answered to, and its inverse turns it back into white noise. With a coarse encoder the gain is
large. Smoothed positions bias the estimate twice, by what the smoother takes from the motion at
the reversals and, since E[f(dq + n)] ≠ f(dq), by what it leaves of the noise in the friction
column; instruments correct neither. q_s has no noise, and is not smoothed.

The price: where model, law or reference are wrong, so is q_s. Two things are looked after.

* Positions at the start are only known to within the encoder's noise; samples before the loop has
  forgotten them do not vote.
* On measured records the residual is mostly model error. A noise model of it would be a
  high-pass filter and trade Coulomb's friction for viscous one, so there the prefilter is the
  inverse controller alone.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.full_rate import FullRateRecord, accumulate, voting
from pivident.estimation.full_rate_answer import full_rate_answer
from pivident.estimation.identification import Identification
from pivident.estimation.inner_signals import with_inner
from pivident.estimation.iteration import iterate, law_findings, torque_units
from pivident.estimation.kinematics import Kinematics, estimate_kinematics
from pivident.estimation.load_dependence import estimate_without_load
from pivident.estimation.methods import PrefilteredIV
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.simulated_motion import SimulatedMotion
from pivident.estimation.whitening import Whitening
from pivident.text.finding import Finding

#: Iterations behind the inverse controller alone: as long as θ is wrong the residual shows it, and
#: a noise model of that would be a high-pass filter that the iteration then hardly gets through.
WITHOUT_NOISE_MODEL = 2

#: First iteration that may be the last: two with a noise model, the second of which is kept.
EARLIEST = WITHOUT_NOISE_MODEL + 2

#: Iterations that look at the start anew: parameters are near their final values from the second.
LOOKS_AT_START = 2

#: The start is forgotten once its trace in the torque is this share of the torque's deviation.
FORGOTTEN = 1e-4

#: Ratio of position error to encoder noise from which on positions know more than the simulation.
FAR_FROM_MEASURED = 2.0


def identify_didim(
    problem: Problem, method: PrefilteredIV, say: Callable[[str], None]
) -> Identification:
    """Iterate simulation, noise models and estimate.

    Args:
        problem: robot, recordings, loop, parameters.
        method: options of IDIM-PIV, with ``regressor="simulated"``.
        say: progress.

    Raises:
        ExperimentError: the reference was not recorded.
        IdentificationError: the loop does not forget its start within half a record.
        SimulationDiverged: the controller does not stabilise the simulated robot.
        MassMatrixNotPositiveDefinite: the parameters make no physical mass matrix.
        RankDeficientRegressor: the motion does not separate the parameters.
    """
    if problem.loop is not None and problem.loop.reference == "smoothed":
        raise ExperimentError(
            f"{method.label} takes the motion from the simulated loop, and with reference = "
            '"smoothed" that loop is a virtual one; use piv, or give the recorded reference'
        )
    say(f"{method.label}: noise of the encoders")
    kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
    auxiliary = AuxiliaryModel(problem, differences=True, kinematics=kinematics)
    limits = [problem.speed_limits(r) for r in problem.recordings]
    whitening = Whitening(problem, method, kinematics)
    only_noise = all(r.simulated for r in problem.recordings)
    first = estimate_without_load(problem, kinematics, limits)
    records: list[FullRateRecord] = []
    starts = [k.start for k in kinematics]

    def stage(k: int, theta: np.ndarray, motions: list[SimulatedMotion]) -> list[JointSums]:
        if k < LOOKS_AT_START:
            starts[:] = settled_starts(auxiliary, theta, motions, kinematics)
        carried = theta if k or first is None else first
        moved = [
            with_inner(problem.regressor, simulated_kinematics(*parts), carried)
            for parts in zip(kinematics, motions, starts, strict=True)
        ]
        records[:] = [
            FullRateRecord(m, None, voting(m, m.dq, lim))
            for m, lim in zip(moved, limits, strict=True)
        ]
        whitening.kinematics = moved
        if only_noise:
            whitening.fit(k + 1 - WITHOUT_NOISE_MODEL, theta, records)
        whitening.take_votes(records)
        for record in records:
            for j, prefilter in enumerate(whitening.filters):
                record.votes[j, : record.kinematics.start + prefilter.transient()] = False
        may_be_last = k + 1 >= min(EARLIEST, method.max_iterations)
        return accumulate(problem.regressor, records, whitening.filters, by_window=may_be_last)

    sums, solution, variance, history, converged = iterate(
        problem,
        auxiliary,
        stage,
        method.tolerance,
        method.max_iterations,
        say,
        orders=lambda: tuple(m.order for m in whitening.models),
        earliest=EARLIEST,
        covariance=method.covariance,
    )
    direct = method.prefilter == "direct"
    return full_rate_answer(
        problem,
        method,
        records,
        whitening.filters,
        sums,
        solution,
        variance,
        history,
        converged,
        torque_units(problem) if direct else whitening.units(),
        models=whitening.models,
        at_bound=whitening.at_bound,
        warnings=[*_notes(problem), *whitening.warnings(), *_far_from_measured(records)],
        reported=method.covariance,
    )


def simulated_kinematics(kinematics: Kinematics, motion: SimulatedMotion, start: int) -> Kinematics:
    """The simulated motion in place of the smoothed one, with the measured torque.

    Args:
        kinematics: measured.
        motion: simulated, on the same samples.
        start: first sample that may be used.
    """
    unsmoothed = np.full(kinematics.f50.shape, np.nan)
    return dataclasses.replace(
        kinematics, q=motion.q, dq=motion.dq, ddq=motion.ddq, start=start, f50=unsmoothed
    )


def settled_starts(
    auxiliary: AuxiliaryModel,
    theta: np.ndarray,
    motions: Sequence[SimulatedMotion],
    kinematics: Sequence[Kinematics],
) -> list[int]:
    """First sample of each recording at which the simulated loop has forgotten its start.

    The loop is simulated once more from another start, at rest on its reference. What differs
    comes from the start.

    Args:
        auxiliary: simulates the recordings.
        theta: parameters, shape (parameters,).
        motions: simulated with them from the measured start.
        kinematics: of the same recordings; their usable range is kept.

    Raises:
        IdentificationError: names the recording whose first half is not enough.
    """
    other = copy.copy(auxiliary)
    other.signals = [(s, (s.q_ref[0].copy(), np.zeros_like(s.q_ref[0]))) for s, _ in other.signals]
    starts = []
    for here, there, kin in zip(motions, other.simulate(theta), kinematics, strict=True):
        assert here.tau is not None and there.tau is not None
        trace = np.abs(here.tau - there.tau) > FORGOTTEN * here.tau.std(axis=1, keepdims=True)
        seen = np.flatnonzero(trace.any(axis=0))
        start = max(kin.start, int(seen[-1]) + 1 if seen.size else 0)
        if start > 0.5 * (kin.start + kin.stop):
            raise IdentificationError(
                f"in recording {kin.recording.name!r} the simulated loop still shows where it "
                f"started after {start / kin.recording.rate:.2g} s, more than half the record; "
                "the gains are soft or the record is short. Use piv, or a longer record"
            )
        starts.append(start)
    return starts


def _notes(problem: Problem) -> list[Finding]:
    """Reservations about law and reference."""
    notes, warnings = law_findings(problem.loop)
    return [*notes, *warnings]


def _far_from_measured(records: Sequence[FullRateRecord]) -> list[Finding]:
    """Joints whose measured positions contradict the simulated ones."""
    squares, noise, samples = 0.0, 0.0, 0
    for kin in (r.kinematics for r in records):
        part = slice(kin.start, kin.stop)
        difference = kin.recording.q[part].T - kin.q[:, part]
        squares = squares + np.sum(difference**2, axis=1)
        noise = noise + kin.encoder_std**2 * difference.shape[1]
        samples += difference.shape[1]
    error, noise = np.sqrt(squares / samples), np.sqrt(noise / samples)
    names = records[0].kinematics.recording.joint_names
    far = [
        f"{name!r} ({own:.2g} against {encoder:.2g})"
        for name, own, encoder in zip(names, error, noise, strict=True)
        if own > FAR_FROM_MEASURED * encoder
    ]
    if not far:
        return []
    text = (
        "The simulated motion is further from the measured one than the encoder's noise explains "
        f"(rms, rad or m): {', '.join(far)}."
    )
    step = "Compare with piv, which uses the measured positions."
    return [Finding("warning", "simulation", "far from measured", text, next_step=step)]
