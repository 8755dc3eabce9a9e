"""Pieces of XML: escaped names, numbers with all their digits, a robot drawn as sticks.

A robot as sticks for display: along each link, and along its joint's axis.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.models.runnable_model import RunnableModel, link_inertias
from pivident.robot.frames import rotation_from_z_to

#: Characters that XML 1.0 cannot hold, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
#: Radius of a stick over the sum of all link lengths; axes are twice as thick.
SLENDERNESS = 0.02
#: Reach that is assumed where all joints are in one point [m].
MIN_REACH = 0.1


def quoted(name: str) -> str:
    """A name as the value of an attribute, quotes included."""
    bad = _FORBIDDEN.search(name)
    if bad:
        raise ExportError(
            f"the name {name!r} holds the character {bad[0]!r}, which XML cannot write even "
            "escaped",
            advice="rename it",
        )
    return quoteattr(name)


def number(value: float) -> str:
    """The shortest text that reads back as the same number; no negative zero."""
    if not np.isfinite(value):
        raise ExportError(
            f"a value is {value}, which robot files cannot hold", advice="identify again"
        )
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Numbers with a space between them."""
    return " ".join(number(value) for value in values)


def comment(text: str) -> str:
    """A comment; two hyphens would end it and are separated."""
    return f"<!-- {_FORBIDDEN.sub('?', text).replace('--', '- -').rstrip('-')} -->"


def unlike(name: str, taken: Iterable[str]) -> str:
    """A name that is not taken: the name itself, or with underscores added."""
    used = set(taken)
    while name in used:
        name += "_"
    return name


def distinct(
    names: Sequence[str], others: Sequence[str], reserved: Sequence[str] = ()
) -> tuple[str, ...]:
    """Names of links, each once: repeated or empty ones become ``<joint>_link``."""
    out: list[str] = []
    for name, joint in zip(names, others, strict=True):
        own = name if name and names.count(name) == 1 else f"{joint}_link"
        out.append(unlike(own, [*reserved, *out, *(names if own != name else ())]))
    return tuple(out)


def rpy(rotation: np.ndarray) -> np.ndarray:
    """Roll, pitch and yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll), accurate at pitch = ±90° too.

    The yaw is removed from R first, then roll and pitch are read from the rest; where roll and yaw
    cannot be separated, the roll compensates for any yaw.
    """
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    pitch = np.arctan2(-rest[2, 0], rest[0, 0])
    roll = np.arctan2(-rest[1, 2], rest[1, 1])
    return np.array([roll, pitch, yaw])


@dataclass(frozen=True, eq=False)
class Stick:
    """A straight stick in the frame of its link."""

    start: np.ndarray  # [m], shape (3,)
    end: np.ndarray  # [m], shape (3,)
    radius: float  # [m]

    def cylinder(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Centre [m], roll pitch yaw [rad] and length [m] of a cylinder from end to end."""
        along = self.end - self.start
        length = float(np.linalg.norm(along))
        return 0.5 * (self.start + self.end), rpy(rotation_from_z_to(along / length)), length


def sticks(model: RunnableModel) -> dict[int, tuple[Stick, ...]]:
    """Sticks of every link by its index, -1 for the base.

    A link reaches to the joints that it carries and to where it closes loops; the last ones to
    their centre of mass.
    """
    robot, constraints = model.robot.tree, model.robot.constraints
    reach = sum(float(np.linalg.norm(joint.translation)) for joint in robot.joints)
    radius = SLENDERNESS * max(reach, MIN_REACH)
    inertia = link_inertias(model)
    found: dict[int, tuple[Stick, ...]] = {}
    for i in range(-1, robot.size):
        ends = [joint.translation for joint in robot.joints if joint.parent == i]
        for closure in constraints.closures if constraints else ():
            pairs = zip(closure.links, closure.frames, strict=True)
            ends += [frame.translation for link, frame in pairs if link == i]
        if i >= 0 and not ends and inertia[i, 9] > 0.0:
            ends = [inertia[i, 6:9] / inertia[i, 9]]
        own = [Stick(np.zeros(3), end, radius) for end in ends if np.linalg.norm(end) > radius]
        if i >= 0:
            axis = np.array([0.0, 0.0, 2.0 * radius])
            own.insert(0, Stick(-axis, axis, 2.0 * radius))
        found[i] = tuple(own)
    return found
