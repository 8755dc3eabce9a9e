"""What the page says: rows of its tables beside those of the paper, sentences, and figures.

The figures of the paper, in its layout, from one experiment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.text.numbers import format_significant
from pivident.loop.simulation.joint_loop import joint_feedbacks
from pivident.studies.figures.filters import figure_of_bandpass
from pivident.studies.figures.residuals import figure_of_autocorrelations
from pivident.studies.figures.torques import figure_of_control_law, figure_of_predictions
from pivident.studies.figures.tracking import figure_of_reference
from pivident.studies.many.study.summary import NOMINAL_COVERAGE, geometric_mean
from pivident.studies.paper.claims import (
    IV,
    KINDS,
    LS,
    PIV,
    PRINTED,
    Claim,
    claims,
    percent,
    verdicts,
)
from pivident.studies.paper.equations import EQUATIONS
from pivident.studies.paper.experiment import (
    FORMS,
    IDENTIFIED,
    READINGS,
    PublicRecord,
    Reading,
    condition_numbers,
)
from pivident.studies.paper.markdown import code
from pivident.studies.paper.published import COLUMNS, published_table, stated
from pivident.studies.paper.repetition import Repetition, Runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Joints of the figures of the text, and of those of the appendix.
_FIRST, _LAST = (1, 2, 3), (4, 5, 6)
#: The joint whose identified control law figure 6 shows, and that whose reference A.9 shows.
_LAW_OF, _REFERENCE_OF = 4, 1


def all_forms() -> list[str]:
    """All forms in the order of the page."""
    return [
        *FORMS.values(),
        *(FORMS[name] + IDENTIFIED for name in ("iv", "piv-as-printed", "piv")),
    ]


def beside_table_1(
    results: Mapping[str, Identification],
    forms: Sequence[str],
    columns: Sequence[str] = tuple(COLUMNS),
) -> list[list[str]]:
    """A row for each parameter: the paper's columns, then our estimates by form."""
    rows = []
    for row in published_table():
        published = [f"{row.value[key]:g} ({row.relative_std[key]:g} %)" for key in columns]
        rows.append([row.name, *published, *(_estimate(results.get(f), row.name) for f in forms)])
    return rows


def head_of(forms: Sequence[str], columns: Sequence[str] = tuple(COLUMNS)) -> list[str]:
    """Head of that table."""
    return ["parameter", *(f"paper: {COLUMNS[key]}" for key in columns), *forms]


def _relative_std(found: Identification) -> np.ndarray:
    """100 σ/|θ| by the method's own covariance, which the paper compares [%]."""
    return 100.0 * found.method_std / np.abs(found.theta)


def _estimate(found: Identification | None, name: str) -> str:
    if found is None:
        return "–"
    k = found.names.index(name)
    relative = _relative_std(found)[k]
    return f"{format_significant(found.theta[k])} ({format_significant(relative, 2)} %)"


def public_tables(record: PublicRecord | None) -> dict[str, Any]:
    """What the page says of the public record."""
    if record is None:
        return {
            "public_lead": "The public record of a Stäubli TX40 goes through the same forms where "
            "it is on the machine: `pivident datasets fetch staubli_tx40`, and without `--quick`.",
            "public_rows": [],
            "public_head": [],
            "public_lines": [],
        }
    forms, columns = list(record.results), ("ls", "iv", "piv")
    return {
        "public_lead": "The public record of a Stäubli TX40 is another motion of such an arm, with "
        "encoders as they are and neither reference nor gains: a virtual law follows the smoothed "
        "measurement. Its truth is unknown.",
        "public_rows": beside_table_1(record.results, forms, columns),
        "public_head": head_of(forms, columns),
        "public_lines": _public_lines(record),
    }


