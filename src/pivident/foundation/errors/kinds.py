"""Kinds of errors: one base class, and a child for each thing that can be wrong.

What follows a finished estimate, attempted: what fails costs its own line, not the estimate.

Tests, held-out motion, causes of model error, the verdict and the report judge an estimate that is
there already. Where one ends with an error, of whatever kind, a line says so and the rest goes on.
"""

from __future__ import annotations

import copyreg
import os
import pickle
import traceback
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self, TypeVar

from pivident.foundation.text.identifiers import shortened
from pivident.foundation.text.sentences import NearestNames, nearest


class Advised(Exception):
    """An error that says what was seen and what to do.

    Its text is ``what was seen; what to do``.

    Args:
        fact: what was seen, a half sentence.
        advice: what to do, a half sentence; empty where that is open.

    Attributes:
        fact: what was seen, without the file and the table in front.
        advice: what to do.
        headings: file and table in front of what was seen, the outermost first.
        meant: a name that is not known, and the nearest one that is; None where there is none.
    """

    headings: tuple[str, ...] = ()
    meant: tuple[str, str] | None = None

    def __init__(self, fact: str = "", *, advice: str = "") -> None:
        self.fact, self.advice = fact, advice
        if isinstance(advice, NearestNames):
            self.meant = advice.meant
        super().__init__(_joined(fact, advice))

    @classmethod
    def of_part(cls, heading: str, error: Exception) -> Self:
        """An error of a part as one of the whole, with a heading in front of what was seen."""
        if not isinstance(error, Advised):
            return cls(f"{heading}{error}")
        headings = "".join([heading, *(f"{each} " for each in error.headings)])
        whole = cls(f"{headings}{error.fact}", advice=error.advice)
        whole.meant = error.meant
        return whole

    def followed_by(self, more: str) -> Self:
        """The same with something behind its text."""
        if not self.advice:
            return type(self)(f"{self.fact}{more}")
        whole = type(self)(self.fact, advice=f"{self.advice}{more}")
        whole.meant = self.meant
        return whole

    def __str__(self) -> str:
        return BaseException.__str__(self)  # a KeyError would quote it

    def __reduce__(self) -> tuple[Any, ...]:
        """Text and attributes for another process: a kind cannot be made again of its text.

        What cannot go there, such as a user's control law in a problem, stays behind: an error
        that cannot be sent would break the pool, or be lost.
        """
        evidence = {name: value for name, value in vars(self).items() if _travels(value)}
        return copyreg.__newobj__, (type(self), *self.args), evidence  # type: ignore[attr-defined]


def _travels(value: Any) -> bool:
    """Whether a value can be sent to another process."""
    try:
        pickle.dumps(value)
    except Exception:  # whatever the classes of users raise
        return False
    return True


