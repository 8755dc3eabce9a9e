"""What must be known to read a comparison, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

from pivident.estimation.summary import error_rows
from pivident.foundation.text import sentences
from pivident.foundation.text.numbers import format_significant, with_spread
from pivident.studies.comparison.compared_results import ComparedResults
from pivident.studies.comparison.entry import Entry

#: Differences of so many percent are differences from nearly zero, and not given in percent.
MAX_PERCENT = 1000.0

#: Names in a sentence, at most twelve.
listed = partial(sentences.listed, most=12)


def remarks(comparison: ComparedResults, geometry: Sequence[str]) -> Iterator[str]:
    """The sentences below a comparison.

    ``geometry``: how the robot of each result differs from that of the first, empty where not.
    """
    yield from _correlation(comparison)
    yield from _robots(comparison, geometry)
    yield from _groups(comparison)
    yield from _not_shared(comparison)
    yield from _rows(comparison)
    for entry in comparison.entries:
        yield from entry.notes


def level_sentence(comparison: ComparedResults) -> str:
    """How often a mark is false."""
    if not comparison.tests:
        return "No difference could be tested: at least one of both sides has no interval."
    return (
        f"* differs significantly: the probability of one false mark or more among the "
        f"{comparison.tests} differences is at most {100.0 * comparison.alpha:g} % (Holm), for "
        "normal errors with these standard errors. On measured records part of the model "
        "error is not in them, and it changes with the motion."
    )


def findings(comparison: ComparedResults) -> list[str]:
    """Result by result, which parameters differ from the first."""
    first, found = comparison.labels[0], []
    for k, label in enumerate(comparison.labels[1:], start=1):
        tested = sum(
            (d := p.differences[k]) is not None and not math.isnan(d.p_value)
            for p in comparison.parameters
        )
        marked = comparison.marked(k)
        if not tested:
            found.append(f"{label} cannot be judged against {first}: no common intervals.")
        elif not marked:
            found.append(
                f"{label}: none of {tested} parameters differs significantly from {first}."
            )
        else:
            found.append(
                f"{label}: {len(marked)} of {tested} parameters differ{'s' * (len(marked) == 1)} "
                f"significantly from {first}: {listed(list(_changes(comparison, k, marked)))}."
            )
    return found


def _changes(comparison: ComparedResults, k: int, names: Sequence[str]) -> Iterator[str]:
    """Each parameter with its difference ± 2σ, in percent of the first where that says anything."""
    by_name = {p.name: p for p in comparison.parameters}
    for name in names:
        found = by_name[name].differences[k]
        assert found is not None  # it is marked
        value, spread, unit = found.value, found.spread, by_name[name].unit
        if abs(found.relative) < MAX_PERCENT:
            share = found.relative / found.value
            value, spread, unit = found.relative, abs(share) * spread, "%"
        text, spread_text = with_spread(value, spread)
        signed = text if text.startswith("-") else f"+{text}"
        yield f"{name} {signed} ± {spread_text} {unit}"


def _correlation(comparison: ComparedResults) -> Iterator[str]:
    """Which results share their record."""
    first, *others = comparison.entries
    same = [
        e.label for e, shared in zip(others, comparison.same_record[1:], strict=True)
        if shared and e.inputs and first.inputs
    ]  # fmt: skip
    unknown = [
        e.label for e, shared in zip(others, comparison.same_record[1:], strict=True)
        if shared and not (e.inputs and first.inputs)
    ]  # fmt: skip
    how = "the intervals of the differences hold whatever it is, and are wide for it"
    if same:
        yield (
            f"{listed(same)} and {first.label} come from the same record: the correlation of their "
            f"errors is not known, and {how}."
        )
    if unknown:
        yield (
            f"It is not known from which record {listed(unknown)} or {first.label} come: their "
            f"errors may be correlated, and {how}."
        )


def _robots(comparison: ComparedResults, geometry: Sequence[str]) -> Iterator[str]:
    """How the robots differ."""
    first, *others = comparison.entries
    for entry, apart in zip(others, geometry[1:], strict=True):
        if apart:
            yield (
                f"The robots of {entry.label} ({entry.robot.name}) and {first.label} "
                f"({first.robot.name}) are different: {apart}. Only parameters of the same name "
                "and unit are compared; what their groups are made of differs."
            )
            continue
        one, other = first.robot.friction_text(), entry.robot.friction_text()
        if one != other:
            yield (
                f"The friction laws differ, and so does what their parameters stand for: "
                f"{first.label} has {one}; {entry.label} has {other}."
            )
        if abs(entry.robot.gravity - first.robot.gravity).max() > 1e-6:
            yield f"{entry.label} was taken with another direction or size of gravity."


def _groups(comparison: ComparedResults) -> Iterator[str]:
    """Quantities that are sums of another result's parameters."""
    for k, label in enumerate(comparison.labels):
        mapped = [
            f"{p.name} = {' + '.join(e.from_groups)} (weighted)"
            for p in comparison.parameters
            if (e := p.estimates[k]) is not None and e.from_groups
        ]
        if mapped:
            yield f"{label} has other groups; from them: {listed(mapped)}."


def _not_shared(comparison: ComparedResults) -> Iterator[str]:
    """Parameters that a result does not have."""
    for k, entry in enumerate(comparison.entries):
        if comparison.one_machine:
            lacking = [p.name for p in comparison.parameters if p.estimates[k] is None]
            left_out = [name for name in lacking if name in entry.left_out]
            others = [name for name in lacking if name not in entry.left_out]
            if left_out:
                yield f"{entry.label} left out, as zero: {listed(left_out)}."
            if others:
                yield f"{entry.label} does not determine: {listed(others)}."
        else:
            common = {p.name for p in comparison.parameters}
            alone = [name for name in entry.names if name not in common]
            if alone:
                yield f"Not in all results, hence not compared, of {entry.label}: {listed(alone)}."


def _rows(comparison: ComparedResults) -> Iterator[str]:
    """Relative errors over rows that are not alike."""
    decimated = {
        e.label: e.identification.is_decimated
        for e in comparison.entries
        if e.identification is not None
    }
    if len(set(decimated.values())) > 1:
        filtered = [label for label, thinned in decimated.items() if thinned]
        yield (
            f"The relative errors of {listed(filtered)} are over filtered rows, which have lost "
            "most of the noise that all samples still have; compare them only with each other."
        )


def rows_text(entry: Entry) -> str:
    """The rows that a result's relative error is taken over, in a few words."""
    return "–" if entry.identification is None else error_rows(entry.identification)


def share_text(value: float) -> str:
    """A relative error in percent."""
    return "–" if value != value else f"{format_significant(100.0 * value, 2)} %"
