"""IDIM-PIV: instrumental variables with prefilters from the identified noise.

Brunot, Janot, Young and Carrillo (2018), section 4.3. The torque residual of joint j is filtered by
the inverse of the controller, which turns it back into encoder noise (P-26), and an AR model A_j of
what comes out whitens it, (P-29):

    L_j = λ_j^(-1/2) A_j(z⁻¹) C_j⁻¹(z⁻¹)

is applied to instruments, observation matrix and torque (D6). λ_j^-1 on both sides, as (P-22) and
(P-28) print it, is ``as_printed``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np

from pivident.estimation.answer import answer, loop_warnings
from pivident.estimation.full_rate import (
    FullRateRecord,
    records_with_instruments,
    records_without_instruments,
)
from pivident.estimation.identification import Identification
from pivident.estimation.instrument_choice import (
    Chosen,
    InstrumentSource,
    choose,
    instead_of_loop,
    may_do_without,
    without_loop,
)
from pivident.estimation.iteration import (
    Estimate,
    Pass,
    Run,
    Signals,
    Simulated,
    Steps,
    initial_pass,
    least_squares_pass,
    simulate,
    solve,
    start_number,
)
from pivident.estimation.method import (
    KNOWN,
    Arma,
    AutoRegressive,
    CovarianceKind,
    Handles,
    InstrumentalMethod,
    IteratedMethod,
    Say,
)
from pivident.estimation.noise_identification import Prefilters, Whitening
from pivident.estimation.problem import EQUATION_ERROR, Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import (
    ExperimentError,
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.options import option
from pivident.foundation.progress import IterationLine
from pivident.foundation.text.finding import Finding
from pivident.loop.instruments.given_motion import InstrumentsUsed

#: Estimates before the one that may be the last: noise models come from the residuals of both.
MIN_ESTIMATES = 2


#: What the paper's form fixes, of the method and of its noise model.
FIXED_AS_PRINTED = ("random_walk", "prefilter", "covariance", "start")
NOISE_AS_PRINTED = ("motion_band", "on_unmasked", "period", "repetition")


@dataclass(frozen=True, kw_only=True)
class PrefilteredIV(InstrumentalMethod):
    """IDIM-PIV: IV with prefilters from the identified noise.

    Attributes:
        signals: the smoother.
        noise: the noise model.
        prefilter: ``controller``: inverse of the law's proportional and derivative part, then
            the AR whitener; ``direct``: the AR whitener on the torque residual; ``auto``: the
            former where a loop is simulated, the latter where it is not, and the more precise of
            both where the law was identified from the record.
        covariance: what the standard errors come from: ``stationary``, the autocovariance of the
            residual; ``sandwich``, windows of time, which also holds where the residual comes in
            bursts; ``auto``: stationary where the windows agree with it (see
            `pivident.estimation.covariance.stationary_noise`), else sandwich; or the paper's
            ``formula`` (P-31).
        as_printed: the paper to the letter: irwsm of order 2 applied twice, torque not aligned,
            standard errors by (P-31), and (P-22), (P-28) with λ⁻¹ on both sides. AR orders go up to
            the noise model's ``p_max``; CAPTAIN's ``aic`` stops at 32 by default.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> made = pv.simulate(robot, loop, duration=5.0, encoder=1e-5)
        >>> problem = pv.Problem(robot, (made.recording,), loop)
        >>> result = pv.identify(problem, pv.PrefilteredIV(covariance="sandwich"))
        >>> errors = [result.params[name] - made.truth[name] for name in result.names]
        >>> print(f"{np.abs(errors / result.std).max():.1f} standard errors at most")
        1.2 standard errors at most
    """

    signals: RandomWalk = option(factory=RandomWalk, meaning="the smoother")
    noise: AutoRegressive | Arma = option(  # type: ignore[misc]
        factory=AutoRegressive, meaning="the noise model"
    )
    prefilter: Literal["auto", "controller", "direct"] = option(
        "auto",
        'whiten behind the inverse of the `"controller"`, or `"direct"` the torque residual; '
        '`"auto"`: the former where a loop is simulated, and the more precise of both where the '
        "law was identified",
    )
    covariance: CovarianceKind = option(  # type: ignore[misc]
        "auto",
        'standard errors from `"stationary"` noise, from the `"sandwich"` over windows, from the '
        "first where a test finds that the residual is stationary and else from the second "
        '(`"auto"`), or by the paper\'s `"formula"`',
    )
    as_printed: bool = option(False, "exactly as printed in the paper")

    of_computed_torque: ClassVar[tuple[Finding, ...]] = (EQUATION_ERROR,)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.as_printed:
            self._refuse_instruments()
            changes: dict[str, Any] = {"on_unmasked": False}
            if not isinstance(self.noise, Arma):
                changes["motion_band"] = None
            fixed = {
                "signals": RandomWalk(order=2, passes=2, align=False),
                "noise": replace(self.noise, **changes),
                "covariance": "formula",
                "start": "initial",
            }
            for name, value in fixed.items():
                object.__setattr__(self, name, value)

    def _refuse_instruments(self) -> None:
        """Refuse instruments that are not those of the simulated loop."""
        if self.instruments not in ("auto", "loop"):
            raise ExperimentError(
                f"instruments are {self.instruments!r}, but {self.label} takes them from the "
                "simulated loop: choose 'loop', or piv or iv-full-rate"
            )

    @property
    def weight_power(self) -> float:  # type: ignore[override]
        """w, power of λ in the weights: 1, or 2 as (P-22) and (P-28) are printed."""
        return 2.0 if self.as_printed else 1.0

    @property
    def whitens(self) -> bool | None:  # type: ignore[override]
        """Whether its prefilters make it precise; as printed it is there for comparison."""
        return None if self.as_printed else True

    @property
    def handles(self) -> Handles:  # type: ignore[override]
        """What it copes with; as printed it needs the law."""
        free = not self.as_printed
        return Handles(
            wrenches=free,  # weights λ⁻² leave rows of other units without any
            no_controller=free,
            law_choice=True,
            shape_constants=True,
            payload=free,
            known=KNOWN if free else ("fixed", "bounds", "constraints"),
        )

    @property
    def label(self) -> str:  # type: ignore[override]
        """Name as in the literature."""
        return "IDIM-PIV (as printed)" if self.as_printed else "IDIM-PIV"

    @property
    def summary(self) -> str:  # type: ignore[override]
        """What it is, in a few words."""
        if self.as_printed:
            return "piv exactly as the paper prints it"
        return "prefiltered instrumental variables: no bias, correct intervals"

    @property
    def group(self) -> str:  # type: ignore[override]
        """Heading under which it is offered."""
        return "Regressions" if self.as_printed else ""

    @property
    def recipes(self) -> tuple[str, ...]:
        """The smoother."""
        return ("random_walk",)

    @property
    def keys(self) -> tuple[str, ...]:
        """Options that a file may set; as printed the instruments are those of the loop."""
        return tuple(k for k in super().keys if k != "instruments" or not self.as_printed)

    def check_keys(self, keys: Mapping[str, Any]) -> None:
        """Refuse what the paper's form fixes."""
        if not keys.get("as_printed", self.as_printed):
            return
        fixed = sorted(set(FIXED_AS_PRINTED) & set(keys))
        fixed += [f"noise.{k}" for k in NOISE_AS_PRINTED if k in keys.get("noise", {})]
        if fixed:
            raise ExperimentError(
                f"as_printed follows the paper to the letter and fixes {', '.join(fixed)}",
                advice="remove one of the two",
            ).about(*fixed[0].split("."))

    def steps(self, signals: Signals, chosen: Chosen) -> PrefilteredSteps:
        """The parts of its iteration.

        Args:
            signals: the smoothed recordings.
            chosen: the instruments, with the measured motions that go with them.
        """
        simulated = chosen.used.kind == "loop"
        whitening = Whitening.of(signals.problem, self, chosen.kinematics, simulated)
        own = signals.with_kinematics(chosen.kinematics)
        return PrefilteredSteps(own, self, chosen.source, whitening)

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Iterate instruments, estimate and noise models.

        A law that was found from the record may describe poorly where the noise comes from, and its
        inverse remembers standstill for long. Then the iteration is done with its inverse and
        without, and the more precise estimate is taken.
        """
        say(f"{self.label}: smoothing the records")
        signals = Signals.of(problem, self)
        loop = problem.loop
        if self.prefilter != "auto" or loop is None or loop.identified is None:
            return _identified(signals, self, say)
        direct = _identified(signals, replace(self, prefilter="direct"), say)
        if direct.loop is None:  # other instruments: no law is inverted
            return direct
        say("once more with the inverse of the law")
        try:
            inverse = _identified(signals, replace(self, prefilter="controller"), say)
        except IdentificationError:  # the inverse forgets too slowly
            return direct
        if inverse.loop is None:
            return direct
        free = ~signals.problem.restrictions.is_fixed
        return min(
            direct, inverse, key=lambda i: (not i.converged, np.log(i.method_std[free]).mean())
        )


#: IDIM-PIV, and as the paper prints it.
PIV, PIV_AS_PRINTED = PrefilteredIV(), PrefilteredIV(as_printed=True)


def piv(steps: Steps, say: Say) -> tuple[Estimate, Run]:
    """The iteration of section 4.3, until parameters and residual stand still.

    1. Initialisation: θ⁰ from nominal values or least squares, noise filters H_j = 1.
    2. Iteration: (a) simulate the auxiliary model with θ of the last estimate, which makes the
       instruments; (b) solve (P-28) behind the prefilters; (c) noise models from its residual,
       (P-29) and (P-30).

    A simulation keeps one core busy: (c) goes on beside (a) of the next iteration.
    """
    label = steps.method.label
    say(f"{label}: iterating")
    last, run = steps.start(), Run()
    with ThreadPoolExecutor(1) as beside:
        noise = beside.submit(steps.noise_models, last, last.theta)
        for _ in range(steps.method.max_iterations):
            simulated = simulate(steps, last, run)  # (a)
            prefilters = noise.result()
            if simulated.halvings:  # θ could not be simulated: the residual is that of another one
                prefilters = steps.noise_models(last, simulated.theta)
            last = estimate = solve(steps, last, simulated, prefilters)  # (b)
            run = run.after(steps, estimate, simulated.halvings)
            say(IterationLine(run))
            if run.converged:
                break
            noise = beside.submit(steps.noise_models, estimate, estimate.theta)  # (c)
    say(f"{label}: residuals and covariance")
    return estimate, run


def _identified(signals: Signals, method: PrefilteredIV, say: Say) -> Identification:
    """The iteration with the prefilter that the method names."""

    def iterated(chosen: Chosen) -> tuple[PrefilteredSteps, Estimate, Run]:
        steps = method.steps(signals, chosen)
        return steps, *piv(steps, say)

    (made, estimate, run), used = with_instruments(signals, method, iterated, say)
    warnings = loop_warnings(signals.problem, estimate, used)
    warnings += made.whitening.warnings(estimate.prefilters)
    return answer(signals.problem, method, estimate, run, warnings, used)


Iterated = TypeVar("Iterated")


def with_instruments(
    signals: Signals,
    method: InstrumentalMethod,
    iterated: Callable[[Chosen], Iterated],
    say: Say,
    differences: bool = True,
) -> tuple[Iterated, InstrumentsUsed]:
    """An iteration with the instruments that the method asks for, or the best there are.

    A loop whose law was found or declared, rather than given, may turn out not to carry the
    simulation; then the record itself makes the instruments.
    """
    problem = signals.problem
    chosen = choose(problem, method, signals.kinematics, differences)
    try:
        return iterated(chosen), chosen.used
    except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
        if not may_do_without(problem, method):
            raise
        reason = instead_of_loop(error)
        say(reason)
    chosen = without_loop(signals.kinematics, reason)
    return iterated(chosen), chosen.used


def full_rate_start(
    signals: Signals,
    method: IteratedMethod,
    prefilters: Prefilters,
) -> Pass:
    """θ⁰ of a method at the full rate, with prefilters that need no noise model."""
    nominal = initial_pass(signals.problem, prefilters)
    if not start_number(method):
        return nominal
    records = records_without_instruments(signals.measured(signals.without_load), signals.limits)
    return least_squares_pass(signals, nominal, records)


@dataclass(frozen=True, eq=False)
class PrefilteredSteps:
    """The steps of IDIM-PIV."""

    signals: Signals
    method: PrefilteredIV
    auxiliary: InstrumentSource
    whitening: Whitening

    earliest = MIN_ESTIMATES + 1
    always_by_window = False
    repeatable = True

    def start(self) -> Pass:
        """θ⁰: least squares behind the inverse controllers."""
        return full_rate_start(self.signals, self.method, self.whitening.initial())

    def noise_models(self, last: Pass, theta: np.ndarray) -> Prefilters:
        """Step (c): inverse controllers and whiteners of what they leave of the residual."""
        return self.whitening.fitted(last.prefilters, last.number, theta, last.records)

    def equations(
        self, last: Pass, simulated: Simulated, prefilters: Prefilters
    ) -> tuple[Sequence[FullRateRecord], Prefilters]:
        """Φ(q̂), Z = Φ(q_s) and τ of all recordings."""
        signals, load = self.signals, self.signals.load(last.number, simulated.theta)
        measured = signals.measured(load, simulated.motions)
        records = records_with_instruments(
            measured, signals.simulated(simulated.motions, load), signals.limits
        )
        prefilters.exclude(records)
        return records, prefilters