class PividentError(Advised):
    """Base of every error that pivident raises on purpose.

    Its text is shortened for reading; ``args`` holds all of it, for instance the whole of a name
    of 50,000 letters.

    Attributes:
        place: keys below the table of an experiment file that is being read, whose value the error
            is about; empty where nobody has said it.
        table: the table itself, where it is another one than that being read.

    Example:
        >>> try:
        ...     pv.load_robot("planar_3r")
        ... except pv.PividentError as error:
        ...     print(error)
        the gallery has no robot 'planar_3r'; did you mean 'planar_2r'?
    """

    place: tuple[str, ...] = ()
    table: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The message without the file and the table in front."""
        return shortened(_joined(self.fact, self.advice))

    def about(self, *keys: str) -> Self:
        """The same error, about the value of these keys if it has no place yet."""
        self.place = self.place or keys
        return self

    def __str__(self) -> str:
        return shortened(super().__str__())


def _joined(fact: str, advice: str) -> str:
    """What was seen and what to do, in one line."""
    return f"{fact}; {advice}" if advice else fact


class PividentWarning(UserWarning):
    """Base of every warning that pivident gives by `warnings`."""


class EstimateWarning(PividentWarning):
    """Base of what `identify` and `cross_validate` warn of; the result says the same at length."""


class ConvergenceWarning(EstimateWarning):
    """An iteration ended before its estimate stood still."""


class RankWarning(EstimateWarning):
    """Parameters were left out or held, since the record does not determine them."""


class FallbackWarning(EstimateWarning):
    """Instruments or noise models other than those asked for took their place."""


class FailedFoldWarning(EstimateWarning):
    """The estimate without a held-out block failed; errors are those of the other blocks."""


class UnusableValue(PividentError, ValueError):
    """A value that cannot be used, as its type or a table of a file finds."""


class WrongKind(PividentError, TypeError):
    """An argument of another kind than is taken."""


def require_kind(argument: str, value: Any, kind: Any, advice: str = "") -> None:
    """Refuse an argument of another kind.

    Args:
        argument: its name.
        value: what was given.
        kind: class, or several as of ``isinstance``.
        advice: what to give, a half sentence.

    Raises:
        WrongKind: names the argument, what was given and what to give.
    """
    if not isinstance(value, kind):
        raise WrongKind(f"{argument} is of type {type(value).__name__}", advice=advice)


class UnknownName(PividentError, KeyError):
    """A name of a parameter, a constant or a joint that is not there."""


def require_known(name: str, known: Collection[str], fact: str, error: type[PividentError]) -> None:
    """Refuse a name that is not among the known ones, with those that are near it.

    Args:
        name: what was given.
        known: what there is.
        fact: what was seen, a half sentence that quotes the name.
        error: kind of the error.

    Raises:
        PividentError: an ``error``, with what may be meant, or all that is known.
    """
    if name not in known:
        raise error(fact, advice=nearest(name, known))


class RobotDescriptionError(PividentError, ValueError):
    """A robot description (modified DH table or URDF) that cannot be used."""


class RecordingError(PividentError, ValueError):
    """A recording whose content cannot be used as it is."""


class FileFormatError(RecordingError):
    """A file that is missing, unreadable or not what its name promises."""

    place: tuple[str, ...] = ("files",)


class ExperimentError(PividentError, ValueError):
    """An experiment file with unknown keys, bad values or contradictory options."""

    def headed(self, *headings: str) -> Self:
        """The error with a file, a table or both in front of its message; its place stays."""
        whole = type(self).of_part("".join(f"{each} " for each in headings), self)
        whole.fact, whole.headings = self.fact, (*headings, *self.headings)
        whole.table, whole.place = self.table, self.place
        return whole

    def within(self, table: str, *keys: str) -> Self:
        """The error about keys of this table, such as ``identify.piv``, with its name in front."""
        whole = self.headed(f"[{table}]").about(*keys)
        whole.table = tuple(table.split("."))
        return whole


class IdentificationError(PividentError, ValueError):
    """An identification that cannot be carried out on the given data."""


class IdentificationFileError(PividentError, ValueError):
    """An identification on disk that cannot be used.

    Attributes:
        file: the file.
        reason: what is wrong with it.
    """

    def __init__(self, file: str, reason: str, *, advice: str = "") -> None:
        self.file, self.reason = file, reason
        super().__init__(f"{file}: {reason}", advice=advice)

    @classmethod
    def of_content(cls, file: str, error: Exception, advice: str) -> Self:
        """An error of its content as one of the file, with what to do about the file behind."""
        said = error if isinstance(error, Advised) else UnusableValue(str(error))
        return cls(file, said.fact, advice="; ".join(filter(None, (said.advice, advice))))


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


Made = TypeVar("Made")


class Attempts:
    """Attempts, and the lines of those that failed; ``say`` is called with each line."""

    def __init__(self, say: Callable[[str], None] = lambda line: None) -> None:
        self._say = say
        self.lines: list[str] = []  # whole sentences, each once
        self.errors: list[Exception] = []  # of each attempt that failed

    def of(
        self, heading: str, make: Callable[..., Made], *given: Any, otherwise: Any = None
    ) -> Made | Any:
        """What ``make(*given)`` gives, or ``otherwise`` where it fails.

        ``heading`` begins the line, without a period: ``Nothing could be held out``.
        """
        try:
            return make(*given)
        except BrokenPipeError:  # the reader of what is printed has seen enough
            raise
        except Exception as error:
            line = f"{heading}: {in_words(error).rstrip('.')}."
            self.errors.append(error)
            if line not in self.lines:
                self.lines.append(line)
                self._say(line)
                if is_unexpected(error) and os.environ.get("PIVIDENT_DEBUG", "") not in ("", "0"):
                    traceback.print_exception(error)
            return otherwise

    @property
    def unexpected(self) -> bool:
        """Whether one ended with an error that pivident has not raised on purpose."""
        return any(map(is_unexpected, self.errors))


def is_unexpected(error: BaseException) -> bool:
    """Whether pivident has not raised an error on purpose."""
    return not isinstance(error, PividentError)


def in_words(error: BaseException) -> str:
    """An error with its notes in one line; one that was not raised on purpose says where it is."""
    text = " ".join(str(error).split())
    notes = "".join(f" ({n})" for n in getattr(error, "__notes__", ()))
    if not is_unexpected(error):
        return f"{text}{notes}"
    kind, frames = type(error).__name__, traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f"{os.sep}pivident{os.sep}" in f.filename]
    where = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
    if isinstance(error, FloatingPointError | OverflowError) or kind == "LinAlgError":
        return f"numbers that cannot be computed with, {kind}: {text or 'no message'}{where}{notes}"
    return (
        f"unexpected {kind}: {text or 'no message'}{where}{notes}; this is a bug in pivident, "
        "PIVIDENT_DEBUG=1 shows where"
    )
