"""Lines of keys in a TOML text."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from pivident.text.toml_places import Place, spellings, toml_items


class TomlLines:
    """Where the keys of a TOML text stand."""

    def __init__(self, text: str) -> None:
        self._ends = [k for k, character in enumerate(text) if character == "\n"]
        self._found: dict[Place, int] = {}
        for item in toml_items(text):
            self._found.setdefault(item.place, item.start)

    def line(self, place: Sequence[int | str]) -> int | None:
        """Line of a place, or of the nearest table around it, counted from 1; None without one."""
        whole = tuple(place)
        for length in range(len(whole), 0, -1):
            for known in spellings(whole[:length]):
                if known in self._found:
                    return bisect_right(self._ends, self._found[known]) + 1
        return None
