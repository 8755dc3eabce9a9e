"""What a person says of the machine that was logged: how it was mounted, and what hung on it.

Words of a command line become keys of the table ``[robot]``:

    "flange 2.75 kg"                    {link = "flange", mass = 2.75}
    "wrist_3 800 g at 0, 0, 0.05"       … center_of_mass = [0.0, 0.0, 0.05], in m
    "-y", "none" or "0, 0, -9.81"       gravity
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pivident.experiment.init.assumption import Assumption, DraftError
from pivident.robot.mdh_keys import GRAVITY_BY_NAME
from pivident.robot.naming import nearest

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_BODY = re.compile(
    rf"(?P<link>\S.*?)\s+(?P<mass>{_NUMBER})\s*(?P<unit>kg|g)?(?:\s+at\s+(?P<at>.+))?"
)
_UNITS = {None: 1.0, "kg": 1.0, "g": 1e-3}


@dataclass(frozen=True)
class GivenRobot:
    """What somebody said of the machine.

    Attributes:
        gravity: a direction by its name, three numbers [m/s²], or None.
        bodies: bodies on its links, as an experiment file says them.
    """

    gravity: Any = None
    bodies: tuple[dict[str, Any], ...] = ()

    @classmethod
    def of(cls, gravity: str | None, bodies: Sequence[str]) -> GivenRobot:
        """From the words of a command line; see the head of this module."""
        return cls(
            None if gravity is None else given_gravity(gravity), tuple(map(given_body, bodies))
        )

    @property
    def keys(self) -> dict[str, Any]:
        """Keys of the table ``[robot]`` with their values."""
        keys: dict[str, Any] = {}
        if self.bodies:
            keys["bodies"] = [dict(body) for body in self.bodies]
        if self.gravity is not None:
            keys["gravity"] = self.gravity
        return keys

    def lines(self, no_gravity: str) -> list[Assumption]:
        """Their lines of a draft; ``no_gravity``: how the log shows none, or empty."""
        seen = dict.fromkeys(self.keys, "as given")
        correct = {
            "bodies": "center_of_mass [m] and inertia (xx xy xz yy yz zz about it, kg m²) may be "
            "added, in the frame of the link."
        }
        if no_gravity and "gravity" in seen:
            seen["gravity"] += f", although the log says otherwise: {no_gravity}"
            correct["gravity"] = 'Write "none" where the torques hold none.'
        return [
            Assumption("robot", key, value, "certain", seen[key], correct.get(key, ""))
            for key, value in self.keys.items()
        ]


#: Of a machine of which nobody said anything.
NOTHING_GIVEN = GivenRobot()


def given_body(text: str) -> dict[str, Any]:
    """A body on a link, from ``flange 2.75 kg at 0, 0, 0.05``."""
    found = _BODY.fullmatch(text.strip())
    if found is None:
        raise DraftError(
            f"--body {text!r} says no link and mass",
            advice='write both, such as --body "flange 2.75 kg" or "flange 2.75 kg at 0,0,0.05" '
            "with the centre of mass in m",
        )
    body: dict[str, Any] = {
        "link": found["link"], "mass": float(found["mass"]) * _UNITS[found["unit"]]
    }  # fmt: skip
    if found["at"]:
        body["center_of_mass"] = _three_numbers("--body", text, found["at"])
    return body


def given_gravity(text: str) -> Any:
    """A direction by its name, or three numbers in m/s²."""
    if text in GRAVITY_BY_NAME:
        return text
    if "," not in text:
        raise DraftError(
            f"--gravity {text!r} is no direction",
            advice=f"{nearest(text, GRAVITY_BY_NAME)}; or write three numbers in m/s², such as "
            "--gravity=0,0,-9.81",
        )
    return _three_numbers("--gravity", text, text)


def _three_numbers(option: str, whole: str, text: str) -> list[float]:
    """Three numbers between commas or blanks."""
    words = text.replace(",", " ").split()
    if len(words) != 3 or not all(re.fullmatch(_NUMBER, word) for word in words):
        raise DraftError(
            f"{option} {whole!r} does not say three numbers", advice="write them with commas"
        )
    return [float(word) for word in words]
