"""Prefilters of IDIM-PIV: noise models from the residual, and the samples they can be used on.

An AR model of the residual behind the inverse controller whitens it, (P-25), (P-29). Standstill,
and samples that a prefilter has filtered with standstill in memory, are used where they are worth
it (`pivident.estimation.standstill`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from pivident.data.recording.repeated_motion import repeated_motion
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.method import Arma, AutoRegressive, Repetition
from pivident.estimation.problem import Problem
from pivident.estimation.standstill import (
    reached_by_measured,
    valid_samples,
    without_recent,
    worth_using,
)
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.sentences import plural
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import Kinematics, residual_of, usable_samples
from pivident.loop.simulation.controllers import inverse_controller
from pivident.signals.noise_models import (
    continued_into_band,
    excess_in_band,
    fit_ar,
    highest_order,
    unmasked_stretches,
)
from pivident.signals.prefilter import Prefilter

#: The first estimate's residual decides on the AR orders: flips of the criterion must not go on
#: changing the estimate. The models themselves are kept from the second one on: the residual
#: hardly changes any more, and a filter that follows it only delays convergence.
DECIDES_ORDERS, DECIDES_MODELS = 1, 2


#: Excess of the motion's band from which on a residual there is mostly model error. In the scenario
#: *coarse* it is 0.9 to 1.9, with gains 2 % off or friction that the model lacks 10 to 30.
MODEL_ERROR = 4.0


class Prefiltering(Protocol):
    """Options of prefilters, as `PrefilteredIV` has them."""

    @property
    def noise(self) -> AutoRegressive | Arma:
        """Recipe of the noise models."""

    @property
    def prefilter(self) -> str:
        """Behind the inverse of the ``controller``, or ``direct`` on the torque."""

    @property
    def as_printed(self) -> bool:
        """Whether standstill is left out in any case; of that the paper says nothing."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """D(z⁻¹) v = C(z⁻¹) e."""

    ar: np.ndarray  # D, monic
    ma: np.ndarray  # C, monic
    at_bound: bool = False  # whether the order is the largest allowed
    excess: float = 1.0  # level in the motion's band over that just beyond it
    warnings: tuple[str, ...] = ()  # what its estimation noticed, whole sentences

    @property
    def order(self) -> int:
        """Number of coefficients."""
        return len(self.ar) + len(self.ma) - 2


@dataclass(frozen=True, eq=False)
class Prefilters:
    """L_j = A_j C_j⁻¹ of all joints, and the noise models that they come from."""

    filters: tuple[Prefilter, ...]  # prefilter of each joint; none with decimated equations
    models: tuple[NoiseModel, ...] = ()  # noise model of each joint; none before the first residual
    at_bound: tuple[bool, ...] = ()  # whether each model's order is the largest allowed
    #: Joints whose standstill is used, shape (joints,).
    with_standstill: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    #: Joints of which samples filtered with standstill in memory are used, likewise.
    with_memory: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    inverts_controller: bool = False  # whether what comes out has the unit of the positions

    @classmethod
    def none(cls, problem: Problem) -> Prefilters:
        """L_j = 1."""
        n = problem.robot.size
        return cls((Prefilter(),) * n, (), (), np.zeros(n, bool), np.ones(n, bool))

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders of the noise models."""
        return tuple(m.order for m in self.models)

    def exclude(self, records: Sequence[EquationRecord]) -> None:
        """Use standstill where it is worth it, and exclude what filters remember of others."""
        for record in records:
            used = record.used
            used[self.with_standstill] = valid_samples(record)[self.with_standstill]
            record.seen[:] = used
            for j, prefilter in enumerate(self.filters):
                if prefilter.begins_anew:
                    continue
                used[j, : record.kinematics.start + prefilter.transient()] = False
                used[j] &= reached_by_measured(record.kinematics, j, prefilter.transient())
                if record.motion is not None and record.motion.valid is not None:
                    used[j] &= without_recent(record.motion.valid, prefilter.transient())
                if not self.with_memory[j]:
                    used[j] = without_recent(used[j], prefilter.transient())