def _public_lines(record: PublicRecord) -> list[str]:
    """What of the pattern shows."""
    lines = [f"{form}: no estimate; {text}." for form, text in record.failures.items()]
    found = record.results
    for form in (PRINTED, PIV):
        if form in found and IV in found:
            ratio = _relative_std(found[form]) / _relative_std(found[IV])
            names = [found[form].names.index(row.name) for row in published_table()]
            own = ratio[names]
            lines.append(
                f"Relative standard errors fall from IDIM-IV to {form} for {np.sum(own < 1)} of "
                f"{own.size} parameters (geometric mean of the ratios {geometric_mean(own):.2g})."
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


#: A form is right enough if its intervals cover this share.
RIGHT = 0.90


def paper_figures(reading: Reading) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of each figure that can be drawn from an experiment.

    IDIM-PIV is the form as printed where it gave an estimate, and else the recommended one.
    """
    prefiltered = PRINTED if PRINTED in reading.results else PIV
    said = stated()
    bandpass = figure_of_bandpass(2.0 * said["nyquist"], float(said["cutoff"]))
    yield "figure_3", "Figure 3: the band-pass filters", bandpass
    pair = [form for form in (IV, prefiltered) if form in reading.results]
    for number, joints in (("4", _FIRST), ("A_7", _LAST)):
        if pair:
            made = [reading.predictions[form] for form in pair]
            caption = f"Figure {number.replace('_', '.')}: torques of the second motion"
            yield f"figure_{number}", caption, figure_of_predictions(made, joints)
    for number, joints in (("5", _FIRST), ("A_8", _LAST)):
        if pair:
            results = [reading.results[form] for form in pair]
            caption = f"Figure {number.replace('_', '.')}: autocorrelations of the residuals"
            yield f"figure_{number}", caption, figure_of_autocorrelations(results, joints)
    if reading.law is not None:
        caption = f"Figure 6: the identified control law of axis {_LAW_OF}"
        yield "figure_6", caption, figure_of_control_law(reading.law, _LAW_OF)
    caption = f"Figure A.9: the reference of axis {_REFERENCE_OF}"
    yield "figure_A_9", caption, figure_of_reference(reading.recording, _REFERENCE_OF)


#: What draws each figure of the paper.
DRAWN_BY: dict[str, Callable[..., Figure]] = {
    "3": figure_of_bandpass,
    "4": figure_of_predictions,
    "5": figure_of_autocorrelations,
    "6": figure_of_control_law,
    "A.7": figure_of_predictions,
    "A.8": figure_of_autocorrelations,
    "A.9": figure_of_reference,
}


def page_content(
    readings: Mapping[str, Reading],
    repetition: Repetition,
    record: PublicRecord | None,
    figures_of: str,
) -> dict[str, Any]:
    """Everything that the page says, as text and rows of tables."""
    judged = claims(readings, repetition)
    forms = [f for f in all_forms() if any(f in own.results for own in readings.values())]
    return {
        "lead": _lead(judged),
        "points": stated()["points_per_revolution"],
        "experiment": _experiment(readings),
        "readings": [
            (name, meaning, _torques(readings[name]))
            for name, meaning in READINGS.items()
            if name in readings
        ],
        "claims": judged,
        "verdict_line": _verdict_line(judged),
        "parameters": len(published_table()),
        "nominal": percent(NOMINAL_COVERAGE),
        "runs": repetition.runs,
        "motions": repetition.motions,
        "accuracy": list(_accuracy(repetition)),
        "no_estimates": _no_estimates(repetition),
        "best_line": _best_line(readings, repetition),
        "tables": {name: beside_table_1(own.results, forms) for name, own in readings.items()},
        "table_head": head_of(forms),
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
        **public_tables(record),
    }


def _lead(judged: Sequence[Claim]) -> str:
    counts = verdicts(judged)
    told = ", ".join(f"{number} {KINDS[kind]}" for kind, number in counts.items())
    return (
        "*An improved instrumental variable method for industrial robot model identification*, "
        "Control Engineering Practice 74 (2018), introduces IDIM-PIV. Of its claims, as we read "
        f"them, on the twin below: {told}."
    )


def _verdict_line(judged: Sequence[Claim]) -> str:
    return (
        f"{len(judged)} claims, each judged for every reading: a claim *holds* if it does for all, "
        "*holds with a condition* if it does for those that are named, and is *not reproduced* if "
        "it does for none: the twin has no model error, and a form is one reading of the text."
    )


def _experiment(readings: Mapping[str, Reading]) -> list[tuple[str, str, str]]:
    """What was done here, and what in the paper."""
    reading = next(iter(readings.values()))
    content = reading.bench.scenario.content
    loops = reading.bench.loop
    law, gain = content.controller, np.atleast_1d(loops.drive_gain)
    stiff = ", ".join(format_significant(x) for x in np.atleast_1d(np.asarray(law.kp)) * gain)
    samples = reading.recording.samples
    others = condition_numbers(reading.bench)
    band, said = content.identify.bandpass, stated()
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
            f"one PID per axis, gains not given, bandwidth {said['bandwidth']} Hz",
        ),
        (
            "motion",
            "trapezoidal speeds with smoothed bang-bang accelerations through postures",
            "the same",
        ),
        (
            "condition number",
            f"{others[0]:.0f} of this motion, {min(others):.0f} to {max(others):.0f} of all",
            f"{said['condition_number']}",
        ),
        (
            "samples",
            f"{samples} at {reading.recording.rate:g} Hz to estimate, {samples} of another motion "
            "to validate",
            f"{said['samples']} at {said['rate']} Hz, and a second part",
        ),
        (
            "band-pass",
            f"{band.cutoff:g} Hz, decimation to {band.bandwidth:g} Hz",
            f"{said['cutoff']} Hz, {said['decimation']} Hz",
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


def _accuracy(repetition: Repetition) -> Iterator[tuple[object, ...]]:
    """Coverage and errors of every form."""
    for reading, forms in repetition.readings.items():
        printed = forms.get(PRINTED)
        for form in all_forms():
            if form not in forms:
                continue
            own = forms[form]
            if not len(own.theta):
                yield reading, form, "–", "–", "–", "–", own.failed, "–", own.count
                continue
            low, high = own.coverage_interval
            share = np.nan
            if printed is not None and _estimates(printed):
                share = own.median_error / printed.median_error
            yield (
                reading,
                form,
                percent(own.coverage),
                "–" if np.isnan(low) else f"{percent(low)} to {percent(high)}",
                percent(own.median_error),
                format_significant(share, 2),
                own.failed,
                f"{np.median(own.iterations):.0f}",
                own.count,
            )


def _no_estimates(repetition: Repetition) -> list[str]:
    """Why forms give no estimate on any record."""
    return [
        f"{form} in the reading *{reading}*, first record: {own.message}."
        for reading, forms in repetition.readings.items()
        for form, own in forms.items()
        if own.failed and not _estimates(own)
    ]


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
        if _estimates(runs) and name in (PIV, FORMS["didim"], FORMS["oloe"])
    ]
    text = (
        f"In the reading *{reading}* no form covers {percent(RIGHT)} on all records: "
        f"{'; '.join(parts) or 'none gives an estimate'}."
    )
    loop = own.bench.loop
    count = float(loop.counts(own.recording.joints)[0])
    if count == 0.0:
        return text
    law = joint_feedbacks(loop.controller, own.recording.rate, own.recording.joints)[0]
    step = float(np.atleast_1d(loop.drive_gain)[0]) * count * float(law.feedback[0])
    size = float(own.bench.noise_free.tau[:, 0].std())
    return (
        f"{text} One count of the encoder makes the law of axis 1 answer with {step:.0f} N m, and "
        f"the motion itself takes {size:.0f} N m (rms): the machine shakes. Smoothed positions "
        "take a part of that for motion and leave a part of the motion; simulated loops shake "
        "likewise, but not in step with it."
    )
