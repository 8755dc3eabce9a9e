"""Prefilters of IDIM-PIV: noise models from the residual, and the samples they can be used on.

An AR model of the residual behind the inverse controller whitens it, (P-29). On simulated
records a joint's standstill loses its votes where it is much noisier than the motion, and with it
the samples after it that are filtered with standstill in memory. On measured records the mask
has done that, for the sake of the friction model, and the samples after it are worth more than
their noise (held-out error of the TX40 record 5.92 % with, 6.82 % without them).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.full_rate import FullRateRecord, residual_of
from pivident.estimation.iteration import position_units
from pivident.estimation.kinematics import Kinematics
from pivident.estimation.methods import Arma, PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.repetition import Repetition
from pivident.estimation.standstill import (
    decided_by_residual,
    noisy_standstill,
    slow_samples,
    without_recent,
)
from pivident.signals.noise_models import continued_into_band, fit_ar, unmasked_stretches
from pivident.signals.prefilter import Prefilter
from pivident.simulation.controllers import inverse_controller
from pivident.text.finding import Finding
from pivident.threads import run_in_threads

#: The first estimate's residual decides on the AR orders: flips of the criterion must not go on
#: changing the estimate. The models themselves are kept from the second one on: the residual
#: hardly changes any more, and a filter that follows it only delays convergence.
DECIDES_ORDERS, DECIDES_MODELS = 1, 2


class Whitening:
    """Prefilters of all joints, renewed from the residual at each iteration."""

    def __init__(
        self, problem: Problem, method: PrefilteredIV, kinematics: Sequence[Kinematics]
    ) -> None:
        self.problem, self.method, self.kinematics = problem, method, kinematics
        n = problem.robot.size
        ones = np.ones((n, 1))
        self.numerator, self.denominator = ones, ones
        if method.prefilter == "controller":
            assert problem.loop is not None
            rate = kinematics[0].recording.rate
            self.numerator, self.denominator = inverse_controller(problem.loop.controller, rate, n)
            gain = np.broadcast_to(np.asarray(problem.loop.drive_gain, float), (n,))
            self.numerator = self.numerator / gain[:, None]
        self.models: list[NoiseModel] = []
        self.drop_standstill = np.zeros(n, bool)
        self.at_bound: tuple[bool, ...] = (False,) * n
        self.filters = [Prefilter(self.numerator[j], self.denominator[j]) for j in range(n)]
        self._refuse_slow_filters()

    def fit(self, number: int, theta: np.ndarray, records: Sequence[FullRateRecord]) -> None:
        """Fit the noise models to the residual of an estimate, unless they are settled.

        Args:
            number: of the estimate, counted from one; zero: there has been none, θ is a guess.
            theta: the estimate, shape (parameters,).
            records: all recordings with the instruments and votes that it was made with.
        """
        if DECIDES_ORDERS <= number <= DECIDES_MODELS:
            self._fit(number, theta, records)

    def take_votes(self, records: Sequence[FullRateRecord]) -> None:
        """Take votes that would spoil the estimate: transients of filters, noisy standstill.

        Args:
            records: all recordings with their instruments; their votes are changed.
        """
        for record in records:
            votes = record.votes
            slow = slow_samples(self.problem, record) & self.drop_standstill[:, None]
            votes[slow] = False
            for j, prefilter in enumerate(self.filters):
                votes[j, : prefilter.transient()] = False
                if self.drop_standstill[j]:
                    votes[j] = without_recent(votes[j], prefilter.transient())

    def _refuse_slow_filters(self) -> None:
        """Refuse filters that forget their start no faster than half a record.

        Raises:
            IdentificationError: names the joint and how long it takes.
        """
        longest = max(k.stop - k.start for k in self.kinematics)
        for j, prefilter in enumerate(self.filters):
            if prefilter.transient() > 0.5 * longest:
                rate = self.kinematics[0].recording.rate
                raise IdentificationError(
                    f"the prefilter of joint {self.problem.robot.joint_names[j]!r}, the inverse of "
                    f"its control law, takes {prefilter.transient() / rate:.2g} s to forget its "
                    f"start, but the longest record has {longest / rate:.2g} s; the gains are that "
                    'soft (kd/kp). Use prefilter = "direct", or check the gains'
                )

    def _fit(self, number: int, theta: np.ndarray, records: Sequence[FullRateRecord]) -> None:
        """Noise models, filters, and the joints whose standstill is noisier than their motion."""
        residuals = [residual_of(self.problem.regressor, k, theta) for k in self.kinematics]
        if isinstance(self.method.noise, Repetition):
            residuals = self.method.noise.non_repeating(residuals, self.kinematics)
        n = self.problem.robot.size
        models: list[NoiseModel | None] = [None] * n

        def fit(j: int) -> None:
            order = len(self.models[j].ar) - 1 if number > DECIDES_ORDERS else None
            models[j] = self._fit_joint(j, residuals, records, order)

        run_in_threads(fit, range(n))
        self.models = [m for m in models if m is not None]
        if number == DECIDES_ORDERS:  # later fits are given their order and cannot tell
            self.at_bound = tuple(m.at_bound for m in self.models)
        self.filters = [
            Prefilter(self.numerator[j], np.convolve(self.denominator[j], m.ma), m.ar)
            for j, m in enumerate(self.models)
        ]
        if decided_by_residual(self.problem) and not self.method.as_printed:
            self.drop_standstill = noisy_standstill(self.problem, self.filters, records, residuals)

    def _fit_joint(
        self,
        j: int,
        residuals: Sequence[np.ndarray],
        records: Sequence[FullRateRecord],
        order: int | None,
    ) -> NoiseModel:
        """Model of one joint's residual behind the inverse controller, all recordings."""
        pieces, left_out = [], []
        inverse = Prefilter(self.numerator[j], self.denominator[j])
        skip = inverse.transient()
        for record, residual in zip(records, residuals, strict=True):
            usable = slice(record.kinematics.start, record.kinematics.stop)
            pieces.append(inverse.stream(1).process(residual[j : j + 1, usable])[0])
            voters_only = self.method.noise.on_unmasked
            out = ~record.votes[j, usable] & voters_only
            out[:skip] = True
            left_out.append(out)
            pieces.append(np.zeros(1))  # recordings do not continue each other
            left_out.append(np.ones(1, bool))
        noise, residual, mask = self.method.noise, np.concatenate(pieces), np.concatenate(left_out)
        if isinstance(noise, Arma):
            return _arma_model(residual, mask, noise)
        model = fit_ar(residual, noise.p_max, noise.criterion, order=order, mask=mask)
        recording = self.kinematics[0].recording
        changed = continued_into_band(model, recording.rate, noise.band(recording))
        return NoiseModel(changed.coefficients, np.ones(1), model.at_bound)

    def units(self) -> list[str]:
        """Unit of the residual behind the inverse controller: the encoder's."""
        return position_units(self.problem)

    def warnings(self) -> list[Finding]:
        """Noise models that did not come out as they were asked for."""
        names = self.problem.robot.joint_names
        return [
            Finding("warning", "noise model", "replaced", f"Noise model of {name!r}: {text}", name)
            for name, m in zip(names, self.models, strict=False)
            for text in m.warnings
        ] + self._order_warning()

    def _order_warning(self) -> list[Finding]:
        """Joints whose order is the largest allowed."""
        joints = zip(self.problem.robot.joint_names, self.models, self.at_bound, strict=False)
        bound = [(name, m.order) for name, m, at_bound in joints if at_bound]
        if not bound or self.method.as_printed:
            return []
        text = (
            f"Noise models of {', '.join(name for name, _ in bound)}: the criterion is still "
            f"falling at order {bound[0][1]}."
        )
        step = (
            "Raise p_max or cap the smoother (f50_max) to see whether the estimate depends on it."
        )
        return [Finding("warning", "noise model", "order at its bound", text, next_step=step)]


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """D(z⁻¹) v = C(z⁻¹) e.

    Attributes:
        ar: D, monic.
        ma: C, monic.
        at_bound: whether the order is the largest allowed.
        warnings: what its estimation noticed, whole sentences.
    """

    ar: np.ndarray
    ma: np.ndarray
    at_bound: bool = False
    warnings: tuple[str, ...] = ()

    @property
    def order(self) -> int:
        """Number of coefficients."""
        return len(self.ar) + len(self.ma) - 2


def _arma_model(residual: np.ndarray, mask: np.ndarray, noise: Arma) -> NoiseModel:
    """ARMA model of the stretches between the masked samples."""
    from pivident.signals.arma import arma

    segments = unmasked_stretches(mask)
    shortest = 4 * (noise.ar_order + noise.ma_order)
    segments = segments[segments[:, 1] - segments[:, 0] >= shortest]
    found = arma(residual, noise.ar_order, noise.ma_order, segments=segments)
    zeros = np.roots(found.ma)
    size = np.abs(zeros)
    inside = zeros * np.minimum(1.0, noise.largest_root / np.maximum(size, 1e-300))
    return NoiseModel(
        found.ar, np.atleast_1d(np.real(np.poly(inside))), warnings=tuple(found.warnings)
    )
