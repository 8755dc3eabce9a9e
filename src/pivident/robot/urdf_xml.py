"""The text of a URDF as plain records: every element, attribute and number checked.

`parse_model` reads what dynamics needs: links with their inertials, joints with their frames, axes,
limits and friction. `parse_collisions` reads the shapes of the links, without which a robot can be
identified. Visuals, transmissions and simulator extensions are ignored.
"""

from __future__ import annotations

import gzip
import math
import xml.etree.ElementTree as ElementTree
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, require_known
from pivident.foundation.files import regular_file
from pivident.robot.frames import Pose, exact_angle, residues, rotation_from_rpy
from pivident.robot.inertia import from_center_of_mass, moved, tensor
from pivident.robot.naming import expand_xacro, repeated

#: Largest URDF that is read, after decompression [bytes]; real ones have some 100 kB.
MAXIMUM_SIZE = 8 * 2**20

#: Maximum number of elements, and of links or joints; real files have thousands and hundreds.
MAX_ELEMENTS, MAX_LINKS = 100_000, 1000

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")
MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")
GZIP_MAGIC = b"\x1f\x8b"


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A ``<joint>``; None where a limit is not given (a velocity or effort of zero: likewise)."""

    name: str
    type: str
    parent: str
    child: str
    origin: Pose  # pose of the joint frame in the parent link's frame
    axis: np.ndarray  # unit vector in the joint frame, shape (3,)
    limits: tuple[float, float] | None  # [rad or m]
    velocity: float | None  # highest speed [rad/s or m/s]
    effort: float | None  # highest torque or force [N m or N]
    damping: float  # viscous friction [N m s/rad or N s/m]
    friction: float  # Coulomb friction [N m or N]
    mimics: str | None  # name of the joint that it follows: q = multiplier · q of that + offset
    multiplier: float = 1.0
    offset: float = 0.0  # [rad or m]


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """A whole URDF."""

    name: str
    links: dict[str, np.ndarray]  # ten inertial parameters of each link in its URDF frame
    joints: tuple[UrdfJoint, ...]


@dataclass(frozen=True, eq=False)
class UrdfCollision:
    """A ``<collision>`` of a link: one shape, centred on its own frame."""

    origin: Pose  # pose of the shape's frame in the link's URDF frame
    shape: str  # box, sphere, cylinder, capsule or mesh
    size: np.ndarray  # edges of a box, or the scale of a mesh [m], shape (3,)
    radius: float = 0.0  # [m]
    length: float = 0.0  # of a cylinder or capsule along z, without the capsule's caps [m]
    mesh: str = ""  # file as it is written


class _BoundedTree(ElementTree.TreeBuilder):
    """A tree builder that stops at a DOCTYPE, before any entity expands, or at MAX_ELEMENTS."""

    elements = 0

    def start(self, tag: str, attributes: dict[str, str]) -> ElementTree.Element:
        self.elements += 1
        if self.elements > MAX_ELEMENTS:
            raise RobotDescriptionError(
                f"has more than {MAX_ELEMENTS} elements", advice="this is not a robot description"
            )
        return super().start(tag, attributes)

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise RobotDescriptionError(
            f"has a document type declaration (<!DOCTYPE {name}>), through which a file can "
            "expand without bound or read other files",
            advice="a URDF needs none, remove it",
        )


def file_content(path: Path) -> bytes:
    """The bytes of a file, decompressed if it is gzip."""
    try:
        with regular_file(path).open("rb") as file:
            compressed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
        with gzip.open(path) if compressed else path.open("rb") as file:
            content = file.read(MAXIMUM_SIZE + 1)
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise RobotDescriptionError(
            f"is a damaged gzip file ({error})", advice="fetch or compress it again"
        ) from error
    except OSError as error:
        raise RobotDescriptionError(
            f"cannot be read ({error.strerror})", advice="check the path and its permissions"
        ) from error
    if len(content) > MAXIMUM_SIZE:
        raise RobotDescriptionError(
            f"is larger than {MAXIMUM_SIZE // 2**20} MiB", advice="this is not a robot description"
        )
    return content


def _refuse_xacro(root: ElementTree.Element) -> None:
    """Refuse a file with unexpanded macros: links would be missing silently."""
    macros = [e.tag for e in root.iter() if isinstance(e.tag, str) and "xacro" in e.tag]
    if macros:
        name = macros[0].rpartition("}")[2]
        raise RobotDescriptionError(
            f"still has xacro commands (<xacro:{name.removeprefix('xacro:')}>)",
            advice=expand_xacro(),
        )


def parse_model(content: bytes | str) -> UrdfModel:
    """The records of a URDF."""
    root = _root(content)
    _refuse_xacro(root)
    link_elements = root.findall("link")
    joint_elements = root.findall("joint")
    if max(len(link_elements), len(joint_elements)) > MAX_LINKS:
        raise RobotDescriptionError(
            f"has {len(link_elements)} links and {len(joint_elements)} joints, {MAX_LINKS} can be "
            "read",
            advice="leave out what does not belong to the robot",
        )
    link_names = [_attribute(element, "name", "link") for element in link_elements]
    joint_names = [_attribute(element, "name", "joint") for element in joint_elements]
    for kind, names in (("link", link_names), ("joint", joint_names)):
        if repeated(names):
            raise RobotDescriptionError(
                f"{kind} names used twice: {', '.join(repeated(names))}",
                advice="rename one of each",
            )
    links = {
        name: _inertia(element, f"link {name!r}")
        for name, element in zip(link_names, link_elements, strict=True)
    }
    joints = [
        _joint(element, name, link_names)
        for name, element in zip(joint_names, joint_elements, strict=True)
    ]
    return UrdfModel(root.get("name", "robot"), links, tuple(joints))


def parse_collisions(content: bytes | str) -> dict[str, tuple[UrdfCollision, ...]]:
    """Shapes of each link of a URDF, by the link's name."""
    links = {_attribute(e, "name", "link"): e for e in _root(content).findall("link")}
    return {
        name: tuple(_collision(e, f"link {name!r}: collision") for e in link.findall("collision"))
        for name, link in links.items()
    }