@dataclass(frozen=True, eq=False)
class Whitening:
    """How residuals are made white: inverse controllers, and the recipe of the noise models."""

    problem: Problem  # what is given
    method: Prefiltering
    numerator: np.ndarray  # of each joint's inverse controller, shape (joints, coefficients)
    denominator: np.ndarray  # likewise
    inverts_controller: bool  # whether they are those of the loop's law

    @classmethod
    def of(
        cls,
        problem: Problem,
        method: Prefiltering,
        kinematics: Sequence[Kinematics],
        simulated: bool = True,
    ) -> Whitening:
        """Inverse controllers of a problem's loop, or ones for a ``direct`` prefilter.

        ``simulated``: whether the loop is simulated for the instruments.
        """
        n = problem.robot.size
        numerator = denominator = np.ones((n, 1))
        inverts = simulated if method.prefilter == "auto" else method.prefilter == "controller"
        if inverts:
            if problem.loop is None:
                raise ExperimentError(
                    "the prefilter is to invert the controller, but there is no control loop: "
                    'give it ([controller] in an experiment file), or set prefilter = "direct"'
                )
            rate = kinematics[0].recording.rate
            base = problem.robot.base_joints  # behind whose rows there is no law
            law = inverse_controller(problem.loop.controller, rate, n - base)
            gain = np.broadcast_to(np.asarray(problem.loop.drive_gain, float), (n - base,))
            direct = np.tile(np.eye(1, law[0].shape[1]), (base, 1))
            numerator = np.vstack([direct, law[0] / gain[:, None]])
            denominator = np.vstack([direct, law[1]])
        made = cls(problem, method, numerator, denominator, inverts)
        made._refuse_slow_filters(kinematics)
        return made

    def inverse(self, j: int) -> Prefilter:
        """C_j⁻¹ of a joint."""
        return Prefilter(self.numerator[j], self.denominator[j])

    def initial(self) -> Prefilters:
        """Prefilters before there is a residual: L_j = C_j⁻¹, no noise model."""
        n = self.problem.robot.size
        filters = tuple(self.inverse(j) for j in range(n))
        nowhere, everywhere = np.zeros(n, bool), np.ones(n, bool)
        return Prefilters(filters, (), (False,) * n, nowhere, everywhere, self.inverts_controller)

    def fitted(
        self,
        before: Prefilters,
        number: int,
        theta: np.ndarray,
        records: Sequence[EquationRecord],
    ) -> Prefilters:
        """Prefilters from the residual (P-30) of an estimate; those before, once settled."""
        if not DECIDES_ORDERS <= number <= DECIDES_MODELS:
            return before
        own = [replace(r.kinematics, inner=None) for r in records]  # with the load of θ
        residuals = noise = [residual_of(self.problem.regressor, k, theta) for k in own]
        if isinstance(self.method.noise, Repetition):
            motion = repeated_motion([k.recording for k in own], self.method.noise.period)
            noise = motion.split(residuals, [usable_samples(k) for k in own])[1]
        n = self.problem.robot.size
        models: list[NoiseModel | None] = [None] * n

        def fit(j: int) -> None:
            order = len(before.models[j].ar) - 1 if before.models else None
            models[j] = self._model_of_joint(j, noise, records, order)

        run_in_threads(fit, range(n))
        fitted = tuple(m for m in models if m is not None)
        filters = tuple(
            Prefilter(self.numerator[j], np.convolve(self.denominator[j], m.ma), m.ar)
            for j, m in enumerate(fitted)
        )
        worth = (
            (before.with_standstill, before.with_memory)
            if self.method.as_printed
            else worth_using(self.problem, filters, records, residuals)
        )
        at_bound = before.at_bound  # a later fit is given its order and does not know
        if not before.models:
            at_bound = tuple(m.at_bound for m in fitted)
        return replace(
            before,
            filters=filters,
            models=fitted,
            at_bound=at_bound,
            with_standstill=worth[0],
            with_memory=worth[1],
        )

    def warnings(self, prefilters: Prefilters) -> list[Finding]:
        """Noise models that did not come out as they were asked for."""
        return [
            Finding("warning", "noise model", "replaced", f"Noise model of {name!r}: {text}", name)
            for name, m in zip(self.problem.robot.joint_names, prefilters.models, strict=False)
            for text in m.warnings
        ] + self._order_warning(prefilters)

    def _order_warning(self, prefilters: Prefilters) -> list[Finding]:
        """Joints whose order is the largest allowed."""
        names = self.problem.robot.joint_names
        joints = zip(names, prefilters.models, prefilters.at_bound, strict=False)
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
        return [Finding("note", "noise model", "order at its bound", text, next_step=step)]

    def _refuse_slow_filters(self, kinematics: Sequence[Kinematics]) -> None:
        """Refuse filters that forget their start no faster than half a record."""
        longest = max(k.stop - k.start for k in kinematics)
        rate = kinematics[0].recording.rate
        for j, name in enumerate(self.problem.robot.joint_names):
            transient = self.inverse(j).transient()
            if transient > 0.5 * longest:
                raise IdentificationError(
                    f"the prefilter of joint {name!r}, the inverse of its control law, takes "
                    f"{transient / rate:.2g} s to forget its initial state, but the longest "
                    f"record has {longest / rate:.2g} s",
                    advice="the gains are too soft (kd/kp). Use "
                    'prefilter = "direct", or check the gains',
                )

    def _model_of_joint(
        self,
        j: int,
        residuals: Sequence[np.ndarray],
        records: Sequence[EquationRecord],
        order: int | None,
    ) -> NoiseModel:
        """Model of one joint's residual behind the inverse controller, (P-29), all recordings."""
        noise, pieces, left_out = self.method.noise, [], []
        inverse = self.inverse(j)
        skip = inverse.transient()
        for record, residual in zip(records, residuals, strict=True):
            usable = slice(record.kinematics.start, record.kinematics.stop)
            pieces.append(inverse.stream(1).process(residual[j : j + 1, usable])[0])
            out = ~record.used[j, usable] & noise.on_unmasked
            out |= ~reached_by_measured(record.kinematics, j, skip)[usable]
            out[:skip] = True
            left_out.append(out)
            pieces.append(np.zeros(1))  # recordings do not continue each other
            left_out.append(np.ones(1, bool))
        whole, mask = np.concatenate(pieces), np.concatenate(left_out)
        if isinstance(noise, Arma):
            return _arma_model(whole, mask, noise)
        fallen: tuple[str, ...] = ()
        stretches = unmasked_stretches(mask)
        carried = highest_order(stretches)
        if not carried:
            return _white(stretches)
        if order is not None and order > carried:
            fallen = (f"{_longest(stretches)}: its order falls from {order} to {carried}.",)
            order = carried
        model = fit_ar(whole, noise.p_max, noise.criterion, order=order, mask=mask)
        recording = records[0].kinematics.recording
        band = noise.band(recording)
        changed = continued_into_band(model, recording.rate, band)
        excess = excess_in_band(model, recording.rate, band)
        return NoiseModel(changed.coefficients, np.ones(1), model.at_bound, excess, fallen)


