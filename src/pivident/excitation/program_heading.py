"""What every robot program says before it moves anything, in comments.

Names of joints and robots come from files of strangers. In comments and in YAML they stand between
quotation marks, with every other character than printable ASCII escaped, so that none ends a
comment or a text; identifiers are never made of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap

import numpy as np

from pivident.excitation.design import Design, LimitUse
from pivident.text.numbers import format_exact, percent
from pivident.version import __version__

#: What a controller decides in moves between postures.
PLANNED = (
    "The controller plans the moves: accelerations, jerks and torques are not those of the design."
)

#: How remarks begin that name what was not checked.
UNCHECKED = "Not checked"

#: Width of a comment, in characters.
WIDTH = 96

#: Longest name in a comment, in characters.
MAX_NAME = 60


def heading(design: Design, language: str, units: str, pace: float | None = None) -> Iterator[str]:
    """What every program says before it moves anything, one line each.

    Args:
        design: the design.
        language: of the program.
        units: of the positions.
        pace: its speed over that of the design; None where the pendant's override sets it.
    """
    motion = design.motion
    yield f"{language}, written by pivident {__version__}."
    yield (
        f"Exciting motion of {_shortened(design.robot.name)}: kind {motion.kind}, "
        f"{format_exact(motion.duration)} s."
    )
    careful = "with a hand on the stop and nobody in reach."
    if pace is None:
        yield f"RUN IT SLOWLY FIRST (override 10 %), {careful}"
    elif pace == 1.0:
        yield f"RUN THE SLOW PROGRAM FIRST, {careful}"
    else:
        yield f"{100 * pace:.0f} % OF THE DESIGNED SPEED, for a first run, {careful}"
        yield "A record of it determines less than one of the motion at its own speed."
    yield "The way to the start is not checked: bring the robot near it by hand before."
    yield from _checked(design)
    yield f"Joints of the robot description, in this order, in {units}:"
    for k, joint in enumerate(design.robot.joints, start=1):
        uses = [
            f"{quantity} {percent(100.0 * largest.share)} of its limit"
            for quantity in ("speed", "torque")
            if (largest := _largest(design, joint.name, quantity)) is not None
        ]
        yield f"  {k}: {_shortened(joint.name)}{', ' if uses else ''}{', '.join(uses)}"


def _checked(design: Design) -> Iterator[str]:
    """Which distances the design has checked, and which not."""
    if not design.clearances:
        yield "COLLISIONS WERE NOT CHECKED, neither of the arm with itself nor with anything else."
        return
    things = ", ".join(_shortened(own.name) for own in design.obstacles) or "no obstacles"
    yield f"Checked: {len(design.clearances)} distances, with {things}; see design.html."
    for note in design.notes:
        if note.startswith(UNCHECKED):
            yield from (f"  {line}" for line in wrap(quoted(note)[1:-1], WIDTH))


def _largest(design: Design, joint: str, quantity: str) -> LimitUse | None:
    """The use of a joint's limit that is known; None without one."""
    uses = [u for u in design.limits if (u.joint, u.quantity) == (joint, quantity)]
    return max((u for u in uses if np.isfinite(u.share)), key=lambda u: u.share, default=None)


def typed_warning(axes: str) -> Iterator[str]:
    """Lines about axes that a controller counts differently, and plans by itself.

    Args:
        axes: their names on the controller.
    """
    yield f"Joint k of the description is written as axis k; {axes} may have another zero and"
    yield "another sign than the description: compare both at one posture before it moves."
    yield PLANNED


def si_units(design: Design) -> str:
    """Units of the positions, such as ``rad and m``.

    Args:
        design: the design.
    """
    kinds = {joint.position_unit: None for joint in design.robot.joints}
    return " and ".join(kinds)


def quoted(name: str) -> str:
    """A name between quotation marks, as YAML and Python read it, in printable ASCII.

    Args:
        name: any text.
    """
    plain = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{"".join(c if " " <= c <= "~" else _escape(ord(c)) for c in plain)}"'


def _escape(code: int) -> str:
    r"""A character by its number: ``\xe4``, ``\u2028`` or ``\U0001f600``."""
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _shortened(name: str) -> str:
    """A name for a comment, quoted."""
    return quoted(name if len(name) <= MAX_NAME else f"{name[:MAX_NAME]}...")
