"""Lines of keys in a TOML text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tomlkit.items import Array, InlineTable, Item, Key

from pivident.experiment.file_lines import file_lines, numbered
from pivident.foundation.text.repair import Place
from pivident.foundation.text.toml_tree import behind_dots, keys_in, tables, toml_document

#: A character that stands in no TOML text.
_MARK = "\0"


class TomlLines:
    """Where the keys of a TOML text stand; nowhere in one that `tomlkit` would reorder.

    The number of its place is written behind each key and header, and found in the text.
    """

    def __init__(self, text: str) -> None:
        self._rows: dict[Place, int] = {}
        try:
            document = toml_document(text, to_write=True)
        except ValueError:
            return
        places: list[Place] = []
        for line in file_lines(document):
            _, body, number = behind_dots(line.body, line.number)
            for place, key in _keys(line.place, *body[number]):
                key.sep += f"{_MARK}{len(places)}{_MARK}"
                places.append(place)
        for place, element in tables(document.body):
            element.trivia.comment_ws += f"{_MARK}{len(places)}{_MARK}"
            places.append(place)
        row = 1
        for k, part in enumerate(document.as_string().split(_MARK)):
            if k % 2:
                self._rows.setdefault(numbered(places[int(part)]), row)
            row += part.count("\n")

    def line(self, place: Sequence[int | str]) -> int | None:
        """Line of a place, or of the nearest table around it, counted from 1; None without one."""
        around = (numbered(place[:length]) for length in range(len(place), 0, -1))
        return next((self._rows[place] for place in around if place in self._rows), None)


def _keys(place: Place, key: Key | None, item: Item) -> Iterator[tuple[Place, Key]]:
    """A key and those inside of its value."""
    if key is not None:
        yield place, key
    if isinstance(item, InlineTable):
        for parts, inner, value in keys_in(item):
            yield from _keys((*place, *parts), inner, value)
    elif isinstance(item, Array):
        for number, entry in enumerate(item):
            yield from _keys((*place, number), None, entry)
