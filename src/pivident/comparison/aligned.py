"""Which quantities of several results are the same, and what each result says about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pivident.comparison.differences import Estimate
from pivident.comparison.entry import Entry
from pivident.comparison.groups import Key

#: A quantity: name, unit, group written out, and its coefficients on standard parameters.
Quantity = tuple[str, str, str, Mapping[Key, float]]


def aligned_by_group(
    entries: Sequence[Entry],
) -> list[tuple[Quantity, tuple[Estimate | None, ...]]]:
    """All quantities that some result estimates, each with what every result says about it.

    For results of one machine. The quantities are the base parameters of the first result, then
    those of the others that none before can express.
    """
    rows: list[tuple[Quantity, tuple[Estimate | None, ...]]] = []
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
            rows.append(((name, unit, expression, row), estimates))
    return rows


def aligned_by_name(
    entries: Sequence[Entry],
) -> list[tuple[Quantity, tuple[Estimate | None, ...]]]:
    """The parameters that all results have under one name and in one unit.

    For results of different machines, where nothing but the name is common.
    """
    first, *others = entries
    rows: list[tuple[Quantity, tuple[Estimate | None, ...]]] = []
    groups = first.groups
    columns = zip(groups.names, groups.units, groups.expressions, groups.rows, strict=True)
    for name, unit, expression, row in columns:
        units = [dict(zip(e.groups.names, e.groups.units, strict=True)) for e in others]
        if name in first.place and all(
            name in e.place and u.get(name) == unit for e, u in zip(others, units, strict=True)
        ):
            estimates = tuple(_own(e, e.place[name]) for e in entries)
            rows.append(((name, unit, expression, row), estimates))
    return rows


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
