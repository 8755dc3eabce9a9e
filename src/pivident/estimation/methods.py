"""The methods as small frozen dataclasses: how to estimate, and nothing else.

The signal recipe belongs to the method, since methods are compared with different ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, get_args

from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.filter_methods import (
    CentralDifferenceKalman,
    ExtendedKalman,
    Particles,
    StateFilter,
    UnscentedKalman,
)
from pivident.estimation.noise_options import Arma, AutoRegressive, CovarianceKind
from pivident.estimation.option_checks import check_iteration
from pivident.estimation.regression_methods import (
    Adaline,
    CorrelatedJoints,
    FrequencyDomain,
    Hopfield,
    LeastSquares,
    PriorRegression,
    Regression,
    Ridge,
    RobustRegression,
    SetMembership,
    TotalLeastSquares,
)
from pivident.estimation.signal_recipes import (
    Algebraic,
    Bandpass,
    RandomWalk,
    SignalRecipe,
)
from pivident.robot.naming import nearest

#: Where instruments come from, see `pivident.instruments`.
Instruments = Literal["auto", "loop", "response", "repetition", "sensor", "virtual", "halves"]

#: What the first simulation is made with.
Start = Literal["least-squares", "initial"]


def _check_start(start: str) -> None:
    if start not in get_args(Start):
        raise ExperimentError(f"start is {start!r}; choose 'least-squares' or 'initial'")


def _check_instruments(instruments: str) -> None:
    if instruments not in get_args(Instruments):
        choices = ", ".join(map(repr, get_args(Instruments)))
        raise ExperimentError(f"instruments are {instruments!r}; choose one of {choices}")


@dataclass(frozen=True)
class InstrumentalVariables:
    """IDIM-IV: instruments Φ(q_s) from the simulated loop, or another motion q_s.

    Attributes:
        signals: ``Bandpass()`` as in the literature, ``Algebraic()``, or ``RandomWalk()`` at full
            rate.
        tolerance: both criteria of convergence.
        max_iterations: give up after so many.
        start: what the first simulation is made with: ``least-squares`` on the record, or the
            problem's ``initial`` values, as the literature does.
        instruments: ``loop``: simulated with its law; ``response``: the reference through the
            identified response of the loop; ``repetition``: other repetitions of the motion;
            ``sensor``: a second encoder; ``virtual``: a virtual computed-torque loop around the
            smoothed motion; ``halves``: every other sample. ``auto``: the simulated loop where the
            problem has one, else the best that the record allows.
        simulates_loop: whether instruments come from a simulated loop, for all such methods.
        weight_power: power of λ in the weights, likewise.
        covariance: which covariance is reported, likewise.
    """

    signals: SignalRecipe = field(default_factory=Bandpass)
    tolerance: float = 1e-2
    max_iterations: int = 20
    instruments: Instruments = "auto"
    start: Start = "least-squares"

    simulates_loop: ClassVar[bool] = True
    weight_power: ClassVar[float] = 1.0
    covariance: ClassVar[CovarianceKind] = "formula"

    def __post_init__(self) -> None:
        check_iteration(self.tolerance, self.max_iterations)
        _check_instruments(self.instruments)
        _check_start(self.start)

    @property
    def label(self) -> str:
        """Name as in the literature."""
        thinned = isinstance(self.signals, Bandpass) or (
            isinstance(self.signals, Algebraic) and self.signals.decimation != 1
        )
        return "IDIM-IV" if thinned else "IDIM-IV (full rate)"


@dataclass(frozen=True)
class PrefilteredIV:
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
        start: what the first simulation is made with: ``least-squares`` on the record, or the
            problem's ``initial`` values, as the paper does.
        regressor: what the observation matrix is made of: ``measured``, smoothed positions, or
            ``simulated``, the motion of the simulated loop, which is DIDIM (for coarse encoders).
        tolerance: both criteria of convergence.
        max_iterations: give up after so many.
        instruments: see `InstrumentalVariables`.
        simulates_loop: whether instruments come from a simulated loop, for all such methods.
    """

    signals: RandomWalk = field(default_factory=RandomWalk)
    noise: AutoRegressive | Arma = field(default_factory=AutoRegressive)
    prefilter: Literal["auto", "controller", "direct"] = "auto"
    covariance: CovarianceKind = "auto"
    as_printed: bool = False
    start: Start = "least-squares"
    regressor: Literal["measured", "simulated"] = "measured"
    tolerance: float = 1e-2
    max_iterations: int = 20
    instruments: Instruments = "auto"

    simulates_loop: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_iteration(self.tolerance, self.max_iterations)
        _check_instruments(self.instruments)
        if self.prefilter not in ("auto", "controller", "direct"):
            raise ExperimentError(
                f"prefilter is {self.prefilter!r}; choose 'auto', 'controller' or 'direct'"
            )
        if self.instruments not in ("auto", "loop") and (
            self.as_printed or self.regressor == "simulated"
        ):
            raise ExperimentError(
                f"instruments are {self.instruments!r}, but {self.label} takes them from the "
                "simulated loop: choose 'loop', or piv or iv-full-rate"
            )
        if self.covariance not in get_args(CovarianceKind):
            choices = ", ".join(map(repr, get_args(CovarianceKind)))
            raise ExperimentError(f"covariance is {self.covariance!r}; choose one of {choices}")
        _check_start(self.start)
        if self.regressor not in ("measured", "simulated"):
            raise ExperimentError(
                f"regressor is {self.regressor!r}; choose 'measured' or 'simulated'"
            )
        if self.as_printed and self.regressor == "simulated":
            raise ExperimentError(
                "as_printed follows the paper to the letter: regressor 'measured'"
            )
        if self.as_printed:
            object.__setattr__(self, "signals", RandomWalk(order=2, passes=2, align=False))
            if isinstance(self.noise, Arma):
                noise: AutoRegressive | Arma = replace(self.noise, on_unmasked=False)
            else:
                noise = replace(self.noise, on_unmasked=False, motion_band=None)
            object.__setattr__(self, "noise", noise)
            object.__setattr__(self, "covariance", "formula")
            object.__setattr__(self, "start", "initial")

    @property
    def weight_power(self) -> float:
        """w, power of λ in the weights: 1, or 2 as (P-22) and (P-28) are printed."""
        return 2.0 if self.as_printed else 1.0

    @property
    def label(self) -> str:
        """Name as in the literature."""
        if self.regressor == "simulated":
            return "DIDIM (prefiltered)"
        return "IDIM-PIV (as printed)" if self.as_printed else "IDIM-PIV"


