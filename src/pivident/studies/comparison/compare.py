"""Results of several methods, days or robots side by side, quantity by quantity.

All are compared with the first. A difference is marked where it is significant after correction for
the number of differences that are looked at, so that the probability of marking one or more that
are none is at most α.

Which quantities of several results are the same, and what each result says about them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.common_work import work_in_common
from pivident.studies.comparison.compared_results import (
    ComparedParameter,
    ComparedResults,
    Difference,
    Estimate,
    cross_torques,
    difference,
    holm,
    share_a_record,
)
from pivident.studies.comparison.entry import (
    ComparisonError,
    Entry,
    distinct_labels,
    entry_of,
    load_entries,
    relabelled,
)
from pivident.studies.comparison.friction_curves import friction_curves
from pivident.studies.comparison.groups import Key, difference_of_geometry
from pivident.studies.comparison.remarks import remarks
from pivident.studies.comparison.side_by_side import comparison_text

#: Probability of one false mark or more in a comparison.
ALPHA = 0.05
#: Results side by side, at most: beyond that a fleet is the better question.
MOST = 24
#: What can be compared.
Result = Identification | str | PathLike[str]
#: A quantity: name, unit, group written out, and its coefficients on standard parameters.
Quantity = tuple[str, str, str, Mapping[Key, float]]


class Comparison(ComparedResults):
    """Several results side by side.

    Attributes:
        entries: the results; the others are compared with the first.
        parameters: quantity by quantity.
        alpha: probability of one false mark or more.
        same_record: whether each result may share its record with the first.
        one_machine: whether all robots have the same geometry.
        torques: torques of all results on the records of those that hold them.
        friction: friction against speed, joint by joint.
        notes: what must be known to read the rest, whole sentences.
    """

    def __str__(self) -> str:
        return comparison_text(self)

    def save(self, folder: str | PathLike[str]) -> None:
        """Write comparison.html, .csv, .json and .tex into a folder, all or nothing.

        Args:
            folder: folder to create or to write into.

        Raises:
            PividentError: it cannot be written.
        """
        from pivident.studies.comparison.account import save_comparison

        save_comparison(self, folder)


def aligned_by_group(
    entries: Sequence[Entry],
) -> Iterator[tuple[Quantity, tuple[Estimate | None, ...]]]:
    """All quantities that some result estimates, each with what every result says about it.

    For results of one machine. The quantities are the base parameters of the first result, then
    those of the others that none before can express.
    """
    seen: dict[frozenset[Key], list[Mapping[Key, float]]] = {}
    for entry in entries:
        groups = entry.groups
        columns = zip(groups.names, groups.units, groups.expressions, groups.rows, strict=True)
        for name, unit, expression, row in columns:
            alike = seen.setdefault(frozenset(row), [])
            if name not in entry.place or any(_same(row, other) for other in alike):
                continue
            alike.append(row)
            estimates = tuple(estimate_of(other, row) for other in entries)
            yield (name, unit, expression, row), estimates


def aligned_by_name(
    entries: Sequence[Entry],
) -> Iterator[tuple[Quantity, tuple[Estimate | None, ...]]]:
    """The parameters that all results have under one name and in one unit.

    For results of different machines, where nothing but the name is common.
    """
    first, *others = entries
    groups = first.groups
    columns = zip(groups.names, groups.units, groups.expressions, groups.rows, strict=True)
    for name, unit, expression, row in columns:
        units = [dict(zip(e.groups.names, e.groups.units, strict=True)) for e in others]
        if name in first.place and all(
            name in e.place and u.get(name) == unit for e, u in zip(others, units, strict=True)
        ):
            estimates = tuple(_own(e, e.place[name]) for e in entries)
            yield (name, unit, expression, row), estimates


def estimate_of(entry: Entry, row: Mapping[Key, float]) -> Estimate | None:
    """What a result says about a quantity; None where it does not determine it."""
    c = entry.groups.coefficients(row)
    if c is None:
        return None
    used = np.flatnonzero(c)
    names = [entry.groups.names[k] for k in used]
    if any(name not in entry.place for name in names):
        return None
    own = [entry.place[name] for name in names]
    if len(own) == 1 and c[used[0]] == 1.0:
        return _own(entry, own[0])
    weights = c[used]
    value = float(weights @ entry.value[own])
    spread = float("nan")
    if entry.covariance is not None:
        spread = 2.0 * float(np.sqrt(weights @ entry.covariance[np.ix_(own, own)] @ weights))
    return Estimate(value, value - spread, value + spread, tuple(names))


def _own(entry: Entry, k: int) -> Estimate:
    """A parameter of the result itself."""
    return Estimate(float(entry.value[k]), float(entry.low[k]), float(entry.high[k]))


def _same(a: Mapping[Key, float], b: Mapping[Key, float]) -> bool:
    """Whether two quantities with the same keys are one."""
    return all(abs(a[key] - b[key]) <= 1e-7 * max(abs(a[key]), abs(b[key])) for key in a)


def compare(
    results: Sequence[Result] | Mapping[str, Result],
    labels: Sequence[str] | None = None,
    *,
    alpha: float = ALPHA,
) -> Comparison:
    """Compare results with the first of them.

    Args:
        results: identifications, or files and folders of results, in any mixture;
            a table of them gives each its label.
        labels: a name for each; None: the methods where they differ, else parts of the paths.
        alpha: probability of one false mark or more.

    Returns:
        The comparison; printed, it is a table with a mark at what differs.

    Raises:
        ComparisonError: fewer than two results, labels that do not fit, or robots that have the
            same joints in another order.
        IdentificationFileError: a file cannot be used.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> results = {}
        >>> for seed, (day, fv1) in enumerate({"Monday": 2.5, "Friday": 3.0}.items()):
        ...     made = pv.simulate(robot, loop, values={"fv1": fv1}, encoder=1e-5, seed=seed)
        ...     results[day] = pv.identify(pv.Problem(robot, (made.recording,), loop), "piv")
        >>> print(pv.compare(results))
        Results ...
        · Friday: 1 of 13 parameters differs significantly from Monday: fv1 +20.0...
        ...
    """
    if isinstance(results, Mapping):
        labels, results = labels or list(results), list(results.values())
    if labels is not None and not _is_sequence_of_names(labels):
        raise ComparisonError(
            f"labels is {labels!r}", advice="give all results in one list, compare([one, other])"
        )
    with work_in_common():  # base parameters once for each robot
        return _compared(_named(_entries(results), labels), alpha)


def _is_sequence_of_names(labels: Any) -> bool:
    """Whether it can be the names of several results: neither a result nor one name."""
    return isinstance(labels, Iterable) and not isinstance(labels, (str, PathLike, Identification))


def _compared(entries: Sequence[Entry], alpha: float) -> Comparison:
    """Entries under their names compared with the first of them."""
    if len(entries) < 2:
        raise ComparisonError(
            f"there is {'one result' if entries else 'no result'}",
            advice="give two or more to compare",
        )
    if len(entries) > MOST:
        raise ComparisonError(
            f"there are {len(entries)} results, and no one reads more than {MOST} side by side",
            advice="`pivident fleet` follows parameters over many records",
        )
    if not 0.0 < alpha < 1.0:
        raise ComparisonError(
            f"alpha is {alpha:g}", advice=f"it is a probability between 0 and 1, such as {ALPHA:g}"
        )
    first = entries[0]
    for entry in entries[1:]:
        _check_joint_order(first, entry)
    geometry = [difference_of_geometry(first.robot, e.robot) for e in entries]
    one_machine = not any(geometry)
    rows = list(aligned_by_group(entries) if one_machine else aligned_by_name(entries))
    same_record = tuple(k > 0 and share_a_record(first, e) for k, e in enumerate(entries))
    parameters = _judged(rows, same_record)
    comparison = Comparison(
        entries=tuple(entries),
        parameters=parameters,
        alpha=alpha,
        same_record=same_record,
        one_machine=one_machine,
        torques=tuple(cross_torques(entries)) if one_machine else (),
        friction=tuple(friction_curves(entries)) if one_machine else (),
        notes=(),
    )
    return replace(comparison, notes=tuple(remarks(comparison, geometry)))


def _check_joint_order(first: Entry, other: Entry) -> None:
    """Refuse the same joints in another order, whose parameters have each other's numbers."""
    one, two = first.robot.joint_names, other.robot.joint_names
    if one != two and set(one) == set(two):
        raise ComparisonError(
            f"{first.label} has the joints {', '.join(one)}, {other.label} {', '.join(two)}: the "
            "numbers of their parameters mean different joints",
            advice="describe the robot with its joints in one order, and identify again",
        )


