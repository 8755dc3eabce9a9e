"""All tests on the residuals of an identification, joint by joint.

What is tested is the residual of the equation that was solved: prefiltered, scaled, on the rows
in use. With 200,000 samples everything is significant, so each test also has a practical size,
and its sentence gives both.

Whether the residual is normal is D'Agostino and Pearson's test,

    K² = Z(skewness)² / F₃ + Z(kurtosis)² / F₄  ~  χ²(2),   F_m = 1 + 2 Σ_k ρ_k^m

Z are the transforms to a standard normal of D'Agostino (1970) and Anscombe and Glynn (1983), right
from some fifty samples on, where the statistic of Jarque and Bera needs thousands. F widens
them where the residual is correlated (Lobato and Velasco 2004); they are one where it is white.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.distributions import chi_square
from pivident.foundation.text.display import Displayed
from pivident.foundation.threads import run_in_threads
from pivident.judgement.validation.residuals.autocorrelation import (
    EXTRA_LAGS,
    MIN_LAGS,
    MIN_SAMPLES,
    Autocorrelation,
    DurbinWatsonTest,
    JointResidual,
    LjungBoxTest,
    WithProbability,
    autocorrelation,
    durbin_watson,
    joint_residuals,
    ljung_box,
    penalty_of,
    probability,
    reading,
    variance_factor,
)
from pivident.judgement.validation.residuals.cross_correlation import (
    CrossCorrelationTest,
    VarianceTest,
    cross_correlation_tests,
    variance_test,
)
from pivident.signals.noise_models import LaggedSums, lagged_sums

#: Skewness and excess kurtosis below which a distribution is as good as normal.
PRACTICAL_SKEWNESS = 0.5
PRACTICAL_KURTOSIS = 1.0


@dataclass(frozen=True)
class NormalityTest(WithProbability):
    """Test for a normal distribution."""

    statistic: float  # K²
    degrees_of_freedom: int  # 2
    p_value: float  # probability of a larger K² if the residual is normal
    skewness: float  # third standardised moment, 0 for a normal residual
    excess_kurtosis: float  # fourth standardised moment minus 3, 0 for a normal residual
    samples: int  # n

    @property
    def matters(self) -> bool:
        """Significant, and of practical size: skewness of 0.5 or excess kurtosis of 1."""
        large = (
            abs(self.skewness) >= PRACTICAL_SKEWNESS
            or abs(self.excess_kurtosis) >= PRACTICAL_KURTOSIS
        )
        return self.significant and large

    def __str__(self) -> str:
        return (
            f"Normality (D'Agostino-Pearson): K² = {self.statistic:.3g} on "
            f"{self.degrees_of_freedom} degrees of freedom, {probability(self.p_value)}; skewness "
            f"{self.skewness:.2g}, excess kurtosis {self.excess_kurtosis:.2g}: "
            f"{reading(self.significant, self.matters)}."
        )


def normality(values: np.ndarray, sums: LaggedSums | None = None) -> NormalityTest:
    """D'Agostino and Pearson's test.

    ``values``: residual without gaps, shape (samples,); ``sums``: its lagged sums; None: it is
    taken to be white.
    """
    thirds, fourths = (1.0, 1.0) if sums is None else (variance_factor(sums, m) for m in (3, 4))
    centred = values - values.mean()
    square = np.mean(centred**2)
    skewness = np.mean(centred**3) / square**1.5
    kurtosis = np.mean(centred**4) / square**2
    statistic = (
        _skewness_score(skewness, values.size) ** 2 / thirds
        + _kurtosis_score(kurtosis, values.size) ** 2 / fourths
    )
    return NormalityTest(
        float(statistic),
        2,
        float(chi_square.sf(statistic, 2)),
        float(skewness),
        float(kurtosis - 3.0),
        values.size,
    )


def _skewness_score(skewness: float, n: int) -> float:
    """Skewness of n samples as a standard normal number (D'Agostino 1970)."""
    y = skewness * np.sqrt((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0)))
    beta = 3.0 * (n**2 + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0)
    beta /= (n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0)
    square = np.sqrt(2.0 * (beta - 1.0)) - 1.0
    return float(np.arcsinh(y / np.sqrt(2.0 / (square - 1.0))) / np.sqrt(0.5 * np.log(square)))


