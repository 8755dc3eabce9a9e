"""Whether a verdict names a trap, takes it silently, or offers repairs of a log without one."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .planting import DELAY
from .running import Outcome

#: Growth of the held-out error over that of the log without a trap up to which it is repaired.
AS_GOOD = 1.05

#: An edit of a repair as plain values, and the joints that are concerned.
IsRight = Callable[[Mapping[str, Any], list[str]], bool]


@dataclass(frozen=True)
class Cause:
    """How a verdict names the cause of a trap.

    Attributes:
        words: a statement that names it, as a pattern of what ``topic: kind: message`` begins with.
        is_right: whether an edit undoes it.
        of_joint: whether the statement has to name the joint.
        said: pattern of a refusal, or of what is said above the verdict, that names it; empty:
            neither does.
    """

    words: str
    is_right: IsRight
    of_joint: bool = True
    said: str = ""

    def is_named_by(self, statement: Mapping[str, str], joints: list[str]) -> bool:
        """Whether a reservation is about the cause."""
        topic, kind, message = (statement[key] for key in ("topic", "kind", "message"))
        said = f"{statement['subject']} {message}"
        is_about = not self.of_joint or any(joint in said for joint in joints)
        return is_about and bool(re.match(self.words, f"{topic}: {kind}: {message}"))

    def is_said_in(self, lines: list[str]) -> bool:
        """Whether one of these lines names it."""
        return bool(self.said) and any(re.search(self.said, line) for line in lines)


def _key(edit: Mapping[str, Any]) -> str:
    """Last two parts of the place of an edit, such as ``units.t``."""
    return ".".join(str(part) for part in edit.get("place", ())[-2:])


def _reversed(channel: str) -> IsRight:
    def is_right(edit: Mapping[str, Any], joints: list[str]) -> bool:
        return (
            edit["edit"] == "Reversed"
            and edit.get("channel") == channel
            and list(edit.get("joints", ())) == joints
        )

    return is_right


def _names(edit: Mapping[str, Any], joints: list[str]) -> bool:
    """Whether an edit is about these joints alone."""
    return [
        str(own[0]) for key in ("factors", "gains", "offsets") for own in edit.get(key, ())
    ] == (joints)


def _is_clock(edit: Mapping[str, Any], joints: list[str]) -> bool:
    key = _key(edit)
    return edit["edit"] == "Retimed" or key.endswith("units.t") or key.endswith(".rate")


def _is_exchange(edit: Mapping[str, Any], joints: list[str]) -> bool:
    moved = [j for j, column in enumerate(edit.get("order", ())) if column != j]
    return edit["edit"] == "Reordered" and edit.get("channel") == "tau" and len(moved) == 2


def _is_zero(edit: Mapping[str, Any], joints: list[str]) -> bool:
    return edit["edit"] == "Shifted" and _names(edit, joints)


def _is_unit(edit: Mapping[str, Any], joints: list[str]) -> bool:
    if edit["edit"] == "Multiplied":
        return edit["channel"] == "q" and _names(edit, joints)
    return "units.q" in ".".join(map(str, edit.get("place", ())))


def _is_gravity(edit: Mapping[str, Any], joints: list[str]) -> bool:
    return _key(edit) == "robot.gravity"


def _is_delay(edit: Mapping[str, Any], joints: list[str]) -> bool:
    value = edit.get("value")  # beside what the log is late without the trap
    right = isinstance(value, float) and 0.7 * DELAY < value < 2.0 * DELAY
    return _key(edit).endswith(".delay") and right


def _is_repeats(edit: Mapping[str, Any], joints: list[str]) -> bool:
    return "epeat" in edit["edit"] or "resample" in _key(edit) or "repeat" in _key(edit)


def _is_gain(edit: Mapping[str, Any], joints: list[str]) -> bool:
    if edit["edit"] == "Multiplied":
        return edit["channel"] == "tau" and _names(edit, joints)
    of_torque = edit["edit"] == "Gain" or "units.tau" in ".".join(map(str, edit.get("place", ())))
    return of_torque and (_names(edit, joints) or edit["edit"] == "Edit")


def _is_mass(edit: Mapping[str, Any], joints: list[str]) -> bool:
    text = f"{edit['edit']} {edit.get('place', '')}".lower()
    return "load" in text or "mass" in text


def _is_standstill(edit: Mapping[str, Any], joints: list[str]) -> bool:
    return _key(edit).rpartition(".")[2] in ("part", "mask")


#: Topics of statements about signs; a torque of the other sign than the description's is one, too.
SIGN = "power: sign|signs: |joints: reversed|scale: gain: .* is -"

CLOCK = "timing: clock|clock: |speed: "

CAUSES: dict[str, Cause] = {
    "clock x2": Cause(CLOCK, _is_clock, False),
    "clock x0.5": Cause(CLOCK, _is_clock, False),
    "sign of torque": Cause(SIGN, _reversed("tau")),
    "sign of position": Cause(SIGN, _reversed("q")),
    "joint reversed": Cause("joints: reversed", _reversed("")),
    "torques exchanged": Cause("joints: exchanged|order: ", _is_exchange),
    "zero 90 deg off": Cause("model: zero position|zero", _is_zero),
    "degrees as rad": Cause("units?: |position unit: |scale: angle unit|reach: ", _is_unit,
                            said="degrees"),
    "gravity along x": Cause("gravity: |model: gravity", _is_gravity, False),
    "torque 20 ms late": Cause("delay: late|model: delay", _is_delay, False),
    "rows repeated": Cause(
        "timing: repeated", _is_repeats, False, said="row repeats the one before"
    ),
    "torque x1.5": Cause("scale: gain|model: torque gain", _is_gain),
    "3 kg missing": Cause("scale: load|payload: |masses: ", _is_mass, False),
    "standstill": Cause("motion: rest at the ends", _is_standstill, False),
}  # fmt: skip


@dataclass(frozen=True)
class Judgement:
    """What a verdict makes of a trap.

    Attributes:
        named: ``first``, the number of the first right repair or reservation, or ``no``.
        by: what named it: ``repair``, ``statement``, ``notice`` (samples that were left out, said
            above the verdict, or a note that it is of no consequence, if it has none), ``refusal``,
            or nothing.
        taken: ``silently`` without any reservation, ``unnoticed`` with none that the log without a
            trap has not as well, or empty.
        repaired: whether the first repair brings the error back; None: it was not tried.
    """

    named: str
    by: str
    taken: str
    repaired: bool | None = None


def judge(trap: str, joints: list[str], outcome: Outcome, clean: Outcome) -> Judgement:
    """Judge a verdict on a log with a trap.

    Args:
        trap: its name.
        joints: that are concerned.
        outcome: of the log with the trap.
        clean: of the log without one.

    Returns:
        The judgement; of repairs where there are any, otherwise of new reservations. One that
        names the cause is new if it says something else, such as another number of rows.
    """
    cause = CAUSES[trap]
    known = [_about(one) for one in clean.reservations]
    words = [one["message"] for one in clean.reservations]
    named = {
        id(one): cause.is_named_by(one, joints) and one["message"] not in words
        for one in outcome.reservations
    }
    new = [one for one in outcome.reservations if named[id(one)] or _about(one) not in known]
    taken = "" if new or outcome.severity == "refused" or outcome.repairs else "unnoticed"
    if outcome.severity == "ok" and not outcome.repairs:
        taken = "silently"
    if outcome.repairs:
        right = [
            any(cause.is_right(edit, joints) for edit in one["repair"]["edits"])
            for one in outcome.repairs
        ]
        return Judgement(_rank(right), "repair" if any(right) else "", taken)
    if outcome.severity == "refused":
        return Judgement(
            "first" if cause.is_said_in([outcome.headline]) else "no", "refusal", taken
        )
    if cause.is_said_in(outcome.notices):
        return Judgement("first", "notice", "")
    notes = [one for one in outcome.statements if one["severity"] == "note"]
    if is_as_good(outcome, clean) and any(cause.is_named_by(one, joints) for one in notes):
        return Judgement("first", "notice", "")
    right = [named[id(one)] for one in new]
    return Judgement(_rank(right), "statement" if any(right) else "", taken)


def is_as_good(outcome: Outcome, clean: Outcome) -> bool:
    """Whether the held-out error is that of the log without a trap, to a few percent."""
    if outcome.held_out is None or clean.held_out is None:
        return False
    return outcome.held_out <= AS_GOOD * clean.held_out


def _about(statement: Mapping[str, str]) -> tuple[str, str, str, str]:
    return tuple(statement[key] for key in ("severity", "topic", "kind", "subject"))  # type: ignore[return-value]


def _rank(right: list[bool]) -> str:
    if not any(right):
        return "no"
    first = right.index(True)
    return "first" if first == 0 else str(first + 1)
