"""Texts that say why a parameter heads no group."""

from __future__ import annotations

from pivident.robot.description import INERTIAL, JointKind

_ON_THE_AXIS = "lies on the axis: it acts as part of the link before"
_NEVER_ACROSS = "the link never turns about a direction across its axis"
_DIFFERENCE = "only xx - yy is felt here; equal xx and yy act as part of the link before"
_NOT_ACCELERATED = "neither motion nor gravity accelerates the link across its axis"
_CROSSING = "all axes before cross this axis in one point: felt only as inertia about it"
_SLIDES = "does not change with the slide: it acts as part of the link before"
_NEVER_ACROSS_SLIDE = "the link never turns about a direction across its slide"
_ONE_DIRECTION = "moments along the one direction that the link turns about are not felt here"


def reasons_by_stem(kind: JointKind, turns_across: bool, crossing: bool) -> dict[str, str]:
    """The rule that keeps a parameter from heading a group, by stem.

    ``crossing``: all axes before cross this one in one point, and gravity does not act on its first
    moments.
    """
    if kind == "prismatic":
        words = dict.fromkeys(INERTIAL[:6], _SLIDES)
        along = _ONE_DIRECTION if turns_across else _NEVER_ACROSS_SLIDE
        words |= dict.fromkeys(("mx", "my", "mz"), along)
        return words | {"ia": "moves like m: only their sum is felt"}
    words = dict.fromkeys(INERTIAL[:6], _NEVER_ACROSS)
    if turns_across:
        words["yy"] = _DIFFERENCE
    words |= dict.fromkeys(("mx", "my"), _CROSSING if crossing else _NOT_ACCELERATED)
    words |= dict.fromkeys(("mz", "m"), _ON_THE_AXIS)
    return words | {"ia": "turns like zz: only their sum is felt"}
