"""Table ``[identify]`` of an experiment file: the methods, and the options of each.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PositiveFloat, model_validator
from pydantic.functional_validators import PlainValidator

from pivident.consistency.method_names import CONSISTENT_METHODS  # consistency
from pivident.errors import ExperimentError
from pivident.estimation.methods import METHODS, Instruments
from pivident.estimation.noise_options import CovarianceKind
from pivident.experiment.table_values import Cutoff, Edge, Mask, MotionBand, Names, Stages
from pivident.robot.mdh_schema import Entry
from pivident.robot.naming import nearest

#: Names of methods, those of consistent estimates included.
METHOD_NAMES = (*METHODS, *CONSISTENT_METHODS)


def _methods(value: Any) -> Any:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise ValueError(
            f"must be a list with some of {', '.join(METHODS)}, each also with the prefix pc-"
        )
    for name in names:
        if name not in METHOD_NAMES:
            bare = name.lower().replace("_", "-").removeprefix("idim-")
            raise ValueError(f"there is no method {name!r}; {nearest(bare, METHOD_NAMES)}")
    if len(set(names)) < len(names):
        raise ValueError("names a method twice; name each one once")
    return names


def _switch(value: Any) -> Any:
    if isinstance(value, bool):
        return value
    raise ValueError("must be true or false, a boolean; names of parameters go under parameters")


def _check_decimation(entry: BandpassEntry | AlgebraicEntry) -> None:
    if entry.decimation is not None and entry.bandwidth is not None:
        raise ExperimentError(
            "decimation and bandwidth are both given; the factor follows from one"
        ).about("decimation")


#: Names of the recipes of `pivident.estimation.signal_recipes`.
SignalNames = Literal["bandpass", "algebraic", "random_walk"]

Methods = Annotated[list[str], PlainValidator(_methods)]


class BandpassEntry(Entry):
    """Options of `pivident.estimation.methods.Bandpass`."""

    cutoff: Cutoff | None = None
    order: Annotated[int, Field(ge=1, le=20)] | None = None
    decimation: Stages | None = None
    bandwidth: PositiveFloat | None = None
    convention: Literal["matlab", "scipy"] | None = None
    median: Annotated[int, Field(ge=1)] | None = None
    padlen: Annotated[int, Field(ge=0)] | None = None
    edge: Edge | None = None
    align: bool | None = None
    at_instants: bool | None = None

    @model_validator(mode="after")
    def _one_decimation(self) -> BandpassEntry:
        _check_decimation(self)
        if self.median is not None and self.median % 2 == 0:
            message = f"median = {self.median} must be an odd number of samples"
            raise ExperimentError(message).about("median")
        return self


class AlgebraicEntry(Entry):
    """Options of `pivident.estimation.methods.Algebraic`."""

    window: Cutoff | None = None
    degree: Annotated[int, Field(ge=0, le=10)] | None = None
    exponent: Annotated[float, Field(ge=2, le=50)] | None = None
    both_sides: bool | None = None
    decimation: Stages | None = None
    bandwidth: PositiveFloat | None = None
    align: bool | None = None

    @model_validator(mode="after")
    def _one_decimation(self) -> AlgebraicEntry:
        _check_decimation(self)
        return self


class RandomWalkEntry(Entry):
    """Options of `pivident.estimation.methods.RandomWalk`."""

    order: Literal[1, 2, 3, 4] | None = None
    passes: Annotated[int, Field(ge=1, le=10)] | None = None
    f50_max: PositiveFloat | None = None
    align: bool | None = None
    measurement_noise: Literal["white", "auto"] | None = None


class NoiseEntry(Entry):
    """Options of `AutoRegressive` noise, or with orders of `Arma`, in `estimation.methods`."""

    p_max: Annotated[int, Field(ge=1, le=5000)] | None = None
    criterion: Literal["aic", "aicc", "bic"] | None = None
    on_unmasked: bool | None = None
    motion_band: MotionBand | None = None
    repetition: bool | None = None
    period: Annotated[int, Field(ge=10)] | None = None
    ar_order: Annotated[int, Field(ge=1, le=200)] | None = None
    ma_order: Annotated[int, Field(ge=1, le=50)] | None = None
    largest_root: Annotated[float, Field(gt=0, lt=1)] | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> NoiseEntry:
        arma = {"ar_order", "ma_order", "largest_root"} & self.model_fields_set
        others = {"p_max", "criterion", "motion_band", "repetition", "period"}
        others &= self.model_fields_set
        if arma and others:
            raise ExperimentError(
                f"{', '.join(sorted(arma))} make an ARMA model, {', '.join(sorted(others))} belong "
                "to an AR model; keep one of the two"
            ).about(min(arma))
        if self.period is not None and not self.repetition:
            raise ExperimentError(
                "period belongs to noise from repetition; set repetition = true"
            ).about("period")
        return self


class SharedOptions(Entry):
    """Options that apply to every method that has them."""

    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None
    max_iterations: Annotated[int, Field(ge=1)] | None = None
    instruments: Instruments | None = None
    bandpass: BandpassEntry = BandpassEntry()
    algebraic: AlgebraicEntry = AlgebraicEntry()
    random_walk: RandomWalkEntry = RandomWalkEntry()
    noise: NoiseEntry = NoiseEntry()


class MethodEntry(SharedOptions):
    """Options of one method; they win over the shared ones."""

    signals: SignalNames | None = None
    prefilter: Literal["auto", "controller", "direct"] | None = None
    covariance: CovarianceKind | None = None
    start: Literal["least-squares", "initial"] | None = None
    as_printed: bool | None = None


def _bounds(value: Any) -> Any:
    """A table of two numbers for each name."""
    if not isinstance(value, dict):
        raise ValueError("must be a table such as { fc1 = [0, 20] }")
    for name, pair in value.items():
        numbers = isinstance(pair, list) and len(pair) == 2
        if not numbers or not all(type(x) in (int, float) for x in pair) or not pair[0] < pair[1]:
            raise ValueError(f"{name} needs two numbers, the lower one first, not {pair!r}")
    return value


class SimulationEntry(Entry):
    """Options of a method that fits a simulation, `pivident.estimation.methods.OutputError`."""

    free: Names | None = None
    bounds: Annotated[dict[str, list[float]], PlainValidator(_bounds)] | None = None
    prefilter: Literal["auto", "noise", "none"] | None = None
    bandwidth: PositiveFloat | None = None
    segment: PositiveFloat | None = None
    loss: Literal["squares", "huber"] | None = None
    undetermined: Literal["refuse", "hold"] | None = None
    covariance: CovarianceKind | None = None
    start: Literal["least-squares", "initial"] | None = None
    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None
    max_iterations: Annotated[int, Field(ge=1)] | None = None
    random_walk: RandomWalkEntry = RandomWalkEntry()
    noise: NoiseEntry = NoiseEntry()


class RegressionEntry(Entry):
    """Options of a method of `pivident.estimation.regression_methods`."""

    signals: SignalNames | None = None
    bandpass: BandpassEntry = BandpassEntry()
    algebraic: AlgebraicEntry = AlgebraicEntry()
    random_walk: RandomWalkEntry = RandomWalkEntry()


class IterationEntry(RegressionEntry):
    """Options of a regression in passes."""

    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None
    max_iterations: Annotated[int, Field(ge=1)] | None = None


class RobustEntry(IterationEntry):
    """Options of `pivident.estimation.regression_methods.RobustRegression`."""

    loss: Literal["huber", "bisquare"] | None = None


class RidgeEntry(RegressionEntry):
    """Options of `pivident.estimation.regression_methods.Ridge`."""

    penalty: PositiveFloat | None = None


class PriorEntry(RegressionEntry):
    """Options of `pivident.estimation.regression_methods.PriorRegression`."""

    spread: PositiveFloat | None = None
    deviation: dict[str, float] | None = None
    names: Names | None = None
    prior_covariance: list[list[float]] | None = None


class SetMembershipEntry(RegressionEntry):
    """Options of `pivident.estimation.regression_methods.SetMembership`."""

    bound: PositiveFloat | list[PositiveFloat] | None = None


class FrequencyEntry(IterationEntry):
    """Options of `pivident.estimation.regression_methods.FrequencyDomain`."""

    period: PositiveFloat | None = None
    transient: Annotated[int, Field(ge=0)] | None = None


class AdalineEntry(RegressionEntry):
    """Options of `pivident.estimation.regression_methods.Adaline`."""

    rate: Annotated[float, Field(gt=0, lt=2)] | None = None
    epochs: Annotated[int, Field(ge=1)] | None = None


class HopfieldEntry(RegressionEntry):
    """Options of `pivident.estimation.regression_methods.Hopfield`."""

    reach: Annotated[float, Field(gt=1)] | None = None
    time: PositiveFloat | None = None


class FilterEntry(RegressionEntry):
    """Options of `pivident.estimation.filter_methods.StateFilter`."""

    start: Literal["least-squares", "initial"] | None = None
    spread: PositiveFloat | None = None
    drift: Annotated[float, Field(ge=0)] | None = None
    encoder_noise: PositiveFloat | list[PositiveFloat] | None = None
    torque_noise: PositiveFloat | list[PositiveFloat] | None = None
    passes: Annotated[int, Field(ge=1)] | None = None


class UnscentedEntry(FilterEntry):
    """Options of `pivident.estimation.filter_methods.UnscentedKalman`."""

    alpha: PositiveFloat | None = None
    beta: float | None = None
    kappa: float | None = None
    square_root: bool | None = None


class CentralDifferenceEntry(FilterEntry):
    """Options of `pivident.estimation.filter_methods.CentralDifferenceKalman`."""

    step: Annotated[float, Field(ge=1)] | None = None
    square_root: bool | None = None


class ParticlesEntry(FilterEntry):
    """Options of `pivident.estimation.filter_methods.Particles`."""

    particles: Annotated[int, Field(ge=10)] | None = None
    discount: Annotated[float, Field(gt=0.5, lt=1)] | None = None
    seed: Annotated[int, Field(ge=0)] | None = None


class IdentifyEntry(SharedOptions):
    """What is estimated, and how."""

    methods: Methods | None = None
    parameters: Names | None = None
    essential: Annotated[bool, PlainValidator(_switch)] = False
    shapes: Literal["given", "identify"] = "given"
    free: Names | None = None
    mask: Mask = "auto"
    initial: dict[str, float] = Field(default_factory=dict)
    ols: MethodEntry = MethodEntry()
    ls: MethodEntry = MethodEntry()
    wls: MethodEntry = MethodEntry()
    tls: RegressionEntry = RegressionEntry()
    irls: RobustEntry = RobustEntry()
    ridge: RidgeEntry = RidgeEntry()
    map: PriorEntry = PriorEntry()
    ml_ls: IterationEntry = Field(IterationEntry(), alias="ml-ls")
    set_membership: SetMembershipEntry = Field(SetMembershipEntry(), alias="set-membership")
    frequency: FrequencyEntry = FrequencyEntry()
    adaline: AdalineEntry = AdalineEntry()
    hopfield: HopfieldEntry = HopfieldEntry()
    ekf: FilterEntry = FilterEntry()
    ukf: UnscentedEntry = UnscentedEntry()
    cdkf: CentralDifferenceEntry = CentralDifferenceEntry()
    particle: ParticlesEntry = ParticlesEntry()
    iv: MethodEntry = MethodEntry()
    iv_full_rate: MethodEntry = Field(MethodEntry(), alias="iv-full-rate")
    piv: MethodEntry = MethodEntry()
    didim: MethodEntry = MethodEntry()
    piv_as_printed: MethodEntry = Field(MethodEntry(), alias="piv-as-printed")
    cloe: SimulationEntry = SimulationEntry()
    clie: SimulationEntry = SimulationEntry()
    ml: SimulationEntry = SimulationEntry()
    oloe: SimulationEntry = SimulationEntry()

    def of(self, method: str) -> MethodEntry | SimulationEntry | RegressionEntry:
        """The table of one method."""
        return getattr(self, method.replace("-", "_"))
