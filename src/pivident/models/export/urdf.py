"""Model → URDF: into the file that the robot was read from, carried bodies kept, or as a new file.

Into a file: the inertials of the identified links and damping and friction of the identified joints
are replaced, everything else is kept byte for byte. The frame of an identified link is that of the
URDF turned by the frame rule's A (`pivident.robot.urdf`), so its parameters are rotated back.

Bodies behind fixed and frozen joints, which identification adds to the link that carries them.

In the file each of them is a link of its own, so what was identified together is divided again:

- Behind *fixed* joints: the carrier has everything, the others get a mass of zero. An element with
  zeros is kept, because readers that find none invent a mass from the shapes.
- Behind *frozen* joints, which can move in the file: their nominal bodies are kept, and subtracted
  from the carrier at the frozen position. Where the rest would be physically impossible, all
  nominal bodies there are scaled down until it is possible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.foundation.text.sentences import listed
from pivident.models.export.differences import RobotFile, differences, plain_content
from pivident.models.export.joint_side import JointProperty, JointSide, joint_side
from pivident.models.export.load_back import verify_with_mujoco, verify_with_pinocchio
from pivident.models.export.urdf_new import (
    dynamics_line,
    inertial_lines,
    mimics,
    new_urdf,
    unknown_limits,
)
from pivident.models.export.xml_edit import Element, XmlText, number, numbers
from pivident.models.export_format import Format
from pivident.models.runnable_model import RunnableModel, is_possible, link_inertias
from pivident.robot.closed_chains import tree_order
from pivident.robot.description import Robot
from pivident.robot.frames import Pose, exact_angle, rotation_from_z_to
from pivident.robot.inertia import moved
from pivident.robot.naming import errors_name
from pivident.robot.refusals import without_base
from pivident.robot.urdf import DOWN, joint_motion, parse_urdf, text_digest
from pivident.robot.urdf_xml import UrdfModel, file_content, parse_model

#: Halvings of the interval in which the scale of the frozen bodies is searched.
HALVINGS = 40
#: Fraction of the largest possible scale that is used, to keep off the boundary.
CAUTION = 0.5


@dataclass(frozen=True)
class OriginalUrdf:
    """The file that inertials are written into."""

    path: Path
    content: bytes  # its text, unpacked
    notes: tuple[str, ...] = ()  # sentences for the user


def original_urdf(robot: Robot, given: Path | None, folder: Path) -> OriginalUrdf | None:
    """The robot's URDF, by its path or in the folder of the result; None if it has none.

    A ``given`` file replaces it; its joints must be the robot's.
    """
    known = robot.urdf
    if given is not None:
        content = _content(given)
        notes: tuple[str, ...] = ()
        if known is not None and text_digest(content) != known.sha256:
            notes = (
                f"{given} is not the file that was identified (SHA-256 "
                f"{text_digest(content)[:12]}… instead of {known.sha256[:12]}…); its joints are "
                "the same",
            )
        return OriginalUrdf(given, content, notes)
    if known is None or not known.path:
        return None
    places = (Path(known.path), folder / Path(known.path).name)
    present = [place for place in places if place.is_file()]
    if not present:
        raise ExportError(
            f"the URDF of the robot {robot.name!r} no longer exists, neither {places[0]} nor "
            f"{places[1]}",
            advice="give it with --robot FILE.urdf",
        )
    for place in present:
        content = _content(place)
        if text_digest(content) == known.sha256:
            return OriginalUrdf(place, content)
    raise ExportError(
        f"{present[0]} has changed since the robot was identified with it (SHA-256 "
        f"{text_digest(_content(present[0]))[:12]}… instead of {known.sha256[:12]}…)",
        advice="give the old file, or the new one by name, with --robot FILE.urdf",
    )


def _content(path: Path) -> bytes:
    with errors_name(str(path)):
        return file_content(path)


#: Joint properties of URDF.
SUPPORTED: frozenset[JointProperty] = frozenset({"damping", "dry friction"})
#: Largest difference of a frame that is still the same robot [m, or element of a rotation].
SAME_FRAME = 1e-6


def to_urdf(
    model: RunnableModel,
    original: bytes | None = None,
    *,
    frozen: Mapping[str, float] | None = None,
) -> RobotFile:
    """Write a model into the URDF that the robot was read from (gzip or not), or as a new file.

    Args:
        model: the model.
        original: the URDF that the robot was read from, gzip or not; None: a new file, with
            cylinders along the links to look at.
        frozen: positions at which joints of that file were frozen [rad or m], by name; None: as
            the robot was read.

    Returns:
        The file and the sentences that say where it differs from the model.

    Raises:
        RobotDescriptionError: the original is no URDF, or lacks a joint; names the nearest.
        ExportError: the original is another robot, or a link has no positive mass.
    """
    without_base(model.robot, "a file of URDF", "export it as JSON")
    mimics(model.robot)  # or it cannot be a URDF
    side = joint_side(model, SUPPORTED)
    sentences = [*differences(model, "URDF", SUPPORTED, side.left_out), *_gravity(model.robot)]
    if frozen is None:
        frozen = {} if model.robot.urdf is None else model.robot.urdf.frozen
    if original is None:
        content, decisions = new_urdf(model, side).encode(), unknown_limits(model.robot)
    else:
        content, decisions = _changed(model, side, plain_content(original), frozen)
    sentences += [*decisions, *_impossible(model)]
    return RobotFile(content, tuple(sentences), left_out=side.left_out, supported=SUPPORTED)


@dataclass(frozen=True, eq=False)
class Mounted:
    """A link of the file that hangs on an identified one."""

    name: str
    carrier: int  # index of the identified joint that moves it
    pose: Pose  # its frame in that of the carrier's link, as in the file
    frozen: bool  # whether a frozen joint lies between


@dataclass(frozen=True, eq=False)
class Division:
    """New inertial parameters of links in their frames of the file, and the decisions made."""

    inertia: Mapping[str, np.ndarray]  # ten by link; zeros: merged
    sentences: tuple[str, ...]  # one for each carrier


def mounted_links(
    file: UrdfModel, kept: Sequence[str], frozen: Mapping[str, float]
) -> tuple[Mounted, ...]:
    """Links that hang on identified ones behind fixed or frozen joints."""
    carried_by = {joint.child: i for i, joint in enumerate(file.joints)}
    place: dict[str, Mounted] = {}
    for i in tree_order([carried_by.get(joint.parent, -1) for joint in file.joints]):
        joint = file.joints[i]
        if joint.name in kept:
            own = Mounted(joint.child, list(kept).index(joint.name), Pose.identity(), False)
        elif joint.parent not in place:
            continue  # the base carries it
        else:
            before = place[joint.parent]
            pose = before.pose @ joint.origin @ joint_motion(joint, frozen.get(joint.name, 0.0))
            turns = before.frozen or joint.type != "fixed"
            own = Mounted(joint.child, before.carrier, pose, turns)
        place[joint.child] = own
    carriers = {joint.child for joint in file.joints if joint.name in kept}
    return tuple(m for name, m in place.items() if name not in carriers)


def divide(
    file: UrdfModel,
    kept: Sequence[str],
    frozen: Mapping[str, float],
    identified: np.ndarray,
    with_shapes: frozenset[str],
) -> Division:
    """Divide identified inertial parameters (joints, 10) among the links of the file.

    ``with_shapes`` are links with collision shapes, from which readers may invent a mass.
    """
    by_name = {joint.name: joint for joint in file.joints}
    mounted = mounted_links(file, kept, frozen)
    inertia: dict[str, np.ndarray] = {}
    sentences: list[str] = []
    for i, name in enumerate(kept):
        joint = by_name[name]
        total = moved(identified[i], rotation_from_z_to(joint.axis), np.zeros(3))
        fixed = [m for m in mounted if m.carrier == i and not m.frozen]
        merged = [m for m in fixed if file.links[m.name].any()]
        inertia |= {
            m.name: np.zeros(10) for m in fixed if file.links[m.name].any() or m.name in with_shapes
        }
        if merged:
            sentences.append(
                f"link {joint.child!r} contains the bodies behind its fixed joints, whose own "
                f"masses are zero: {', '.join(repr(m.name) for m in merged)}"
            )
        still = [m for m in mounted if m.carrier == i and m.frozen and file.links[m.name].any()]
        nominal = [moved(file.links[m.name], m.pose.rotation, m.pose.translation) for m in still]
        others = np.sum(nominal, axis=0) if still else np.zeros(10)
        scale = _largest_scale(total, others)
        if scale < 1.0:
            inertia |= {m.name: scale * file.links[m.name] for m in still}
        inertia[joint.child] = total - scale * others
        if still:
            sentences.append(_frozen_sentence(joint.child, [m.name for m in still], others, scale))
    return Division(inertia, tuple(sentences))


def _largest_scale(total: np.ndarray, others: np.ndarray) -> float:
    """1 where the total less the others is possible, else half the largest possible scale.

    A total that is impossible itself (a free estimate) is divided with the scale 1.
    """
    if is_possible(total - others) or not is_possible(total):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if is_possible(total - middle * others):
            low = middle
        else:
            high = middle
    return CAUTION * low


def _frozen_sentence(carrier: str, names: list[str], others: np.ndarray, scale: float) -> str:
    listed = ", ".join(map(repr, names))
    if scale == 1.0:
        return (
            f"from link {carrier!r} the nominal bodies behind frozen joints were subtracted, "
            f"{others[9]:.4g} kg: {listed}"
        )
    return (
        f"the nominal bodies behind frozen joints on link {carrier!r}, {others[9]:.4g} kg, were "
        f"scaled by {scale:.3g} in the file, because otherwise the rest of the identified link "
        f"would be physically impossible: {listed}"
    )


def _changed(
    model: RunnableModel, side: JointSide, original: bytes, frozen: Mapping[str, float]
) -> tuple[bytes, tuple[str, ...]]:
    """The original with new inertials and dynamics, and the decisions made."""
    kept = model.robot.tree.joint_names
    nominal = parse_urdf(original, joints=kept, frozen=frozen, source="the original URDF")
    _check_same_robot(model.robot, nominal)
    file, text = parse_model(original), XmlText(original)
    links = {e.attributes["name"]: e for e in text.root.children if e.tag == "link"}
    joints = {e.attributes["name"]: e for e in text.root.children if e.tag == "joint"}
    with_shapes = frozenset(name for name, e in links.items() if e.first("collision"))
    division = divide(file, kept, frozen, link_inertias(model), with_shapes)
    for name, inertia in division.inertia.items():
        _set_inertial(text, links[name], name, inertia)
    for i, name in enumerate(kept):
        _set_dynamics(text, joints[name], side.damping[i], side.dry_friction[i])
    sentences = list(division.sentences)
    turned = [name for name, joint in joints.items() if _written_in_full(text, joint)]
    if turned:
        sentences.append(
            f"angles that the original rounds are written in full, as identified: {listed(turned)}"
        )
    if any(
        not np.allclose(ours.inertia, theirs.inertia, rtol=1e-6, atol=1e-9)
        for ours, theirs in zip(model.robot.tree.links, nominal.tree.links, strict=True)
        if ours.inertia.any()
    ):
        sentences.append(
            "the original's nominal inertias are not those of the identified robot: bodies were "
            "mounted on it, joints were frozen at other positions, or the file has changed since"
        )
    left = [
        repr(name)
        for name, inertia in file.links.items()
        if name not in division.inertia and inertia.any() and not is_possible(inertia)
    ]
    if left:
        sentences.append(
            "the original has physically impossible bodies, which were left unchanged; MuJoCo "
            f"refuses them: {', '.join(left)}"
        )
    return text.content(), tuple(sentences)


def _check_same_robot(ours: Robot, theirs: Robot) -> None:
    """Refuse a file whose identified joints differ in kind, parent, frame or leader."""
    if not _same_followers(ours, theirs):
        raise ExportError(
            "the original URDF is another robot: its joints mimic others than in the model",
            advice="take the file that was identified",
        )
    for own, other in zip(ours.tree.joints, theirs.tree.joints, strict=True):
        if own.kind != other.kind or own.parent != other.parent:
            what = (
                "hangs on another link there"
                if own.parent != other.parent
                else f"is {other.kind} there and {own.kind} in the model"
            )
            raise ExportError(f"the original URDF is another robot: joint {own.name!r} {what}")
        shift = np.abs(own.translation - other.translation).max()
        turn = np.abs(own.rotation - other.rotation).max()
        if not max(shift, turn) <= SAME_FRAME:
            raise ExportError(
                f"the original URDF is another robot: the frame of joint {own.name!r} is "
                f"{shift:.3g} m away and turned by some {turn:.3g} rad from the model's",
                advice="take the file that was identified, or give the positions of frozen joints",
            )


def _same_followers(ours: Robot, theirs: Robot) -> bool:
    """Whether the same joints follow the same ones in the same way."""
    one, other = mimics(ours), mimics(theirs)
    return one.keys() == other.keys() and all(
        one[i].leader == other[i].leader
        and np.allclose(
            (one[i].multiplier, one[i].offset),
            (other[i].multiplier, other[i].offset),
            rtol=SAME_FRAME,
            atol=SAME_FRAME,
        )
        for i in one
    )


def _set_inertial(text: XmlText, link: Element, name: str, inertia: np.ndarray) -> None:
    lines = inertial_lines(name, inertia)
    before = link.first("inertial")
    if before is None:
        text.append(link, lines)
    else:
        text.replace(before, lines)


def _written_in_full(text: XmlText, joint: Element) -> bool:
    """Write angles that a joint's origin rounds with all digits; whether there were any."""
    if (origin := joint.first("origin")) is None:
        return False
    words = origin.attributes.get("rpy", "").split()
    exact = [exact_angle(word) for word in words]
    rounded = any(abs(x - float(word)) > 1e-10 for x, word in zip(exact, words, strict=True))
    if rounded:
        text.set_attributes(origin, {"rpy": numbers(exact)})
    return rounded


