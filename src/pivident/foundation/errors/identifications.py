"""Errors of identifications: an unsuitable motion, loop, model or bound."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from pivident.foundation.errors.kinds import IdentificationError

if TYPE_CHECKING:
    import numpy as np


class RankDeficientRegressor(IdentificationError):
    """The motion does not separate all requested parameters.

    Attributes:
        rank: numerical rank of the observation matrix.
        expected: number of requested parameters.
        groups: names of the inseparable parameters, one tuple per missing rank.
        evidence: Gram matrix of weighted columns of length one and the torque that each acts on,
            in noise; None where there are no such columns.
    """

    def __init__(
        self,
        rank: int,
        expected: int,
        groups: Sequence[Sequence[str]],
        evidence: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        self.rank, self.expected, self.evidence = rank, expected, evidence
        self.groups = tuple(tuple(group) for group in groups)
        listed = "; ".join(", ".join(group) for group in self.groups)
        super().__init__(
            f"the motion separates {rank} of {expected} parameters",
            advice=f"not separable: {listed}. Add a recording that moves these joints, or leave "
            "parameters out of the set",
        )


class SimulationFailed(IdentificationError):
    """A model cannot be simulated.

    Attributes:
        time: of the sample [s].
        problem: the problem of the identification in which it could not, and which says why;
            None outside of identifications.
        from_start: whether no other parameters of that problem could be simulated before.
    """

    time: float
    problem: Any = None
    from_start: bool = False


class MassMatrixNotPositiveDefinite(SimulationFailed):
    """The mass matrix of the current parameters is indefinite on the motion.

    Attributes:
        joint: name of the joint at which the Cholesky factorisation failed.
        time: time of that sample [s].
        pivot: the pivot that should have been positive.
    """

    def __init__(self, joint: str, time: float, pivot: float) -> None:
        self.joint, self.time, self.pivot = joint, time, pivot
        super().__init__(
            f"the mass matrix is not positive definite at joint {joint!r}, t = {time:.4f} s "
            f"(pivot {pivot:.3g})",
            advice="start from larger rotor inertias or CAD values",
        )


class LoopNotClosed(IdentificationError):
    """The loops of a mechanism cannot be closed at a posture, or it is singular there.

    Attributes:
        q: positions of the independent joints [rad or m], shape (joints,).
        singular: whether the loops close, but the independent joints no longer move the others.
        sample: index of the sample, or None.
        time: time in a simulation [s], or None.
    """

    def __init__(
        self,
        status: int,
        q: Iterable[float],
        joints: Sequence[str],
        sample: int | None = None,
        time: float | None = None,
    ) -> None:
        self.q, self.singular = tuple(float(x) for x in q), status == 2
        self.sample, self.time = sample, time
        names = joints or [f"joint {k + 1}" for k in range(len(self.q))]
        where = ", ".join(f"{name} = {x:.4g}" for name, x in zip(names, self.q, strict=True))
        when = "" if sample is None else f"at sample {sample}, "
        when = when if time is None else f"at t = {time:.4f} s, "
        what = (
            "the mechanism is singular: its independent joints no longer move the others"
            if self.singular
            else "the mechanism cannot be assembled: its loops do not close"
        )
        IdentificationError.__init__(  # the base of `LoopOpened` comes between
            self,
            f"{when}{where}: {what}",
            advice="check units, signs and zero positions of the joints, lengths of the links, "
            "and the posture from which the description assembles them",
        )


class SimulationDiverged(SimulationFailed):
    """The simulated closed loop left the neighbourhood of its reference.

    Attributes:
        joint: name of the first joint to leave it.
        time: time at which it left [s].
        deviation: distance from the reference at that time [rad or m], or the speed.
        bound: the largest one allowed.
        speed: whether the joint was too fast, rather than too far away.
    """

    def __init__(
        self,
        joint: str,
        time: float,
        deviation: float,
        bound: float,
        speed: bool = False,
        slides: bool = False,
    ) -> None:
        self.joint, self.time, self.deviation, self.bound = joint, time, deviation, bound
        self.speed = speed
        unit = "m" if slides else "rad"
        what = (
            f"has a speed of {deviation:.3g} {unit}/s"
            if speed
            else f"is {deviation:.3g} {unit} away from its reference"
        )
        super().__init__(
            f"the simulated joint {joint!r} {what} at t = {time:.4f} s (bound {bound:.3g})",
            advice="check the controller's gains, units and sign, the drive gain and the initial "
            "parameters",
        )


class LoopOpened(LoopNotClosed, SimulationDiverged):
    """A simulated motion went where the loops of the mechanism do not close.

    Its attributes are those of both; the joint is the first independent one, since all are meant.
    """

    time: float

    def __init__(self, status: int, q: Iterable[float], joints: Sequence[str], time: float) -> None:
        LoopNotClosed.__init__(self, status, q, joints, time=time)
        self.joint, self.time = joints[0] if joints else "", time
        self.deviation = self.bound = float("nan")
        self.speed = False


class FilterDiverged(IdentificationError):
    """A filter met a sample that its estimate cannot explain.

    Attributes:
        joint: name of the joint.
        sample: number of the sample, from the first one that the filter was given.
        innovation: what was measured less what was expected, in standard deviations; NaN where the
            expectation itself is not a number.
        cause: what happened, a clause; empty for a large innovation.
    """

    def __init__(self, joint: str, sample: int, innovation: float, cause: str = "") -> None:
        self.joint, self.sample, self.innovation, self.cause = joint, sample, innovation, cause
        found = f"innovation {innovation:.3g} standard deviations"
        what = f"{cause} ({found})" if cause else f"the {found} of its position"
        super().__init__(
            f"the filter diverged at sample {sample}, joint {joint!r}: {what}",
            advice="start it nearer to "
            'the truth (start = "least-squares"), with a smaller spread, or assume larger noise '
            "(torque_noise, encoder_noise)",
        )


class UnusableSignal(IdentificationError):
    """An input or output from which no linear model can be estimated.

    Attributes:
        signal: name of the signal, such as ``u2``.
        found: its property at fault.
    """

    def __init__(self, signal: str, found: str, advice: str) -> None:
        self.signal, self.found = signal, found
        super().__init__(f"{signal} {found}", advice=advice)


class DelayTooLong(IdentificationError):
    """A delay that leaves too little of the record.

    Attributes:
        delay: the delay [samples].
        samples: samples of the record.
    """

    def __init__(self, delay: int, samples: int) -> None:
        self.delay, self.samples = delay, samples
        super().__init__(
            f"a delay of {delay} samples leaves nothing to fit in a record of {samples}",
            advice="give delays in samples (not seconds), or take a longer record",
        )


class OrdersNotSupported(IdentificationError):
    """Orders of a linear model that the record cannot support.

    Attributes:
        parameters: number of requested parameters.
        reason: what is missing.
    """

    def __init__(self, parameters: int, reason: str) -> None:
        self.parameters, self.reason = parameters, reason
        super().__init__(
            f"the record does not support a model of {parameters} parameters: {reason}",
            advice="lower the orders (select_orders compares several), or excite more frequencies",
        )


class UnstableFit(IdentificationError):
    """A linear model that fits only with unstable poles.

    Attributes:
        poles: the unstable ones [rad/s].
    """

    def __init__(self, poles: Sequence[complex], advice: str = "") -> None:
        self.poles = tuple(poles)
        listed = ", ".join(f"{pole:.4g}" for pole in self.poles)
        super().__init__(
            f"the estimate has unstable poles at {listed} rad/s",
            advice=advice
            or "check the sign of u, the orders and the delay. Of an unstable plant in a loop, "
            "identify the closed loop",
        )


class NegativePayload(IdentificationError):
    """A load of negative mass.

    Attributes:
        mass: the estimated mass [kg].
        std: its standard error [kg].
    """

    def __init__(self, mass: float, std: float) -> None:
        self.mass, self.std = mass, std
        super().__init__(
            f"the load's mass is {mass:.4g} kg (2σ: {mass - 2 * std:.4g} to "
            f"{mass + 2 * std:.4g} kg): the record with the load carries less than the one "
            "without. Swap the two records, or check which tool each one was taken with"
        )


class ContradictoryBounds(IdentificationError):
    """Declared bounds that no consistent set of parameters satisfies.

    Attributes:
        bounds: those concerned, in words.
    """

    def __init__(self, bounds: Sequence[str]) -> None:
        self.bounds = tuple(bounds)
        fact = f"no consistent parameters satisfy the bounds: {'; '.join(self.bounds)}"
        advice = "they contradict each other or physical consistency, widen them"
        if not self.bounds:
            fact = "no consistent parameters can be found from this estimate, which is too far "
            fact += "from any machine"
            advice = "check signs, units and gear ratios (pivident audit), or identify again"
        super().__init__(fact, advice=advice)


class NoConsistentModelNear(IdentificationError):
    """An estimate so poor that the nearest consistent parameters explain the record much worse.

    Attributes:
        distance: from the estimate to the nearest consistent parameters [σ].
        p_value: probability of such a distance if the estimate's intervals were true.
        error_free: relative torque error of the estimate on the fitted record.
        error_consistent: of the nearest consistent parameters.
        at_fault: links and joints whose constraints are active, the most expensive first.
        model: the nearest consistent model, for inspection.
    """

    def __init__(
        self,
        distance: float,
        p_value: float,
        error_free: float,
        error_consistent: float,
        at_fault: Sequence[str],
        model: object = None,
    ) -> None:
        self.distance, self.p_value, self.model = distance, p_value, model
        self.error_free, self.error_consistent = error_free, error_consistent
        self.at_fault = tuple(at_fault)
        super().__init__(
            f"no consistent parameters lie near the estimate: the nearest are {distance:.3g} σ "
            f"away (p = {p_value:.2g}), with a torque error of {100 * error_consistent:.3g} % on "
            f"the fitted record ({100 * error_free:.3g} % free), by demands on "
            f"{', '.join(self.at_fault[:4]) or 'the links'}",
            advice="check geometry, gear ratios, units and signs (pivident audit), the friction "
            "law and the parameters that were left out; --accept-far (accept_far = True) gives "
            "the model all the same",
        )
