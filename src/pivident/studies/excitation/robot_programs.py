"""A motion as programs of robots, with their headings: ROS 2, URScript, KUKA KRL, ABB RAPID.

What every robot program says before it moves anything, in comments.

Names of joints and robots come from files of strangers. In comments and in YAML they stand between
quotation marks, with every other character than printable ASCII escaped, so that none ends a
comment or a text; identifiers are never made of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from textwrap import wrap

import numpy as np

from pivident.foundation.text.numbers import format_exact, percent
from pivident.foundation.version import __version__
from pivident.studies.excitation.design import Design, LimitUse, pendant_positions, posture_moves
from pivident.studies.excitation.motions import DWELL

#: Points of a ROS trajectory per second, at least: the controller interpolates by quintic
#: polynomials, which follow those of the motion exactly between its breakpoints.
ROS_RATE = 50.0
#: Speed of the slow programs, as a share of the design's: for a first run, with all clearances.
SLOW = 0.25
#: Time that a ROS controller has to bring the robot to the start [s].
LEAD_IN = 5.0
#: Setpoints per second of URScript: the cycle of CB controllers, every fourth one of e-Series.
UR_RATE = 125.0
#: Look-ahead time [s] and gain with which URScript follows setpoints.
UR_LOOKAHEAD, UR_GAIN = 0.05, 300
#: Acceleration [rad/s²] and speed [rad/s] with which URScript goes to the start.
UR_APPROACH = (0.5, 0.25)
#: Speed where the rated ones are unknown [%], and of the way to the start.
CAREFUL = 10
#: Speeds with which RAPID goes to the start: of the tool [mm/s], of its orientation [deg/s], and of
#: external axes likewise.
ABB_APPROACH = "[50,15,50,15]"
#: Name of the program on the controller.
PROGRAM = "pivident_motion"
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


@dataclass(frozen=True)
class RobotProgram:
    """A program for a robot.

    Attributes:
        name: of its file.
        words: what it is, such as ``URScript of Universal Robots``.
        text: the program.
    """

    name: str
    words: str
    text: str


def robot_programs(design: Design) -> tuple[RobotProgram, ...]:
    """The programs that can run the motion of a design.

    Args:
        design: the design.

    Returns:
        One program for each controller that can run it; `unwritten_programs` names the
        others.
    """
    return tuple(
        RobotProgram(name, words, write(design))
        for name, words, obstacle, write in _KINDS
        if not obstacle(design)
    )


def unwritten_programs(design: Design) -> tuple[str, ...]:
    """Programs that cannot run the motion of a design, and why: one sentence each.

    Args:
        design: the design.
    """
    return tuple(
        f"No {words} was written: {reason}."
        for _, words, obstacle, _ in _KINDS
        if (reason := obstacle(design))
    )


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
    return " and ".join({joint.position_unit: None for joint in design.robot.joints})


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


def ros_trajectory(design: Design, pace: float = 1.0) -> str:
    """The motion as a ``trajectory_msgs/msg/JointTrajectory`` in YAML.

    The first point is the start of the motion, `LEAD_IN` seconds after the controller receives
    the trajectory; the last one is at rest.
    """
    t = _ros_times(design)
    lines = [
        f"# {line}"
        for line in (
            *heading(design, "ROS 2 trajectory_msgs/msg/JointTrajectory", si_units(design), pace),
            "Signs and zeros are those of the robot description.",
            f"The controller has {LEAD_IN:g} s to reach the start; move the robot there before.",
            f"ros2 topic pub --once --yaml-file {_file('trajectory.yaml', pace)} TOPIC "
            "trajectory_msgs/msg/JointTrajectory",
            "An older ros2 without --yaml-file: load this file in a node and publish the message.",
        )
    ]
    lines += ["header:", "  stamp: {sec: 0, nanosec: 0}", '  frame_id: ""', "joint_names:"]
    lines += [f"  - {quoted(name)}" for name in design.robot.joint_names]
    lines.append("points:")
    for instant, (q, dq, ddq) in zip(t, design.motion.at(t)[:3].swapaxes(0, 1), strict=True):
        sec, nanosec = divmod(round((LEAD_IN + instant / pace) * 1e9), 10**9)
        lines += [
            f"  - positions: {_list(q, 9)}",
            f"    velocities: {_list(pace * dq, 9)}",
            f"    accelerations: {_list(pace**2 * ddq, 9)}",
            "    effort: []",
            f"    time_from_start: {{sec: {sec}, nanosec: {nanosec}}}",
        ]
    return "\n".join(lines) + "\n"


def _ros_times(design: Design) -> np.ndarray:
    """Breakpoints of the motion and equidistant instants between them, shape (points,) [s]."""
    family = design.motion.family
    ends = [
        np.linspace(a, b, 1 + int(np.ceil((b - a) * ROS_RATE - 1e-9)))[:-1]
        for a, b in pairwise(family.breakpoints)
        if b - a > 1e-9
    ]
    one = np.concatenate(ends)
    rounds = family.duration * np.arange(family.rounds)[:, None]
    return np.append((rounds + one).ravel(), design.motion.duration)


def ur_script(design: Design, pace: float = 1.0) -> str:
    """The motion as URScript: moves between postures, else a stream of setpoints."""
    motion, (a, v) = design.motion, UR_APPROACH
    comments = [
        *heading(design, "URScript", si_units(design), pace),
        "The speed slider stays at 100 %: below it the arm leaves a stream of setpoints.",
        "Robot joints: base, shoulder, elbow, wrist 1, wrist 2, wrist 3. Compare signs and zeros",
        "of the description with those of the pendant at one posture before anything else.",
    ]
    body = [f"movej({_list(motion.start, 6)}, a={a:g}, v={v:g})", "sleep(1.0)"]
    if motion.kind == "postures":
        comments.append(PLANNED)
        for move in posture_moves(design)[1:]:
            body += [
                f"movej({_list(move.q, 6)}, t={move.duration / pace:.4f})",
                f"sleep({DWELL:g})",
            ]
    else:
        comments.append(
            f"servoj smooths and delays the setpoints: look-ahead {UR_LOOKAHEAD:g} s, gain "
            f"{UR_GAIN}; record target_q, the reference that the joints are given."
        )
        settings = f"0, 0, {1.0 / UR_RATE / pace:g}, {UR_LOOKAHEAD:g}, {UR_GAIN}"
        q, _, _ = motion.sampled(UR_RATE)
        body += [*(f"servoj({_list(row, 6)}, {settings})" for row in q), "stopj(2.0)"]
    name = _file(PROGRAM, pace)
    lines = [f"def {name}():", *(f"  # {line}" for line in comments)]
    return "\n".join([*lines, *(f"  {line}" for line in body), "end", ""])


def krl(design: Design) -> str:
    """The postures as KUKA KRL; the controller plans each move at its share of the rated speed."""
    lines = [f"DEF {PROGRAM} ( )"]
    lines += [
        *(f"; - {line}" for line in heading(design, "KUKA KRL", "deg")),
        *(f"; - {line}" for line in typed_warning("A1 to A6 of the KUKA")),
        "; - Durations are not those of the design either.",
    ]
    known = np.isfinite(design.robot.rated_speeds).all()
    lines.append(
        "; - VEL_PTP is a share of the rated speeds of the description; compare them with yours."
        if known
        else f"; - Rated speeds are unknown: every move is made at {CAREFUL} % of the axes' speeds."
    )
    lines.append("BAS (#INITMOV,0)")
    for move in posture_moves(design):
        axes = pendant_positions(design, move.q)
        aim = ",".join(f"A{k} {x:.4f}" for k, x in enumerate(axes, start=1))
        lines += [f"BAS (#VEL_PTP,{_speed_percent(move.speed_share)})", f"PTP {{{aim}}}"]
        lines.append(f"WAIT SEC {1.0 if move.number == 1 else DWELL:g}")
    return "\n".join([*lines, "END", ""])


def rapid(design: Design) -> str:
    """The postures as ABB RAPID, each move in the time of the design."""
    lines = [f"MODULE {PROGRAM}"]
    lines += [
        *(f"  ! {line}" for line in heading(design, "ABB RAPID", "deg")),
        *(f"  ! {line}" for line in typed_warning("rax_1 to rax_6 of the ABB")),
        "  ! Declare the tool that is mounted in place of tool0.",
        f"  PROC run_{PROGRAM}()",
    ]
    for move in posture_moves(design):
        axes = pendant_positions(design, move.q)
        aim = f"[[{','.join(f'{x:.4f}' for x in axes)}],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        if move.number == 1:
            lines += [f"    MoveAbsJ {aim},{ABB_APPROACH},fine,tool0;", "    WaitTime 1;"]
            continue
        lines += [
            f"    MoveAbsJ {aim},v1000\\T:={move.duration:.4f},fine,tool0;",
            f"    WaitTime {DWELL:g};",
        ]
    return "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])


def _no_obstacle(design: Design) -> str:
    return ""


def _no_ur(design: Design) -> str:
    """Why a robot cannot be one of Universal Robots; empty where it can."""
    kinds = [joint.kind for joint in design.robot.joints]
    if kinds == ["revolute"] * 6 and design.robot.is_chain:
        return ""
    return f"it needs a chain of six revolute joints, and this robot has {_joints_of(design)}"


def _no_abb(design: Design) -> str:
    """Why the postures are not those of six axes of ABB; empty where they are."""
    if design.robot.size != 6:
        return f"it needs six revolute joints, and this robot has {_joints_of(design)}"
    return _no_pendant(design)


def _no_pendant(design: Design) -> str:
    """Why a list of postures for six axes cannot be made; empty where it can."""
    kinds = [joint.kind for joint in design.robot.joints]
    if len(kinds) > 6 or set(kinds) != {"revolute"}:
        return f"it needs up to six revolute joints, and this robot has {_joints_of(design)}"
    if design.motion.kind != "postures":
        return (
            f"it moves from posture to posture, and this motion is of the kind "
            f"{design.motion.kind!r}; design one of the kind 'postures'"
        )
    return ""


def _file(name: str, pace: float) -> str:
    """A name, with ``_slow`` before its ending for a slow pace."""
    stem, dot, ending = name.partition(".")
    return f"{stem}{'_slow' if pace < 1.0 else ''}{dot}{ending}"


#: File, words, why a design cannot be written (empty where it can), and who writes it.
_KINDS: tuple[
    tuple[str, str, Callable[[Design], str], Callable[[Design], str]],
    ...,
] = (
    ("trajectory.yaml", "trajectory for ROS 2 controllers", _no_obstacle, ros_trajectory),
    (
        _file("trajectory.yaml", SLOW),
        f"the same at {100 * SLOW:.0f} % of the speed, for a first run",
        _no_obstacle,
        partial(ros_trajectory, pace=SLOW),
    ),
    (f"{PROGRAM}.script", "URScript of Universal Robots", _no_ur, ur_script),
    (
        _file(f"{PROGRAM}.script", SLOW),
        f"slow URScript at {100 * SLOW:.0f} % of the speed, for a first run",
        _no_ur,
        partial(ur_script, pace=SLOW),
    ),
    (f"{PROGRAM}.src", "KRL program of KUKA", _no_pendant, krl),
    (f"{PROGRAM}.mod", "RAPID program of ABB", _no_abb, rapid),
)
#: Names of all files that `robot_programs` may write.
PROGRAM_FILES = tuple(name for name, *_ in _KINDS)


def _joints_of(design: Design) -> str:
    """How many joints of which kind, in words."""
    kinds = [joint.kind for joint in design.robot.joints]
    counted = [f"{kinds.count(k)} {k}" for k in ("revolute", "prismatic") if k in kinds]
    return f"{' and '.join(counted)} joint{'s' if len(kinds) > 1 else ''}"


def _speed_percent(share: float) -> int:
    """A share of the speed as whole percent, 1 to 100; careful where it is unknown."""
    return CAREFUL if np.isnan(share) else int(np.clip(np.ceil(100.0 * share), 1, 100))


def _list(values: Sequence[float] | np.ndarray, decimals: int) -> str:
    """Numbers in brackets, always with a decimal point: YAML takes 1e-05 for a text."""
    return f"[{', '.join(f'{x + 0.0:.{decimals}f}' for x in np.round(values, decimals))}]"
