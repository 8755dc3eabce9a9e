"""Filters on positions, speeds and parameters as small frozen dataclasses.

See `pivident.estimation.filters`. All begin with least squares, which also gives the noises that
nobody has stated.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.noise_options import CovarianceKind
from pivident.estimation.option_checks import check_positive
from pivident.estimation.signal_recipes import Bandpass, SignalRecipe


@dataclass(frozen=True, kw_only=True)
class StateFilter:
    """A filter with the state (q, dq, θ), whose input is the torque and whose output is q.

    Attributes:
        signals: how positions become speeds and accelerations, for the least squares at the start
            and the torques that results show.
        start: first parameters: ``least-squares`` on the record, or the problem's ``initial``
            values.
        spread: first standard deviation of each parameter: in standard errors of least squares
            (None: 10), or as a share of initial values, and where these are zero of the value that
            alone would explain the torque of a joint (None: 0.3).
        drift: standard deviation that a parameter gains in a second, as a share of its first value.
        encoder_noise: standard deviation of measured positions of all joints, or of each [rad or
            m]; None: from the record.
        torque_noise: standard deviation of the torques, white from sample to sample, likewise
            [N m or N]; None: the likeliest one.
        passes: how often the record is gone through, each time with the first spread.
        simulates_loop: whether instruments come from a simulated loop, for all such methods.
        weight_power: power of λ in the weights, likewise.
        covariance: which covariance is reported, likewise.
        label: name as in the literature, likewise.
    """

    signals: SignalRecipe = field(default_factory=Bandpass)
    start: Literal["least-squares", "initial"] = "least-squares"
    spread: float | None = None
    drift: float = 0.0
    encoder_noise: float | tuple[float, ...] | None = None
    torque_noise: float | tuple[float, ...] | None = None
    passes: int = 1

    simulates_loop: ClassVar[bool] = False
    weight_power: ClassVar[float] = 1.0
    covariance: ClassVar[CovarianceKind] = "formula"
    label: ClassVar[str] = ""

    @property
    def first_spread(self) -> float:
        """The spread, or what stands for None."""
        usual = 10.0 if self.start == "least-squares" else 0.3
        return usual if self.spread is None else self.spread

    def __post_init__(self) -> None:
        if self.start not in ("least-squares", "initial"):
            raise ExperimentError(
                f"start is {self.start!r}; choose 'least-squares' or 'initial'"
            ).about("start")
        if self.spread is not None:
            check_positive("spread", self.spread)
        if not (np.isfinite(self.drift) and self.drift >= 0.0):
            raise ExperimentError(f"drift is {self.drift}; zero or more").about("drift")
        if self.passes < 1:
            raise ExperimentError(f"passes is {self.passes}; at least one").about("passes")
        for name in ("encoder_noise", "torque_noise"):
            given = getattr(self, name)
            for value in np.atleast_1d([] if given is None else given).tolist():
                check_positive(name, value)


@dataclass(frozen=True, kw_only=True)
class ExtendedKalman(StateFilter):
    """Kalman filter with the exact tangent of each step."""

    label: ClassVar[str] = "EKF"


@dataclass(frozen=True, kw_only=True)
class UnscentedKalman(StateFilter):
    """Kalman filter with the sigma points of Julier and Uhlmann.

    Attributes:
        alpha: spread of the points.
        beta: weight of the middle point in the covariance, 2 for normal distributions.
        kappa: added to the number of states; their sum is positive.
        square_root: whether factors of the covariance are carried, by QR and Cholesky updates.
    """

    alpha: float = 0.1
    beta: float = 2.0
    kappa: float = 0.0
    square_root: bool = False

    label: ClassVar[str] = "UKF"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive("alpha", self.alpha)
        _check_switch(self.square_root)


@dataclass(frozen=True, kw_only=True)
class CentralDifferenceKalman(StateFilter):
    """Kalman filter with the central differences of Nørgaard, Poulsen and Ravn.

    Attributes:
        step: half width of the differences, in standard deviations; √3 fits normal distributions.
        square_root: whether factors of the covariance are carried, by QR.
    """

    step: float = 3.0**0.5
    square_root: bool = False

    label: ClassVar[str] = "CDKF"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.step >= 1.0:
            raise ExperimentError(f"step is {self.step}; at least 1").about("step")
        _check_switch(self.square_root)


@dataclass(frozen=True, kw_only=True)
class Particles(StateFilter):
    """Sequential importance resampling with the kernel of Liu and West.

    Attributes:
        particles: how many.
        discount: δ of the kernel, below 1: what an older sample counts at a resampling.
        seed: of the random numbers.
    """

    particles: int = 500
    discount: float = 0.9
    seed: int = 0

    label: ClassVar[str] = "particle filter"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.particles < 10:
            raise ExperimentError(f"particles is {self.particles}; at least ten").about("particles")
        if not 0.5 < self.discount < 1.0:
            raise ExperimentError(f"discount is {self.discount}; it lies between 0.5 and 1").about(
                "discount"
            )
        if self.seed < 0:
            raise ExperimentError(f"seed is {self.seed}; zero or more").about("seed")


def _check_switch(square_root: bool) -> None:
    if not isinstance(square_root, bool):
        raise ExperimentError(f"square_root is {square_root!r}; true or false").about("square_root")
