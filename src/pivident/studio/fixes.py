"""What a remark of the check asks for as edits of the experiment file, ready to be applied.

Where a remark gives a setting, ``Set delay = 0.0103``, that is the fix. Others follow from what was
found: a sign is reversed by a factor of -1, columns take the order that fits. A remark that leaves
open what is right has no fix.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pivident.errors import ExperimentError, PividentError
from pivident.studio.edits import changed, refuse_new_problems
from pivident.studio.fix_columns import (
    command_gain,
    fixed_columns,
    loop_gain,
    opposite_sense,
    order_of_columns,
    order_of_reference,
    order_of_torques,
    reversed_reference,
    reversed_torque,
    unit_of_time,
    unnamed_torque,
    without_joint,
    zero_position,
)
from pivident.studio.fix_settings import (
    advised,
    declared_rate,
    gap,
    long_delay,
    one_setting,
    renamed,
    superfluous,
    wrong_name,
)
from pivident.studio.remark_case import Edits, RemarkCase
from pivident.text.toml_places import Place


@dataclass(frozen=True)
class Fix:
    """One way to do what a remark asks for.

    Attributes:
        words: what is done, a sentence.
        edits: place and new value as TOML, in their order; None: removed.
    """

    words: str
    edits: Edits


Maker = Callable[[RemarkCase], Iterator[tuple[str, Edits]]]

#: Makers of fixes by topic and kind of a remark.
MAKERS: dict[tuple[str, str], tuple[Maker, ...]] = {
    ("delay", "late"): (advised,),
    ("delay", "early"): (advised,),
    ("timing", "delay"): (long_delay,),
    ("timing", "jitter"): (advised,),
    ("timing", "gap"): (gap,),
    ("timing", "rate change"): (advised,),
    ("timing", "rate"): (unit_of_time,),
    ("timing", "drift"): (declared_rate,),
    ("timing", "control rate"): (advised, superfluous("control_rate")),
    ("channels", "clipped"): (
        one_setting("saturation", '"allow"', "Accept the torques that are cut off"),
    ),
    ("channels", "constant"): (
        without_joint,
        one_setting("allow_constant", "true", "Accept joints that do not move"),
    ),
    ("motion", "standstill"): (without_joint,),
    ("order", "order"): (order_of_torques,),
    ("power", "sign"): (reversed_torque,),
    ("power", "gives energy"): (reversed_torque,),
    ("scale", "angle unit"): (advised,),
    ("scale", "side"): (advised,),
    ("scale", "gain"): (advised, command_gain),
    ("scale", "torque side"): (advised, superfluous("torque_side")),
    ("scale", "reach"): (advised,),
    ("speed", "derivative"): (fixed_columns,),
    ("geometry", "gravity"): (advised,),
    ("geometry", "zero"): (zero_position,),
    ("geometry", "sense"): (opposite_sense,),
    ("reference", "unit"): (advised, reversed_reference),
    ("reference", "order"): (order_of_reference,),
    ("columns", "unit"): (advised,),
    ("columns", "joint order"): (order_of_columns,),
    ("columns", "torque not named"): (unnamed_torque,),
    ("controller", "gravity"): (advised,),
    ("controller", "gain"): (loop_gain,),
    ("controller", "limit"): (superfluous("limit"),),
    ("recordings", "same run"): (superfluous(""),),
    ("file", "unknown key"): (renamed, superfluous("")),
    ("file", "value"): (superfluous(""),),
}


def fixes(remark: Mapping[str, Any], text: str) -> tuple[Fix, ...]:
    """Ways to do what a remark asks for, the most likely first; empty where none is definite.

    Each has been tried on the text.

    Args:
        remark: an entry of ``check.json``.
        text: the experiment file that was checked.
    """
    try:
        case = RemarkCase.of(remark, text)
    except (ExperimentError, ValueError):
        return ()
    makers = MAKERS.get((case.topic, case.kind), ())
    makers = (*makers, wrong_name) if remark.get("refused") else makers
    found: list[Fix] = []
    for maker in makers:
        for words, edits in maker(case):
            fix = Fix(words, edits)
            if all(fix.edits != other.edits for other in found) and _works(text, fix):
                found.append(fix)
    return tuple(found)


def applied(text: str, fix: Fix) -> str:
    """The text with all edits of a fix.

    Raises:
        ExperimentError: the text has changed since, so that it cannot be applied.
    """
    new = text
    for place, value in fix.edits:
        new = changed(new, place, value)
    refuse_new_problems(text, new)
    return new


def _works(text: str, fix: Fix) -> bool:
    """Whether a fix can be applied and changes something."""
    try:
        return applied(text, fix) != text
    except PividentError:
        return False


def as_json(fix: Fix) -> dict[str, Any]:
    """A fix as plain values."""
    return {"words": fix.words, "edits": [[list(place), value] for place, value in fix.edits]}


def of_json(content: Mapping[str, Any]) -> Fix:
    """A fix from `as_json`, as a page sends it back.

    Raises:
        ExperimentError: it has another form.
    """
    try:
        edits = tuple((_place(place), _value(value)) for place, value in content["edits"])
        return Fix(str(content["words"]), edits)
    except (KeyError, TypeError, ValueError):
        raise ExperimentError("this is no fix of the check; reload the page") from None


def _place(place: Any) -> Place:
    if not isinstance(place, list) or not all(isinstance(part, (str, int)) for part in place):
        raise TypeError
    return tuple(place)


def _value(value: Any) -> str | None:
    if value is not None and not isinstance(value, str):
        raise TypeError
    return value
