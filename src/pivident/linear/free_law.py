"""A control law of free structure: a transfer function from the error to the output, by joint.

Error and output are exact signals of the controller, so that a discrete ARX model by least squares
is exact where the output is logged without noise. With noise or quantisation the refined
instrumental variable method (RIV) is unbiased; the continuous-time search over orders (SRIVC) is
that of Brunot et al. (2018, section 5.3), who offer it the speed and acceleration of the reference
besides. An integrator's pole is fixed at one: an estimated one lies slightly inside the unit circle
and leaks; one this near to it is taken for an integrator.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from pivident.data.recording.checks import clipped_samples
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.threads import run_in_threads
from pivident.loop.simulation.controllers import TAPS, SampledLaw
from pivident.loop.simulation.linear_law import reference_derivatives

if TYPE_CHECKING:
    from pivident.linear.estimate import LinearEstimate

FreeMethod = Literal["arx", "riv", "srivc"]

#: Orders (numerator, denominator) of the continuous-time search.
SEARCHED = ((0, 1, 2), (1, 2))

#: Numerators of error, speed and acceleration of the reference that are searched with them. The
#: speed has none but a constant: its derivative is the acceleration.
SEARCHED_WITH_REFERENCE = (((1, 0, 1), (2, 0, 2)), (1, 2))

#: Distance from one at which a pole is an integrator.
INTEGRATOR = 1e-6


@dataclass(frozen=True, eq=False)
class FreeLaw:
    """Transfer functions of all joints."""

    law: TransferLaw  # the controller, ready for a ``Loop``
    estimates: tuple[LinearEstimate, ...]  # one linear model per joint
    relative_error: tuple[float, ...]  # rms of the residual over that of the output
    joint_names: tuple[str, ...]  # names of the joints
    output: np.ndarray  # recorded output without known inputs, shape (samples, joints) [u]
    model: np.ndarray  # output of the law, likewise
    rate: float  # sampling rate [Hz]

    def __str__(self) -> str:
        return "\n\n".join(
            f"joint {j + 1}, {100 * error:.2g} % of the output unexplained\n{estimate}"
            for j, (estimate, error) in enumerate(
                zip(self.estimates, self.relative_error, strict=True)
            )
        )


def identify_free_law(
    recording: Recording,
    drive_gain: np.ndarray | float = 1.0,
    limit: np.ndarray | float = np.inf,
    method: FreeMethod = "arx",
    orders: tuple[int, int] = (2, 1),
    integrator: bool = False,
    reference_inputs: bool = False,
) -> FreeLaw:
    """Identify a transfer function from the position error to the controller's output.

    Args:
        recording: one run with a recorded reference.
        drive_gain: joint torque per controller output, shape (joints,) or a scalar.
        limit: largest output; saturated samples are left out (ARX) or refused (RIV, SRIVC),
            which simulate through them.
        method: ``arx``, ``riv``, or ``srivc``, which searches its orders itself.
        orders: degrees of numerator and denominator in z⁻¹, without the integrator.
        integrator: whether the law has a pole at one besides.
        reference_inputs: whether ``srivc`` also tries laws into which speed and acceleration of the
            reference enter besides the error.

    Returns:
        The law as a transfer function for each joint, with its fit.

    Raises:
        ExperimentError: no reference, or orders above two.
        IdentificationError: samples are saturated and the method cannot leave them out.
    """
    recording.require_torque("a control law is identified")
    if recording.q_ref is None:
        raise ExperimentError(
            f"recording {recording.name!r} has no reference q_ref, from which the control error "
            "is formed",
            advice="map its column",
        )
    if not (0 <= orders[0] < TAPS and 0 <= orders[1] < TAPS):
        raise ExperimentError(f"orders of a control law go up to {TAPS - 1}, not {orders}")
    if reference_inputs and method != "srivc":
        raise ExperimentError(
            f"{method} takes the error as its only input", advice="use srivc with reference_inputs"
        )
    joints = recording.joints
    gain = np.broadcast_to(np.asarray(drive_gain, float), (joints,))
    bound = np.broadcast_to(np.asarray(limit, float), (joints,))
    found: dict[int, _JointLaw] = {}

    def work(j: int) -> None:
        found[j] = _joint_law(
            recording, j, float(gain[j]), float(bound[j]), method, orders, integrator,
            reference_inputs,
        )  # fmt: skip

    run_in_threads(work, range(joints))
    laws = [found[j] for j in range(joints)]
    law = TransferLaw(
        np.array([own.numerator for own in laws]),
        np.array([own.denominator for own in laws]),
        np.array([own.ki for own in laws]),
        recording.rate,
        np.stack([own.of_reference for own in laws], axis=1)
        if reference_inputs
        else np.zeros((3, 0, TAPS)),
    )
    return FreeLaw(
        law,
        tuple(own.estimate for own in laws),
        tuple(own.relative_error for own in laws),
        recording.joint_names,
        np.stack([own.output for own in laws], axis=1),
        np.stack([own.model for own in laws], axis=1),
        recording.rate,
    )


@dataclass(frozen=True, eq=False)
class _JointLaw:
    """One joint's law, in the terms of `TransferLaw`."""

    numerator: np.ndarray  # (TAPS,)
    denominator: np.ndarray  # (TAPS,)
    ki: float
    of_reference: np.ndarray  # B_v, B_a and A_r, (3, TAPS)
    estimate: LinearEstimate
    relative_error: float
    output: np.ndarray  # (samples,)
    model: np.ndarray  # (samples,)