def _kurtosis_score(kurtosis: float, n: int) -> float:
    """Kurtosis of n samples as a standard normal number (Anscombe and Glynn 1983)."""
    mean = 3.0 * (n - 1.0) / (n + 1.0)
    variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0))
    x = (kurtosis - mean) / np.sqrt(variance)
    third = 6.0 * (n * n - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
    third *= np.sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)))
    a = 6.0 + 8.0 / third * (2.0 / third + np.sqrt(1.0 + 4.0 / third**2))
    root = np.cbrt((1.0 - 2.0 / a) / (1.0 + x * np.sqrt(2.0 / (a - 4.0))))
    return float((1.0 - 2.0 / (9.0 * a) - root) / np.sqrt(2.0 / (9.0 * a)))


ResidualTest = LjungBoxTest | DurbinWatsonTest | NormalityTest | VarianceTest | CrossCorrelationTest

#: What the residual's variance may depend on.
DRIVERS = ("speed", "acceleration", "torque")

#: What each test says, if it finds something of practical size, about the joints it finds it on.
_FINDINGS = {
    "whiteness": "The residual is correlated in time",
    "neighbours": "Neighbouring residuals are correlated",
    "normality": "The residual is far from a normal distribution",
    "variance": "The residual's variance changes with the motion",
    "motion": "The motion explains part of the residual",
}


@dataclass(frozen=True, eq=False)
class JointResidualTests(Displayed):
    """Tests on the residual of one joint."""

    name: str  # joint
    samples: int  # rows in use
    autocorrelation: Autocorrelation  # autocorrelations with their band, for the figure
    whiteness: LjungBoxTest  # Ljung and Box
    neighbours: DurbinWatsonTest  # Durbin and Watson
    normality: NormalityTest  # D'Agostino and Pearson
    variance: VarianceTest  # Breusch and Pagan against |speed|, |acceleration| and |torque|
    #: Residual against instruments at other lags; None where the identification does not hold its
    #: equations, or the record is too short for its parameters.
    motion: CrossCorrelationTest | None

    @property
    def tests(self) -> dict[str, ResidualTest]:
        """The tests by name, without those that could not be made."""
        every: dict[str, ResidualTest | None] = {
            "whiteness": self.whiteness,
            "neighbours": self.neighbours,
            "normality": self.normality,
            "variance": self.variance,
            "motion": self.motion,
        }
        return {name: test for name, test in every.items() if test is not None}

    def __str__(self) -> str:
        return "\n".join(f"{self.name}: {test}" for test in self.tests.values())


@dataclass(frozen=True, eq=False)
class ResidualTests(Displayed):
    """Tests on the residuals of all joints.

    Attributes:
        joints: one for each joint whose residual is long enough and not constant.
        untested: names of the other joints.
    """

    joints: tuple[JointResidualTests, ...]
    untested: tuple[str, ...] = ()

    def of(self, name: str) -> tuple[tuple[str, ResidualTest], ...]:
        """The test of this name on all joints, as pairs of joint and test."""
        return tuple((j.name, j.tests[name]) for j in self.joints if name in j.tests)

    def worst(self, name: str) -> tuple[str, ResidualTest] | None:
        """The joint on which the test of this name finds most, and the test, or None.

        Findings of practical size come first, then the smaller probability.
        """
        found = self.of(name)
        return min(found, key=lambda pair: (not pair[1].matters, _p_value(pair[1])), default=None)

    @property
    def matters(self) -> bool:
        """Whether any test finds something of practical size."""
        return any(test.matters for joint in self.joints for test in joint.tests.values())

    @property
    def summary(self) -> tuple[str, ...]:
        """One sentence per test, with the joints and the worst one's numbers."""
        return tuple(self._sentences())

    def _sentences(self) -> Iterator[str]:
        for name, finding in _FINDINGS.items():
            worst = self.worst(name)
            if worst is None:
                continue
            matter = [joint for joint, test in self.of(name) if test.matters]
            where = f"{finding} on {', '.join(matter)}; worst " if matter else "Worst "
            yield f"{where}{worst[0]}: {worst[1]}"
        if self.untested:
            yield (
                f"Residuals of {', '.join(self.untested)} were not tested: they have fewer than "
                f"{MIN_SAMPLES} samples, too few for their noise model, or are constant."
            )

    def __str__(self) -> str:
        return "\n".join([*map(str, self.joints), *list(self._sentences())[len(_FINDINGS) :]])


