"""Predicted beside reached standard errors, in words and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator
from textwrap import wrap

import numpy as np

from pivident.excitation.followed_motion import FollowedMotion
from pivident.excitation.reached import ReachedErrors
from pivident.text.lists import listed
from pivident.text.numbers import format_significant
from pivident.text.plain_table import plain_table
from pivident.text.printable import escaped

#: Ratios of reached to predicted standard errors up to this, or down to its inverse, are called as
#: predicted.
AS_PREDICTED = 1.15

#: How many of the parameters that were predicted worst are named.
NAMED = 3

#: Width of a line, in characters.
WIDTH = 100

#: A motion of which this share was recorded is complete; the rest may be rest at its ends.
COMPLETE = 0.95

#: Other motion in a record is reported from this duration on [s].
MIN_OTHER = 0.5


def reached_text(found: ReachedErrors) -> str:
    """The comparison for a terminal.

    Args:
        found: predicted and reached standard errors.

    Returns:
        A heading, the table and sentences.
    """
    lines = [heading(found)]
    if found.errors:
        head, *rows = table(found)
        lines.append(
            plain_table(
                [
                    (title, "<" if k in (0, len(head) - 1) else ".", [row[k] for row in rows])
                    for k, title in enumerate(head)
                ]
            )
        )
    for sentence in sentences(found):
        lines += wrap(sentence, WIDTH)
    return escaped("\n".join(lines))


def heading(found: ReachedErrors) -> str:
    """What is compared, without a full stop.

    Args:
        found: predicted and reached standard errors.
    """
    return f"Standard errors predicted by {found.file.name} and reached by {found.method}"


def table(found: ReachedErrors) -> list[list[str]]:
    """Head and rows as text.

    Args:
        found: predicted and reached standard errors.
    """
    head = ["parameter", "σ predicted", "σ reached", "reached/predicted", "unit"]
    return [
        head,
        *(
            [
                error.name,
                format_significant(error.predicted),
                format_significant(error.reached),
                format_significant(error.ratio),
                error.unit,
            ]
            for error in found.errors
        ),
    ]


def sentences(found: ReachedErrors) -> list[str]:
    """What the comparison says: how well it was predicted, by joint, and what motion was run.

    Args:
        found: predicted and reached standard errors.
    """
    if found.reason:
        return [found.reason, *_deviations(found)]
    return [*_prediction(found), *_deviations(found)]


def _prediction(found: ReachedErrors) -> Iterator[str]:
    """How well standard errors were predicted."""
    compared = found.compared
    if compared:
        ratio, many = found.ratio, f"geometric mean of {len(compared)} parameters"
        words = f"{format_significant(ratio)} times the predicted ones, {many}"
        if ratio > AS_PREDICTED:
            yield f"The standard errors are larger than predicted: {words}."
        elif ratio < 1.0 / AS_PREDICTED:
            yield f"The standard errors are smaller than predicted: {words}."
        else:
            yield f"The standard errors are as predicted: {words}."
        if worst := [e for e in compared if e.ratio > AS_PREDICTED * max(1.0, ratio)][:NAMED]:
            named = ", ".join(f"{e.name} {format_significant(e.ratio)}" for e in worst)
            yield f"Furthest from their prediction: {named} times as large."
        by_joint = found.ratio_by_joint
        if len(by_joint) > 1:
            named = ", ".join(f"{j} {format_significant(r)}" for j, r in by_joint.items())
            yield f"By joint: {named}."
        if larger := [j for j, r in by_joint.items() if r > AS_PREDICTED]:
            yield (
                f"Noise or model error is larger than the design assumed on {listed(larger)}. "
                f"{found.noise}"
            )
        elif ratio < 1.0 / AS_PREDICTED:
            yield f"The noise is smaller than the design assumed. {found.noise}"
    else:
        yield "No parameter has both standard errors."
    new = [e.name for e in found.errors if math.isinf(e.predicted) and math.isfinite(e.reached)]
    if new:
        yield f"Estimated, although the design predicted nothing: {listed(new)}."
    if found.with_earlier:
        yield "The earlier recordings count on both sides."


def _deviations(found: ReachedErrors) -> Iterator[str]:
    """How the recorded motions differ from the designed one."""
    for followed in found.followed:
        if followed.is_same:
            yield _followed(followed)
            yield from _more_or_less(followed)


def _followed(followed: FollowedMotion) -> str:
    """That the robot ran the motion, and which joints deviate."""
    times = len(followed.starts)
    ran = "followed the design" + (f" {times} times" if times > 1 else "")
    largest = int(np.argmax(followed.share))
    if deviating := followed.deviating:
        return (
            f"{followed.recording} {ran}, but {listed(deviating)} deviate"
            f"{'s' if len(deviating) == 1 else ''}: {followed.joint_names[largest]} by "
            f"{100 * followed.share[largest]:.0f} % of the rms of its motion. What was predicted "
            "holds for the motion as designed."
        )
    return (
        f"{followed.recording} {ran}: positions differ by at most "
        f"{format_significant(100 * followed.share[largest], 2)} % of the rms of the motion "
        f"({followed.joint_names[largest]})."
    )


def _more_or_less(followed: FollowedMotion) -> Iterator[str]:
    """Parts of the motion that are missing, and motion that is not of the design."""
    if followed.covered < COMPLETE:
        yield (
            f"Only {100 * followed.covered:.0f} % of the motion was recorded, so that standard "
            "errors must be larger than predicted."
        )
    if followed.other > MIN_OTHER:
        yield (
            f"The record also holds {format_significant(followed.other)} s of other motion, which "
            "the prediction does not know of."
        )
