"""The two jobs of the command line: the demonstration, and an experiment from file to report."""

from __future__ import annotations

import math
import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.app.cli.compile_ahead import compile_ahead
from pivident.app.cli.console import Progress, can_draw, note
from pivident.app.cli.designs import designs_beside, write_designs
from pivident.data.logs.source_files import sha256
from pivident.estimation.identification import Identification, torque_sums
from pivident.estimation.identification_file import save_identification
from pivident.estimation.identify import narrowed
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.problem import Problem
from pivident.estimation.summary import (
    comparison_table,
    identification_table,
    label_lines,
    name_lines,
    rows_kind,
)
from pivident.experiment.check.plan import (
    CONSISTENT,
    JUDGED,
    WRITTEN,
    expected_stages,
    first_run,
    simulates,
    time_before,
)
from pivident.experiment.experiment import load_experiment
from pivident.foundation.common_work import numbers_beside, shared_work
from pivident.foundation.errors import Attempts, PividentError
from pivident.foundation.files import atomic_folder, check_output
from pivident.foundation.text.numbers import time_in_words
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.diagnostics.consistent_estimate import (
    ConsistentEstimate,
    NoConsistentEstimate,
    consistent_estimates,
)
from pivident.judgement.diagnostics.diagnostics import Diagnostics, diagnose
from pivident.judgement.diagnostics.failed_simulation import identify
from pivident.judgement.diagnostics.stored_verdict import VERDICT_FILE
from pivident.judgement.diagnostics.summary import Summary
from pivident.judgement.diagnostics.verdict import Verdict, beside_verdict, verdict
from pivident.judgement.diagnostics.verdict_file import save_verdict
from pivident.judgement.model_errors.corrections import (
    Corrections,
    corrections,
    kinds_of,
    with_corrections,
)
from pivident.judgement.validation.held_out.out_of_sample import prefixed
from pivident.models.consistency.options import PREFIX, free_methods

if TYPE_CHECKING:
    from pivident.judgement.validation.essential_parameters import EssentialParameters
    from pivident.studies.excitation.reached import ReachedErrors

#: What the demonstration compares, and on how many held-out blocks.
DEMO_METHODS = ("ls", "iv", "iv-full-rate", "piv")
DEMO_FOLDS = 3

#: Where to go from the demonstration.
OWN_LOG = "pivident init your_log.csv --robot your_arm.urdf"

#: The page of a folder of results.
REPORT = "report.html"