@dataclass(frozen=True)
class OutputError:
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
        segment: longest stretch that an open loop runs from its own initial state [s]; None: until
            an error of that state has grown five-fold, the whole record where it never does.
        loss: ``squares``, or ``huber`` where single stretches do not fit.
        undetermined: ``refuse`` unknowns that nothing determines, or ``hold`` them where they are.
        covariance: ``formula``, for errors that are white behind their prefilters, ``stationary``,
            for stationary noise of any colour, ``sandwich``, from windows of time, or ``auto``:
            stationary where the windows agree with it, else sandwich.
        start: ``least-squares`` on the record, or the problem's ``initial`` values.
        tolerance: step, in standard errors, at which the iteration may end: no combination of
            unknowns moves by more.
        max_iterations: give up after so many.
        weight_power: power of λ in the weights, likewise.
    """

    compares: Literal["positions", "torques", "both"] = "both"
    loop: Literal["closed", "open"] = "closed"
    free: tuple[str, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    signals: RandomWalk = field(default_factory=RandomWalk)
    noise: AutoRegressive = field(default_factory=AutoRegressive)
    prefilter: Literal["auto", "noise", "none"] = "auto"
    bandwidth: float = 100.0
    segment: float | None = None
    loss: Literal["squares", "huber"] = "squares"
    undetermined: Literal["refuse", "hold"] = "refuse"
    covariance: CovarianceKind = "auto"
    start: Start = "least-squares"
    tolerance: float = 0.1
    max_iterations: int = 30

    weight_power: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        check_iteration(self.tolerance, self.max_iterations)
        _check_start(self.start)
        for name, choices in (
            ("compares", ("positions", "torques", "both")),
            ("loop", ("closed", "open")),
            ("prefilter", ("auto", "noise", "none")),
            ("loss", ("squares", "huber")),
            ("undetermined", ("refuse", "hold")),
            ("covariance", get_args(CovarianceKind)),
        ):
            if getattr(self, name) not in choices:
                raise ExperimentError(
                    f"{name} is {getattr(self, name)!r}; choose one of "
                    f"{', '.join(map(repr, choices))}"
                ).about(name)
        if self.loop == "open" and self.compares != "positions":
            raise ExperimentError(
                "an open loop is driven by the recorded torques, so that only positions can be "
                "compared: compares = 'positions'"
            ).about("compares")
        if self.segment is not None and (self.loop == "closed" or not self.segment > 0.0):
            raise ExperimentError(
                f"segment is {self.segment} s; it cuts the records of an open loop, and is positive"
            ).about("segment")
        if not self.bandwidth > 0.0:
            raise ExperimentError(f"bandwidth is {self.bandwidth} Hz; it has to be positive").about(
                "bandwidth"
            )
        object.__setattr__(self, "free", tuple(self.free))
        bounds = {name: (float(low), float(high)) for name, (low, high) in self.bounds.items()}
        object.__setattr__(self, "bounds", bounds)

    @property
    def simulates_loop(self) -> bool:
        """Whether the control loop is simulated: in open loop it is not."""
        return self.loop == "closed"

    @property
    def label(self) -> str:
        """Name as in the literature."""
        if self.loop == "open":
            return "OLOE"
        return {"positions": "CLOE", "torques": "CLIE", "both": "ML"}[self.compares]


Method = Regression | StateFilter | InstrumentalVariables | PrefilteredIV | OutputError

#: Names that the command line and experiment files use.
METHODS: dict[str, Method] = {
    "ols": LeastSquares(weighted=False),
    "ls": LeastSquares(),
    "wls": LeastSquares(),
    "tls": TotalLeastSquares(),
    "irls": RobustRegression(),
    "ridge": Ridge(),
    "map": PriorRegression(),
    "ml-ls": CorrelatedJoints(),
    "set-membership": SetMembership(),
    "adaline": Adaline(),
    "hopfield": Hopfield(),
    "frequency": FrequencyDomain(),
    "ekf": ExtendedKalman(),
    "ukf": UnscentedKalman(),
    "cdkf": CentralDifferenceKalman(),
    "particle": Particles(),
    "iv": InstrumentalVariables(),
    "iv-full-rate": InstrumentalVariables(signals=RandomWalk()),
    "piv": PrefilteredIV(),
    "didim": PrefilteredIV(regressor="simulated"),
    "piv-as-printed": PrefilteredIV(as_printed=True),
    "cloe": OutputError("positions"),
    "clie": OutputError("torques"),
    "ml": OutputError("both"),
    "oloe": OutputError("positions", loop="open"),
}

#: Methods that are taken where a log has no torque and nobody names others.
WITHOUT_TORQUE: tuple[str, ...] = ("cloe",)


def method_named(method: Method | str) -> Method:
    """A method, given itself or one of the names in ``METHODS``."""
    if not isinstance(method, str):
        return method
    if method not in METHODS:
        raise IdentificationError(f"unknown method {method!r}; {nearest(method, METHODS)}")
    return METHODS[method]
