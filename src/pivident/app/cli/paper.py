"""The command ``pivident paper``: the experiment of Brunot et al. (2018) again, as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pivident.app.cli.console import Progress, check_count, chosen_pool, note


def paper(
    *,
    out: Path = Path("paper"),
    quick: Annotated[bool, Parameter(negative=())] = False,
    runs: Annotated[int | None, Parameter(show_default=False)] = None,
    markdown: Annotated[bool, Parameter(negative=())] = False,
    study: Path | None = None,
    workers: int | None = None,
) -> int:
    """Repeat the experiment of Brunot, Janot, Young and Carrillo (2018), and judge its claims.

    The page has their Table 1 beside ours, their figures, and the code of every equation. Runs of
    the repetition that are in the folder are kept: the same command continues it.

    Parameters
    ----------
    out
        Folder for the page and the repetition.
    quick
        In under a minute: known control laws only, two records of each reading.
    runs
        Records of each reading in the repetition, 100 for all of it. Default: four of each with
        known control laws, besides those that are there.
    markdown
        Write Markdown with its figures, as in the documentation, in place of one HTML file.
    study
        Folder of the repetition. Default: study in the folder of the page.
    workers
        Processes on this machine. Default: one for each core.
    """
    from pivident.studies.paper.page import STUDY, make_page

    check_count("--runs", runs)
    check_count("--workers", workers)
    with Progress() as progress:
        try:
            page = make_page(
                out,
                quick=quick,
                runs=runs,
                kind="markdown" if markdown else "html",
                study=study,
                pool=chosen_pool(workers, False, None),
                say=progress.say,
            )
        except KeyboardInterrupt:
            note(f"the finished runs are in {study or out / STUDY}; the same command goes on there")
            raise
    print(f"Page: {page}")
    return 0
