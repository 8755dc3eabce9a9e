"""Fixes of keys and names of the file itself: misspelt, superfluous, in another unit."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from pivident.init.experiment_text import value_text
from pivident.studio.remark_case import Edits, RemarkCase

_MEANT = re.compile(r"did you mean '?([^'?,]+?)'?(?:,| or |\?)", re.IGNORECASE)
_QUOTED = re.compile(r"'([^']+)'")


def renamed(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A key with the name that was meant."""
    meant, value = _MEANT.search(case.step), case.value(*case.place)
    if meant is None or value is None or isinstance(value, dict):
        return
    place = (*case.place[:-1], meant[1])
    if case.value(*place) is None:
        edits: Edits = ((case.place, None), (place, value_text(value)))
        yield f"Call it {meant[1]}.", edits


def wrong_name(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A name that is not there, such as that of a column, with the one that was meant."""
    meant, value = _MEANT.search(case.step), case.value(*case.place)
    wrong = _QUOTED.findall(case.message)
    if meant is None or value is None or case.kind == "unknown key":
        return
    if isinstance(value, list) and any(name in wrong for name in value):
        made = [meant[1] if name in wrong else name for name in value]
        yield f"Write {meant[1]}.", ((case.place, value_text(made)),)
    elif isinstance(value, str) and value in wrong:
        yield f"Write {meant[1]}.", ((case.place, value_text(meant[1])),)


def superfluous(key: str) -> Callable[[RemarkCase], Iterator[tuple[str, Edits]]]:
    """A maker that removes a key, or what the remark is about where no key is named."""

    def made(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
        place = case.place
        if not key and case.topic == "recordings":
            place = case.table
        if key and place[-1:] != (key,):
            return
        is_advised = case.topic in ("file", "recordings", "controller") or re.search(
            r"leave it out|remove", case.step
        )
        if place and is_advised and case.value(*place) is not None:
            what = f"Remove {place[-1]}." if isinstance(place[-1], str) else "Remove this run."
            yield what, ((place, None),)

    return made


def declared_rate(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A declared rate from which the stamps run away."""
    place = (*case.table, "rate")
    if "declared rate" in case.message and case.value(*place) is not None:
        yield "Take the rate of the time stamps: remove rate.", ((place, None),)


def long_delay(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A delay in milliseconds where seconds are meant."""
    delay = case.value(*case.place)
    if isinstance(delay, (int, float)):
        yield "It is in milliseconds.", ((case.place, value_text(float(f"{1e-3 * delay:.6g}"))),)
