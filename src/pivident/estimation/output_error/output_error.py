"""CLOE, CLIE, ML and OLOE: the parameters whose simulated motion is nearest to the measured one.

    θ̂ = argmin Σ_j ‖L_j (y_j - y_s,j(θ))‖²

With y the positions this is the closed-loop output error method (CLOE), with the torques the
closed-loop input error method (CLIE), with both and their noise models maximum likelihood (ML).
In open loop (OLOE) the recorded torques drive the simulation. Neither accelerations nor filtered
speeds are needed, and the measured positions enter without a smoother: nothing biases them.

The price is that of DIDIM: where model, law or reference are wrong, so is the simulated motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from pivident.estimation.answer import Covariances, answer, law_findings
from pivident.estimation.equation_record import accumulate
from pivident.estimation.full_rate import records_without_instruments
from pivident.estimation.identification import Identification, Iteration
from pivident.estimation.iteration import Estimate, Run, Signals
from pivident.estimation.method import (
    AutoRegressive,
    Cost,
    CovarianceKind,
    Handles,
    IteratedMethod,
    Refit,
    Say,
)
from pivident.estimation.noise_identification import DECIDES_ORDERS, Prefilters, Whitening
from pivident.estimation.normal_equations import Solution, joint_variances
from pivident.estimation.output_error.fit import FitOptions, SimulationFit, fit_simulation
from pivident.estimation.output_error.loop_unknowns import (
    Unknown,
    loop_unknowns,
    model_unknowns,
    with_values,
    within_bounds,
)
from pivident.estimation.output_error.misfit import misfit_findings
from pivident.estimation.output_error.record_stretches import (
    MIN_SECONDS,
    Stretch,
    closed_stretches,
    longest_run,
    open_stretches,
)
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES
from pivident.estimation.prefiltered_iv import PrefilteredIV, full_rate_start
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.estimation.simulation_result import LoopParameter, SimulationResult
from pivident.foundation.common_work import once
from pivident.foundation.errors import (
    ExperimentError,
    RankDeficientRegressor,
    SimulationDiverged,
    SimulationFailed,
)
from pivident.foundation.options import DECLARED, Option, option
from pivident.foundation.text.finding import Finding, Quantity
from pivident.loop.instruments.given_motion import InstrumentsUsed

#: Shares of the way from nominal values to least squares at which a start is tried.
STARTS = (1.0, 0.5, 0.25, 0.0)

#: What is compared, by name.
CHANNELS = {
    "positions": (POSITIONS,),
    "torques": (TORQUES,),
    "both": (POSITIONS, TORQUES),
}


@dataclass(frozen=True, kw_only=True)
class OutputError(IteratedMethod):
    """Simulation error: parameters whose simulated motion is nearest to what was measured.

    Attributes:
        compares: ``positions`` (CLOE), ``torques`` (CLIE) or ``both``, weighted by noise (ML).
        loop: ``closed``: the control law answers to the simulated motion; ``open``: the recorded
            torques drive it (OLOE).
        free: further unknowns of the loop: ``delay``, ``drive_gain``, ``inputs``, ``kp``, ``kd``
            and other gains of the law, ``encoder_offset``, ``torque_offset``, or a constant of a
            friction law; of one joint with its label, ``kp2``.
        bounds: lowest and highest value of an unknown by its name.
        signals: the smoother, for the start and for the torque that the report shows.
        noise: recipe of the noise models.
        prefilter: ``noise``: errors are weighted by the inverse of their identified noise, as in
            IDIM-PIV; ``none``: squares of the errors, each joint by its size; ``auto``: the former
            in a closed loop, the latter in an open one, whose errors are drift.
        bandwidth: highest frequency that is compared [Hz]; motions of robots end far below.
        horizon: how long a simulation runs before it begins anew from the measured state:
            ``record``, the whole of it, a number of seconds [s], or ``moves``, each from rest to
            rest; None: the record, of an open loop as far as an error of the state at its
            beginning has not grown five-fold.
        loss: ``squares``, or ``huber`` where single stretches do not fit.
        undetermined: ``refuse`` unknowns that nothing determines, or ``hold`` them where they are.
        covariance: ``formula``, for errors that are white behind their prefilters, ``stationary``,
            for stationary noise of any colour, ``sandwich``, from windows of time, or ``auto``:
            stationary where the windows agree with it, else sandwich; in an open loop that runs
            over several moves from kinds of moves.
        start: ``least-squares`` on the record, or the problem's ``initial`` values.
        tolerance: step, in standard errors, at which the iteration may end: no combination of
            unknowns moves by more.
        max_iterations: give up after so many.
    """

    # mypy knows fields without their name by dataclasses.field alone
    compares: Literal["positions", "torques", "both"] = field(
        default="both", kw_only=False, metadata={DECLARED: Option("signals that are compared")}
    )
    loop: Literal["closed", "open"] = field(
        default="closed", kw_only=False, metadata={DECLARED: Option("what drives the simulation")}
    )
    free: tuple[str, ...] = option(
        (),
        "further unknowns of the loop: `delay`, `drive_gain`, `inputs`, gains of the law such as "
        "`kp`, `encoder_offset`, `torque_offset`, a constant of a friction law; of one joint with "
        "its label, `kp2` ([how to](how_to/fit_gains_and_delay.md))",
    )
    bounds: Mapping[str, tuple[float, float]] = option(
        factory=dict,
        meaning="lowest and highest value by name, `{fc1 = [0, 20]}`; friction, gains, drive gains "
        "and delay are not below zero",
        unit="of the unknown", kind="table", shown="see meaning",
    )  # fmt: skip
    signals: RandomWalk = option(
        factory=RandomWalk, meaning="for the start, and for the torque errors that are shown"
    )
    noise: AutoRegressive = option(  # type: ignore[misc]
        factory=AutoRegressive, meaning="AR models only"
    )
    prefilter: Literal["auto", "noise", "none"] = option(
        "auto",
        'weight errors by the inverse of their identified `"noise"`, or by the size of each '
        'joint\'s errors, `"none"`; `"auto"`: the former in a closed loop, the latter in an '
        "open one",
    )
    bandwidth: float = option(100.0, "highest frequency that is compared", unit="Hz", above=0.0)
    horizon: float | Literal["moves", "record"] | None = option(  # type: ignore[misc]
        None,
        'how long a simulation runs before it begins anew from the measured state: the `"record"`, '
        'a number of seconds, or `"moves"`, each from rest to rest; not given: the record, with '
        "`oloe` as far as an error of the state at its beginning has not grown five-fold "
        "([when to choose which](theory/output_error.md#horizon))",
        unit="s", kind='`"record"`, `"moves"` or number', shown="see meaning", above=0.0,
    )  # fmt: skip
    loss: Literal["squares", "huber"] = option(
        "squares", 'or `"huber"`, where single stretches do not fit'
    )
    undetermined: Literal["refuse", "hold"] = option(
        "refuse",
        'unknowns that nothing determines: refuse them, or `"hold"` them where they are',
    )
    covariance: CovarianceKind = option(  # type: ignore[misc]
        "auto",
        'standard errors by the `"formula"` for white errors, from `"stationary"` noise, from the '
        '`"sandwich"` over windows, or stationary where the windows agree with it (`"auto"`), from '
        "kinds of moves where an open loop runs over several",
    )
    tolerance: float = option(
        0.1, "step in standard errors at which the iteration may end", unit="σ",
        above=0.0, below=1.0,
    )  # fmt: skip
    max_iterations: int = option(30, "largest number of passes", at_least=1, shared=True)

    group: ClassVar[str] = "Methods that fit a simulation"
    cost: ClassVar[Cost] = Cost(0.3, 8e-7)
    fits_simulation: ClassVar[bool] = True
    without_controller: ClassVar[str] = "oloe, which takes the recorded torques"
    refit: ClassVar[Refit] = "simulation"

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.noise) is not AutoRegressive:
            raise ExperimentError(
                "noise models of simulation errors are autoregressive",
                advice="leave ar_order, ma_order and repetition out",
            ).about("noise")
        if self.loop == "open" and self.compares != "positions":
            raise ExperimentError(
                "an open loop is driven by the recorded torques, so that only positions can be "
                "compared: compares = 'positions'"
            ).about("compares")
        object.__setattr__(self, "free", tuple(self.free))
        bounds = {name: (float(low), float(high)) for name, (low, high) in self.bounds.items()}
        object.__setattr__(self, "bounds", bounds)

    @property
    def simulates_loop(self) -> bool:  # type: ignore[override]
        """Whether the control loop is simulated: in open loop it is not."""
        return self.loop == "closed"

    @property
    def in_leagues(self) -> bool:  # type: ignore[override]
        """Not without feedback: an arm that its control law holds up would fall."""
        return self.loop == "closed"

    @property
    def handles(self) -> Handles:  # type: ignore[override]
        """What it copes with: an open loop needs torques in place of the law."""
        is_open = self.loop == "open"
        return Handles(
            wrenches=False,
            computed_torque=not is_open and self.compares == "positions",
            no_controller=is_open,
            no_reference=is_open,
            known=("fixed", "bounds"),
            weights=False,
        )

    @property
    def label(self) -> str:  # type: ignore[override]
        """Name as in the literature."""
        if self.loop == "open":
            return "OLOE"
        return {"positions": "CLOE", "torques": "CLIE", "both": "ML"}[self.compares]

    @property
    def summary(self) -> str:  # type: ignore[override]
        """What it is, in a few words."""
        if self.loop == "open":
            return "positions of the robot driven by the recorded torques"
        return {
            "positions": "positions of the simulated closed loop",
            "torques": "torques of the simulated closed loop",
            "both": "positions and torques by their noise; needs law and reference",
        }[self.compares]

    @property
    def recipes(self) -> tuple[str, ...]:
        """The smoother."""
        return ("random_walk",)

    @property
    def keys(self) -> tuple[str, ...]:
        """Options that a file may set: what is compared has names of its own."""
        return tuple(k for k in super().keys if k not in ("compares", "loop"))

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Start from least squares, fit the simulation, and say what it leaves."""
        say(f"{self.label}: smoothing the records")
        signals = Signals.of(problem, self)
        theta = _start(signals, self)
        say(f"{self.label}: fitting the simulation")
        try:
            fit, found = _fitted(signals, self, theta, say)
        except SimulationFailed as error:
            error.problem, error.from_start = problem, True
            raise
        say(f"{self.label}: residuals and covariance")
        return _identification(signals, self, fit, found, test_gains and self.simulates_loop)


