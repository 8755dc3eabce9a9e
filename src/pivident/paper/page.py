"""The page: experiments, repetition, claims and figures put together."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pivident.estimation.identification import Identification
from pivident.files import atomic_folder, check_output
from pivident.many.batch.runner import Pool
from pivident.many.study.monte_carlo import run_study
from pivident.paper.claims import IV, LS, PIV, PRINTED, Claim, claims, percent, verdicts
from pivident.paper.equations import EQUATIONS
from pivident.paper.experiment import (
    FORMS,
    IDENTIFIED,
    READINGS,
    Reading,
    condition,
    run_reading,
)
from pivident.paper.figures import DRAWN_BY, paper_figures
from pivident.paper.markdown import code, html_of, markdown_of
from pivident.paper.public_record import PublicRecord, run_public_record
from pivident.paper.published import COLUMNS, published_table
from pivident.paper.repetition import WAYS, Repetition, Runs, read_repetition
from pivident.simulation.joint_loop import joint_feedbacks
from pivident.text.numbers import format_significant
from pivident.version import __version__

#: Folder of the repetition inside that of the page, and the page by its kind.
STUDY, PAGES = "study", {"html": "paper.html", "markdown": "index.md"}

#: Records of each reading that a page has at least, and those of a quick one.
RUNS, QUICK_RUNS = 4, 2

#: A form is right enough if its intervals cover this share, and much better than the printed one
#: if its error is at most this share of that.
RIGHT, MUCH_BETTER = 0.90, 0.25

Say = Callable[[str], None]


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
        quick: one reading's experiment in detail, without identified laws and DIDIM.
        runs: records of each reading in the repetition, with identified laws and DIDIM on at most
            one for each motion; None: a few with known laws, besides those that are there.
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
        name: run_reading(name, didim=not quick, identified=not quick, say=say) for name in READINGS
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


def page_content(
    readings: Mapping[str, Reading],
    repetition: Repetition,
    record: PublicRecord | None,
    figures_of: str,
) -> dict[str, Any]:
    """Everything that the page says, as text and rows of tables."""
    judged = claims(readings, repetition)
    forms = [f for f in _forms() if any(f in own.results for own in readings.values())]
    return {
        "lead": _lead(judged),
        "experiment": _experiment(readings),
        "readings": [
            (name, meaning, _torques(readings[name])) for name, meaning in _known(readings)
        ],
        "claims": judged,
        "verdict_line": _verdict_line(judged),
        "parameters": len(published_table()),
        "runs": repetition.runs,
        "motions": repetition.motions,
        "accuracy": _accuracy(repetition),
        "best_line": _best_line(readings, repetition),
        "tables": {name: _table_1(own, forms) for name, own in readings.items()},
        "table_head": {
            name: ["parameter", *(f"paper: {title}" for title in COLUMNS.values()), *forms]
            for name in readings
        },
        "failures": {
            name: [f"{form}: no estimate; {text}." for form, text in own.failures.items()]
            for name, own in readings.items()
        },
        "reading_of_figures": figures_of,
        "equations": [(f"({e.number})", e.says, code(*e.code)) for e in EQUATIONS],
        "drawn_by": ", ".join(
            f"{code(f'{draw.__module__}.{draw.__name__}')} ({number})"
            for number, draw in DRAWN_BY.items()
        ),
        **_public(record),
    }


def _forms() -> list[str]:
    """All forms in the order of the page."""
    return [
        *FORMS.values(),
        *(FORMS[name] + IDENTIFIED for name in ("iv", "piv-as-printed", "piv")),
    ]


def _known(readings: Mapping[str, Reading]) -> list[tuple[str, str]]:
    return [(name, meaning) for name, meaning in READINGS.items() if name in readings]


def _lead(judged: Sequence[Claim]) -> str:
    counts = verdicts(judged)
    told = ", ".join(f"{number} {kind}" for kind, number in counts.items())
    return (
        "*An improved instrumental variable method for industrial robot model identification*, "
        "Control Engineering Practice 74 (2018), introduces IDIM-PIV. Of its claims, as we read "
        f"them: {told}."
    )


def _verdict_line(judged: Sequence[Claim]) -> str:
    return (
        f"{len(judged)} claims, each judged for every reading: a claim *holds* if it does for all, "
        "*holds with a condition* if it does for those that are named."
    )


def _experiment(readings: Mapping[str, Reading]) -> list[tuple[str, str, str]]:
    """What was done here, and what in the paper."""
    reading = next(iter(readings.values()))
    content = reading.bench.scenario.content
    loops = reading.bench.loop
    law, gain = content.controller, np.atleast_1d(loops.drive_gain)
    stiff = ", ".join(format_significant(x) for x in np.atleast_1d(law.kp) * gain)
    samples = reading.recording.samples
    conditions = [own.results[LS].condition for own in readings.values() if LS in own.results]
    band = content.identify.bandpass
    return [
        ("robot", "Stäubli TX40 with the coupling of its wrist", "the same"),
        (
            "truth",
            f"{len(published_table())} parameters of Table 1, column IDIM-PIV",
            "unknown",
        ),
        (
            "control law",
            f"one PID per axis, kp {stiff} N m/rad, derivative filter "
            f"{1e3 * law.derivative_time:.2g} ms",
            "one PID per axis, gains not given",
        ),
        (
            "motion",
            "trapezoidal speeds with smoothed bang-bang accelerations through postures",
            "the same",
        ),
        (
            "condition number",
            ", ".join(f"{x:.0f}" for x in conditions) + " (by reading)",
            "200",
        ),
        (
            "samples",
            f"{samples} at {reading.recording.rate:g} Hz to estimate, {samples} of another motion "
            "to validate",
            "34500 at 5000 Hz, and a second part",
        ),
        (
            "band-pass",
            f"{band.cutoff:g} Hz, decimation to {band.bandwidth:g} Hz",
            "50 Hz, 20 Hz",
        ),
        ("torque", "from the control signal", "the same"),
        (
            "start",
            f"inertias {100 * (content.start.inertia - 1):.0f} % off, no friction; the forms other "
            "than the printed one start from least squares",
            "CAD values, no friction",
        ),
    ]


def _torques(reading: Reading) -> str:
    return ", ".join(format_significant(x, 2) for x in reading.recording.tau.std(axis=0))


def _accuracy(repetition: Repetition) -> list[tuple[object, ...]]:
    """Coverage and errors of every form."""
    rows: list[tuple[object, ...]] = []
    for reading, forms in repetition.readings.items():
        printed = forms.get(PRINTED)
        for form in _forms():
            if form not in forms:
                continue
            own = forms[form]
            if not len(own.theta):
                rows.append((reading, form, "–", "–", "–", "–", own.failed, "–", own.count))
                continue
            low, high = own.coverage_interval
            share = own.median_error / printed.median_error if _estimates(printed) else np.nan
            rows.append(
                (
                    reading,
                    form,
                    percent(own.coverage),
                    f"{percent(low)} to {percent(high)}",
                    percent(own.median_error),
                    format_significant(share, 2),
                    own.failed,
                    f"{np.median(own.iterations):.0f}",
                    own.count,
                )
            )
    return rows


def _estimates(runs: Runs | None) -> bool:
    return runs is not None and len(runs.theta) > 0


def _best_line(readings: Mapping[str, Reading], repetition: Repetition) -> str:
    """Of each reading: the form with right intervals and the smallest error, or why none is."""
    lines = []
    for reading, forms in repetition.readings.items():
        printed = forms.get(PRINTED)
        usable = {
            name: own
            for name, own in forms.items()
            if name != PRINTED and _estimates(own) and own.coverage >= RIGHT and not own.failed
        }
        if usable:
            name, own = min(usable.items(), key=lambda item: item[1].median_error)
            beside = "IDIM-PIV as printed gives no estimate"
            if printed is not None and _estimates(printed):
                ratio = own.median_error / printed.median_error
                beside = f"{format_significant(ratio, 2)} of the error of IDIM-PIV as printed"
                if printed.failed:
                    beside += f", which gives no estimate on {printed.failed} of {printed.count}"
            lines.append(
                f"In the reading *{reading}* the best form is {name}: {percent(own.coverage)} "
                f"covered, median error {percent(own.median_error)}; {beside}."
            )
        else:
            lines.append(_why_none(reading, readings[reading], forms))
    return "\n\n".join(lines)


def _why_none(reading: str, own: Reading, forms: Mapping[str, Runs]) -> str:
    """What keeps every form from being right."""
    parts = [
        f"{name} covers {percent(runs.coverage)} and gives no estimate on {runs.failed} of "
        f"{runs.count}"
        for name, runs in forms.items()
        if _estimates(runs) and name in (PIV, FORMS["didim"])
    ]
    loop = own.bench.loop
    law = joint_feedbacks(loop.controller, own.recording.rate, own.recording.joints)[0]
    count = float(loop.counts(own.recording.joints)[0])
    step = float(np.atleast_1d(loop.drive_gain)[0]) * count * float(law.feedback[0])
    size = float(own.bench.noise_free.tau[:, 0].std())
    return (
        f"In the reading *{reading}* no form covers {percent(RIGHT)} on all records: "
        f"{'; '.join(parts) or 'none gives an estimate'}. One count of the encoder makes the law "
        f"of axis 1 answer with {step:.0f} N m, and the motion itself takes {size:.0f} N m (rms): "
        "the machine shakes. Smoothed positions take a part of that for motion and leave a part of "
        "the motion; simulated loops shake likewise, but not in step with it."
    )


def _table_1(reading: Reading, forms: Sequence[str]) -> list[list[str]]:
    """Rows: paper's columns, then ours."""
    rows = []
    for row in published_table():
        published = [f"{row.value[key]:g} ({row.relative_std[key]:g} %)" for key in COLUMNS]
        rows.append(
            [row.name, *published, *(_estimate(reading.results.get(f), row.name) for f in forms)]
        )
    return rows