@dataclass(frozen=True)
class Outcome:
    """How a run over several methods ended."""

    identifications: Mapping[str, Identification]  # results by the method's short name
    #: methods that ended with an error, and ``pc-NAME`` where no consistent parameters lie near
    #: their estimate
    failed: tuple[str, ...]
    unjudged: bool = False  # whether a bug ended what follows an estimate, or a file is missing

    @property
    def converged(self) -> bool:
        """Whether every result is a converged one."""
        return all(result.converged for result in self.identifications.values())


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that is shown and written."""

    identifications: Mapping[str, Identification]  # by the method's short name
    diagnostics: Diagnostics
    #: the search for the essential parameters, where there was one
    essential: EssentialParameters | None = None
    #: what designs predicted of the records, beside what the recommended method reached
    designs: tuple[ReachedErrors, ...] = ()
    attempts: Attempts = field(default_factory=Attempts)  # by which all that follows is made
    path: Path | None = None  # the experiment file
    hash: str = ""  # its SHA-256 when it was read


@shared_work()
def run_experiment(
    path: Path,
    names: Sequence[str],
    out: Path | None,
    folds: int | None = None,
    free: Sequence[str] = (),
    details: bool = False,
) -> Outcome:
    """Read an experiment file, identify, judge, print the verdict, write the results.

    A method that fails does not take the results of the others with it, nor does anything that
    judges them. Without names, the methods are those of the file, and so are the kinds of causes
    that are corrected with the estimate.
    """
    with Progress() as progress, numbers_beside(path):
        attempts = Attempts(progress.keep)
        experiment, hashed = load_experiment(path), sha256(path)
        methods = experiment.methods(free_methods(names))
        consistent = experiment.made_consistent(names)
        options = experiment.consistency()
        folder = out or experiment.output or Path(f"{path.stem}-results")
        check_output(folder)
        compile_ahead(simulates(methods, experiment.content.controller is not None))
        problem, validation = experiment.problem(progress.say), experiment.content.validation
        unseen = experiment.unseen_recordings()
        law = experiment.content.controller
        progress.ready(time_before(problem, law_unknown=law is not None and law.type == "identify"))
        folds = validation.folds if folds is None else folds
        essential, shaped = None, None
        last = list(methods.values())[-1]
        if experiment.has_open_friction:
            from pivident.studies.friction.bearing_friction import bearing_friction

            problem = bearing_friction(problem, experiment.methods(["ls"])["ls"], progress.say)
        if experiment.content.identify.shapes == "identify":
            from pivident.studies.friction_laws.shapes import identify_shapes

            shaped = identify_shapes(problem, last, progress=progress.say)
            problem = shaped.problem
        if experiment.content.identify.essential:
            from pivident.judgement.validation.essential_parameters import essential_parameters

            failed = "All parameters are estimated, for the essential ones were not found"
            search = partial(essential_parameters, problem, last, progress=progress.say)
            essential = attempts.of(failed, search)
            if essential is not None:
                problem = narrowed(problem, essential.identification)
        freed = None
        kinds = kinds_of(free or experiment.content.identify.free or ())
        if kinds or experiment.content.identify.temperature is not None:
            freed = corrections(problem, last, kinds, progress.say)
            problem, unseen = freed.problem, freed.on(unseen)
        say_compiling(progress, methods, problem.loop is not None)
        progress.stages(_stages(problem, methods, folds, len(consistent)))
        outcome = identify_all(problem, methods, progress, attempts)
        if freed is not None:
            failed = "The estimates do not hold their corrections"
            outcome = attempts.of(failed, corrected, outcome, freed, otherwise=outcome)
        progress.begin(JUDGED)
        diagnostics = diagnose(
            problem,
            outcome.identifications,
            methods,
            folds=folds,
            gap=validation.gap,
            recordings=unseen,
            progress=progress.say,
            attempts=attempts,
        )
        wanted = [name for name in consistent if name in outcome.identifications]
        if wanted:
            progress.begin(CONSISTENT)
            recordings = unseen or problem.recordings
            made = consistent_estimates(
                diagnostics.identifications,
                diagnostics.out_of_sample,
                wanted,
                options,
                recordings,
                progress.say,
                attempts,
            )
            for name, estimate in made.items():
                progress.keep(estimate.headline())
                if isinstance(estimate, NoConsistentEstimate):
                    outcome = replace(outcome, failed=(*outcome.failed, f"{PREFIX}{name}"))
            diagnostics = replace(diagnostics, consistent=made)
        progress.begin(WRITTEN)
        progress.say("writing the results")
        report = experiment.content.output.report and can_draw(progress)
        best = diagnostics.identifications[diagnostics.recommended]
        designs = attempts.of(
            "The design is not compared",
            designs_beside, experiment, problem.recordings, best, progress, otherwise=(),
        )  # fmt: skip
        results = Results(
            diagnostics.identifications, diagnostics, essential, designs, attempts, path, hashed
        )
        whole = write_results(results, folder, experiment.title, report=report)
    _print_results(results, folder, report=report, details=details)
    if shaped is not None:
        print("\n".join(["", "Constants of the friction laws:", shaped.table(), *shaped.notes]))
    return replace(outcome, unjudged=attempts.unexpected or not whole)


@shared_work()
def run_demo(out: Path, seed: int = 0) -> Outcome:
    """Simulate a TX40 record, identify it, print estimates against truth, write the report."""
    from pivident.experiment.simulated_tx40 import tx40_machine

    check_output(out)
    compile_ahead()
    with Progress() as progress:
        attempts = Attempts(progress.keep)
        methods = {n: METHODS[n] for n in DEMO_METHODS}
        say_compiling(progress, methods, looped=True)
        progress.say("simulating the closed loop of a TX40")
        problem, truth = tx40_machine(seed)
        progress.stages(_stages(problem, methods, DEMO_FOLDS))
        outcome = identify_all(problem, methods, progress, attempts)
        progress.begin(JUDGED)
        diagnostics = diagnose(
            problem,
            outcome.identifications,
            methods,
            folds=DEMO_FOLDS,
            progress=progress.say,
            attempts=attempts,
        )
        progress.begin(WRITTEN)
        progress.say("writing the results")
        title = "Simulated Stäubli TX40: estimates against truth"
        results = Results(diagnostics.identifications, diagnostics, attempts=attempts)
        report = can_draw(progress)
        whole = write_results(results, out, title, truth, report=report)
    _print_results(results, out, truth, report=report)
    return replace(outcome, unjudged=attempts.unexpected or not whole)


def corrected(outcome: Outcome, made: Corrections) -> Outcome:
    """Results of a corrected problem, with the corrections and what is not known of them."""
    results = outcome.identifications
    return replace(
        outcome, identifications={n: with_corrections(r, made) for n, r in results.items()}
    )


def say_compiling(progress: Progress, methods: Mapping[str, Method], looped: bool) -> None:
    """What a first run waits for, and how long; ``looped``: whether there is a control law."""
    if seconds := first_run(methods, looped):
        progress.keep(
            f"Compiling for this computer takes about {time_in_words(seconds)}, in this first run "
            "only."
        )


def _stages(
    problem: Problem, methods: Mapping[str, Method], folds: int, consistent: int = 0
) -> dict[str, float]:
    """Seconds expected of each stage; the first one compiles what is not in the cache."""
    stages = expected_stages(problem, methods, folds, consistent)
    stages[next(iter(methods))] += first_run(methods, problem.loop is not None)
    return stages


def identify_all(
    problem: Problem, methods: Mapping[str, Method], progress: Progress, attempts: Attempts
) -> Outcome:
    """Estimate with one method after the other; one that fails takes no other's result away."""
    found: dict[str, Identification] = {}
    failed: list[str] = []
    if len(methods) == 1:
        attempts = Attempts()  # its error ends the run, and is its line
    for name, method in methods.items():
        progress.begin(name)
        begin = time.perf_counter()
        say = prefixed(progress.say, method.label)
        made = attempts.of(f"{method.label} failed", identify, problem, method, say)
        if made is None:
            failed.append(name)
            continue
        found[name] = made
        seconds = time.perf_counter() - begin
        end = attempts.of(f"{method.label} is not summed up", _verdict, made, otherwise=made.method)
        progress.keep(f"{end} ({seconds:.1f} s)")
        problem = narrowed(problem, made)  # all methods estimate the same parameters
    if not found:
        raise attempts.errors[-len(failed)]
    return Outcome(found, tuple(failed))