def _joint_law(
    recording: Recording,
    j: int,
    gain: float,
    bound: float,
    method: FreeMethod,
    orders: tuple[int, int],
    integrator: bool,
    reference_inputs: bool,
) -> _JointLaw:
    """One joint's transfer functions, with an integrator of the error apart."""
    assert recording.q_ref is not None
    total = recording.tau[:, j] / gain
    u = total - sum(inputs[:, j] for inputs in recording.inputs.values())
    left_out = (np.abs(total) >= bound * (1.0 - 1e-9)) | clipped_samples(
        recording.tau[:, j], recording.q[:, j]
    )
    seen = recording.q_ref[:, j] - recording.q[:, j]
    if reference_inputs:
        seen = np.column_stack([seen, *_reference_derivatives(recording, j)])
    name = recording.joint_names[j]
    try:
        estimate = _estimate(
            seen, u, 1.0 / recording.rate, left_out, method, orders, integrator, name
        )
    except IdentificationError as error:
        error.add_note(f"in the law of joint {name!r}")
        raise
    (b, *others), a = _discrete(estimate)
    of_reference = [*others, a] if others else [np.zeros(1), np.zeros(1), np.ones(1)]
    ki = 0.0
    if np.abs(np.roots(a) - 1.0).min(initial=1.0) < INTEGRATOR:
        free = np.polydiv(a, [1.0, -1.0])[0]
        b, residue = split_integrator(b, free)
        a, ki = free, residue * recording.rate
    model = estimate.simulate(seen[:, : len(others) + 1] if reference_inputs else seen)
    left = np.sum((u - model)[~left_out] ** 2) / np.sum(u[~left_out] ** 2)
    return _JointLaw(
        _taps(b), _taps(a), ki, np.array([_taps(own) for own in of_reference]), estimate,
        float(np.sqrt(left)), u, model,
    )  # fmt: skip


def _taps(polynomial: np.ndarray) -> np.ndarray:
    """Coefficients of z⁰, z⁻¹, …, with zeros behind, shape (TAPS,)."""
    return np.concatenate([polynomial, np.zeros(TAPS - len(polynomial))])