def residual_tests(identification: Identification, *, motion: bool = True) -> ResidualTests:
    """Test the residuals of all joints: white, and free of the motion?

    Args:
        identification: the result, with its equations for the second question.
        motion: whether they are also tested against the motion.

    Returns:
        The tests by joint; printed, one line for each.
    """
    residuals = joint_residuals(identification)
    against: tuple[CrossCorrelationTest | None, ...] = (None,) * len(residuals)
    if motion and identification.equations is not None:
        rate = identification.recordings[0].whitened_rate
        against = cross_correlation_tests(identification.equations, identification.theta, rate)
    found: list[JointResidualTests | None] = [None] * len(residuals)

    def work(j: int) -> None:
        if _testable(residuals[j]):
            found[j] = _joint_tests(identification, residuals[j], j, against[j])

    run_in_threads(work, range(len(residuals)))
    return ResidualTests(
        tuple(tests for tests in found if tests is not None),
        tuple(r.name for r, tests in zip(residuals, found, strict=True) if tests is None),
    )


def _testable(residual: JointResidual) -> bool:
    """Whether there are enough samples, and not all of them the same."""
    values = residual.values
    enough = values.size >= max(MIN_SAMPLES, 2 * (residual.order + EXTRA_LAGS))
    return enough and bool(np.ptp(values) > 1e-12 * np.abs(values).max())


def _joint_tests(
    identification: Identification,
    residual: JointResidual,
    j: int,
    motion: CrossCorrelationTest | None,
) -> JointResidualTests:
    """All tests of one joint."""
    sums = lagged_sums(residual.pieces, max(MIN_LAGS, residual.order + EXTRA_LAGS))
    values = residual.values
    return JointResidualTests(
        residual.name,
        values.size,
        autocorrelation(residual, sums=sums),
        ljung_box(residual, sums=sums),
        durbin_watson(residual),
        normality(values, sums),
        variance_test(values, _drivers(identification, j), DRIVERS, sums),
        motion,
    )


def _drivers(identification: Identification, j: int) -> np.ndarray:
    """Sizes of speed, acceleration and model torque on the rows in use, (samples, 3)."""
    parts = []
    for r in identification.recordings:
        used = np.isfinite(r.whitened[:, j])
        parts.append(np.abs(np.column_stack((r.dq[used, j], r.ddq[used, j], r.tau_model[used, j]))))
    return np.concatenate(parts)


def _p_value(test: ResidualTest) -> float:
    """The probability that the sentence goes by; one where there is none."""
    p = test.robust_p_value if isinstance(test, LjungBoxTest) else test.p_value
    return 1.0 if np.isnan(p) else p


#: Names of what is compared, by channel.
CHANNEL_WORDS = ("positions", "torques")


@dataclass(frozen=True)
class SimulationWhiteness:
    """The test of one channel of one joint."""

    joint: str  # its name
    what: str  # positions or torques
    test: LjungBoxTest


def simulation_whiteness(identification: Identification) -> tuple[SimulationWhiteness, ...]:
    """Ljung and Box's test of each joint and channel that a simulation was compared in.

    Empty where the fit is not there, as after reading a file, and where errors are too few.
    """
    simulation = identification.simulation
    fit = None if simulation is None else simulation.fit
    if simulation is None or fit is None:
        return ()
    method, joints, found = identification.method_used, identification.joints, []
    noise = None if method is None else method.noise
    for c, channel in enumerate(fit.channels):
        for j, joint in enumerate(joints):
            place = c * len(joints) + j
            order = simulation.noise_orders[place] if simulation.noise_orders else 0
            pieces = tuple(white[c, j] for white in fit.white)
            residual = JointResidual(joint.name, pieces, order, fit.rates[0], order > 0)
            if residual.values.size >= max(MIN_SAMPLES, 2 * (order + EXTRA_LAGS)):
                known = JointResidual(
                    joint.name, pieces, order, fit.rates[0], order > 0,
                    penalty_of(noise, residual.values.size) if order else None,
                )  # fmt: skip
                found.append(
                    SimulationWhiteness(joint.name, CHANNEL_WORDS[channel], ljung_box(known))
                )
    return tuple(found)
