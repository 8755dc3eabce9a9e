"""The commands ``pivident identify`` and ``pivident demo``: a record, or a simulated one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import DONE, NOT_CONVERGED, WRONG_INPUT, UsageError
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.app.cli.workflow import Outcome


def identify(
    experiment: Path,
    /,
    *,
    method: Annotated[
        tuple[str, ...], Parameter(name=["--method", "-m"], negative=(), show_default=False)
    ] = (),
    folds: Annotated[int | None, Parameter(show_default=False)] = None,
    free: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = (),
    out: Path | None = None,
    details: Annotated[bool, Parameter(negative=())] = False,
) -> int:
    """Identify the record that an experiment file (TOML) describes.

    Parameters
    ----------
    experiment
        The experiment file.
    method
        ls (least squares), iv and iv-full-rate (instruments: without the bias of the loop), piv
        (iv-full-rate with correct intervals), ml (fits the simulated loop), or pc-piv (piv, then
        made physically consistent, as pc- makes any); several separated by commas or repeated. The
        page docs/reference/methods.md lists all. Default: those of the file.
    folds
        Blocks of the motion that are held out in turn to judge the methods; 0: none. Default: that
        of the file, or else 5.
    free
        Causes of model error that are corrected with the estimate, each with an interval: delay,
        geometry, gear-ratio, torque-gain, zero-position, position-scale, encoder, encoder-coupling;
        several separated by commas. Default: those of the file, or else none.
    out
        Folder for the results. Default: that of the file, or else NAME-results for NAME.toml.
    details
        Print all statements of the verdict and all tables before it.
    """
    from pivident.app.cli.workflow import run_experiment

    names = separated(method)
    if method:
        _check_methods(names)
    if folds is not None and (folds < 0 or folds == 1):
        raise UsageError(
            f"--folds {folds} leaves nothing to fit", advice="use 2 or more, or 0 for none"
        )
    return code_of(run_experiment(experiment, names, out, folds, separated(free), details))


def demo(*, out: Path = Path("pivident-demo"), seed: int = 0) -> int:
    """Simulate a TX40 record, identify it with LS, IV and PIV, and compare with the truth.

    Parameters
    ----------
    out
        Folder for the results.
    seed
        Seed of the simulated noise.
    """
    from pivident.app.cli.workflow import run_demo

    return code_of(run_demo(out, seed))


def code_of(outcome: Outcome) -> int:
    """Exit code of a run over several methods: what failed counts before the others."""
    if outcome.failed or outcome.unjudged:
        return WRONG_INPUT
    return DONE if outcome.converged else NOT_CONVERGED


def _check_methods(names: Sequence[str]) -> None:
    """Refuse methods that do not exist, before anything is read."""
    from pivident.estimation.methods import METHODS
    from pivident.models.consistency.options import CONSISTENT_METHODS
    from pivident.robot.naming import nearest

    known = (*METHODS, *CONSISTENT_METHODS)
    if not names:
        raise UsageError(
            "--method names no method",
            advice=f"choose from {', '.join(METHODS)}, each also with the prefix pc-",
        )
    for name in names:
        if name not in known:
            bare = name.lower().removeprefix("idim-")
            raise UsageError(f"there is no method {name!r}", advice=nearest(bare, known))
