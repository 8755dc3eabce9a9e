"""What the verdict says about the estimate: which to take, whether it converged, what is known."""

from __future__ import annotations

from collections.abc import Iterator

from pivident.diagnostics.diagnostics import Diagnostics
from pivident.diagnostics.statement import Grade, Statement
from pivident.diagnostics.wanted_motion import wanted_motions
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import parameter_rows
from pivident.logs.torque_scale import scale_sentences
from pivident.text.lists import listed
from pivident.text.numbers import format_significant, percent, plus_minus

#: A parameter whose 2σ is below this share of its value is well determined [%].
WELL = 10.0

#: Most doubts about an identified law that are told one by one.
DOUBTS = 3


def choice(diagnostics: Diagnostics, name: str) -> Iterator[Statement]:
    """Which method to use for this record and why."""
    result, compared = diagnostics.identifications[name], diagnostics.out_of_sample
    if compared is None:
        why = (
            "it is the only one here"
            if len(diagnostics.identifications) == 1
            else "it is the last that converged; nothing was held out to compare them on"
        )
        yield Statement("estimate", "note", f"Take that of {result.method}: {why}.")
        return
    sentences = compared.sentences()
    contradicted = compared.undecided and compared.apart
    errors = ", ".join(
        f"{r.method} {percent(r.prediction.total_in_band)}" for r in compared.results.values()
    )
    ratio = next((s for s in sentences if s.startswith("Held-out")), "")
    yield Statement(
        "estimate",
        "caution" if compared.piv_is_worse or contradicted else "good",
        " ".join(s for s in sentences if not s.startswith("Held-out")),
        f"torque error on held-out motion: {errors}. {ratio}".strip(),
    )


def convergence(result: Identification) -> Iterator[Statement]:
    """Whether the iteration came to an end; a single solution has nothing to say."""
    if result.iterations < 2:
        return
    last = f"last change {percent(100.0 * result.history[-1].change)}"
    if result.converged:
        text = f"It converged in {result.iterations} iterations."
        yield Statement("iteration", "good", text, last)
    else:
        text = (
            f"It did not converge in {result.iterations} iterations; this is not an estimate yet."
        )
        yield Statement("iteration", "bad", text, last)


def determined(result: Identification) -> Iterator[Statement]:
    """What is well determined, what is not, and which motion would determine it."""
    rows = parameter_rows(result)
    well = [r for r in rows if 2.0 * r.relative_std <= WELL]
    zero = tuple(r.name for r in rows if r.includes_zero)
    middle = tuple(r.name for r in rows if 2.0 * r.relative_std > WELL and not r.includes_zero)
    best = min(rows, key=lambda r: r.relative_std)
    worst = max(rows, key=lambda r: r.relative_std)
    evidence = (
        f"2σ from {percent(2 * best.relative_std)} ({best.name}) to "
        f"{percent(2 * worst.relative_std)} ({worst.name}); condition number "
        f"{format_significant(result.condition)}"
    )
    text = f"{len(well)} of {len(rows)} parameters are known to {WELL:g} % or better (2σ)"
    if not (zero or middle):
        yield Statement("parameters", "good", f"All {text.split(' of ')[1]}.", evidence)
        return
    parts = [text]
    if middle:
        parts.append(f"less well {listed(middle)}")
    if zero:
        parts.append(f"not told apart from zero, which they may be: {listed(zero)}")
    grade: Grade = "caution" if len(zero) > len(rows) // 4 else "note"
    yield Statement("parameters", grade, "; ".join(parts) + ".", evidence)
    for sentence in wanted_motions(result, zero or middle):
        yield Statement("motion", "note", sentence)


def torque_scale(result: Identification) -> Iterator[Statement]:
    """Where the scale of the torque is an assumption, so are all parameters."""
    for sentence in scale_sentences(result.torque_scale):
        yield Statement("torque scale", "caution", sentence)


def signs(result: Identification) -> Iterator[Statement]:
    """Friction and rotor inertias cannot be negative."""
    negative = [
        f"{row.name} = {plus_minus(row.value, 2 * row.std)} {row.unit}"
        for row, parameter in zip(parameter_rows(result), result.parameters, strict=True)
        if parameter.is_dissipative and row.value < 0
    ]
    certain = [
        row.name
        for row, parameter in zip(parameter_rows(result), result.parameters, strict=True)
        if parameter.is_dissipative and row.value + 2.0 * row.std < 0
    ]
    if not negative:
        return
    text = "Negative, as no friction or rotor inertia can be"
    if certain:
        yield Statement("physics", "bad", f"{text}: {', '.join(certain)}.", "; ".join(negative))
    else:
        text = "Negative, but not told apart from zero"
        yield Statement("physics", "note", f"{text}: {listed(negative)} (2σ).")


def identified_law(result: Identification) -> list[Statement]:
    """What was found in the control law beside its gains; no reservation."""
    return [Statement("law", "note", text) for text in _law_notes(result)]


def _law_notes(result: Identification) -> tuple[str, ...]:
    found = None if result.loop is None else result.loop.identified
    return () if found is None else found.notes


def further_warnings(result: Identification) -> Iterator[str]:
    """The estimator's warnings that no statement above repeats; many of one law are one."""
    told = scale_sentences(result.torque_scale)
    found = None if result.loop is None else result.loop.identified
    of_law = () if found is None or len(found.warnings) <= DOUBTS else tuple(found.warnings)
    elsewhere = (*of_law, *told, *_law_notes(result))
    for text in result.warnings:
        if text in elsewhere or text.startswith(("Not converged", "Exogeneity")):
            continue
        yield text
    if of_law:
        yield (
            f"The control law found from the record leaves {len(of_law)} doubts (all of them in "
            f"the summary of the report), and the instruments rest on it. The first: {of_law[0]} "
            'Give the law where it is known, or compare with type = "virtual_pd".'
        )
