"""The page: experiments, repetition, claims and figures put together."""

from __future__ import annotations

import time
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from pivident.foundation.files import atomic_folder, check_output
from pivident.foundation.progress import Say
from pivident.foundation.version import __version__
from pivident.studies.many.batch.runner import Pool
from pivident.studies.many.study.run import run_study
from pivident.studies.paper.claims import IV, PRINTED
from pivident.studies.paper.content import page_content, paper_figures
from pivident.studies.paper.experiment import (
    READINGS,
    Reading,
    condition,
    run_public_record,
    run_reading,
)
from pivident.studies.paper.markdown import html_of, markdown_of
from pivident.studies.paper.repetition import WAYS, Repetition, read_repetition

#: Folder of the repetition inside that of the page, and the page by its kind.
STUDY, PAGES = "study", {"html": "paper.html", "markdown": "index.md"}

#: The figure of standstill, of records that the page does not make (benchmarks/independent_paper).
STANDSTILL = resources.files(__package__) / "templates" / "standstill.png"

#: Records of each reading that a page has at least, and those of a quick one.
RUNS, QUICK_RUNS = 4, 2


def make_page(
    folder: str | Path,
    *,
    quick: bool = False,
    runs: int | None = None,
    kind: Literal["html", "markdown"] = "html",
    study: str | Path | None = None,
    pool: Pool | None = None,
    say: Say = lambda line: None,
) -> Path:
    """Run the experiment, repeat it, and write the page.

    Runs that are in the study's folder already are kept, so that an interrupted repetition goes on.

    Args:
        folder: folder of the page; the repetition is kept in its ``study``.
        quick: two records of each reading, without identified laws, DIDIM and OLOE.
        runs: records of each reading in the repetition, with identified laws, DIDIM and OLOE on at
            most one for each motion; None: a few with known laws, besides those that are there.
        kind: one HTML file, or Markdown with its figures, as in the documentation.
        study: folder of the repetition; None: inside ``folder``.
        pool: workers of the repetition; None: one for each core.
        say: progress.

    Returns:
        The page.

    Raises:
        PividentError: the folder cannot be written to, or the study in it is another one.
    """
    begin = time.perf_counter()
    folder = Path(folder)
    check_output(folder)
    place = folder / STUDY if study is None else Path(study)
    repetition = repeat(place, quick, runs, pool, say)
    readings = {
        name: run_reading(name, simulated=not quick, identified=not quick, say=say)
        for name in READINGS
    }
    record = None if quick else run_public_record(say)
    say("figures and page")
    detail = _detailed(readings)
    drawn = list(paper_figures(detail))
    content = page_content(readings, repetition, record, detail.name)
    content["figures"] = [(name, caption) for name, caption, _ in drawn]
    content["provenance"] = _provenance(repetition, time.perf_counter() - begin, quick)
    return _write(folder, kind, content, {name: figure for name, _, figure in drawn})


def repeat(place: Path, quick: bool, runs: int | None, pool: Pool | None, say: Say) -> Repetition:
    """The repetition in a folder, after the runs that it lacks."""
    for reading in READINGS:
        for way in WAYS if runs is not None else ("known",):
            scenario = condition(reading, way)
            wanted = (QUICK_RUNS if quick else RUNS) if runs is None else runs
            most = min(wanted, scenario.content.runs) if way != "known" else wanted
            run_study(scenario.with_runs(most), place / scenario.condition, pool=pool, say=say)
    return read_repetition(place)


def _detailed(readings: Mapping[str, Reading]) -> Reading:
    """The reading whose figures are drawn: one in which the printed form and IV gave estimates."""
    everything = [own for own in readings.values() if {IV, PRINTED} <= own.results.keys()]
    return (everything or list(readings.values()))[0]


def _provenance(repetition: Repetition, seconds: float, quick: bool) -> str:
    runs = {
        f"{reading}, {form}": own.count
        for reading, forms in repetition.readings.items()
        for form, own in forms.items()
    }
    few, many = min(runs.values()), max(runs.values())
    return (
        f"pivident {__version__}; {few} to {many} records for each form and reading, "
        f"{repetition.motions} motions; {seconds:.0f} s for this page besides the records that "
        f"were there.{' Quick: without identified laws, DIDIM and OLOE.' if quick else ''} "
        "`pivident study paper` repeats the experiment; `pivident paper --runs 100` does both."
    )


def _write(folder: Path, kind: str, content: dict[str, Any], figures: Mapping[str, Any]) -> Path:
    """Page and figures, as a whole or not at all."""
    from pivident.studies.figures.paper_style import save_figure

    page = markdown_of(content)
    with atomic_folder(folder) as build:
        for name, figure in figures.items():
            save_figure(figure, build / "figures" / f"{name}.png")
        (build / "figures" / STANDSTILL.name).write_bytes(STANDSTILL.read_bytes())
        if kind == "html":
            page = html_of(page, build / "figures")
        (build / PAGES[kind]).write_text(page, encoding="utf-8")
    return folder / PAGES[kind]
