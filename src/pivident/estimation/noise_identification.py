"""Prefilters of IDIM-PIV: noise models from the residual, and the samples they can be used on.

An AR model of the residual behind the inverse controller whitens it, (P-25), (P-29). A law that was
found from the record may be a poor description of where the noise comes from: then a model behind
its inverse and one of the torque residual itself are both fitted, joint by joint, and Schwarz's
criterion of their prediction errors decides. On simulated records a joint's standstill is excluded
where it is much noisier than the motion; on measured ones the mask has done that. A prefilter that
inverts a controller has seen it, and remembers it for long: samples filtered with standstill in
memory are excluded where they cost more than they are worth (`standstill.remembers_standstill`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.methods import Arma, PrefilteredIV, Repetition
from pivident.estimation.problem import Problem
from pivident.estimation.standstill import (
    MIN_ROWS,
    decided_by_residual,
    noisy_standstill,
    remembers_standstill,
    slow_samples,
    without_recent,
)
from pivident.estimation.torque_residual import residual_of
from pivident.motion.kinematics import Kinematics, usable_samples
from pivident.recording.repeated_motion import repeated_motion
from pivident.signals.noise_models import continued_into_band, fit_ar, unmasked_stretches
from pivident.signals.prefilter import Prefilter
from pivident.simulation.controllers import inverse_controller
from pivident.text.finding import Finding
from pivident.threads import run_in_threads

#: The first estimate's residual decides on the AR orders: flips of the criterion must not go on
#: changing the estimate. The models themselves are kept from the second one on: the residual
#: hardly changes any more, and a filter that follows it only delays convergence.
DECIDES_ORDERS, DECIDES_MODELS = 1, 2


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """D(z⁻¹) v = C(z⁻¹) e."""

    ar: np.ndarray  # D, monic
    ma: np.ndarray  # C, monic
    at_bound: bool = False  # whether the order is the largest allowed
    warnings: tuple[str, ...] = ()  # what its estimation noticed, whole sentences

    @property
    def order(self) -> int:
        """Number of coefficients."""
        return len(self.ar) + len(self.ma) - 2


@dataclass(frozen=True, eq=False)
class Inverse:
    """What a joint's torque residual passes before its noise model: C_j⁻¹, or nothing."""

    filter: Prefilter = field(default_factory=Prefilter)
    of_law: bool = False  # whether what comes out has the unit of the positions

    def behind(self, model: NoiseModel) -> Prefilter:
        """L_j = A_j C_j⁻¹."""
        numerator, denominator = self.filter.numerator, self.filter.denominator
        return Prefilter(numerator, np.convolve(denominator, model.ma), model.ar)