#: Closed loop compared in positions, in torques, in both, and open loop.
CLOE, CLIE, ML = OutputError("positions"), OutputError("torques"), OutputError("both")
OLOE = OutputError("positions", "open")


def _fitted(
    signals: Signals, method: OutputError, theta: np.ndarray, say: Say
) -> tuple[SimulationFit, list[Finding]]:
    """The fit over the horizon; an open loop that diverges begins with a shorter one and grows.

    From a start that is far off a run over minutes leaves what was measured. Runs of half the time
    may not, and what they find is a better start for those of twice theirs.
    """
    problem, asked, found = signals.problem, method, None
    while True:
        stretches = _stretches(signals, asked, theta)
        loop = stretches[0].loop
        unknowns = within_bounds(
            [*model_unknowns(problem), *loop_unknowns(problem, loop, method.free)], method.bounds
        )
        if found is not None:
            loops = [with_values(own.loop, unknowns, found.values) for own in stretches]
            stretches = [own.with_loop(loop) for own, loop in zip(stretches, loops, strict=True)]
        seconds = longest_run(stretches)
        try:
            fit = fit_simulation(stretches, unknowns, _options(problem, method), say)
        except SimulationDiverged:
            if found is not None:
                return found, [_shortened(longest_run(found.stretches), seconds)]
            if method.loop == "closed" or seconds < 2.0 * MIN_SECONDS:
                raise
            asked = replace(method, horizon=seconds / 2.0)
            say(f"{method.label}: runs of {seconds:.3g} s diverge, begun with half of it")
            continue
        if asked is method:
            return fit, []
        found, wanted = fit, longest_run(_stretches(signals, method, theta))
        asked = replace(method, horizon=2.0 * seconds) if 2.0 * seconds < wanted else method