def _entries(results: Any) -> list[Entry]:
    """Results of any kind; files are read together, so that their names differ."""
    if isinstance(results, (str, PathLike, Identification)) or not isinstance(results, Iterable):
        results = [results]
    results = list(results)
    entries: list[Entry] = []
    paths = [r for r in results if not isinstance(r, Identification)]
    for path in paths:
        if not isinstance(path, (str, PathLike)):
            raise ComparisonError(
                f"a {type(path).__name__} cannot be compared",
                advice="give identifications, or files and folders of results",
            )
    if paths and len(paths) == len(results):
        return load_entries(paths)
    for result in results:
        is_estimate = isinstance(result, Identification)
        entries += [entry_of(result, result.method)] if is_estimate else load_entries([result])
    return entries


def _named(entries: list[Entry], labels: Sequence[str] | None) -> list[Entry]:
    """The results with the names that were asked for, or with ones that differ."""
    if labels is None:
        names = [e.label for e in entries]
        if len(set(names)) == len(names):
            return entries
        labels = distinct_labels([e.method for e in entries], [(e.label,) for e in entries])
    labels = [str(label).strip() for label in labels]
    if len(labels) != len(entries):
        raise ComparisonError(
            f"there are {len(labels)} names for {len(entries)} results "
            f"({', '.join(e.label for e in entries)})",
            advice="give one for each",
        )
    twice = [label for label, count in Counter(labels).items() if count > 1 or not label]
    if twice:
        raise ComparisonError(
            f"the name {twice[0]!r} is empty or given twice", advice="names must differ"
        )
    return [relabelled(entry, label) for entry, label in zip(entries, labels, strict=True)]


def _judged(
    rows: Sequence[tuple[Any, tuple[Estimate | None, ...]]], same_record: tuple[bool, ...]
) -> tuple[ComparedParameter, ...]:
    """Differences from the first result, with probabilities adjusted among all of them."""
    table: list[list[Difference | None]] = []
    for _, estimates in rows:
        first, *others = estimates
        found = (
            difference(first, other, independent=not same) if first and other else None
            for other, same in zip(others, same_record[1:], strict=True)
        )
        table.append([None, *found])
    single = np.array([[math.nan if d is None else d.p_value for d in line] for line in table])
    adjusted = holm(single.ravel()).reshape(single.shape)
    return tuple(
        ComparedParameter(
            name,
            unit,
            expression,
            estimates,
            tuple(
                None if d is None else replace(d, p_adjusted=float(p))
                for d, p in zip(line, adjusted[k], strict=True)
            ),
        )
        for k, (((name, unit, expression, _), estimates), line) in enumerate(
            zip(rows, table, strict=True)
        )
    )
