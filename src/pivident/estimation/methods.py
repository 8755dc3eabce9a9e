"""The methods as small frozen dataclasses: how to estimate, and nothing else.

The signal recipe belongs to the method, since methods are compared with different ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, get_args

import numpy as np

from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.noise_options import Arma, AutoRegressive, CovarianceKind
from pivident.motion.kinematics import MOTION_BAND
from pivident.robot.naming import nearest
from pivident.signals.decimation import Convention

#: Where instruments come from, see `pivident.instruments`.
Instruments = Literal["auto", "loop", "response", "repetition", "sensor", "virtual", "halves"]

#: What the first simulation is made with.
Start = Literal["least-squares", "initial"]

#: Samples in a period of the highest frequency that a decimation keeps, at least: a difference that
#: is corrected to its instant keeps 99 % there, one that is not 90 %.
SAMPLES_OF_A_PERIOD = 8.0


def _check_iteration(tolerance: float, max_iterations: int) -> None:
    if not 0 < tolerance < 1:
        raise ExperimentError(f"tolerance must lie between 0 and 1, not {tolerance}")
    if max_iterations < 1:
        raise ExperimentError(f"max_iterations must be at least 1, not {max_iterations}")


def _check_start(start: str) -> None:
    if start not in get_args(Start):
        raise ExperimentError(f"start is {start!r}; choose 'least-squares' or 'initial'")


def _check_instruments(instruments: str) -> None:
    if instruments not in get_args(Instruments):
        choices = ", ".join(map(repr, get_args(Instruments)))
        raise ExperimentError(f"instruments are {instruments!r}; choose one of {choices}")


@dataclass(frozen=True)
class Bandpass:
    """Zero-phase Butterworth, central differences, parallel decimation of Φ and τ.

    Attributes:
        cutoff: cut-off of the position filter, for all joints or for each [Hz]; None: from the
            record, see `pivident.estimation.kinematics.settled_recipe`.
        order: order of the Butterworth filter.
        decimation: factor n_d, or its stages (10, 10); None: to ``bandwidth``.
        bandwidth: frequency kept by the decimation [Hz]: n_d = (rate/2)/bandwidth. None: 20 Hz,
            where the motion of an arm ends, or an eighth of a rate below 160 Hz.
        convention: whose ``decimate`` is followed at the ends, ``matlab`` or ``scipy``.
        median: length of a median filter before, 1 for none.
        padlen: samples the zero-phase filters extend the record by; None: scipy's choice.
        edge: samples dropped at both ends (or at start and end) before decimation; None: five
            periods of the lowest cut-off.
            One period is not enough: what the zero-phase filter makes up at the ends then decides
            the estimate (median error 2 % in place of 0.07 % on a simulated TX40).
        align: whether the torque is moved to the instants of the differences first; the
            literature does not, a declared delay is taken out in any case.
        at_instants: whether the differences, which are averages over two sampling periods, are
            made values at the instants (5 % of an acceleration at 5 Hz, logged at 80 Hz). None:
            where the cut-off comes from the record; the literature does not.
    """

    cutoff: float | tuple[float, ...] | None = None
    order: int = 4
    decimation: int | tuple[int, ...] | None = None
    bandwidth: float | None = None
    convention: Convention = "matlab"
    median: int = 1
    padlen: int | None = None
    edge: int | tuple[int, int] | None = None
    align: bool = False
    at_instants: bool | None = None

    def cutoffs(self, joints: int) -> np.ndarray:
        """Cut-off of each joint, shape (joints,) [Hz]; NaN as long as the record has to say.

        Raises:
            ExperimentError: a cut-off for each of another number of joints.
        """
        given = np.atleast_1d(np.array(np.nan if self.cutoff is None else self.cutoff, float))
        if len(given) not in (1, joints):
            raise ExperimentError(
                f"cutoff has {len(given)} numbers for {joints} joints; give one for all or one for "
                "each"
            )
        return np.broadcast_to(given, joints)

    def ends(self, rate: float) -> tuple[int, int]:
        """Samples dropped at the start and at the end for a sampling rate [Hz]."""
        if self.edge is None:
            return (int(np.ceil(5.0 * rate / np.min(np.atleast_1d(self.cutoff or np.nan)))),) * 2
        return (self.edge, self.edge) if isinstance(self.edge, int) else self.edge

    def band(self, rate: float) -> float:
        """Frequency that the decimation keeps, for a sampling rate [Hz]."""
        if self.decimation is not None:
            return 0.5 * rate / float(np.prod(self.decimation))
        return self.bandwidth or min(MOTION_BAND, rate / SAMPLES_OF_A_PERIOD)

    def factor(self, rate: float) -> int | tuple[int, ...]:
        """Decimation factor for a sampling rate [Hz]."""
        if self.decimation is not None:
            return self.decimation
        return max(1, int(rate / 2.0 / self.band(rate) + 1e-9))


@dataclass(frozen=True)
class RandomWalk:
    """Integrated random walk smoother at full rate, torque aligned with the positions.

    Attributes:
        order: order of integration m; 2 is the paper's, 3 the better prior of a trajectory.
        passes: number of times it is applied (2 with m = 2: the paper's ``irwsm`` twice).
        f50_max: cap of the half-power frequency [Hz]; None: none.
        align: whether the torque is moved to the instants of the central differences.
        measurement_noise: ``auto``: visible counts and spectral lines of the encoders are searched,
            and where there are any the smoother knows them. ``white``, or two passes: no search.
    """

    order: int = 3
    passes: int = 1
    f50_max: float | None = None
    align: bool = True
    measurement_noise: Literal["white", "auto"] = "auto"

    def __post_init__(self) -> None:
        if self.measurement_noise not in ("white", "auto"):
            raise ExperimentError(
                f"measurement_noise is {self.measurement_noise!r}; choose 'white' or 'auto'"
            )


@dataclass(frozen=True)
class LeastSquares:
    """IDIM-LS: ordinary (weighted = False) or weighted by each joint's own residual.

    Attributes:
        weighted: whether joints are weighted by the inverse of their residual variance.
        signals: how positions become speeds and accelerations.
        simulates_loop: whether instruments come from a simulated loop, for all such methods.
        weight_power: power of λ in the weights, likewise.
        covariance: which covariance is reported, likewise.
    """

    weighted: bool = True
    signals: Bandpass | RandomWalk = field(default_factory=Bandpass)

    simulates_loop: ClassVar[bool] = False
    weight_power: ClassVar[float] = 1.0
    covariance: ClassVar[CovarianceKind] = "formula"

    @property
    def label(self) -> str:
        """Name as in the literature."""
        return "IDIM-WLS" if self.weighted else "IDIM-OLS"


@dataclass(frozen=True)
class InstrumentalVariables:
    """IDIM-IV: instruments Φ(q_s) from the simulated loop, or another motion q_s.

    Attributes:
        signals: ``Bandpass()`` as in the literature, ``RandomWalk()`` at full rate.
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

    signals: Bandpass | RandomWalk = field(default_factory=Bandpass)
    tolerance: float = 1e-2
    max_iterations: int = 20
    instruments: Instruments = "auto"
    start: Start = "least-squares"

    simulates_loop: ClassVar[bool] = True
    weight_power: ClassVar[float] = 1.0
    covariance: ClassVar[CovarianceKind] = "formula"

    def __post_init__(self) -> None:
        _check_iteration(self.tolerance, self.max_iterations)
        _check_instruments(self.instruments)
        _check_start(self.start)

    @property
    def label(self) -> str:
        """Name as in the literature."""
        return "IDIM-IV" if isinstance(self.signals, Bandpass) else "IDIM-IV (full rate)"


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
        _check_iteration(self.tolerance, self.max_iterations)
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
        simulates_loop: whether a loop is simulated, for all such methods.
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

    simulates_loop: ClassVar[bool] = True
    weight_power: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        _check_iteration(self.tolerance, self.max_iterations)
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
    def label(self) -> str:
        """Name as in the literature."""
        if self.loop == "open":
            return "OLOE"
        return {"positions": "CLOE", "torques": "CLIE", "both": "ML"}[self.compares]


Method = LeastSquares | InstrumentalVariables | PrefilteredIV | OutputError

#: Names that the command line and experiment files use.
METHODS: dict[str, Method] = {
    "ols": LeastSquares(weighted=False),
    "ls": LeastSquares(),
    "wls": LeastSquares(),
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