def _collision(element: ElementTree.Element, where: str) -> UrdfCollision:
    geometry = element.find("geometry")
    shapes = [] if geometry is None else [e for e in geometry if e.tag in SHAPES]
    if len(shapes) != 1:
        raise RobotDescriptionError(f"{where}: <geometry> needs one of {', '.join(SHAPES)}")
    (shape,) = shapes
    where, origin = f"{where}: {shape.tag}", _origin(element, where)
    if shape.tag == "mesh":
        scale = _numbers(shape.get("scale", "1 1 1"), 3, f"{where} scale")
        if not np.abs(scale).min() > 0.0:
            raise RobotDescriptionError(f"{where} scale = {shape.get('scale')!r} flattens the mesh")
        return UrdfCollision(origin, "mesh", scale, mesh=_attribute(shape, "filename", where))
    if shape.tag == "box":
        size = _numbers(_attribute(shape, "size", where), 3, f"{where} size")
        if not size.min() > 0.0:
            raise RobotDescriptionError(f"{where} size = {shape.get('size')!r} must be positive")
        return UrdfCollision(origin, "box", size)
    length = 0.0 if shape.tag == "sphere" else _positive(shape, "length", where)
    return UrdfCollision(origin, shape.tag, np.ones(3), _positive(shape, "radius", where), length)


def _root(content: bytes | str) -> ElementTree.Element:
    parser = ElementTree.XMLParser(target=_BoundedTree())
    try:
        root = ElementTree.fromstring(content, parser)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        if isinstance(error, RobotDescriptionError):
            raise
        raise RobotDescriptionError(f"is not XML: {error}", advice="correct this place") from error
    if root.tag != "robot":
        raise RobotDescriptionError(
            f"is not a URDF: its root element is <{root.tag}>, expected <robot>",
            advice="convert it first",
        )
    return root


def _joint(element: ElementTree.Element, name: str, link_names: list[str]) -> UrdfJoint:
    where = f"joint {name!r}"
    joint_type = _attribute(element, "type", where)
    require_known(
        joint_type,
        JOINT_TYPES,
        f"{where}: type {joint_type!r} does not exist",
        RobotDescriptionError,
    )
    limit = element.find("limit")
    dynamics = element.find("dynamics")
    mimic = element.find("mimic")
    return UrdfJoint(
        name=name,
        type=joint_type,
        parent=_end(element, "parent", where, link_names),
        child=_end(element, "child", where, link_names),
        origin=_origin(element, where),
        axis=_axis(element, joint_type, where),
        limits=_limits(limit, joint_type, where),
        velocity=_bound(limit, "velocity", where) or None,
        effort=_bound(limit, "effort", where) or None,
        damping=_non_negative(dynamics, "damping", f"{where}: dynamics"),
        friction=_non_negative(dynamics, "friction", f"{where}: dynamics"),
        mimics=None if mimic is None else _attribute(mimic, "joint", f"{where}: mimic"),
        multiplier=_factor(mimic, "multiplier", 1.0, where),
        offset=_factor(mimic, "offset", 0.0, where),
    )


def _end(element: ElementTree.Element, tag: str, where: str, link_names: list[str]) -> str:
    """Name of the link in ``<parent>`` or ``<child>``."""
    end = element.find(tag)
    if end is None:
        raise RobotDescriptionError(f"{where}: element <{tag}> is missing", advice="add it")
    link = _attribute(end, "link", f"{where}: {tag}")
    require_known(
        link, link_names, f"{where}: {tag} link {link!r} is not in the file", RobotDescriptionError
    )
    return link