def write_results(
    results: Results,
    folder: Path,
    title: str,
    truth: Mapping[str, float] | None = None,
    *,
    report: bool = True,
) -> bool:
    """Write the files of all results and the report, all or nothing; whether none is missing.

    One method's files lie in the folder itself, those of several in one folder each.
    """
    attempts = results.attempts
    before = len(attempts.errors)
    with linear_algebra_in_one_thread():
        found = {  # sums once for all files
            name: attempts.of(
                f"{result.method}: what other parameters cost in torque is not stored",
                _with_sums, result, otherwise=result,
            )
            for name, result in results.identifications.items()
        }  # fmt: skip
    several = len(found) > 1
    with atomic_folder(folder) as build:
        for name, result in found.items():
            save_identification(result, build / name if several else build)
        for name, estimate in results.diagnostics.consistent.items():
            own = build / name if several else build
            if isinstance(estimate, ConsistentEstimate):
                from pivident.judgement.diagnostics.stored_consistent import write_consistent

                failed, free = f"{estimate.label} could not be written", own / "identification.json"
                attempts.of(failed, write_consistent, estimate, own, free)
        judged = verdict(results.diagnostics, attempts)
        every = list(found.values())
        failed = "What the names in the verdict stand for is not written"
        terms = attempts.of(failed, lambda: [*label_lines(every), *name_lines(every)], otherwise=[])
        screen = screen_of(judged, folder, results.path)
        save_verdict(judged, build / VERDICT_FILE, terms, screen, results.hash)
        if results.essential is not None:
            text = f"{results.essential}\n"
            (build / "essential_parameters.txt").write_text(text, encoding="utf-8")
        attempts.of("The design is not compared", write_designs, results.designs, build)
        if report:

            def draw() -> None:
                from pivident.judgement.report.builder import write_report

                write_report(
                    list(found.values()),
                    build / REPORT,
                    truth=truth,
                    title=title,
                    diagnostics=results.diagnostics,
                    screen=screen,
                    designs=[own.account() for own in results.designs],
                    attempts=attempts,
                )

            attempts.of("The report could not be written", draw)
            if not (build / REPORT).exists():  # none of an earlier run stays beside the results
                page = (
                    f"<!doctype html><title>{escape(title)}</title><p>{escape(attempts.lines[-1])}"
                )
                (build / REPORT).write_text(page, encoding="utf-8")
    return len(attempts.errors) == before


