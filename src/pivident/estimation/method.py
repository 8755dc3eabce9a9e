"""What a method declares: its options, noise models, what it copes with, what it costs.

One file holds one method: a frozen dataclass of options with the algorithm in `Method.estimate`.
Experiment file, command line, manual, studio, stored results, refusals and expected times follow
from the declarations; no other file asks which method it has.

Recipes of noise models: autoregressive, from what repeats, with a moving average.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.kinematics import settled_recipe
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RECIPES, Bandpass, SignalRecipe
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.options import Options, declarations, option
from pivident.foundation.progress import Say as Say
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.sentences import listed
from pivident.loop.instruments.kinds import KINDS
from pivident.loop.motion.motion import MOTION_BAND
from pivident.robot.refusals import without_loops, without_wrenches

#: What makes an estimate of one's own: of Φ, shape (rows, parameters), and τ, shape (rows,), the
#: parameters, shape (parameters,), alone or with their covariance.
Estimator = Callable[[np.ndarray, np.ndarray], Any]
#: Which covariance of an estimate is reported.
CovarianceKind = Literal["auto", "formula", "sandwich", "stationary"]
#: Where instruments come from, see `pivident.loop.instruments`.
if TYPE_CHECKING:
    Instruments = str
else:
    Instruments = Literal[("auto", *KINDS)]
#: What the first simulation is made with.
Start = Literal["least-squares", "initial"]
#: What the estimate without a part of the record is made from: sums of the equations over the other
#: parts, their rows, their samples, or the errors of a fitted simulation.
Refit = Literal["sums", "rows", "samples", "simulation"]


class Cost(NamedTuple):
    """Processor time of one estimate: seconds, and per sample, joint and parameter [s]."""

    seconds: float
    each: float


#: What may be known of parameters beforehand: fields of a problem.
KNOWN = ("fixed", "bounds", "priors", "constraints")


@dataclass(frozen=True)
class Handles(Displayed):
    """What a method copes with.

    Attributes:
        wrenches: measured wrenches, and a base that a sensor holds or that floats.
        closed_loops: mechanisms with closed loops of bodies.
        inner_friction: friction with a memory, and friction that grows with the load.
        computed_torque: torques that are computed from the control law where none was logged.
        no_controller: records whose control law nobody knows.
        no_reference: a loop whose reference is not known: the measured motion takes its place.
        law_choice: comparisons of friction laws on its equations.
        shape_constants: a search for the constants of friction laws on its equations.
        payload: the load between a record without and one with it.
        known: what may be known of the parameters beforehand, of the problem's ``fixed``,
            ``bounds``, ``priors`` and ``constraints``.
        weights: weights of samples.
        without_equation: joints that move and whose torque does not count.
    """

    wrenches: bool = True
    closed_loops: bool = True
    inner_friction: bool = True
    computed_torque: bool = True
    no_controller: bool = True
    no_reference: bool = True
    law_choice: bool = False
    shape_constants: bool = False
    payload: bool = False
    known: tuple[str, ...] = KNOWN
    weights: bool = True
    without_equation: bool = True


@dataclass(frozen=True)
class AutoRegressive(Options):
    """AR noise model by Burg, all orders at once.

    Attributes:
        p_max: largest order tried.
        criterion: ``aic``, ``aicc`` or ``bic``.
        on_unmasked: whether it is fitted on the rows in use only.
        motion_band: highest frequency of the motion [Hz]. Below it the residual may be mostly
            model error, and noise counts up to the level just above it.
            ``auto``: 20 Hz or a quarter of the Nyquist frequency. None: no band.
    """

    p_max: int = option(150, "largest order of the AR model tried", at_least=1, at_most=5000)
    criterion: Literal["aic", "aicc", "bic"] = option("aic", '`"aic"`, `"aicc"` or `"bic"`')
    on_unmasked: bool = option(True, "fit it on valid samples only")
    motion_band: Literal["auto"] | float | None = option(
        "auto",
        "highest frequency of the motion, below which the noise is continued; 0: none",
        unit="Hz", kind='`"auto"` or number', at_least=0.0,
    )  # fmt: skip

    def band(self, recording: Recording) -> float:
        """Highest frequency of the motion of a recording [Hz], zero for none."""
        if self.motion_band == "auto":
            return min(MOTION_BAND, recording.rate / 8.0)
        return float(self.motion_band or 0.0)


@dataclass(frozen=True)
class Repetition(AutoRegressive):
    """AR noise model fitted to what does not repeat, for records in which the motion repeats.

    Standard errors that the paper's formula gives with it would describe repeatability alone; those
    of the sandwich contain the model error as it differs from one part of the record to the next.
    """

    #: None is needed: model error is gone from the residual.
    motion_band: Literal["auto"] | float | None = option(
        None,
        "highest frequency of the motion, below which the noise is continued; 0: none",
        unit="Hz", kind='`"auto"` or number', at_least=0.0,
    )  # fmt: skip
    period: int | None = option(
        None,
        "period of the motion, where `repetition` does not find it",
        unit="samples", shown="found", at_least=10,
    )  # fmt: skip


@dataclass(frozen=True)
class Arma(Options):
    """ARMA noise model by maximum likelihood (section 4.4 of the paper), of given orders.

    A moving average saves autoregressive terms where the noise's spectrum has a dip. Its whitener
    is recursive: zeros close to the unit circle make it remember for long.

    Attributes:
        ar_order: degree of the autoregressive part.
        ma_order: degree of the moving average.
        on_unmasked: whether it is fitted on the rows in use only.
        largest_root: zeros of the moving average are kept inside this radius, so that the
            whitener forgets within a few thousand samples.
    """

    ar_order: int = option(
        8, "degree of the AR part of an ARMA model; any of these three keys chooses ARMA",
        at_least=1, at_most=200,
    )  # fmt: skip
    ma_order: int = option(4, "degree of its moving average", at_least=1, at_most=50)
    on_unmasked: bool = option(True, "fit it on valid samples only")
    largest_root: float = option(
        0.99, "zeros of the moving average stay inside this radius", above=0.0, below=1.0
    )


@dataclass(frozen=True, kw_only=True)
class Method(Options):
    """A way to estimate the parameters of a problem.

    Attributes:
        signals: how positions become speeds and accelerations.
        label: name as in the literature, for all such methods.
        summary: what it is, in a few words, likewise.
        group: heading under which it is offered; empty: with those that people need.
        handles: what it copes with.
        cost: processor time of one estimate.
        simulates_loop: whether the control loop is simulated.
        fits_simulation: whether a simulation is compared with what was measured.
        has_instruments: whether instruments take the place of the observation matrix.
        whitens: whether prefilters from its own noise make its instruments precise; None: it has no
            instruments, or is there for comparison.
        horizon: how long a simulation runs from a measured state, see `OutputError`.
        filters_positions: whether ``signals`` is a filter that a figure shows.
        weight_power: power of λ in the weights.
        covariance: which covariance is reported.
        noise: recipe of its noise models; None: it has none.
        in_leagues: whether studies with all methods have it.
        refit: what the estimate without a part of the record is made from.
        without_controller: what to use where the control law is not known.
        of_computed_torque: what to say of a torque that was computed from the law.
    """

    signals: SignalRecipe = option(
        factory=Bandpass,
        meaning="how positions become speeds and accelerations",
        shown="`bandpass`",
    )

    label: ClassVar[str] = ""
    summary: ClassVar[str] = ""
    group: ClassVar[str] = "Regressions"
    handles: ClassVar[Handles] = Handles()
    cost: ClassVar[Cost] = Cost(0.05, 3e-8)
    simulates_loop: ClassVar[bool] = False
    fits_simulation: ClassVar[bool] = False
    has_instruments: ClassVar[bool] = False
    whitens: ClassVar[bool | None] = None
    horizon: ClassVar[float | Literal["moves", "record"] | None] = None
    filters_positions: ClassVar[bool] = True
    weight_power: ClassVar[float] = 1.0
    covariance: ClassVar[CovarianceKind] = "formula"
    noise: ClassVar[AutoRegressive | Arma | None] = None
    in_leagues: ClassVar[bool] = True
    refit: ClassVar[Refit] = "sums"
    without_controller: ClassVar[str] = "piv, which makes its instruments from the record"
    of_computed_torque: ClassVar[tuple[Finding, ...]] = ()

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Any:
        """The `Identification` of a problem.

        Args:
            problem: what is given.
            say: called with one line at each stage.
            test_gains: whether a fitted simulation asks for other gains; see `identify`.
        """
        raise NotImplementedError(f"{type(self).__name__} has no estimate()")

    @property
    def settings(self) -> dict[str, Any]:
        """Its options as plain values, which a result keeps."""
        return asdict(self)

    def settled(self, problem: Problem) -> Self:
        """With cut-offs or windows in numbers, where the record decides on them.

        Args:
            problem: what is given.
        """
        signals = settled_recipe(self.signals, problem.recordings)
        return self if signals is self.signals else replace(self, signals=signals)

    def refuse(self, problem: Problem) -> None:
        """Refuse what the method does not cope with, before any work.

        Args:
            problem: what is given.

        Raises:
            RobotDescriptionError: the robot has measured wrenches, or closed loops.
            IdentificationError: torques were computed from the control law.
            ExperimentError: the loop has to be simulated, and law or reference are not known; or
                friction has a memory or grows with the load.
        """
        if not self.handles.wrenches:
            without_wrenches(problem.robot, f"the method {self.label}")
        if not self.handles.closed_loops:
            without_loops(problem.robot, f"the method {self.label}")
        inner = [
            joint.name
            for joint in problem.robot.joints
            if any(term.has_memory or term.depends_on_load for term in joint.friction.terms)
        ]
        if inner and not self.handles.inner_friction:
            raise ExperimentError(
                f"joint {inner[0]!r} has friction with a memory or of the load, which the method "
                f"{self.label} does not handle",
                advice="use piv or cloe, or another friction law",
            )
        if others := [n for n in KNOWN if getattr(problem, n) and n not in self.handles.known]:
            able = (
                f"it takes {listed(self.handles.known)}" if self.handles.known else "leave it out"
            )
            raise ExperimentError(
                f"the problem has {listed(others)} of parameters, which {self.label} does not take",
                advice=f"use ls, iv-full-rate or piv, or {able}",
            ).about(others[0])
        if not self.handles.weights and any(r.weights is not None for r in problem.recordings):
            raise ExperimentError(
                f"samples have weights, which {self.label} does not take",
                advice="use ls, iv-full-rate or piv",
            ).about("weights")
        if not self.handles.without_equation and (silent := problem.silent_joints):
            raise ExperimentError(
                f"joint {silent[0]!r} has no equation, and {self.label} takes the torques of all "
                "joints at once",
                advice="use ls, iv-full-rate or piv",
            ).about("without_equation")
        computed = [r.name for r in problem.recordings if r.torque_source == "law"]
        if computed and not self.handles.computed_torque:
            raise IdentificationError(
                f"{self.label} needs measured torques, but recording {computed[0]!r} has none: "
                "one computed from the control law holds nothing that the positions do not",
                advice="use cloe",
            )
        if problem.loop is None and not self.handles.no_controller:
            raise ExperimentError(
                f"{self.label} simulates the closed loop: give the controller and its gains "
                f"([controller] in an experiment file), or use {self.without_controller}"
            )
        smoothed = problem.loop is not None and problem.loop.reference == "smoothed"
        if smoothed and not self.handles.no_reference:
            raise ExperimentError(
                f"{self.label} takes the motion that the loop makes of its reference, but with "
                'reference = "smoothed" the measurement itself takes its place',
                advice="give the recorded reference, or use piv",
            )

    def about_torques(self, recordings: Sequence[Recording]) -> tuple[Finding, ...]:
        """What to say where it takes a computed torque for a measured one.

        Args:
            recordings: the runs.
        """
        computed = any(recording.torque_source == "law" for recording in recordings)
        return self.of_computed_torque if computed else ()

    @property
    def needs_controller(self) -> bool:
        """Whether it cannot do without a control law."""
        return not self.handles.no_controller

    @property
    def begins_as_described(self) -> bool:
        """Whether its first simulation has the initial values, by default the description's."""
        return False

    def first_iteration(self) -> Method | None:
        """The same with one iteration; None where the record is all that it needs."""
        return None

    @property
    def recipes(self) -> tuple[str, ...]:
        """Names of the recipes that ``signals`` may be; one alone is no choice."""
        return tuple(RECIPES)

    @property
    def keys(self) -> tuple[str, ...]:
        """Options that a file may set, in their order."""
        return tuple(declarations(type(self)))

    def check_keys(self, keys: Mapping[str, Any]) -> None:
        """Refuse keys of a file that contradict one another; none by default.

        Args:
            keys: what the file gives for this method alone, tables as mappings.
        """


