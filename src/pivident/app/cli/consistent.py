"""The command ``pivident consistent``: an estimate on disk made physically consistent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pivident.app.cli.console import Progress

if TYPE_CHECKING:
    from pivident.models.consistency.options import ConsistencyOptions
    from pivident.robot.description import Robot

#: As of `pivident.models.consistency.priors`, which is not imported before it is needed.
Prior = Literal["entropic", "euclidean", "none"]


def consistent(
    identification: Path,
    /,
    *,
    prior: Prior | None = None,
    bounds: Path | None = None,
    reference: str | None = None,
    accept_far: bool = False,
    out: Path | None = None,
) -> int:
    """Find the parameters nearest to an estimate that a real machine can have.

    The estimate is not changed: consistent.json and consistent_parameters.csv are written beside
    it.

    Parameters
    ----------
    identification
        The file identification.json of a result, its folder, or the folder of results: of these
        the one that the verdict recommends.
    prior
        Which of the equally near sets of bodies is taken: entropic or euclidean distance from the
        nominal bodies, or none: the one farthest from all limits. Default: entropic.
    bounds
        TOML file with a table [consistency]: what is known of masses and centres of mass. An
        experiment file also works.
    reference
        Robot with the nominal bodies: name in the gallery, .toml or .urdf. Default: the robot's
        own.
    accept_far
        Accept the nearest consistent parameters even where the estimate is too poor for them to
        mean much.
    out
        Folder for the two files. Default: that of the identification.
    """
    from pivident.estimation.stored_identification import load_identification
    from pivident.foundation.files import atomic_folder, check_output
    from pivident.judgement.diagnostics.consistent_estimate import consistent_estimate
    from pivident.judgement.diagnostics.stored_consistent import write_consistent
    from pivident.judgement.diagnostics.stored_verdict import result_of, said_against

    identification = result_of(identification)
    folder = identification.parent if out is None else out
    with Progress() as progress:
        progress.say(f"reading {identification}")
        free = load_identification(identification)
        options = _options(free.robot, prior, bounds, reference)
        check_output(folder)
        found = consistent_estimate(
            free, replace(options, accept_far=accept_far or options.accept_far), progress.say
        )
        notes = (*said_against(identification.parent), *found.model.notes)
        found = replace(found, model=replace(found.model, notes=notes))
        with atomic_folder(folder) as build:
            write_consistent(found, build, identification)
    print(found)
    print(f"\nResults: {folder}")
    return 0


def _options(
    robot: Robot, prior: Prior | None, bounds: Path | None, reference: str | None
) -> ConsistencyOptions:
    """Those of the file, and what the command line says instead."""
    from pivident.experiment.consistency_table import read_consistency, reference_of
    from pivident.models.consistency.options import ConsistencyOptions

    options = ConsistencyOptions() if bounds is None else read_consistency(bounds, robot)
    if prior is not None:
        options = replace(options, prior=prior)
    if reference is not None:
        options = replace(options, reference=reference_of(reference, robot, Path()))
    return options
