"""What a column holds, and how sure it is, by its name: ``actual_qd_0``, ``J1 (deg)``, ``I_A1``.

The vocabulary of all that reads names of columns stands here. Plain words are trusted in the name
of a single column, as an audit or a check of an experiment file meets it; the others only where
`pivident.data.logs.recognition.log_clock` has found columns that differ in the joint alone.

How sure it is what a column, a clock or a unit was taken for.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

#: Words that name a quantity wherever they stand.
PLAIN_QUANTITIES = {
    "q": "q qm pos position positions theta angle pfbk",
    "dq": "dq qdot vel velocity velocities speed omega vfbk",
    "ddq": "ddq qddot acc accel acceleration",
    "tau": "tau torque torques effort efforts trq force",
    "current": "current curr",
}
#: Words that do so too; one alone may mean something else, a column for each joint does not.
OTHER_QUANTITIES = {
    "q": "θ angles encoder encoders enc jointangle jpos lage winkel",
    "dq": "qd qp speeds ω dtheta dpos jvel",
    "ddq": "qdd accelerations",
    "tau": "τ moment moments forces drehmoment",
    "current": "currents i iq amp amps ampere strom",
}
#: Words of a reference: what the controller was commanded. The first line wherever they stand.
PLAIN_REFERENCE = set("ref reference des desired cmd command target setpoint r".split())
REFERENCE = PLAIN_REFERENCE | set(
    "cmds commands commanded targets setpoints set sp soll goal demand demanded d planned".split()
)
#: Words of a measurement. The first line wherever they stand.
PLAIN_MEASURED = set("measured meas actual act".split())
MEASURED = PLAIN_MEASURED | set("msr fbk feedback ist state states".split())
#: Words of things that are no joint signal, or not the one that is looked for.
FOREIGN = set(
    "tcp tool pose cartesian cart ee flange temperature temperatures temp temps voltage error"
    " errors err following ext external std min max limit limits status mode digital analog"
    " accelerometer diff deviation variance covariance wrench friction gravity coriolis momentum"
    " payload power io quat orientation euler imu odom odometry safety scaling".split()
)
#: Words of a temperature, and of things that are warm besides a motor.
TEMPERATURE = set("temperature temperatures temp temps".split())
OTHER_TEMPERATURE = set("core board cpu ambient room air tool gripper imu".split())
#: Words that say nothing about quantity or joint. The first line wherever they stand.
PLAIN_FILLING = set("joint j axis motor link".split())
FILLING = PLAIN_FILLING | set("joints axes jnt a robot data value values column actuator".split())
#: Units as people write them after a name, with the quantity that they imply.
UNITS: dict[str, tuple[str, str]] = {
    "deg": ("deg", "q"), "degs": ("deg", "q"), "degree": ("deg", "q"), "degrees": ("deg", "q"),
    "°": ("deg", "q"), "rad": ("rad", "q"), "rads": ("rad", "q"), "radian": ("rad", "q"),
    "radians": ("rad", "q"), "rev": ("rev", "q"), "mm": ("mm", "q"), "m": ("m", "q"),
    "deg/s": ("deg/s", "dq"), "°/s": ("deg/s", "dq"), "rad/s": ("rad/s", "dq"),
    "m/s": ("m/s", "dq"), "mm/s": ("mm/s", "dq"), "rpm": ("rpm", "dq"), "1/min": ("rpm", "dq"),
    "deg/s^2": ("deg/s^2", "ddq"), "rad/s^2": ("rad/s^2", "ddq"), "rad/s²": ("rad/s^2", "ddq"),
    "nm": ("N m", "tau"), "n m": ("N m", "tau"), "n*m": ("N m", "tau"), "n·m": ("N m", "tau"),
    "n.m": ("N m", "tau"), "mnm": ("mN m", "tau"), "n": ("N", "tau"),
    "kn": ("kN", "tau"), "a": ("A", "current"), "amp": ("A", "current"),
    "ma": ("mA", "current"), "v": ("V", "tau"),
}  # fmt: skip
#: Words that name the unit of time stamps.
TIME_UNITS: dict[str, set[str]] = {
    "s": {"s", "sec", "secs", "seconds", "second"},
    "ms": {"ms", "msec", "msecs", "milliseconds", "millis"},
    "us": {"us", "µs", "usec", "usecs", "microseconds", "micros"},
    "ns": {"ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds", "nanos"},
}
#: Words of a column that holds time stamps.
TIME_WORDS = set("t time timestamp stamp clock rosbagtimestamp ts zeit uptime".split()).union(
    *TIME_UNITS.values()
)
#: Units that stand as a word of their own, without brackets around them.
BARE_UNITS = {"deg", "degs", "degree", "degrees", "rad", "rads", "nm", "mnm", "mm", "rpm", "°"}
#: Words of a name that mean a unit where the quantity is known, which ``deg`` alone does not.
UNIT_WORDS: dict[str, dict[str, set[str]]] = {
    "angle": {
        "deg": {"deg", "degs", "degree", "degrees"},
        "rad": {"rad", "radian", "radians"},
        "mm": {"mm", "millimetre", "millimeter"},
        "counts": {"counts", "count", "ticks", "inc", "increments"},
        "rev": {"rev", "revs", "turns"},
    },
    "speed": {
        "deg/s": {"deg", "degs", "dps", "degrees"},
        "rad/s": {"rad", "rads"},
        "rpm": {"rpm"},
        "mm/s": {"mm", "mms"},
    },
    "torque": {
        "N m": {"nm"},
        "mN m": {"mnm"},
        "A": {"a", "amp", "amps", "ampere", "current", "currents", "curr", "iq"},
        "mA": {"ma", "milliamp", "milliamps"},
        "V": {"v", "volt", "volts", "voltage"},
    },
    "time": {unit: words for unit, words in TIME_UNITS.items() if unit != "s"},
}
_CHANNELS = {
    word: key
    for quantities in (PLAIN_QUANTITIES, OTHER_QUANTITIES)
    for key, words in quantities.items()
    for word in words.split()
}
_MEANT = REFERENCE | MEASURED | FILLING | BARE_UNITS | set(_CHANNELS) | {"dot"}
_ENDINGS = {word for word in REFERENCE | MEASURED if len(word) > 2}
_BRACKETS = re.compile(
    r"[(\[{<]\s*([^\W\d_][^()\[\]{}<>]{0,8}|°[^()\[\]{}<>]{0,4}|1/min)\s*[)\]}>]"
)
_HUMPS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_WORD = re.compile(r"[^\W\d_]+|\d+|°")
#: ``certain``: the log or the robot says so. ``likely``: all that was seen agrees. ``assumed``:
#: something else is possible.
Sureness = Literal["certain", "likely", "assumed"]


@dataclass(frozen=True)
class Reading:
    """What the words of a name say."""

    channel: str | None  # ``q``, ``tau_ref``, …; None for no quantity or no joint signal
    unit: str | None  # unit written beside the name, or None
    measured: int = 0  # 1: called a measurement, 0: not, -1: has unknown words
    foreign: bool = False  # whether it is something else than a joint signal
    strange: tuple[str, ...] = ()  # words of no known meaning, such as that of one of two arms


def words_of(name: str) -> list[str]:
    """The words and numbers of a name in small letters: ``axis_1.actPos`` → axis, 1, act, pos.

    What is written in one is taken apart where both parts are known: ``qref`` → q, ref.
    """
    words = [word.lower() for word in _WORD.findall(_HUMPS.sub(" ", name))]
    return [part for word in words for part in _parts(word)]


def _parts(word: str) -> tuple[str, ...]:
    """A quantity and whether it is a reference or measured, written in one; else the word."""
    if word in _MEANT or word in FOREIGN:
        return (word,)
    for k in range(1, len(word)):
        first, last = word[:k], word[k:]
        if (first in _CHANNELS and last in _ENDINGS) or (first in _ENDINGS and last in _CHANNELS):
            return first, last
    return (word,)


def without_unit(name: str) -> tuple[str, str | None, str | None]:
    """A name without the unit in brackets at its end, the unit, and the quantity it implies."""
    for found in _BRACKETS.finditer(name):
        unit = UNITS.get(found[1].strip().lower().replace("µ", "u"))
        if unit is not None:
            return name[: found.start()] + name[found.end() :], *unit
    return name, None, None


def plain_channel(name: str) -> str | None:
    """The channel of a single column by plain words alone, None for none or several.

    A current stands for a torque, and a word for a reference alone means positions.
    """
    words = set(words_of(name.lower()))
    named = {
        {"current": "tau"}.get(quantity, quantity)
        for quantity, own in PLAIN_QUANTITIES.items()
        if words & set(own.split())
    }
    (channel,) = named if len(named) == 1 else {"q"} if not named and "r" in words else {None}
    if channel is None or not words & PLAIN_REFERENCE:
        return channel
    return None if channel == "tau" else f"{channel}_ref"


def read_words(
    words: Sequence[str], unit: str | None = None, betrayed: str | None = None
) -> Reading:
    """What the words of a name say, those of the joint left out."""
    known = [word for word in words if not word.isdecimal()]
    for word in known:
        if unit is None and word in BARE_UNITS:
            unit, betrayed = UNITS[word]
    foreign = bool(FOREIGN & set(known))
    strange = tuple(word for word in known if word not in _MEANT)
    named = [_CHANNELS[word] for word in known if word in _CHANNELS]
    if "dot" in known and named and named[-1] == "q":
        named.append("dq")
    channel = named[-1] if named else betrayed
    if named and betrayed == "current" and channel == "tau":
        channel = "current"
    reference = bool(REFERENCE & set(known))
    if channel is None and reference:
        channel = "q"
    if foreign or channel is None:
        return Reading(None, unit, foreign=foreign, strange=strange)
    measured = 1 if set(known) & MEASURED else -1 if strange else 0
    return Reading(f"{channel}_ref" if reference else channel, unit, measured, strange=strange)
