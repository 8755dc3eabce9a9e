"""Kinds of errors: one base class, and a child for each thing that can be wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Self

from pivident.text.printable import shortened


class PividentError(Exception):
    """Base of every error that pivident raises on purpose.

    Its text is shortened for reading; ``args`` holds all of it, for instance the whole of a name
    of 50,000 letters.

    Attributes:
        place: keys below the table of an experiment file that is being read, whose value the error
            is about; empty where nobody has said it.
        table: the table itself, where it is another one than that being read.
        meant: a name that is not known, and the nearest one that is; None where there is none.
    """

    place: tuple[str, ...] = ()
    table: tuple[str, ...] = ()
    meant: tuple[str, str] | None = None
    _sentence = ""

    @property
    def sentence(self) -> str:
        """The message without the file and the table in front."""
        return self._sentence or str(self)

    def about(self, *keys: str) -> Self:
        """The same error, about the value of these keys if it has no place yet."""
        self.place = self.place or keys
        return self

    def naming(self, name: str, near: Sequence[str]) -> Self:
        """The same error, about a name that is not known; ``near``: those that are like it."""
        self.meant = (name, near[0]) if near else None
        return self

    def __str__(self) -> str:
        return shortened(super().__str__())


class RobotDescriptionError(PividentError, ValueError):
    """A robot description (modified DH table or URDF) that cannot be used."""


class RecordingError(PividentError, ValueError):
    """A recording whose content cannot be used as it is."""


class FileFormatError(RecordingError):
    """A file that is missing, unreadable or not what its name promises."""

    place: tuple[str, ...] = ("files",)


class ExperimentError(PividentError, ValueError):
    """An experiment file with unknown keys, bad values or contradictory options."""

    def headed(self, heading: str) -> Self:
        """The error with a file or a table in front of its message; its place stays."""
        made = type(self)(f"{heading} {self}")
        made._sentence, made.table, made.place = self.sentence, self.table, self.place
        made.meant = self.meant
        return made

    def within(self, table: str, *keys: str) -> Self:
        """The error about keys of this table, such as ``identify.piv``, with its name in front."""
        made = self.headed(f"[{table}]").about(*keys)
        made.table = tuple(table.split("."))
        return made


class IdentificationError(PividentError):
    """An identification that cannot be carried out on the given data."""


class IdentificationFileError(PividentError, ValueError):
    """An identification on disk that cannot be used.

    Attributes:
        file: the file.
        reason: what is wrong with it, and the next step.
    """

    def __init__(self, file: str, reason: str) -> None:
        self.file, self.reason = file, reason
        super().__init__(f"{file}: {reason}")


class ExportError(PividentError, ValueError):
    """A model that cannot be written in a format, or a file that must not be written."""


@contextmanager
def concerning(*keys: str) -> Iterator[None]:
    """Errors from inside are about the value of these keys, unless they have a place already."""
    try:
        yield
    except PividentError as error:
        error.about(*keys)
        raise
