"""The command ``pivident laws``: which friction law each joint of a record has."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import Progress, note
from pivident.foundation.errors import ExperimentError
from pivident.foundation.files import write_file
from pivident.foundation.text.numbers import plain_table
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.estimation.method import Method
    from pivident.estimation.problem import Problem
    from pivident.studies.friction_laws.chosen_laws import LawChoice


def laws(
    experiment: Path,
    /,
    *,
    method: str | None = None,
    joint: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = (),
    blocks: int = 10,
    band: float | None = None,
    depth: int = 3,
    out: Path | None = None,
) -> int:
    """Try friction laws on each joint and report which one fits the next motion.

    The experiment's own laws come first; each other one is a change of the best so far. Laws are
    judged on motion to which they were not fitted: each recording in turn, or, of a single one,
    blocks and the parts in which a joint is fastest, slowest, most and least loaded, first and
    last. How far these go beyond the fitted range of speed, load and position is reported. The
    chosen laws are printed as lines for the experiment file, after a check of the whole robot with
    and without them.

    Parameters
    ----------
    experiment
        The experiment file (.toml).
    method
        Estimator on whose equations laws are compared: ls, iv, iv-full-rate or piv. Default: least
        squares at the full rate.
    joint
        Names of the joints; several separated by commas or repeated. Default: all.
    blocks
        Blocks that are held out in turn, if there is one recording.
    band
        Highest frequency of the motion, below which errors are compared [Hz]. Default: 20 Hz, or
        an eighth of a low rate.
    depth
        Largest number of terms by which a law may be changed.
    out
        TOML file for the chosen laws, with the lines that are printed; none is written where no law
        changes.
    """
    from pivident.experiment.experiment import load_experiment
    from pivident.studies.friction_laws.law_choice import choose_laws

    if depth < 1:
        raise ExperimentError(f"--depth {depth} leaves no law to try", advice="give 1 or more")
    given = load_experiment(experiment)
    chosen: Method | None = None if method is None else given.methods([method])[method]
    names = separated(joint)
    with Progress() as progress:
        problem = given.problem(progress.say)
        choice = choose_laws(
            problem,
            chosen,
            joints=names or None,
            folds=blocks,
            band=band,
            depth=depth,
            progress=progress.say,
        )
        progress.say("checking the whole robot")
        checked = _checked(problem, choice, chosen, given.unseen_recordings())
    print(choice)
    print(f"\n{checked}")
    lines = choice.toml()
    if lines and out is not None:
        write_file(out, f"{lines}\n")
    note(
        f"[robot.joint_friction] belongs in {experiment.name}; where that says "
        'robot = "NAME", write [robot] with model = "NAME" below it'
        if lines
        else "no law predicts significantly better than the present ones"
    )
    return 0


def _checked(problem: Problem, choice: LawChoice, method: Method | None, unseen: Sequence) -> str:
    """Errors on motion that was not fitted, of the whole robot before and after."""
    from pivident.estimation.least_squares import LeastSquares
    from pivident.estimation.signal_recipes import RandomWalk
    from pivident.judgement.validation.held_out.cross_validation import cross_validate

    method = method or LeastSquares(signals=RandomWalk())
    rows = []
    for name, own in (("present laws", problem), ("chosen laws", choice.problem)):
        judged = cross_validate(own, method, recording=unseen or None)
        replay = "–" if judged.replay is None else f"{judged.replay.total:.2f}"
        rows.append((name, f"{judged.prediction.total_in_band:.2f}", replay))
    what = "another recording" if unseen else "5 blocks"
    return plain_table(
        [
            (f"held-out error on {what}", "<", [r[0] for r in rows]),
            (f"torque % < {judged.prediction.band:g} Hz", ".", [r[1] for r in rows]),
            ("simulated loop %", ".", [r[2] for r in rows]),
        ]
    )