def _reference_derivatives(recording: Recording, j: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed and acceleration of a joint's reference, as the law forms them, (samples,)."""
    assert recording.q_ref is not None
    dq_ref = None if recording.dq_ref is None else recording.dq_ref[:, j]
    return reference_derivatives(recording.q_ref[:, j], dq_ref, 0.0, False, recording.rate)


def _estimate(
    seen: np.ndarray,
    u: np.ndarray,
    dt: float,
    left_out: np.ndarray,
    method: FreeMethod,
    orders: tuple[int, int],
    integrator: bool,
    name: str,
) -> LinearEstimate:
    """One joint's linear model from the error, or what else the law sees, to the output."""
    from pivident.linear.arx import arx
    from pivident.linear.order_selection import select_orders
    from pivident.linear.sriv import riv

    if seen.ndim > 1:
        both = (seen[:, 0], SEARCHED), (seen, SEARCHED_WITH_REFERENCE)
        tables = [select_orders(x, u, dt, *searched, criterion="bic") for x, searched in both]
        accepted = [table.best for table in tables if not table.rows[0].rejected]
        return min(accepted or [tables[0].best], key=lambda found: found.fit.bic)
    e = seen
    poles = (1.0,) if integrator else ()
    degree = orders[1] + len(poles)
    if method == "arx":
        mask = left_out if left_out.any() else None
        return arx(e, u, dt, orders[0], degree, mask=mask, fixed_poles=poles)
    if left_out.any():
        raise IdentificationError(
            f"joint {name!r} is saturated at {np.count_nonzero(left_out)} sample(s)",
            advice=f'{method} simulates through them; use method = "arx", which leaves them out',
        )
    if method == "riv":
        return riv(e, u, dt, orders[0], degree, fixed_poles=poles)
    if integrator:
        raise ExperimentError(
            "srivc searches continuous-time orders and does not fix an integrator",
            advice="use arx or riv",
        )
    return select_orders(e, u, dt, *SEARCHED, criterion="bic").best


def _discrete(estimate: LinearEstimate) -> tuple[list[np.ndarray], np.ndarray]:
    """B of each input and A in z⁻¹; a continuous model is sampled with the hold of its fit."""
    a = estimate.denominator
    if not estimate.continuous:
        return [np.asarray(b) for b in estimate.numerators], np.asarray(a)
    from scipy.signal import cont2discrete

    sampled = [cont2discrete((b, a), estimate.dt, estimate.hold) for b in estimate.numerators]
    return [np.ravel(b) for b, _, _ in sampled], np.ravel(sampled[0][1])


@dataclass(frozen=True, eq=False)
class TransferLaw:
    """u = [B/A + K_i h/(1 - z⁻¹)] (q_ref - q) + B_v/A_r dq_ref + B_a/A_r ddq_ref, in z⁻¹.

    It is sampled with the period of its fit.
    """

    numerator: np.ndarray  # B, coefficients of z⁰, z⁻¹, …, shape (joints, TAPS)
    denominator: np.ndarray  # A, monic, likewise; stable
    ki: np.ndarray  # integral gains [u per rad s or m s], shape (joints,)
    rate: float  # sampling rate that the coefficients belong to [Hz]
    # B_v, B_a and A_r, which may have a pole at one, shape (3, joints, TAPS); no joints: the
    # reference enters by the error only
    of_reference: np.ndarray = field(default_factory=lambda: np.zeros((3, 0, TAPS)))

    def check(self, joints: int) -> None:
        """Refuse a law of another number of joints."""
        if self.numerator.shape != (joints, TAPS):
            raise ExperimentError(
                f"the control law has {len(self.numerator)} joints, but the robot has {joints}"
            )

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """The law at its own rate."""
        from scipy.signal import lfilter

        if abs(rate - self.rate) > 1e-9 * rate:
            raise ExperimentError(
                f"the control law was identified at {self.rate:g} Hz and cannot run at {rate:g} Hz",
                advice="identify a structured law, whose gains hold at any rate",
            )
        reference = np.empty_like(q_ref)
        for j in range(q_ref.shape[1]):
            reference[:, j] = settled(self.numerator[j], self.denominator[j], q_ref[:, j])
        for j in range(self.of_reference.shape[1]):
            dq = None if dq_ref is None else dq_ref[:, j]
            derivatives = reference_derivatives(q_ref[:, j], dq, 0.0, False, rate)
            *numerators, poles = self.of_reference[:, j]
            for numerator, derivative in zip(numerators, derivatives, strict=True):
                reference[:, j] += lfilter(numerator, poles, derivative)
        return SampledLaw(
            self.numerator, self.denominator, self.denominator.copy(), self.ki, reference,
            q_ref.copy(),
        )  # fmt: skip


def settled(numerator: np.ndarray, denominator: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A signal behind B/A that had its first value for ever, as the loop's positions had theirs."""
    from scipy.signal import lfilter, lfilter_zi

    return lfilter(numerator, denominator, x, zi=lfilter_zi(numerator, denominator) * x[0])[0]


def split_integrator(numerator: np.ndarray, denominator: np.ndarray) -> tuple[np.ndarray, float]:
    """B/((1 - z⁻¹) A) = B'/A + r/(1 - z⁻¹): B' and the residue r = B(1)/A(1).

    ``numerator``: B, coefficients of z⁰, z⁻¹, ….
    """
    residue = float(np.sum(numerator) / np.sum(denominator))
    size = max(len(numerator), len(denominator))
    remainder = np.zeros(size)
    remainder[: len(numerator)] += numerator
    remainder[: len(denominator)] -= residue * denominator
    # (1 - z⁻¹) divides what is left: its quotient is the running sum
    return np.cumsum(remainder)[: max(size - 1, 1)], residue
