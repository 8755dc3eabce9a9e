"""A remark of the check beside the file that it is about."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pivident.experiment.explained import plain_form
from pivident.text.toml import parse_toml
from pivident.text.toml_places import Place
from pivident.text.toml_values import value_text

#: Places and their new values as TOML; None: removed.
Edits = tuple[tuple[Place, str | None], ...]


@dataclass(frozen=True)
class RemarkCase:
    """A remark, and what the file says.

    Attributes:
        topic: what was looked at.
        kind: what was found.
        message: the sentence.
        step: what to do next.
        subject: joint, channel or column.
        evidence: numbers by name.
        place: where it is changed.
        joints: names of the robot's joints, in order; empty where they are not known.
        content: the file, its short forms written out.
    """

    topic: str
    kind: str
    message: str
    step: str
    subject: str
    evidence: Mapping[str, float]
    place: Place
    joints: tuple[str, ...]
    content: Mapping[str, Any]

    @classmethod
    def of(cls, remark: Mapping[str, Any], text: str) -> RemarkCase:
        """A remark of ``check.json``, with ``joints`` beside its own entries.

        Raises:
            ValueError: the text is not TOML.
        """
        evidence = {
            name: float(entry["value"])
            for name, entry in (remark.get("evidence") or {}).items()
            if entry.get("value") is not None
        }
        return cls(
            str(remark.get("topic", "")),
            str(remark.get("kind", "")),
            str(remark.get("message", "")),
            str(remark.get("next_step", "")),
            str(remark.get("subject", "")),
            evidence,
            tuple(remark.get("place", ())),
            tuple(remark.get("joints", ())),
            plain_form(parse_toml(text)),
        )

    @property
    def table(self) -> Place:
        """Table of the recording that it is about, or of the first."""
        for k, part in enumerate(self.place[:-1]):
            if part == "recording" and isinstance(self.place[k + 1], int):
                return self.place[: k + 2]
        return ("recording", 0)

    def value(self, *place: int | str) -> Any:
        """What the file says at a place; None for nothing."""
        found: Any = self.content
        for part in place:
            try:
                found = found[part]
            except (KeyError, IndexError, TypeError):
                return None
        return found

    def columns(self, channel: str) -> list[str] | None:
        """Columns of a channel where they are listed by name."""
        listed = self.value(*self.table, "columns", channel)
        is_list = isinstance(listed, list) and all(isinstance(name, str) for name in listed)
        return list(listed) if is_list else None

    def unit(self, channel: str, joints: int) -> list[Any]:
        """Unit of a channel for each joint; None where nothing is said."""
        said = self.value(*self.table, "units", channel)
        listed = list(said) if isinstance(said, list) else [said] * joints
        return [*listed, *[None] * joints][:joints]

    def concerned(self) -> list[int]:
        """Numbers of the joints that it is about, those of "The same for" included."""
        named = re.split(r", | of ", self.subject)
        rest = self.message.partition("The same for ")[2]
        return [
            j
            for j, name in enumerate(self.joints)
            if name in named
            or re.search(rf"(?:^|, |\bof ){re.escape(name)}(?: \(|, |\.$)", rest) is not None
        ]


def unit_edit(table: Place, channel: str, units: Sequence[Any]) -> tuple[Place, str]:
    """Units of a channel, one for all where they are the same."""
    alike = all(unit == units[0] for unit in units)
    return (*table, "units", channel), value_text(units[0] if alike else list(units))