def _estimate(found: Identification | None, name: str) -> str:
    if found is None:
        return "–"
    k = found.names.index(name)
    relative = 100.0 * found.std[k] / abs(found.theta[k])
    return f"{format_significant(found.theta[k])} ({format_significant(relative, 2)} %)"


def _detailed(readings: Mapping[str, Reading]) -> Reading:
    """The reading whose figures are drawn: one in which the printed form and IV gave estimates."""
    everything = [own for own in readings.values() if {IV, PRINTED} <= own.results.keys()]
    return (everything or list(readings.values()))[0]


def _public(record: PublicRecord | None) -> dict[str, Any]:
    """What the page says of the public record."""
    if record is None:
        return {
            "public_lead": "The public record of a Stäubli TX40 goes through the same forms where "
            "it is on the machine: `pivident datasets fetch staubli_tx40`, and without `--quick`.",
            "public_rows": [],
            "public_head": [],
            "public_lines": [],
        }
    forms = list(record.results)
    rows = [
        [
            row.name,
            *(f"{row.value[key]:g} ({row.relative_std[key]:g} %)" for key in ("ls", "iv", "piv")),
            *(_estimate(record.results[form], row.name) for form in forms),
        ]
        for row in published_table()
    ]
    return {
        "public_lead": "The public record of a Stäubli TX40 is another motion of such an arm, with "
        "encoders as they are and neither reference nor gains: a virtual law follows the smoothed "
        "measurement. Its truth is unknown.",
        "public_rows": rows,
        "public_head": [
            "parameter",
            *(f"paper: {COLUMNS[key]}" for key in ("ls", "iv", "piv")),
            *forms,
        ],
        "public_lines": _public_lines(record),
    }