@dataclass(frozen=True, kw_only=True)
class IteratedMethod(Method):
    """A method that simulates, or makes instruments, with each estimate anew.

    Attributes:
        tolerance: both criteria of convergence.
        max_iterations: give up after so many.
        start: what the first simulation is made with: ``least-squares`` on the record, or the
            problem's ``initial`` values, as the literature does.
    """

    tolerance: float = option(1e-2, "criterion of convergence", above=0.0, below=1.0, shared=True)
    max_iterations: int = option(20, "largest number of iterations", at_least=1, shared=True)
    start: Start = option(
        "least-squares",
        'first simulation with a least-squares estimate, or with `"initial"` values',
    )

    cost: ClassVar[Cost] = Cost(0.1, 6e-8)

    @property
    def begins_as_described(self) -> bool:
        """Whether ``start`` is ``initial``."""
        return self.start == "initial"

    def first_iteration(self) -> Method | None:
        """The same with one iteration."""
        return replace(self, max_iterations=1)


@dataclass(frozen=True, kw_only=True)
class InstrumentalMethod(IteratedMethod):
    """A method of instruments.

    Attributes:
        instruments: ``loop``: simulated with its law; ``response``: the reference through the
            identified response of the loop; ``repetition``: other repetitions of the motion;
            ``sensor``: a second encoder; ``virtual``: a virtual computed-torque loop around the
            smoothed motion; ``halves``: every other sample. ``auto``: the simulated loop where the
            problem has one, else the best that the record allows.
    """

    instruments: Instruments = option(
        "auto",
        'from the simulated `"loop"`, the `"response"` to the reference, another `"repetition"`, '
        'a second `"sensor"`, a `"virtual"` loop, or `"halves"` of the samples; `"auto"`: the loop '
        "where there is a controller, else the best that the record allows",
        shared=True,
    )

    has_instruments: ClassVar[bool] = True
    simulates_loop: ClassVar[bool] = True
    whitens: ClassVar[bool | None] = False
    group: ClassVar[str] = ""

    @property
    def needs_controller(self) -> bool:
        """Whether it cannot do without a control law."""
        return self.instruments == "loop" or super().needs_controller