def _longest(stretches: np.ndarray) -> str:
    longest = int((stretches[:, 1] - stretches[:, 0]).max(initial=0))
    return f"the longest stretch of residual in use has {plural(longest, 'sample')}"


def _white(stretches: np.ndarray) -> NoiseModel:
    """No model, where nothing is long enough for one."""
    text = f"{_longest(stretches)}, too few for a model; it is taken for white."
    return NoiseModel(np.ones(1), np.ones(1), warnings=(text,))


def _arma_model(residual: np.ndarray, mask: np.ndarray, noise: Arma) -> NoiseModel:
    """ARMA model of the stretches between the masked samples, of orders that they carry."""
    from pivident.signals.arma import arma, carries

    stretches = unmasked_stretches(mask)
    lengths, p, q = stretches[:, 1] - stretches[:, 0], noise.ar_order, noise.ma_order
    while not carries(segments := stretches[lengths >= 4 * (p + q)], p, q):
        if p + q == 2:
            return _white(stretches)
        p, q = (p - 1, q) if p >= q else (p, q - 1)
    found = arma(residual, p, q, segments=segments)
    fallen: tuple[str, ...] = ()
    if (wanted := noise.ar_order + noise.ma_order) > p + q:
        fallen = (f"{_longest(stretches)}: its order falls from {wanted} to {p + q}.",)
    zeros = np.roots(found.ma)
    inside = zeros * np.minimum(1.0, noise.largest_root / np.maximum(np.abs(zeros), 1e-300))
    return NoiseModel(
        found.ar, np.atleast_1d(np.real(np.poly(inside))), warnings=(*fallen, *found.warnings)
    )
