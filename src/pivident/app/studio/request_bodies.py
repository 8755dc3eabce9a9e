"""What requests that change something carry, as JSON; anything else is refused."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class NewProject(_Body):
    """Name of a project to make."""

    name: str


class RobotChoice(_Body):
    """A robot of the gallery or a file that was brought."""

    model: str
    version: str


class DraftRequest(_Body):
    """Draft the experiment file anew."""

    answers: dict[str, str] = {}
    column_names: str = ""


class Edit(_Body):
    """A new value of a key as TOML; None takes the key away."""

    place: list[str | int]
    value: str | None
    version: str


class Confirmation(_Body):
    """An assumption that is right."""

    place: list[str | int]
    version: str


class Text(_Body):
    """The whole experiment file."""

    text: str
    version: str


class FixRequest(_Body):
    """The fix of a finding, by their numbers."""

    remark: int
    fix: int
    version: str


class RepairRequest(_Body):
    """A repair that the verdict of a run has tried, by its number."""

    run: str
    number: int
    version: str


class LawsRequest(_Body):
    """The friction laws that a run has chosen."""

    run: str
    version: str


class RunRequest(_Body):
    """A step of the way, with its arguments; ``go_on``: also where it is held back."""

    step: str
    arguments: dict[str, Any] = {}
    go_on: bool = False