def _origin(element: ElementTree.Element, where: str) -> Pose:
    origin = element.find("origin")
    if origin is None:
        return Pose.identity()
    xyz = _numbers(origin.get("xyz", "0 0 0"), 3, f"{where}: origin xyz")
    written = origin.get("rpy", "0 0 0")
    _numbers(written, 3, f"{where}: origin rpy")
    return Pose(rotation_from_rpy(*map(exact_angle, written.split())), xyz)


def _axis(element: ElementTree.Element, joint_type: str, where: str) -> np.ndarray:
    """The joint's unit axis, x where none is given (as URDF says)."""
    axis = element.find("axis")
    if axis is None or joint_type not in MOVING:
        return np.array([1.0, 0.0, 0.0])
    vector = _numbers(_attribute(axis, "xyz", f"{where}: axis"), 3, f"{where}: axis xyz")
    largest = np.abs(vector).max()
    if not largest > 1e-9:
        raise RobotDescriptionError(
            f"{where}: axis xyz = {axis.get('xyz')!r} has no direction",
            advice="give the joint's axis",
        )
    direction = vector / largest  # the square of a very long one would be infinite
    direction[residues(direction, 1.0)] = 0.0
    return direction / np.linalg.norm(direction)


def _limits(
    limit: ElementTree.Element | None, joint_type: str, where: str
) -> tuple[float, float] | None:
    if limit is None or joint_type == "continuous" or not {"lower", "upper"} & set(limit.keys()):
        return None
    lower = _number(limit.get("lower", "0"), f"{where}: limit lower")
    upper = _number(limit.get("upper", "0"), f"{where}: limit upper")
    return (lower, upper) if lower or upper else None


def _bound(limit: ElementTree.Element | None, key: str, where: str) -> float:
    """A speed or torque limit; zero, which many files write for unknown, where there is none."""
    return _non_negative(limit, key, f"{where}: limit")


def _inertia(element: ElementTree.Element, where: str) -> np.ndarray:
    """Ten parameters in the link's frame; zeros for a link without ``<inertial>``."""
    inertial = element.find("inertial")
    if inertial is None:
        return np.zeros(10)
    where = f"{where}: inertial"
    mass_element, inertia_element = inertial.find("mass"), inertial.find("inertia")
    if mass_element is None or inertia_element is None:
        missing = "mass" if mass_element is None else "inertia"
        raise RobotDescriptionError(f"{where}: element <{missing}> is missing", advice="add it")
    mass = _number(_attribute(mass_element, "value", f"{where} mass"), f"{where} mass value")
    if mass < 0.0:
        raise RobotDescriptionError(
            f"{where} mass value = {mass:g} is negative",
            advice="give the mass in kg, 0 where unknown",
        )
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    at_center = [
        _number(_attribute(inertia_element, key, f"{where} inertia"), f"{where} inertia {key}")
        for key in keys
    ]
    body = from_center_of_mass(mass, np.zeros(3), tensor(np.array(at_center)))
    center = _origin(inertial, where)
    return moved(body, center.rotation, center.translation)


def _attribute(element: ElementTree.Element, key: str, where: str) -> str:
    value = element.get(key)
    if not value:
        raise RobotDescriptionError(
            f"{where}: attribute {key!r} is missing or empty", advice="add it"
        )
    return value


def _non_negative(element: ElementTree.Element | None, key: str, where: str) -> float:
    """An optional attribute that is not negative, zero where there is none."""
    if element is None:
        return 0.0
    value = _number(element.get(key, "0"), f"{where} {key}")
    if value < 0.0:
        raise RobotDescriptionError(
            f"{where} {key} = {value:g} is negative", advice="give its magnitude or remove it"
        )
    return value


def _factor(element: ElementTree.Element | None, key: str, default: float, where: str) -> float:
    """An optional number of any sign."""
    if element is None:
        return default
    return _number(element.get(key, str(default)), f"{where}: mimic {key}")


def _positive(element: ElementTree.Element, key: str, where: str) -> float:
    value = _number(_attribute(element, key, where), f"{where} {key}")
    if not value > 0.0:
        raise RobotDescriptionError(f"{where} {key} = {value:g} must be positive, in metres")
    return value


def _numbers(text: str, count: int, where: str) -> np.ndarray:
    words = text.split()
    if len(words) != count:
        raise RobotDescriptionError(f"{where} = {text!r}: {count} numbers are needed")
    return np.array([_number(word, where) for word in words])


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        advice = (
            f"this looks like xacro: {expand_xacro()}" if "$" in text else "write a decimal number"
        )
        raise RobotDescriptionError(f"{where} = {text!r} is not a number", advice=advice) from None
    if not math.isfinite(value):
        raise RobotDescriptionError(
            f"{where} = {text!r} is not finite",
            advice="give a number, or leave an unknown limit out",
        )
    return value