@dataclass(frozen=True, eq=False)
class Prefilters:
    """L_j = A_j C_j⁻¹ of all joints, and the noise models that they come from."""

    filters: tuple[Prefilter, ...]  # prefilter of each joint; none with decimated equations
    models: tuple[NoiseModel, ...] = ()  # noise model of each joint; none before the first residual
    at_bound: tuple[bool, ...] = ()  # whether each model's order is the largest allowed
    #: Joints whose standstill is excluded, shape (joints,).
    without_standstill: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    #: Joints of which samples filtered with standstill in memory are excluded, likewise.
    without_memory: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    inverses: tuple[Inverse, ...] = ()  # C_j⁻¹ of each joint; none with decimated equations

    @classmethod
    def none(cls, problem: Problem) -> Prefilters:
        """L_j = 1."""
        n = problem.robot.size
        nowhere = np.zeros(n, bool)
        return cls((Prefilter(),) * n, (), (), nowhere, nowhere, (Inverse(),) * n)

    @property
    def inverts_controller(self) -> tuple[bool, ...]:
        """Joint by joint, whether what comes out of the filter has the unit of the positions."""
        return tuple(inverse.of_law for inverse in self.inverses)

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders of the noise models."""
        return tuple(m.order for m in self.models)

    def exclude(self, problem: Problem, records: Sequence[EquationRecord]) -> None:
        """Exclude samples that would bias the estimate: filter transients, noisy standstill."""
        for record in records:
            used = record.used
            used[slow_samples(problem, record) & self.without_standstill[:, None]] = False
            record.seen[:] = used
            for j, prefilter in enumerate(self.filters):
                if prefilter.begins_anew:
                    continue
                used[j, : record.kinematics.start + prefilter.transient()] = False
                if record.motion is not None and record.motion.valid is not None:
                    used[j] &= without_recent(record.motion.valid, prefilter.transient())
                if self.without_standstill[j] or self.without_memory[j]:
                    used[j] = without_recent(used[j], prefilter.transient())


@dataclass(frozen=True, eq=False)
class Whitening:
    """How residuals are made white: inverse controllers, and the recipe of the noise models."""

    problem: Problem  # what is given
    method: PrefilteredIV  # options of IDIM-PIV
    #: Candidates of each joint; the iteration starts with the first, the residual decides.
    inverses: tuple[tuple[Inverse, ...], ...]

    @classmethod
    def of(
        cls,
        problem: Problem,
        method: PrefilteredIV,
        kinematics: Sequence[Kinematics],
        simulated: bool = True,
    ) -> Whitening:
        """Inverse controllers of a problem's loop, or ones for a ``direct`` prefilter.

        ``simulated``: whether the loop is simulated for the instruments.
        """
        n = problem.robot.size
        inverts = simulated if method.prefilter == "auto" else method.prefilter == "controller"
        if not inverts:
            return cls(problem, method, ((Inverse(),),) * n)
        if problem.loop is None:
            raise ExperimentError(
                "the prefilter is to invert the controller, but there is no control loop: "
                'give it ([controller] in an experiment file), or set prefilter = "direct"'
            )
        rate = kinematics[0].recording.rate
        numerator, denominator = inverse_controller(problem.loop.controller, rate, n)
        gain = np.broadcast_to(np.asarray(problem.loop.drive_gain, float), (n,))
        laws = [Inverse(Prefilter(numerator[j] / gain[j], denominator[j]), True) for j in range(n)]
        if method.prefilter == "auto" and problem.loop.identified is not None:
            return cls(problem, method, tuple((law, Inverse()) for law in laws))
        made = cls(problem, method, tuple((law,) for law in laws))
        made._refuse_slow_filters(kinematics)
        return made

    def initial(self) -> Prefilters:
        """Prefilters before there is a residual: L_j = C_j⁻¹, no noise model."""
        n = self.problem.robot.size
        first = tuple(candidates[0] for candidates in self.inverses)
        nowhere = np.zeros(n, bool)
        return Prefilters(
            tuple(inverse.filter for inverse in first), (), (False,) * n, nowhere, nowhere, first
        )

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
        residuals = [residual_of(self.problem.regressor, k, theta) for k in own]
        if isinstance(self.method.noise, Repetition):
            motion = repeated_motion([k.recording for k in own], self.method.noise.period)
            residuals = motion.split(residuals, [usable_samples(k) for k in own])[1]
        n = self.problem.robot.size
        found: list[tuple[Inverse, NoiseModel]] = [(Inverse(), NoiseModel(*np.ones((2, 1))))] * n

        def fit(j: int) -> None:
            found[j] = self._fitted_joint(j, before, number, residuals, records)

        run_in_threads(fit, range(n))
        inverses = tuple(inverse for inverse, _ in found)
        fitted = tuple(model for _, model in found)
        filters = tuple(inverse.behind(model) for inverse, model in found)
        standstill, memory = before.without_standstill, before.without_memory
        if not self.method.as_printed:
            if decided_by_residual(self.problem):
                standstill = noisy_standstill(self.problem, filters, records, residuals)
            memory = remembers_standstill(filters, records, residuals)
        at_bound = before.at_bound  # a later fit is given its order and does not know
        if number == DECIDES_ORDERS:
            at_bound = tuple(m.at_bound for m in fitted)
        return Prefilters(filters, fitted, at_bound, standstill, memory, inverses)

    def warnings(self, prefilters: Prefilters) -> list[Finding]:
        """Noise models that did not come out as they were asked for."""
        names = self.problem.robot.joint_names
        return [
            Finding("warning", "noise model", "replaced", f"Noise model of {name!r}: {text}", name)
            for name, m in zip(names, prefilters.models, strict=False)
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
        return [Finding("warning", "noise model", "order at its bound", text, next_step=step)]

    def _refuse_slow_filters(self, kinematics: Sequence[Kinematics]) -> None:
        """Refuse filters that forget their start no faster than half a record."""
        longest = max(k.stop - k.start for k in kinematics)
        rate = kinematics[0].recording.rate
        for name, (inverse, *_) in zip(self.problem.robot.joint_names, self.inverses, strict=True):
            transient = inverse.filter.transient()
            if transient > 0.5 * longest:
                raise IdentificationError(
                    f"the prefilter of joint {name!r}, the inverse of its control law, takes "
                    f"{transient / rate:.2g} s to forget its initial state, but the longest record "
                    f"has {longest / rate:.2g} s; the gains are too soft (kd/kp). Use "
                    'prefilter = "direct", or check the gains'
                )

    def _fitted_joint(
        self,
        j: int,
        before: Prefilters,
        number: int,
        residuals: Sequence[np.ndarray],
        records: Sequence[EquationRecord],
    ) -> tuple[Inverse, NoiseModel]:
        """The candidate that predicts a joint's residual best, with its noise model."""
        if number > DECIDES_ORDERS:
            inverse, order = before.inverses[j], len(before.models[j].ar) - 1
            return inverse, self._model_of_joint(j, inverse, residuals, records, order)
        fits = [
            (inverse, self._model_of_joint(j, inverse, residuals, records, None))
            for inverse in self._quick_enough(j, records)
        ]
        if len(fits) == 1:
            return fits[0]
        scores = _schwarz(j, fits, residuals, records)
        return fits[int(np.argmin(scores))]

    def _quick_enough(self, j: int, records: Sequence[EquationRecord]) -> list[Inverse]:
        """Candidates of a joint that forget their start in half of the longest record."""
        longest = max(r.kinematics.stop - r.kinematics.start for r in records)
        quick = [i for i in self.inverses[j] if i.filter.transient() <= 0.5 * longest]
        return quick or [self.inverses[j][-1]]

    def _model_of_joint(
        self,
        j: int,
        inverse: Inverse,
        residuals: Sequence[np.ndarray],
        records: Sequence[EquationRecord],
        order: int | None,
    ) -> NoiseModel:
        """Model of one joint's residual behind the inverse controller, (P-29), all recordings."""
        noise, pieces, left_out = self.method.noise, [], []
        skip = inverse.filter.transient()
        for record, residual in zip(records, residuals, strict=True):
            usable = slice(record.kinematics.start, record.kinematics.stop)
            pieces.append(inverse.filter.stream(1).process(residual[j : j + 1, usable])[0])
            out = ~record.used[j, usable] & noise.on_unmasked
            out[:skip] = True
            left_out.append(out)
            pieces.append(np.zeros(1))  # recordings do not continue each other
            left_out.append(np.ones(1, bool))
        whole, mask = np.concatenate(pieces), np.concatenate(left_out)
        if isinstance(noise, Arma):
            return _arma_model(whole, mask, noise)
        model = fit_ar(whole, noise.p_max, noise.criterion, order=order, mask=mask)
        recording = records[0].kinematics.recording
        changed = continued_into_band(model, recording.rate, noise.band(recording))
        return NoiseModel(changed.coefficients, np.ones(1), model.at_bound)


