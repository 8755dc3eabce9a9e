"""Descriptions that somebody who does not know of the loops would write.

Each has one joint for each motor, in the order of the log; lengths, limits and gravity are right.
`exact` ones are not wrong: their torques are those of the mechanism with other parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pivident.robot.description import Robot
from pivident.robot.modified_dh import parse_modified_dh

#: Positions and torques, shape (samples, joints) each, from positions and torques.
Reading = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Forced:
    """A description forced on a mechanism.

    Attributes:
        mechanism: in the gallery.
        name: of the description.
        what: what it assumes.
        text: the robot file.
        exact: whether its torques are those of the mechanism.
        ratio: positions of the model over those of the log, shape (joints,); None: ones.
        reading: positions and torques of the model from those of the log, where they are converted
            otherwise; the law of the machine is then not known in the model's coordinates.
    """

    mechanism: str
    name: str
    what: str
    text: str
    exact: bool = False
    ratio: tuple[float, ...] | None = None
    reading: Reading | None = None

    @property
    def robot(self) -> Robot:
        """The robot as described."""
        return parse_modified_dh(f'name = "{self.name}"\n{self.text}', self.name)


_TURNTABLE = """
units = "degrees"
gravity = "-z"
[[joints]]
name = "turntable"
parent = "base"
position_limits = [-170, 170]
rated_speed = 120
torque_limit = 2500
"""

_LOWER = """
[[joints]]
name = "lower_arm"
parent = "turntable"
alpha = 90
b = 0.8
d = 0.35
position_limits = [45, 130]
rated_speed = 110
torque_limit = 4000
"""

_UPPER_LIMITS = """position_limits = [145, 205]
rated_speed = 115
torque_limit = 4000
"""

_TOOL = """
[[joints]]
name = "tool"
parent = "{parent}"
alpha = 90
d = {d}
r = 0.1
position_limits = [-300, 300]
rated_speed = 300
torque_limit = 300
"""

_LEVER = """
[[joints]]
name = "lever"
parent = "turntable"
alpha = 90
b = 0.8
d = 0.35
"""

_PASSIVE_UPPER = """
[[joints]]
name = "upper_arm"
parent = "lower_arm"
passive = true
d = 1.0
"""

_UPPER_GEAR = """
[[gears]]
name = "upper_arm"
ratios = {upper_arm = 1, lower_arm = 1, lever = -1}
offset = -180
"""


def _angles_converted(q: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The third angle counted from the lower arm, the torques as they were logged."""
    q = q.copy()
    q[:, 2] += 0.5 * np.pi - q[:, 1]
    return q, tau