def _options(problem: Problem, method: OutputError) -> FitOptions:
    """What the fit needs of the method."""
    weighted = method.prefilter == "noise" or (
        method.prefilter == "auto" and method.loop == "closed"
    )
    return FitOptions(
        channels=CHANNELS[method.compares],
        noise=method.noise if weighted else None,
        motion_band=max(method.noise.band(r) for r in problem.recordings),
        bandwidth=method.bandwidth,
        robust=method.loss == "huber",
        undetermined=method.undetermined,
        tolerance=method.tolerance,
        max_iterations=method.max_iterations,
        covariance=method.covariance,
    )


def _start(signals: Signals, method: OutputError) -> np.ndarray:
    """θ⁰: least squares on the measured motion, else the initial values."""
    none = Prefilters.none(signals.problem)
    if method.start == "initial":
        return signals.problem.initial_values()
    try:
        return full_rate_start(signals, method, none).theta
    except RankDeficientRegressor:
        if method.undetermined == "refuse":
            raise
        return signals.problem.initial_values()


def _stretches(signals: Signals, method: OutputError, theta: np.ndarray) -> list[Stretch]:
    """Records beside their loops, from the nearest start that can be simulated."""
    problem, nominal = signals.problem, signals.problem.initial_values()
    parameters = problem.regressor.parameters
    if method.loop == "open":
        return open_stretches(problem, parameters, theta, signals.kinematics, method.horizon)
    assert problem.loop is not None
    unknowns = model_unknowns(problem)
    for share in STARTS:
        values = nominal + share * (theta - nominal)
        values = np.clip(values, [u.low for u in unknowns], [u.high for u in unknowns])
        make = partial(
            closed_stretches, problem, problem.loop, parameters, values, signals.kinematics,
            method.horizon,
        )  # fmt: skip
        try:
            return once(
                ("stretches", problem, method.signals, method.horizon, values.tobytes()), make
            )
        except SimulationFailed as error:
            failure = error
    raise failure