def _with_sums(result: Identification) -> Identification:
    return replace(result, torque_sums=result.torque_sums or torque_sums(result))


def truth_lines(results: Sequence[Identification], truth: Mapping[str, float]) -> str:
    """How far each method is from known values, and whether its intervals say so."""
    from statistics import median

    lines = []
    for result in results:
        rows = [row for row in parameter_rows(result, truth) if not math.isnan(row.truth)]
        within = sum(abs(row.error_sigmas) <= 2.0 for row in rows)
        error = median(abs(row.error_percent) for row in rows)
        lines.append(
            f"{result.method:<22} median error {error:.3f} %, {within} of {len(rows)} true values "
            "within 2σ (about 95 % should be)"
        )
    return "\n".join(lines)


def _verdict(result: Identification) -> str:
    """One method's end in half a line."""
    passes = "1 solution" if result.iterations == 1 else f"{result.iterations} iterations"
    state = passes if result.converged else f"NOT CONVERGED after {passes}"
    error = f"{100 * result.relative_error:.2f} % ({rows_kind(result)})"
    return f"{result.method}: {state}, relative error {error}"


def _print_results(
    results: Results,
    folder: Path,
    truth: Mapping[str, float] | None = None,
    *,
    report: bool = True,
    details: bool = False,
) -> None:
    """The verdict on one screen, or with all of its statements and tables, and places after it."""
    judged = verdict(results.diagnostics)
    screen = screen_of(judged, folder, results.path)
    if details or screen is None:
        results.attempts.of("Tables could not be printed", _print_tables, results, judged, truth)
        print()
    where = f"{folder / REPORT if report else folder}"
    if results.path is not None:
        where += f", or {shlex.join(['pivident', 'identify', str(results.path), '--details'])}"
    if screen is not None:
        step = OWN_LOG if truth is not None else screen.next_step
        print(replace(screen, details=where, next_step=step).text())
    results.attempts.of("What was asked for is not printed", _print_asked, results, truth)


def _print_asked(results: Results, truth: Mapping[str, float] | None) -> None:
    """What a run was asked for besides: essential and consistent parameters, designs, a truth."""
    consistent = results.diagnostics.consistent.values()
    asked = [
        None if results.essential is None else str(results.essential),
        None if truth is None else truth_lines([*results.identifications.values()], truth),
        *(str(made) for made in consistent if isinstance(made, ConsistentEstimate)),
        "\n\n".join(map(str, results.designs)),
    ]
    for text in filter(None, asked):
        print(f"\n{text}\n")


def screen_of(judged: Verdict, folder: Path, experiment: Path | None) -> Summary | None:
    """The verdict on one screen, with the commands of a folder of results."""
    if judged.summary is None:
        return None
    refused = set() if experiment is None else refused_repairs(experiment, judged)
    return judged.summary.in_folder(folder, experiment, judged.next_motion(folder), refused)


def refused_repairs(experiment: Path, judged: Verdict) -> set[int]:
    """Numbers of the repairs that cannot be written into an experiment file as it is."""
    refused = set()
    for number, trial in enumerate(judged.repairs, start=1):
        try:
            if trial.repair is not None:
                from pivident.experiment.edited_file import with_repair

                with_repair(experiment.read_text(encoding="utf-8"), trial.repair, judged.joints)
        except (PividentError, OSError, ValueError):
            refused.add(number)
    return refused


def _print_tables(results: Results, judged: Verdict, truth: Mapping[str, float] | None) -> None:
    """Verdict, tables and warnings."""
    print(f"{judged}\n")
    found = list(results.identifications.values())
    if len(found) == 1 and truth is None:
        # warnings are in the verdict
        print(identification_table(found[0], with_warnings=False, ranges=judged.ranges))
    else:
        print(comparison_table(found, truth, judged.ranges, judged.method))
        warnings = {n: i.warnings for n, i in results.identifications.items() if n != judged.name}
        for names, warning in beside_verdict(judged, warnings):
            methods = ", ".join(results.identifications[name].method for name in names)
            note(f"{methods}: {warning.advised}")
    compared = results.diagnostics.out_of_sample
    if compared is not None:
        print(f"\n{compared.table().text()}")
        if found[0].robot.size > 1:
            print(f"\n{compared.joint_heading()}\n{compared.joint_table().text()}")
        if (positions := compared.position_table()) is not None:
            print(f"\n{compared.position_heading()}\n{positions.text()}")
