"""The content of an experiment file as plain values, with one of them changed."""

from __future__ import annotations

import copy
from itertools import pairwise
from typing import Any

from pivident.errors import ExperimentError
from pivident.experiment.explained import plain_form
from pivident.studio.rows import table_name
from pivident.text.toml_places import Place


def content_with(content: dict[str, Any], place: Place, value: Any) -> dict[str, Any]:
    """The content with a value at a place."""
    new = copy.deepcopy(content)
    table: Any = new
    for part, after in pairwise(place):
        if isinstance(table, dict) and part not in table:
            table[part] = {} if isinstance(after, str) else []
        table = _inside(table, part, place)
    if isinstance(table, list) and not (isinstance(place[-1], int) and place[-1] < len(table)):
        raise ExperimentError(f"{called(place)} is not in the file; reload the page")
    table[place[-1]] = value
    return plain_form(new)


def content_without(content: dict[str, Any], place: Place) -> dict[str, Any]:
    """The content without what is at a place."""
    new = copy.deepcopy(content)
    table: Any = new
    for part in place[:-1]:
        table = _inside(table, part, place)
    del table[place[-1]]
    if isinstance(table, list) and not table:
        return content_without(content, place[:-1])
    return plain_form(new)


def without_empty_tables(content: Any, place: Place) -> Any:
    """The content without a table that is empty, nor those around it that are empty then."""
    inner = content
    for part in place:
        inner = _inside(inner, part, place)
    if inner or not place:
        return content
    return without_empty_tables(content_without(content, place), place[:-1])


def _inside(table: Any, part: int | str, place: Place) -> Any:
    """A part of a table."""
    try:
        inner = table[part]
    except (KeyError, IndexError, TypeError):
        inner = None
    if not isinstance(inner, (dict, list)):
        raise ExperimentError(f"{called(place)} has no table to stand in; add the table as text")
    return inner


def called(place: Place) -> str:
    """A place in words: its table and key."""
    heading = table_name(place)
    return f"[{heading}] {place[-1]}" if heading else str(place[-1])
