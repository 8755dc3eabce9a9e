"""A hint that names what was probably meant, as a sentence and as data."""

from __future__ import annotations

from collections.abc import Sequence


class NearestNames(str):
    """A half sentence such as ``did you mean 'tau'?``.

    Attributes:
        meant: a name that is not known, and the nearest one that is; None where none is near.
    """

    meant: tuple[str, str] | None = None

    @classmethod
    def of(cls, text: str, name: str, near: Sequence[str]) -> NearestNames:
        """The hint in its words, with the name and those that are near it, the nearest first."""
        hint = cls(text)
        hint.meant = (name, near[0]) if near else None
        return hint
