"""How positions become speeds and accelerations: the recipes of signals that methods have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from pivident.foundation.errors import ExperimentError
from pivident.foundation.options import Options, option, per_joint
from pivident.loop.motion.motion import MOTION_BAND
from pivident.signals.algebraic import half_gain_product, half_samples
from pivident.signals.decimation import Convention

#: Samples in a period of the highest frequency that a decimation keeps, at least: a difference that
#: is corrected to its instant keeps 99 % there, one that is not 90 %.
SAMPLES_OF_A_PERIOD = 8.0


class Decimated(Options):
    """What recipes share whose equations are decimated, Φ and τ alike."""

    decimation: int | tuple[int, ...] | None
    bandwidth: float | None
    convention: Convention

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
class Bandpass(Decimated):
    """Zero-phase Butterworth, central differences, parallel decimation of Φ and τ.

    Attributes:
        cutoff: cut-off of the position filter, for all joints or for each [Hz]; None: from the
            record, see `pivident.estimation.kinematics.settled_recipe`.
        order: order of the Butterworth filter.
        decimation: factor n_d, or its stages (10, 10); None: to ``bandwidth``.
        bandwidth: frequency kept by the decimation [Hz]: n_d = (rate/2)/bandwidth. None: 20 Hz,
            where an arm's motion ends, or an eighth of a rate below 160 Hz (or all, by `ls`).
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

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> recipe = pv.Bandpass(cutoff=30.0, decimation=20)
        >>> result = pv.identify(pv.Problem(robot, (recording,)), pv.LeastSquares(signals=recipe))
        >>> recording.samples, result.joints[0].rows  # a row for 20 samples, but at standstill
        (5000, 203)
    """

    cutoff: float | tuple[float, ...] | None = option(
        None,
        "cut-off of the position filter, for all joints or for each; from the record: "
        "[1.5 times the half-power frequency](theory/signals.md#cut-offs-from-the-record) of each "
        "joint, at most 2.5 times `bandwidth`",
        unit="Hz", kind="number(s)", shown="from the record", above=0.0,
    )  # fmt: skip
    order: int = option(4, "order of the Butterworth filter", at_least=1, at_most=20)
    decimation: int | tuple[int, ...] | None = option(
        None, "factor, or the factors of its stages", kind="number(s)", shown="from `bandwidth`",
        at_least=1,
    )  # fmt: skip
    bandwidth: float | None = option(
        None, "frequency kept by the decimation", unit="Hz",
        shown="20 Hz, or an eighth of a lower rate", above=0.0,
    )  # fmt: skip
    convention: Convention = option(
        "matlab", 'whose `decimate` determines the treatment of the ends; or `"scipy"`'
    )
    median: int = option(1, "length of a preceding median filter, odd", unit="samples", at_least=1)
    padlen: int | None = option(
        None, "by how much the filters extend the record", unit="samples", shown="chosen",
        at_least=0,
    )  # fmt: skip
    edge: int | tuple[int, int] | None = option(
        None, "dropped at both ends, or at start and end", unit="samples", kind="number or 2",
        shown="five periods of `cutoff`", at_least=0,
    )  # fmt: skip
    align: bool = option(False, "move the torque to the instants of the derivatives")
    at_instants: bool | None = option(
        None, "correct differences, which are averages over two periods, to the instant",
        shown="where `cutoff` is from the record",
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.median % 2 == 0:
            raise ExperimentError(f"median = {self.median} must be an odd number of samples").about(
                "median"
            )

    def cutoffs(self, joints: int) -> np.ndarray:
        """Cut-off of each joint, shape (joints,) [Hz]; NaN as long as the record has to say.

        Raises:
            ExperimentError: a cut-off for each of another number of joints.
        """
        return per_joint("cutoff", np.nan if self.cutoff is None else self.cutoff, joints)

    def ends(self, rate: float) -> tuple[int, int]:
        """Samples dropped at the start and at the end for a sampling rate [Hz]."""
        if self.edge is None:
            return (int(np.ceil(5.0 * rate / np.min(np.atleast_1d(self.cutoff or np.nan)))),) * 2
        return (self.edge, self.edge) if isinstance(self.edge, int) else self.edge


@dataclass(frozen=True)
class RandomWalk(Options):
    """Integrated random walk smoother at full rate, torque aligned with the positions.

    Attributes:
        order: order of integration m; 2 is the paper's, 3 the better prior of a trajectory.
        passes: number of times it is applied (2 with m = 2: the paper's ``irwsm`` twice).
        f50_max: cap of the half-power frequency [Hz]; None: none.
        align: whether the torque is moved to the instants of the central differences.
        measurement_noise: ``auto``: visible counts and spectral lines of the encoders are searched,
            and where there are any the smoother knows them. ``white``, or two passes: no search.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,), loop)
        >>> for cap in (None, 40.0):  # half-power frequencies, from the record or capped [Hz]
        ...     method = pv.PrefilteredIV(signals=pv.RandomWalk(f50_max=cap))
        ...     print([round(joint.f50, -1) for joint in pv.identify(problem, method).joints])
        [50.0, 60.0]
        [40.0, 40.0]
    """

    order: Literal[1, 2, 3, 4] = option(
        3, "order of integration of the smoother's model", kind="1 to 4"
    )
    passes: int = option(1, "number of times it is applied", at_least=1, at_most=10)
    f50_max: float | None = option(
        None, "cap of the half-power frequency", unit="Hz", shown="none", above=0.0
    )
    align: bool = option(True, "move the torque to the instants of the derivatives")
    measurement_noise: Literal["white", "auto"] = option(
        "auto",
        "whether the smoother detects visible counts and spectral lines in the encoders' noise and "
        "accounts for them",
        kind='`"auto"`, `"white"`',
    )


@dataclass(frozen=True)
class Algebraic(Decimated):
    """Integrals over a window that is centred on each sample, then parallel decimation.

    Where the window lets less than all of the motion through, the torque loses as much: it passes
    the window too. With a decimation of one the equations keep the full rate.

    Attributes:
        window: length T of the window, for all joints or for each [s]; None: from the record, so
            that its gain is one half at the cut-off that a band-pass would have.
        degree: N, degree of polynomials that a position, a speed and an acceleration may be in the
            window; an odd number is the even one below it.
        exponent: κ of the kernel's weight (1 - s²)^κ, 2 or more; at 2 the acceleration is that of
            Savitzky and Golay.
        both_sides: whether the torque passes the window, too; None: where equations are decimated.
            At the full rate its noise, white before, would no longer be what intervals expect.
        decimation: factor n_d, or its stages (10, 10); None: to ``bandwidth``.
        bandwidth: frequency kept by the decimation [Hz], see `Bandpass`.
        align: whether the torque is moved to the instants of the positions first.
        convention: whose ``decimate`` is followed at the ends, for all such recipes.
    """

    window: float | tuple[float, ...] | None = option(
        None,
        "length of the window, for all joints or for each; from the record: its gain is one half "
        "at the cut-off that *bandpass* would have",
        unit="s", kind="number(s)", shown="from the record", above=0.0,
    )  # fmt: skip
    degree: int = option(
        2, "degree of polynomials that position, speed and acceleration may be in the window, "
        "0 to 10",
        at_least=0, at_most=10,
    )  # fmt: skip
    exponent: float = option(
        4.0,
        "exponent of the kernel's weight, 2 to 50; at 2 accelerations are those of Savitzky and "
        "Golay",
        at_least=2.0, at_most=50.0,
    )  # fmt: skip
    both_sides: bool | None = option(
        None, "pass the torque through the same window", shown="where equations are decimated"
    )
    decimation: int | tuple[int, ...] | None = option(
        None, "factor, or the factors of its stages; 1: the full rate", kind="number(s)",
        shown="from `bandwidth`", at_least=1,
    )  # fmt: skip
    bandwidth: float | None = option(
        None, "frequency kept by the decimation", unit="Hz",
        shown="20 Hz, or an eighth of a lower rate", above=0.0,
    )  # fmt: skip
    align: bool = option(True, "move the torque to the instants of the derivatives")

    convention: ClassVar[Convention] = "matlab"  # type: ignore[misc]  # no option here

    @property
    def filters_torque(self) -> bool:
        """Whether the torque passes the window."""
        return self.decimation != 1 if self.both_sides is None else self.both_sides

    def windows(self, joints: int) -> np.ndarray:
        """Window of each joint, shape (joints,) [s]; NaN as long as the record has to say.

        Raises:
            ExperimentError: a window for each of another number of joints.
        """
        return per_joint("window", np.nan if self.window is None else self.window, joints)

    def cutoffs(self, joints: int) -> np.ndarray:
        """Frequency at which each joint's window has a gain of one half, shape (joints,) [Hz]."""
        return half_gain_product(self.degree, self.exponent) / self.windows(joints)

    def halves(self, rate: float, joints: int) -> list[int]:
        """Samples on each side of the instant, of each joint.

        Args:
            rate: sampling rate [Hz].
            joints: how many joints there are.

        Raises:
            ExperimentError: a window for each of another number of joints.
        """
        return [half_samples(w, rate, self.degree) for w in self.windows(joints).tolist()]

    def ends(self, rate: float) -> tuple[int, int]:
        """Samples at both ends that have no whole window, for a sampling ``rate`` [Hz]."""
        halves = self.halves(rate, len(np.atleast_1d(0.0 if self.window is None else self.window)))
        return max(halves), max(halves)


#: How positions become speeds and accelerations.
SignalRecipe = Bandpass | Algebraic | RandomWalk

#: Recipes by the names of their tables.
RECIPES: dict[str, type[Bandpass] | type[Algebraic] | type[RandomWalk]] = {
    "bandpass": Bandpass, "algebraic": Algebraic, "random_walk": RandomWalk,
}  # fmt: skip


def recipe_name(signals: SignalRecipe) -> str:
    """Name of a recipe in a file."""
    return next(name for name, kind in RECIPES.items() if type(signals) is kind)
