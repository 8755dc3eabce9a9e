"""Bodies behind fixed and frozen joints, which identification adds to the link that carries them.

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

import numpy as np

from pivident.models.possible_values import is_possible
from pivident.robot.assembly import tree_order
from pivident.robot.frames import Pose, rotation_from_z_to
from pivident.robot.inertia import moved
from pivident.robot.urdf import joint_motion
from pivident.robot.urdf_xml import UrdfModel

#: Halvings of the interval in which the scale of the frozen bodies is searched.
HALVINGS = 40

#: Fraction of the largest possible scale that is used, to keep off the boundary.
CAUTION = 0.5


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
        for m in fixed:
            if file.links[m.name].any() or m.name in with_shapes:
                inertia[m.name] = np.zeros(10)
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
