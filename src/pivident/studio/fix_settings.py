"""Fixes of settings that a remark states, ``Set delay = 0.0103 under [recording]``, and of keys."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from pivident.studio.remark_case import Edits, RemarkCase
from pivident.text.toml import parse_toml
from pivident.text.toml_places import Place
from pivident.text.toml_values import value_text

#: What a setting does, by its key.
WORDS = {
    "delay": "Declare how much later the torque is",
    "drive_delay": "Declare that the drive responds late to the logged command",
    "torque_timing": "Declare the instant of a torque sample",
    "control_rate": "Declare the rate of the control loop",
    "rate": "Take the samples for equally spaced",
    "resample": "Interpolate onto a uniform clock",
    "part": "Keep this part of the log only",
    "units": "Change the unit",
    "side": "Change the side of the gear",
    "gravity": "Change the direction of gravity",
    "torque_side": "Declare what the torque measures",
    "feed_forward": "Declare that the controller compensates gravity",
}

#: Table of a key that is none of a recording.
TABLES: dict[str, Place] = {"gravity": ("robot",), "feed_forward": ("controller",)}

_VALUE = r"\"[^\"]*\"|\{[^{}]*\}|\[[^\[\]]*\]|true|false|-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_SETTING = re.compile(rf"\b({'|'.join(WORDS)}) = ({_VALUE})")


def settings(text: str) -> list[tuple[str, str]]:
    """Keys and values that a text names, each once."""
    found = []
    for key, value in _SETTING.findall(text):
        try:
            parse_toml(f"x = {value}")
        except ValueError:
            continue
        found.append((key, value))
    return list(dict.fromkeys(found))


def advised(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """Each setting that the next step names is a fix."""
    for key, value in settings(case.step):
        yield _described(key, value), setting(case, key, value)


def gap(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """The longest stretch between gaps, and new samples where shorter ones remain; each other."""
    parts = [value for key, value in settings(case.step) if key == "part"]
    fill = "resample = true" in case.step
    edits: Edits = setting(case, "resample", "true") if fill else ()
    if not parts:
        if fill:
            yield _described("resample", "true"), edits
        return
    for part in dict.fromkeys(parts):
        yield _described("part", part), (*setting(case, "part", part), *edits)


def one_setting(key: str, value: str, words: str) -> Callable[[RemarkCase], Iterator]:
    """A maker of one setting of the recording."""

    def made(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
        yield f"{words}: {key} = {value}.", setting(case, key, value)

    return made


def setting(case: RemarkCase, key: str, value: str) -> Edits:
    """A setting as edits; of a table of channels only its own channels change."""
    table = TABLES.get(key, case.table)
    content = parse_toml(f"x = {value}")["x"]
    if key == "units":
        return tuple(((*table, "units", k), value_text(own)) for k, own in content.items())
    if key == "side" and isinstance(content, dict):
        said = case.value(*table, "side") or "joint"
        known = said if isinstance(said, dict) else {"q": said, "tau": said}
        return (((*table, "side"), value_text(known | content)),)
    return (((*table, key), value),)


def _described(key: str, value: str) -> str:
    return f"{WORDS[key]}: {key} = {value}."


_MEANT = re.compile(r"did you mean '?([^'?,]+?)'?(?:,| or |\?)", re.IGNORECASE)
_QUOTED = re.compile(r"'([^']+)'")


def renamed(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A key with the name that was meant."""
    meant, value = _MEANT.search(case.step), case.value(*case.place)
    if meant is None or value is None or isinstance(value, dict):
        return
    place = (*case.place[:-1], meant[1])
    if case.value(*place) is None:
        edits: Edits = ((case.place, None), (place, value_text(value)))
        yield f"Call it {meant[1]}.", edits


def wrong_name(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A name that is not there, such as that of a column, with the one that was meant."""
    meant, value = _MEANT.search(case.step), case.value(*case.place)
    wrong = _QUOTED.findall(case.message)
    if meant is None or value is None or case.kind == "unknown key":
        return
    if isinstance(value, list) and any(name in wrong for name in value):
        made = [meant[1] if name in wrong else name for name in value]
        yield f"Write {meant[1]}.", ((case.place, value_text(made)),)
    elif isinstance(value, str) and value in wrong:
        yield f"Write {meant[1]}.", ((case.place, value_text(meant[1])),)


def superfluous(key: str) -> Callable[[RemarkCase], Iterator[tuple[str, Edits]]]:
    """A maker that removes a key, or what the remark is about where no key is named."""

    def made(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
        place = case.place
        if not key and case.topic == "recordings":
            place = case.table
        if key and place[-1:] != (key,):
            return
        is_advised = case.topic in ("file", "recordings", "controller") or re.search(
            r"leave it out|remove", case.step
        )
        if place and is_advised and case.value(*place) is not None:
            what = f"Remove {place[-1]}." if isinstance(place[-1], str) else "Remove this run."
            yield what, ((place, None),)

    return made


def declared_rate(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A declared rate from which the stamps run away."""
    place = (*case.table, "rate")
    if "declared rate" in case.message and case.value(*place) is not None:
        yield "Take the rate of the time stamps: remove rate.", ((place, None),)


def long_delay(case: RemarkCase) -> Iterator[tuple[str, Edits]]:
    """A delay in milliseconds where seconds are meant."""
    delay = case.value(*case.place)
    if isinstance(delay, (int, float)):
        yield "It is in milliseconds.", ((case.place, value_text(float(f"{1e-3 * delay:.6g}"))),)
