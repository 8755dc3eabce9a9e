"""Everything that is asked of a set of results before they are believed.

The recordings are asked first, since no test of a result tells lost samples from a poor model.
Tests on the residuals and on the instruments come from each result; held-out motion and the
separation of noise from model error need the problem, since they go back to its records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from pivident.data.logs.torque_scale import is_ratio
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification, torque_sums
from pivident.estimation.identify import narrowed
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.parameter_rows import ParameterRange
from pivident.estimation.problem import Problem
from pivident.foundation.common_work import work_in_common
from pivident.foundation.errors import Attempts, ExperimentError, PividentError, require_kind
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.audit.recording_audit import recording_faults
from pivident.judgement.diagnostics.baselines import Baselines, baselines
from pivident.judgement.diagnostics.consistent_estimate import (
    ConsistentEstimate,
    NoConsistentEstimate,
)
from pivident.judgement.diagnostics.ranges import block_ranges, friction_ranges
from pivident.judgement.diagnostics.slight_terms import LeftOut, left_out
from pivident.judgement.diagnostics.trials import Trial, consequences, tried
from pivident.judgement.model_errors.named_causes import ModelErrors, named_causes
from pivident.judgement.validation.held_out.cross_validation import CrossValidation
from pivident.judgement.validation.held_out.folds import JudgedMotion
from pivident.judgement.validation.held_out.out_of_sample import OutOfSample, compare_out_of_sample
from pivident.judgement.validation.instrument_tests import (
    InstrumentTests,
    instrument_tests,
)
from pivident.judgement.validation.residuals.model_error import ModelError, model_error
from pivident.judgement.validation.residuals.residual_tests import ResidualTests, residual_tests
from pivident.models.consistency.consistent_model import ConsistentModel, make_consistent

#: Blocks of the motion that are held out in turn.
FOLDS = 5


@dataclass(frozen=True, eq=False)
class Diagnostics(Displayed):
    """What was found out about the results of one problem.

    Attributes:
        identifications: the results by short name of the method.
        residuals: tests on the residuals of each result.
        instruments: tests on the instruments of each result that has some.
        out_of_sample: errors on held-out motion; None where nothing was held out.
        model_error: noise and model error of the recommended result apart; None where neither
            a motion repeats nor anything was held out.
        model_errors: causes of model error that its residual shows; None where none were sought.
        ranges: of the parameters of each result that was judged on held-out blocks, over these
            blocks; of the recommended one also over friction laws that fit about as well.
        notes: why something could not be found out, whole sentences.
        consistent: estimates that were made physically consistent, by short name of their method,
            or why they could not be.
        log: what an audit has against the recordings, warnings and errors.
        nearest: physically possible parameters nearest to the recommended result; None where they
            were not looked for: on measured bases, and from torques whose scales nobody knows.
        trials: repairs of the log that were tried, the winners first.
        left_out: what leaving out the terms of no consequence did; None where there are none.
        baselines: errors of simpler models on the same held-out motion.
    """

    identifications: Mapping[str, Identification]
    residuals: Mapping[str, ResidualTests]
    instruments: Mapping[str, InstrumentTests]
    out_of_sample: OutOfSample | None = None
    model_error: ModelError | None = None
    model_errors: ModelErrors | None = None
    ranges: Mapping[str, tuple[ParameterRange, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = field(default=())
    consistent: Mapping[str, ConsistentEstimate | NoConsistentEstimate] = field(
        default_factory=dict
    )
    log: tuple[Finding, ...] = ()
    nearest: ConsistentModel | None = None
    trials: tuple[Trial, ...] = ()
    left_out: LeftOut | None = None
    baselines: Baselines = field(default_factory=Baselines)

    @property
    def recommended(self) -> str:
        """Short name of the method whose estimate to take.

        The one that held-out motion recommends. Without any, the last one that converged: by
        custom the most refined stands last.
        """
        if self.out_of_sample is not None:
            return self.out_of_sample.recommended
        converged = [name for name, i in self.identifications.items() if i.converged]
        return (converged or list(self.identifications))[-1]

    @property
    def validations(self) -> Mapping[str, CrossValidation]:
        """Results on held-out motion by short name; empty where nothing was held out."""
        return {} if self.out_of_sample is None else self.out_of_sample.results


def diagnose(
    problem: Problem,
    identifications: Mapping[str, Identification],
    methods: Mapping[str, Method] | None = None,
    *,
    folds: int = FOLDS,
    gap: float | None = None,
    recordings: Sequence[Recording] = (),
    progress: Callable[[str], None] | None = None,
    attempts: Attempts | None = None,
) -> Diagnostics:
    """Test results and compare them on held-out motion.

    Args:
        problem: what was given.
        identifications: results by short name.
        methods: how they were made, by the same names; None: what the results say.
        folds: blocks of the motion that are held out in turn; 0: none.
        gap: left out on either side of a block [s]; None: see ``cross_validate``.
        recordings: other recordings of the robot; they are judged on in place of blocks.
        progress: called with one line at each stage.
        attempts: what each test is attempted by; one that fails is a note of the diagnostics.

    Returns:
        What an audit has against the recordings, the tests of each result, their comparison on
        held-out motion and the causes of model error of the recommended one, for `verdict`.

    Raises:
        ExperimentError: a result whose method is not known.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,), loop)
        >>> results = {name: pv.identify(problem, name) for name in ("ls", "piv")}
        >>> print(pv.diagnose(problem, results, folds=3).out_of_sample)
        method    error % < 20 Hz ...
        IDIM-WLS             0.52 ...
        IDIM-PIV             0.23 ...
        Smallest held-out torque error: IDIM-PIV.
    """
    require_kind("identifications", identifications, Mapping, 'give them by name, {"ls": result}')
    say = progress or (lambda line: None)
    if methods is None:
        own = {name: found.method_used for name, found in identifications.items()}
        methods = METHODS.usable() | {name: m for name, m in own.items() if m is not None}
    if unknown := sorted(identifications.keys() - methods.keys()):
        raise ExperimentError(
            f"there is no method for the results {', '.join(unknown)}",
            advice=f"give `methods` by the same names, or use the names {', '.join(METHODS)}",
        )
    with linear_algebra_in_one_thread(), work_in_common():
        attempts = attempts or Attempts()
        return _diagnose(problem, identifications, methods, folds, gap, recordings, say, attempts)


def _diagnose(
    problem: Problem,
    identifications: Mapping[str, Identification],
    methods: Mapping[str, Method],
    folds: int,
    gap: float | None,
    recordings: Sequence[Recording],
    say: Callable[[str], None],
    attempts: Attempts,
) -> Diagnostics:
    """One stage after the other."""
    start = len(attempts.lines)
    say("asking for lost samples, delays and signs")
    failed, robot = "The recordings could not be audited", problem.robot
    log = attempts.of(failed, recording_faults, robot, problem.recordings, otherwise=())
    out_of_sample = motion = None
    given = identifications.get("ls")  # whose band has been chosen
    least_squares = (given and given.method_used) or methods.get("ls", METHODS["ls"])
    if folds or recordings:
        failed = "Nothing could be held out"
        motion = attempts.of(failed, JudgedMotion.of, problem, recordings or None)
    if motion is not None:
        compared = partial(
            compare_out_of_sample,
            problem,
            {name: methods[name] for name in identifications},
            folds=folds,
            gap=gap,
            recording=tuple(recordings) or None,
            identifications=identifications,
            progress=say,
            attempts=attempts,
            motion=motion,
        )
        out_of_sample = attempts.of("Nothing could be held out", compared)
    say("testing residuals and instruments")
    tested = replace(diagnose_one(identifications, attempts), out_of_sample=out_of_sample)
    name = tested.recommended
    own = identifications[name]
    validation = tested.validations.get(name)
    others = Baselines()
    if validation is not None and motion is not None and not is_ratio(own.torque_scale):
        failed, count = "The estimate is compared with nothing else", validation.blocks or folds
        simpler = partial(
            baselines, problem, motion, validation, least_squares, count, validation.gap or None
        )
        others = attempts.of(failed, simpler, otherwise=others)
    problem = narrowed(problem, own)
    failed = "Noise and model error could not be separated"
    split = attempts.of(failed, model_error, problem, own, validation)
    say("looking for causes of model error")
    causes = attempts.of("Causes of model error were not looked for", named_causes, problem, own)
    failed = "The range of the estimates is not given"
    ranges = attempts.of(failed, _ranges, tested, causes, otherwise={})
    trials: tuple[Trial, ...] = ()
    if out_of_sample is not None and all(r.torque_source == "measured" for r in problem.recordings):
        say("trying repairs")
        suspected = partial(tried, problem, log, least_squares, folds or FOLDS, gap)
        trials = attempts.of("Repairs could not be tried", suspected, otherwise=())
    log = consequences(log, trials)
    failed = "Terms of no consequence were not left out on trial"
    slight = attempts.of(failed, left_out, problem, own)
    say("asking whether a machine can have these parameters")
    failed = "Whether a machine can have these parameters could not be asked"
    own, nearest = attempts.of(failed, _nearest_machine, own, otherwise=(own, None))
    fewer = () if out_of_sample is None or not out_of_sample.fewer else (out_of_sample.fewer,)
    return replace(
        tested,
        identifications={**identifications, name: own},
        model_error=split,
        model_errors=causes,
        ranges=ranges,
        notes=(*fewer, *dict.fromkeys(attempts.lines[start:])),
        log=log,
        nearest=nearest,
        trials=trials,
        left_out=slight,
        baselines=others,
    )


def _ranges(
    tested: Diagnostics, causes: ModelErrors | None
) -> dict[str, tuple[ParameterRange, ...]]:
    """Ranges of all results that were judged, and over friction laws of the recommended one."""
    ranges = {name: block_ranges(own) for name, own in tested.validations.items()}
    if causes is not None:
        name = tested.recommended
        by_law = friction_ranges(tested.identifications[name], causes)
        ranges[name] = (*ranges.get(name, ()), *by_law)
    return ranges


def _nearest_machine(
    result: Identification,
) -> tuple[Identification, ConsistentModel | None]:
    """The physically possible parameters nearest to a result, which keeps its torque sums."""
    if result.robot.base_joints or is_ratio(result.torque_scale):
        return result, None
    if result.recordings:  # one from a file has its sums, and no signals
        result = replace(result, torque_sums=torque_sums(result))
    try:
        return result, make_consistent(result, accept_far=True)
    except PividentError:  # a covariance that is no metric; the verdict says why it is none
        return result, None


def diagnose_one(
    identifications: Mapping[str, Identification], attempts: Attempts | None = None
) -> Diagnostics:
    """The tests that need nothing but the results.

    Args:
        identifications: results by short name.
        attempts: what the tests are attempted by; None: nobody but the result is told.
    """
    attempts = attempts or Attempts()
    start, residuals, instruments = len(attempts.lines), {}, {}
    for name, result in identifications.items():
        failed = f"{result.method}: the residuals could not be tested"
        none = ResidualTests((), result.robot.joint_names)
        residuals[name] = attempts.of(failed, residual_tests, result, otherwise=none)
        equations = result.equations
        if equations is not None and equations.has_instruments:
            failed = f"{result.method}: the instruments could not be tested"
            if tests := attempts.of(failed, instrument_tests, result):
                instruments[name] = tests
    return Diagnostics(identifications, residuals, instruments, notes=tuple(attempts.lines[start:]))
