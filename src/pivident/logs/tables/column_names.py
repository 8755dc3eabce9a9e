"""Names that somebody gives to the columns of a table without a header.

Such a table calls its columns column_1, column_2 … The names are given in the order of the columns,
``-`` for one that needs none; ``q1..q7`` stands for q1, q2 … q7.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pivident.errors import RecordingError
from pivident.logs.tables.tables import names_in
from pivident.robot.naming import repeated

#: What stands for a column without a name.
UNNAMED = "-"

_NUMBERED = re.compile(r"column_\d+")

_RANGE = re.compile(r"(.*?)(\d+)\.\.(.*?)(\d+)")


def named_columns(path: Path, names: Sequence[str]) -> dict[str, str]:
    """The column of a table without a header that each name means, in their order.

    Raises:
        RecordingError: the file has a header, or not as many columns as there are names.
    """
    names, own = written_out(names), names_in(path)
    if own[:1] != ("column_1",):
        listed = ", ".join(own[:6]) + (" …" if len(own) > 6 else "")
        raise RecordingError(
            f"{path.name} names its columns itself ({listed})",
            advice="column names are for text tables without a header: leave them out",
        )
    if len(own) != len(names):
        raise RecordingError(
            f"{path.name} has {len(own)} columns, but {len(names)} are named "
            f"({', '.join(names[:4])} …)",
            advice=f"name all in their order, {UNNAMED} for those that are not needed",
        )
    twice = repeated([name for name in names if name != UNNAMED])
    if twice:
        raise RecordingError(
            f"the column name {twice[0]!r} is given twice", advice="give each its own"
        )
    pairs = zip(names, own, strict=True)
    return {column if name == UNNAMED else name: column for name, column in pairs}


def header_advice(columns: Mapping[str, Sequence[str]]) -> str:
    """What to do about tables without names of columns, by file; empty where they have names."""
    bare = {
        file: own for file, own in columns.items() if own and all(map(_NUMBERED.fullmatch, own))
    }
    if not bare:
        return ""
    several = len(bare) > 1
    has = "have no headers" if several else "has no header"
    counts = " + ".join(str(len(own)) for own in bare.values())
    return (
        f"{', '.join(bare)} {has}, so nothing says what {'their' if several else 'its'} {counts} "
        "columns hold; name them in their order"
        + (", file after file" if several else "")
        + ", such as --columns t,q1..q6,tau1..tau6 (- for one that is not needed), or "
        + (
            "column_1, column_2 … of each file under columns of an experiment file"
            if several
            else 'column_names = ["t", "q1", …] under [recording] of an experiment file'
        )
    )


def written_out(names: Iterable[str]) -> list[str]:
    """Names with those of ranges written out: ``q1..q3`` is q1, q2, q3.

    Raises:
        RecordingError: a range whose ends differ in more than a number that grows.
    """
    found = []
    for name in names:
        match = _RANGE.fullmatch(name)
        if match is None:
            found.append(name)
            continue
        first, low, last, high = match.groups()
        if last not in (first, "") or int(low) > int(high) or int(high) - int(low) > 1000:
            raise RecordingError(
                f"{name!r} is no range of columns",
                advice="it has the form q1..q7, from the lower number on",
            )
        found += [f"{first}{k}" for k in range(int(low), int(high) + 1)]
    return found