def _set_dynamics(text: XmlText, joint: Element, damping: float, friction: float) -> None:
    values = {"damping": number(damping), "friction": number(friction)}
    before = joint.first("dynamics")
    if before is not None:
        text.set_attributes(before, values)
    elif damping or friction:
        text.append(joint, [dynamics_line(damping, friction)])


def _gravity(robot: Robot) -> tuple[str, ...]:
    if np.allclose(robot.gravity, DOWN, rtol=0.0, atol=1e-9):
        return ()
    return (
        f"URDF has no gravity; the model's is {numbers(robot.gravity)} m/s² in the base frame: "
        "set it in the engine",
    )


def _impossible(model: RunnableModel) -> tuple[str, ...]:
    """A warning about links that no body can be, which some readers refuse."""
    names = [
        repr(link.name)
        for link, inertia in zip(model.robot.tree.links, link_inertias(model), strict=True)
        if link.is_body and not is_possible(inertia)
    ]
    if not names:
        return ()
    return (
        f"no body can have the inertial parameters of {', '.join(names)}; simulators refuse or "
        "change them, export the physically consistent parameters",
    )


#: The format of ROS.
URDF = Format(
    "URDF",
    ".urdf",
    lambda model, options: to_urdf(model, options.original, frozen=options.frozen),
    (
        lambda file, model, options: verify_with_pinocchio(file, model, frozen=options.frozen),
        lambda file, model, options: verify_with_mujoco(file, model, frozen=options.frozen),
    ),
)
