"""Methods that solve the equations τ = Φθ and need neither instruments nor a loop.

They share the equations of `LeastSquares`, its filters and its bias: measured positions in the
observation matrix, inside a feedback loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.noise_options import CovarianceKind
from pivident.estimation.option_checks import check_iteration, check_positive
from pivident.estimation.signal_recipes import Bandpass, SignalRecipe


@dataclass(frozen=True, kw_only=True)
class Regression:
    """A method of the equations alone.

    Attributes:
        signals: how positions become speeds and accelerations.
        simulates_loop: whether instruments come from a simulated loop, for all such methods.
        weight_power: power of λ in the weights, likewise.
        covariance: which covariance is reported, likewise.
        label: name as in the literature.
    """

    signals: SignalRecipe = field(default_factory=Bandpass)

    simulates_loop: ClassVar[bool] = False
    weight_power: ClassVar[float] = 1.0
    covariance: ClassVar[CovarianceKind] = "formula"
    label: ClassVar[str] = ""


@dataclass(frozen=True, kw_only=True)
class LeastSquares(Regression):
    """IDIM-LS: ordinary (weighted = False) or weighted by each joint's own residual.

    Attributes:
        weighted: whether joints are weighted by the inverse of their residual variance.
    """

    weighted: bool = True

    @property
    def label(self) -> str:  # type: ignore[override]
        """Name as in the literature."""
        return "IDIM-WLS" if self.weighted else "IDIM-OLS"


@dataclass(frozen=True, kw_only=True)
class TotalLeastSquares(Regression):
    """Errors in the observation matrix, too, equally large in all columns."""

    label: ClassVar[str] = "IDIM-TLS"


@dataclass(frozen=True, kw_only=True)
class RobustRegression(Regression):
    """Squares of large errors count less, by iteratively reweighted least squares.

    Attributes:
        loss: ``huber``, which grows linearly, or ``bisquare``, which ends.
        tolerance: change of all parameters, in standard errors, at which the passes end.
        max_iterations: give up after so many.
    """

    loss: Literal["huber", "bisquare"] = "huber"
    tolerance: float = 1e-2
    max_iterations: int = 50

    label: ClassVar[str] = "IDIM-IRLS"

    def __post_init__(self) -> None:
        check_iteration(self.tolerance, self.max_iterations)
        if self.loss not in ("huber", "bisquare"):
            raise ExperimentError(
                f"loss is {self.loss!r}; choose one of 'huber', 'bisquare'"
            ).about("loss")


@dataclass(frozen=True, kw_only=True)
class Ridge(Regression):
    """Shrinks what the motion hardly tells towards zero.

    Attributes:
        penalty: k, in mean squares of the columns; None: by generalised cross-validation.
    """

    penalty: float | None = None

    label: ClassVar[str] = "IDIM-ridge"

    def __post_init__(self) -> None:
        if self.penalty is not None:
            check_positive("penalty", self.penalty)


@dataclass(frozen=True, kw_only=True)
class PriorRegression(Regression):
    """What the description, or anyone, knows beforehand, as a normal prior (MAP).

    The prior's mean are the problem's initial values: nominal ones of the description, or those
    given there. Of what has none (friction, unless given) nothing is known.

    Attributes:
        spread: standard deviation of each parameter over its initial value.
        deviation: standard deviation of single parameters by their names, in their own units; they
            win over ``spread``.
        names: parameters that ``prior_covariance`` is of, in its order.
        prior_covariance: covariance of these, rows of numbers in their own units.
    """

    spread: float = 0.3
    deviation: Mapping[str, float] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    prior_covariance: tuple[tuple[float, ...], ...] = ()

    label: ClassVar[str] = "IDIM-MAP"

    def __post_init__(self) -> None:
        check_positive("spread", self.spread)
        for name, value in self.deviation.items():
            if not value > 0.0:  # infinite: nothing is known
                raise ExperimentError(
                    f"the prior's deviation of {name} is {value}; it has to be positive"
                ).about("deviation")
        object.__setattr__(self, "deviation", dict(self.deviation))
        object.__setattr__(self, "names", tuple(self.names))
        rows = tuple(tuple(float(x) for x in row) for row in self.prior_covariance)
        object.__setattr__(self, "prior_covariance", rows)
        count = len(self.names)
        if len(rows) != count or any(len(row) != count for row in rows):
            raise ExperimentError(
                f"prior_covariance needs {count} rows of {count} numbers, one for each of names"
            ).about("prior_covariance")
        if not count:
            return
        matrix = np.array(rows)
        least = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T)).min())
        if not np.allclose(matrix, matrix.T, rtol=1e-9) or not least > 0.0:
            raise ExperimentError(
                "prior_covariance is not symmetric and positive definite (smallest eigenvalue "
                f"{least:.3g}); no normal distribution has it"
            ).about("prior_covariance")


@dataclass(frozen=True, kw_only=True)
class CorrelatedJoints(Regression):
    """Maximum likelihood with a full covariance between the errors of the joints.

    Attributes:
        tolerance: change of all parameters, in standard errors, at which the passes end.
        max_iterations: give up after so many.
    """

    tolerance: float = 1e-2
    max_iterations: int = 50

    label: ClassVar[str] = "IDIM-ML"

    def __post_init__(self) -> None:
        check_iteration(self.tolerance, self.max_iterations)


@dataclass(frozen=True, kw_only=True)
class SetMembership(Regression):
    """Intervals that are guaranteed where each row's error keeps to its bound.

    Attributes:
        bound: bound of the torque's error of all joints, or of each [N m or N]; None: the
            largest that least squares leaves, and a tenth: no guarantee then.
    """

    bound: float | tuple[float, ...] | None = None

    label: ClassVar[str] = "set membership"

    def __post_init__(self) -> None:
        for value in np.atleast_1d([] if self.bound is None else self.bound).tolist():
            check_positive("bound", value)


@dataclass(frozen=True, kw_only=True)
class FrequencyDomain(Regression):
    """Weighted least squares with instruments on the lines of a periodic motion.

    Of ``signals``, a band-pass, it has ``cutoff``, up to which lines of the positions are kept, and
    ``bandwidth``, up to which lines of the equations are; both without a filter.

    Attributes:
        period: length of a period [s]; None: from the reference, or else the positions.
        transient: periods at the start that are left out, in which the loop still settles.
        tolerance: change of all parameters, in standard errors, at which the passes end.
        max_iterations: give up after so many.
    """

    period: float | None = None
    transient: int = 1
    tolerance: float = 1e-2
    max_iterations: int = 20

    label: ClassVar[str] = "IDIM-FD"

    def __post_init__(self) -> None:
        check_iteration(self.tolerance, self.max_iterations)
        if self.period is not None:
            check_positive("period", self.period)
        if self.transient < 0:
            raise ExperimentError(
                f"transient is {self.transient}; it is a number of periods, 0 or more"
            ).about("transient")
        if not isinstance(self.signals, Bandpass):
            raise ExperimentError(
                "frequency differentiates on the lines of the motion; of its signals it takes "
                "cutoff and bandwidth of a bandpass"
            ).about("signals")


@dataclass(frozen=True, kw_only=True)
class Adaline(Regression):
    """Adaptive linear neuron: least squares, step by step along the rows.

    Attributes:
        rate: step over the largest that converges in the mean.
        epochs: how often all rows are gone through.
    """

    rate: float = 0.1
    epochs: int = 20

    label: ClassVar[str] = "ADALINE"

    def __post_init__(self) -> None:
        if not 0.0 < self.rate < 2.0:
            raise ExperimentError(f"rate is {self.rate}; it lies between 0 and 2").about("rate")
        if self.epochs < 1:
            raise ExperimentError(f"epochs is {self.epochs}; at least one").about("epochs")


@dataclass(frozen=True, kw_only=True)
class Hopfield(Regression):
    """Hopfield and Tank's network: least squares as the end of a differential equation.

    Attributes:
        reach: largest parameter that the neurons can take, over that of least squares.
        time: how long the network runs, in time constants of its fastest direction.
    """

    reach: float = 10.0
    time: float = 1e6

    label: ClassVar[str] = "Hopfield"

    def __post_init__(self) -> None:
        if not self.reach > 1.0:
            raise ExperimentError(
                f"reach is {self.reach}; the neurons have to reach the answer: more than 1"
            ).about("reach")
        check_positive("time", self.time)