def _identification(
    signals: Signals,
    method: OutputError,
    fit: SimulationFit,
    found: Sequence[Finding],
    test_gains: bool,
) -> Identification:
    """The answer, with the torque equations at the estimate beside the simulation's."""
    signals = _with_constants(signals, fit)
    problem = signals.problem
    count = len(problem.names)
    theta = fit.values[:count]
    estimate = _equations(signals, method, fit, theta)
    history = tuple(
        Iteration(own.values[:count], own.change, float(np.sqrt(own.cost)), own.refused, own.orders)
        for own in fit.history
    )
    used = InstrumentsUsed("loop") if method.loop == "closed" else None
    notes, warnings = law_findings(problem.loop if method.loop == "closed" else None)
    result = _result(method, fit, count)
    findings = [
        *notes, *warnings, *found, *_undetermined(fit),
        *(_bound(fit.unknowns[k], fit, int(k)) for k in np.flatnonzero(fit.bound)),
        *misfit_findings(problem, fit, test_gains),
    ]  # fmt: skip
    return answer(
        problem, method, estimate, Run(history, fit.converged), findings, used,
        Covariances(fit.robust_covariance[:count, :count], fit.formula_covariance[:count, :count]),
        result,
    )  # fmt: skip


def _with_constants(signals: Signals, fit: SimulationFit) -> Signals:
    """The problem of the robot whose friction has the constants that were sought with it.

    The parameters of a friction law mean nothing with other constants than those they came with.
    """
    if all(own.direction.kind != "shape" for own in fit.unknowns):
        return signals
    return replace(signals, problem=replace(signals.problem, robot=fit.stretches[0].loop.robot))