def _schwarz(
    j: int,
    fits: Sequence[tuple[Inverse, NoiseModel]],
    residuals: Sequence[np.ndarray],
    records: Sequence[EquationRecord],
) -> list[float]:
    """Schwarz's criterion n ln σ² + p ln n of each model's error in predicting the torque residual.

    L_j/L_j(∞) is monic, so what comes out of it is that error; all models are judged on the same
    samples, which none of them sees with standstill in memory where there are enough.
    """
    filters = [inverse.behind(model) for inverse, model in fits]
    memory = max(f.transient() for f in filters)
    settled = [without_recent(r.used[j], memory) for r in records]
    if sum(int(s.sum()) for s in settled) < MIN_ROWS:
        settled = [r.used[j] for r in records]
    scores = []
    for (_, model), prefilter in zip(fits, filters, strict=True):
        leading = prefilter.numerator[0] / prefilter.denominator[0]
        squares, rows = 0.0, 0
        for residual, used, seen in zip(residuals, settled, (r.seen for r in records), strict=True):
            error = (
                prefilter.stream(1).process(residual[j : j + 1], seen=seen[j])[0][used] / leading
            )
            squares, rows = squares + float(error @ error), rows + error.size
        rows = max(rows, 1)
        scores.append(rows * np.log(max(squares / rows, 1e-300)) + model.order * np.log(rows))
    return scores


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