def _all_converted(q: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The torques too."""
    tau = tau.copy()
    tau[:, 1] += tau[:, 2]
    return _angles_converted(q, tau)


_RELATIVE = (
    _TURNTABLE
    + _LOWER
    + '\n[[joints]]\nname = "upper_arm"\nparent = "lower_arm"\nd = 1.0\ntheta = -270\n'
)

_PALLETIZER = (
    Forced(
        "parallelogram_palletizer",
        "relative angle",
        "the third motor turns the upper arm relative to the lower arm",
        _RELATIVE + _UPPER_LIMITS + _TOOL.format(parent="upper_arm", d=1.3),
    ),
    Forced(
        "parallelogram_palletizer",
        "relative angle, converted",
        "as before, with the angle counted from the lower arm and the torques as logged",
        _RELATIVE + "rated_speed = 115\n" + _TOOL.format(parent="upper_arm", d=1.3),
        reading=_angles_converted,
    ),
    Forced(
        "parallelogram_palletizer",
        "relative angle, all converted",
        "as before, torques converted too; rotor and friction of the third motor are not",
        _RELATIVE + "rated_speed = 115\n" + _TOOL.format(parent="upper_arm", d=1.3),
        reading=_all_converted,
    ),
    Forced(
        "parallelogram_palletizer",
        "two arms",
        "lower and upper arm side by side on the turntable",
        _TURNTABLE + _LOWER + _LEVER + _UPPER_LIMITS + _TOOL.format(parent="lever", d=-1.3),
    ),
    Forced(
        "parallelogram_palletizer",
        "absolute angle",
        "the third motor turns the upper arm relative to the turntable, the wrist tilts",
        _TURNTABLE
        + _LOWER
        + _LEVER
        + _UPPER_LIMITS
        + "body = false\n"
        + _PASSIVE_UPPER
        + _TOOL.format(parent="upper_arm", d=1.3)
        + _UPPER_GEAR,
    ),
    Forced(
        "parallelogram_palletizer",
        "absolute angle, level wrist",
        "as before, and the wrist is kept level; the rods weigh nothing",
        _TURNTABLE
        + _LOWER
        + _LEVER
        + _UPPER_LIMITS
        + "body = false\n"
        + _PASSIVE_UPPER
        + '\n[[joints]]\nname = "wrist"\nparent = "upper_arm"\npassive = true\nd = 1.1\n'
        + _TOOL.format(parent="wrist", d=0.2)
        + _UPPER_GEAR
        + '\n[[gears]]\nname = "wrist"\nratios = {wrist = 1, lever = 1}\noffset = 180\n',
        exact=True,
    ),
)

_PLANAR = 'units = "degrees"\ngravity = "-y"\n'

_LEFT = """
[[joints]]
name = "left"
parent = "base"
position_limits = [105, 175]
rated_speed = 360
torque_limit = 60
"""

_RIGHT = """
[[joints]]
name = "right"
parent = "{parent}"
theta = 0
d = {d}
position_limits = [5, 75]
rated_speed = 360
torque_limit = 60
"""

_FIVE_BAR = (
    Forced(
        "five_bar",
        "two arms",
        "each motor turns an arm of its own",
        _PLANAR + _LEFT + _RIGHT.format(parent="base", d=0.25),
    ),
    Forced(
        "five_bar",
        "serial arm",
        "the second motor sits on the first arm",
        _PLANAR + _LEFT + _RIGHT.format(parent="left", d=0.3),
    ),
    Forced(
        "five_bar",
        "absolute angle",
        "the second motor turns a rod on the first arm relative to the base",
        _PLANAR
        + _LEFT
        + _RIGHT.format(parent="base", d=0.25)
        + 'body = false\n\n[[joints]]\nname = "rod"\nparent = "left"\npassive = true\nd = 0.3\n'
        + '\n[[gears]]\nname = "rod"\nratios = {rod = 1, left = 1, right = -1}\n',
    ),
)

_DELTA_ARM = """
[[joints]]
name = "motor_{number}"
parent = "base"
gamma = {turned}
alpha = 90
d = 0.2
position_limits = [-70, 20]
rated_speed = 600
torque_limit = 40
"""

_DELTA = (
    Forced(
        "delta",
        "three arms",
        "each motor turns an arm of its own, with or without a third of the platform",
        'units = "degrees"\ngravity = "-z"\n'
        + "".join(
            _DELTA_ARM.format(number=k + 1, turned=turned) for k, turned in enumerate((0, 120, 240))
        ),
    ),
)

_SLIDE = """
[[joints]]
name = "slide_{axis}"
parent = "{parent}"
kind = "prismatic"
gamma = {gamma}
alpha = {alpha}
position_limits = [-0.08, 0.08]
rated_speed = 1.2
torque_limit = 600
"""

_ORTHOGLIDE = (
    Forced(
        "orthoglide",
        "three slides",
        "each motor moves a slide of its own",
        'units = "degrees"\ngravity = "-z"\n'
        + _SLIDE.format(axis="x", parent="base", gamma=90, alpha=90)
        + _SLIDE.format(axis="y", parent="base", gamma=180, alpha=90)
        + _SLIDE.format(axis="z", parent="base", gamma=0, alpha=0),
    ),
)

_ARM = """
units = "degrees"
gravity = "-z"
[[joints]]
name = "shoulder"
parent = "base"
position_limits = [-130, 130]
rated_speed = 450
torque_limit = 120

[[joints]]
name = "elbow"
d = 0.325
position_limits = [-145, 145]
rated_speed = 700
torque_limit = 60
"""

_LEAD = 0.02 / (2.0 * np.pi)

_SCARA = (
    Forced(
        "scara",
        "no coupling",
        "the screw lifts the quill, the spline turns it, and neither does both",
        _ARM
        + '\n[[joints]]\nname = "screw_nut"\nparent = "elbow"\nkind = "prismatic"\nd = 0.225\n'
        + "position_limits = [-0.1, 0.1]\nrated_speed = 0.4\ntorque_limit = 628\n"
        + '\n[[joints]]\nname = "spline_nut"\nparent = "screw_nut"\n'
        + "position_limits = [-360, 360]\nrated_speed = 2000\ntorque_limit = 6\n",
        ratio=(1.0, 1.0, _LEAD, 1.0),
    ),
)

FORCED = (*_PALLETIZER, *_FIVE_BAR, *_DELTA, *_ORTHOGLIDE, *_SCARA)
