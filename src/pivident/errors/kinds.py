"""Kinds of errors: one base class, and a child for each thing that can be wrong."""

from __future__ import annotations

from pivident.text.printable import shortened


class PividentError(Exception):
    """Base of every error that pivident raises on purpose.

    Its text is shortened for reading; ``args`` holds all of it, for instance the whole of a name
    of 50,000 letters.
    """

    def __str__(self) -> str:
        return shortened(super().__str__())


class RobotDescriptionError(PividentError, ValueError):
    """A robot description (modified DH table or URDF) that cannot be used."""


class RecordingError(PividentError, ValueError):
    """A recording whose content cannot be used as it is."""


class FileFormatError(RecordingError):
    """A file that is missing, unreadable or not what its name promises."""


class ExperimentError(PividentError, ValueError):
    """An experiment file with unknown keys, bad values or contradictory options."""


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