def _equations(
    signals: Signals, method: OutputError, fit: SimulationFit, theta: np.ndarray
) -> Estimate:
    """τ - Φθ on the measured motion, behind a noise model of its own, for tests and plots."""
    problem, recipe = signals.problem, PrefilteredIV(noise=method.noise, prefilter="direct")
    records = records_without_instruments(signals.measured(theta), signals.limits)
    whitening = Whitening.of(problem, recipe, signals.kinematics, simulated=False)
    prefilters = whitening.fitted(whitening.initial(), DECIDES_ORDERS, theta, records)
    prefilters.exclude(records)
    sums = accumulate(problem.regressor, records, prefilters.filters, by_window=False)
    count = len(theta)
    weakest = tuple(name for name in fit.weakest if name in problem.names)
    solution = Solution(theta, fit.formula_covariance[:count, :count], fit.condition, weakest)
    variance = joint_variances(sums, theta)
    return Estimate(len(fit.history), theta, theta, records, prefilters, sums, solution, variance)


def _result(method: OutputError, fit: SimulationFit, count: int) -> SimulationResult:
    """How near the simulation comes, and the unknowns of the loop."""
    names = [u.name for u in fit.unknowns]
    return SimulationResult(
        compares=method.compares,
        loop=method.loop,
        horizon=longest_run(fit.stretches),
        position_rms=fit.rms[POSITIONS],
        torque_rms=fit.rms[TORQUES],
        loop_parameters=tuple(
            LoopParameter(
                own.name, own.unit, float(fit.values[k]), float(fit.std[k]),
                _side(fit, k) if fit.bound[k] else "", bool(fit.held[k]),
            )
            for k, own in enumerate(fit.unknowns)
            if k >= count
        ),
        held=_held_names(fit),
        at_bound=tuple(names[k] for k in np.flatnonzero(fit.bound)),
        bound_sides=tuple(_side(fit, int(k)) for k in np.flatnonzero(fit.bound)),
        noise_orders=fit.noise.orders,
        fit=fit,
    )  # fmt: skip


def _side(fit: SimulationFit, k: int) -> Literal["low", "high"]:
    """Which bound holds an unknown that one holds."""
    own = fit.unknowns[k]
    return "low" if abs(fit.values[k] - own.low) <= abs(fit.values[k] - own.high) else "high"


def _held_names(fit: SimulationFit) -> tuple[str, ...]:
    """Unknowns that nothing determines; those whose values are known are not among them."""
    return tuple(fit.unknowns[k].name for k in np.flatnonzero(fit.held) if not fit.unknowns[k].held)


def _undetermined(fit: SimulationFit) -> list[Finding]:
    """Unknowns that were held since nothing determines them."""
    names = _held_names(fit)
    if not names:
        return []
    verb = "is" if len(names) == 1 else "are"
    text = (
        f"The compared signals do not determine {', '.join(names)}, which {verb} held at the value "
        "of the start; values of others that act with them rest on it."
    )
    step = "Declare what is known of them, or record a motion in which they act apart."
    return [Finding("warning", "simulation", "undetermined", text, next_step=step)]


def _shortened(shorter: float, longer: float) -> Finding:
    """A horizon [s] beyond which simulations of the open loop diverge."""
    text = (
        f"Runs of {longer:.3g} s in open loop leave what was measured even from the estimate of "
        f"runs of {shorter:.3g} s, which is the one given."
    )
    step = "Simulate the closed loop (cloe, clie, ml), which comes back to its reference."
    evidence = {"horizon": Quantity(shorter, "s")}
    return Finding("warning", "simulation", "short horizon", text, "", step, evidence)


def _bound(own: Unknown, fit: SimulationFit, k: int) -> Finding:
    """One of them."""
    side, value, std = _side(fit, k), float(fit.values[k]), float(fit.std[k])
    text = (
        f"{own.name} is at its {'lower' if side == 'low' else 'upper'} bound; its interval has one "
        "side."
    )
    step = "Widen the bound if the value beyond it is possible."
    if value == 0.0 and own.direction.kind == "parameter":
        step = "The law of friction, or the description, lacks something if it would be negative."
    elif value == 0.0 and own.direction.kind == "delay":
        step = "The record shows no delay; leave it out of free."
    interval = (value, value + 2.0 * std) if side == "low" else (value - 2.0 * std, value)
    evidence = {own.name: Quantity(value, own.unit, bound=value, interval=interval)}
    return Finding("warning", "simulation", "at bound", text, own.name, step, evidence)
