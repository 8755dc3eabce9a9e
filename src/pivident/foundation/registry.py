"""Things that are found by name, to which other distributions add: the doors of pivident.

A registry says where each built-in entry stands, ``module:name``, and imports it when it is asked
for. Entries of other distributions come by the entry points of its group,

    [project.entry-points."pivident.methods"]
    median-ls = "my_package.median_regression:MedianRegression"

and are treated alike. One that cannot be imported is named, and does not stop the others.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pivident.foundation.errors import PividentError, PividentWarning

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Entry = TypeVar("Entry")


class BrokenExtension(PividentError, RuntimeError):
    """An entry of another distribution that is not what its group takes, or cannot be imported.

    Attributes:
        name: name of the entry.
        group: group of entry points.
        distribution: the distribution that declares it.
    """

    def __init__(self, name: str, group: str, distribution: str, why: str) -> None:
        self.name, self.group, self.distribution = name, group, distribution
        super().__init__(
            f"{name!r} of the distribution {distribution} (entry points {group}) cannot be used: "
            f"{why}",
            advice=f"mend it, or run pip uninstall {distribution}",
        )


class ExtensionWarning(PividentWarning):
    """An entry of another distribution is passed over."""


def named(place: str) -> Any:
    """What stands at ``module:name``."""
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute)


class Registry(Mapping[str, Entry], Generic[Entry]):
    """Entries by name: the built-in ones in their order, and those of other distributions.

    Iterating gives the names and imports nothing; an entry is imported when it is asked for.

    Args:
        group: group of entry points, such as ``pivident.methods``.
        kind: class of the entries. A class of this kind stands for its instance with all defaults.
        built_in: where the entries of pivident stand, ``module:name``, by their names.
    """

    def __init__(self, group: str, kind: type[Entry], built_in: Mapping[str, str]) -> None:
        self.group, self.kind, self._built_in = group, kind, dict(built_in)
        self._loaded: dict[str, Entry] = {}
        self._broken: set[str] = set()

    @property
    def foreign(self) -> tuple[str, ...]:
        """Names of entries of other distributions, in alphabetical order."""
        return tuple(name for name in _declared(self.group) if name not in self._built_in)

    def usable(self) -> dict[str, Entry]:
        """All entries that can be imported, by name; one warning names each of the others."""
        return {name: self[name] for name in self.usable_names}

    @property
    def usable_names(self) -> tuple[str, ...]:
        """Names of these, for which only entries of other distributions are imported."""
        names = list(self._built_in)
        for name in self.foreign:
            try:
                self[name]
                names.append(name)
            except BrokenExtension as error:
                if name not in self._broken:
                    warnings.warn(str(error), ExtensionWarning, stacklevel=2)
                self._broken.add(name)
        return tuple(names)

    def names_in(self, module: str) -> tuple[str, ...]:
        """Names of entries that stand in a module, and of all of other distributions."""
        own = (n for n, place in self._built_in.items() if place.partition(":")[0] == module)
        return (*own, *(name for name in self.usable_names if name in self.foreign))

    def __iter__(self) -> Iterator[str]:
        yield from self._built_in
        yield from self.foreign

    def __len__(self) -> int:
        return len(self._built_in) + len(self.foreign)

    def __contains__(self, name: object) -> bool:
        return name in self._built_in or name in self.foreign

    def __getitem__(self, name: str) -> Entry:
        """An entry by its name.

        Raises:
            KeyError: nobody declares one of this name.
            BrokenExtension: another distribution does, and it cannot be used.
        """
        if name not in self._loaded:
            if name in self._built_in:
                entry = named(self._built_in[name])
            else:
                entry = self._imported(_declared(self.group)[name])
            self._loaded[name] = self._instance(entry)
        return self._loaded[name]

    def _imported(self, point: EntryPoint) -> object:
        """What an entry point of another distribution names, of the kind of the others."""
        distribution = "" if point.dist is None else point.dist.name
        try:
            made = self._instance(point.load())
        except Exception as error:  # whatever foreign code raises
            why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
            raise BrokenExtension(point.name, self.group, distribution, why) from error
        if not isinstance(made, self.kind):
            why = f"it is of type {type(made).__name__}, not a {self.kind.__name__}"
            raise BrokenExtension(point.name, self.group, distribution, why)
        return made

    def _instance(self, entry: object) -> Entry:
        is_class = isinstance(entry, type) and issubclass(entry, self.kind)
        return entry() if is_class else entry  # type: ignore[return-value,operator]


@cache
def _declared(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name; of one name, that of the first distribution."""
    if not _anyone_declares():
        return {}
    from importlib.metadata import entry_points

    named = {point.name: point for point in reversed(tuple(entry_points(group=group)))}
    return dict(sorted(named.items()))


@cache
def _anyone_declares() -> bool:
    """Whether an installed distribution declares an entry for pivident.

    ``importlib.metadata`` takes longer to import than the names that ``pivident --help`` shows, so
    it is left alone where no file of entry points has such a group.
    """
    for folder in map(Path, sys.path):
        if not folder.is_dir():
            continue
        for entry in os.scandir(folder):
            if entry.name.endswith((".dist-info", ".egg-info")):
                file = Path(entry.path, "entry_points.txt")
                if file.is_file() and b"[pivident." in file.read_bytes():
                    return True
    return False