def _public_lines(record: PublicRecord) -> list[str]:
    """What of the pattern shows."""
    lines = [f"{form}: no estimate; {text}." for form, text in record.failures.items()]
    found = record.results
    for form in (PRINTED, PIV):
        if form in found and IV in found:
            ratio = found[form].relative_std / found[IV].relative_std
            names = [found[form].names.index(row.name) for row in published_table()]
            own = ratio[names]
            mean = float(np.exp(np.mean(np.log(own))))
            lines.append(
                f"Relative standard errors fall from IDIM-IV to {form} for {np.sum(own < 1)} of "
                f"{own.size} parameters (geometric mean of the ratios {mean:.2g})."
            )
    shares = [f"{form} {percent(record.correlated(form))}" for form in found]
    lines.append(f"Autocorrelations beyond ±2/√n: {', '.join(shares)}.")
    steps = [f"{form} {own.iterations}" for form, own in found.items() if own.iterations > 1]
    lines.append(f"Iterations: {', '.join(steps)}.")
    if LS in found and PIV in found:
        pairs = [
            f"{name} {100 * (found[LS].value(name) / found[PIV].value(name) - 1):+.2g} %"
            for name in ("zz1r", "zz3r", "fv1", "fc1")
        ]
        lines.append(f"IDIM-LS differs from {PIV} by {', '.join(pairs)}.")
    return lines


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
        f"were there.{' Quick: without identified laws and DIDIM.' if quick else ''} "
        "`pivident study paper` repeats the experiment; `pivident paper --runs 100` does both."
    )


def _write(folder: Path, kind: str, content: dict[str, Any], figures: Mapping[str, Any]) -> Path:
    """Page and figures, as a whole or not at all."""
    from pivident.figures import save_figure

    page = markdown_of(content)
    with atomic_folder(folder) as build:
        for name, figure in figures.items():
            save_figure(figure, build / "figures" / f"{name}.png")
        if kind == "html":
            page = html_of(page, build / "figures")
        (build / PAGES[kind]).write_text(page, encoding="utf-8")
    return folder / PAGES[kind]
