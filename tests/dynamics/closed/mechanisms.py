"""Mechanisms with closed loops for the tests, and their energy and poses, written once more."""

from dataclasses import replace

import numpy as np

from pivident.robot.closed_chains import closed_robot, equations
from pivident.robot.constraints import Closure, Constraints, LinearConstraint
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.frames import Pose, rotation_about, rotation_from_z_to, rotation_z
from pivident.robot.friction import FrictionLaw, viscous
from pivident.robot.inertia import Body, from_center_of_mass
from pivident.robot.transmission import Transmission

#: A joint's z axis lies along -y of the base: planar mechanisms move in the plane of x and z.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
GRAVITY = np.array([0.0, 0.0, -9.81])
VISCOUS = FrictionLaw((viscous(),))
NOTHING = FrictionLaw(())


def hinge(name, parent, at=(0.0, 0.0, 0.0), rotation=None, kind="revolute", law=NOTHING, **more):
    """A joint; its frame is that of the parent where no rotation is given."""
    turned = np.eye(3) if rotation is None else rotation
    return Joint(name, kind, parent, turned, np.array(at, float), friction=law, **more)


def at(*position, rotation=None):
    """A frame in a link."""
    return Pose(np.eye(3) if rotation is None else rotation, np.array(position, float))


def random_rotation(rng):
    axis = rng.normal(size=3)
    return rotation_about(axis / np.linalg.norm(axis), rng.uniform(-np.pi, np.pi))


def random_body(rng, center=(0.0, 0.0, 0.0), mass=None):
    """Ten parameters of a body: four masses at random points around a point near ``center``."""
    mass = rng.uniform(0.5, 2.5) if mass is None else mass
    points = rng.uniform(-0.1, 0.1, (4, 3))
    points -= points.mean(axis=0)
    inertia = sum(0.25 * mass * (p @ p * np.eye(3) - np.outer(p, p)) for p in points)
    return from_center_of_mass(mass, np.asarray(center) + rng.uniform(-0.03, 0.03, 3), inertia)


def tree_of(name, joints, links, rotor=None, **friction):
    """A robot without loops; ``friction``: nominal values by parameter."""
    size = len(joints)
    inertia = np.zeros(size) if rotor is None else np.asarray(rotor, float)
    tree = Robot(name, tuple(joints), tuple(links), GRAVITY, inertia, Transmission.direct(size))
    return replace(tree, friction_nominal=friction) if friction else tree


def with_viscous_values(robot, value=0.7):
    """The same robot; the k-th viscous coefficient of its tree is (k + 1) times ``value``."""
    values = {
        f"fv{robot.label(i)}": value * (i + 1)
        for i, joint in enumerate(robot.tree.joints)
        if any(term.stem == "fv" for term in joint.friction.terms)
    }
    return replace(robot, friction_nominal=values)


def five_bar(seed=0, lengths=(0.4, 0.5, 0.4, 0.5), base=0.3, kind="point", law=NOTHING, rotor=0.1):
    """Two cranks at a distance, their rods meet at the tip: 4 joints, 2 independent."""
    rng = np.random.default_rng(seed)
    first, second, third, fourth = lengths
    joints = (
        hinge("a1", -1, rotation=UPRIGHT, law=law),
        hinge("a2", 0, (first, 0.0, 0.0), law=law),
        hinge("b1", -1, (base, 0.0, 0.0), UPRIGHT, law=law),
        hinge("b2", 2, (third, 0.0, 0.0), law=law),
    )
    links = tuple(
        Link(name, random_body(rng, (size / 2.0, 0.0, 0.0)))
        for name, size in zip(("A1", "A2", "B1", "B2"), lengths, strict=True)
    )
    tree = tree_of("five bar", joints, links, (rotor, 0.0, rotor / 2.0, 0.0))
    tip = Closure("tip", (1, 3), (at(second, 0.0, 0.0), at(fourth, 0.0, 0.0)), kind)
    robot = closed_robot(tree, ["a1", "b1"], [tip], posture=np.array([2.0, -1.2, 1.1, 1.2]))
    return with_viscous_values(robot)


def parallelogram(seed=0, crank=0.4, coupler=0.7, law=NOTHING, rotor=0.05, kind="point"):
    """Crank and rocker of one length, coupler as long as the base: 3 joints, 1 independent."""
    rng = np.random.default_rng(seed)
    joints = (
        hinge("crank", -1, rotation=UPRIGHT, law=law),
        hinge("coupler", 0, (crank, 0.0, 0.0), law=law),
        hinge("rocker", -1, (coupler, 0.0, 0.0), UPRIGHT, law=law),
    )
    links = tuple(Link(name, random_body(rng, (0.2, 0.0, 0.0))) for name in ("C", "K", "R"))
    tree = tree_of("parallelogram", joints, links, (rotor, 0.0, 0.0))
    loop = Closure("corner", (1, 2), (at(coupler, 0.0, 0.0), at(crank, 0.0, 0.0)), kind)
    robot = closed_robot(tree, ["crank"], [loop], posture=np.array([1.0, -1.1, 1.1]))
    return with_viscous_values(robot)


#: Geometry of the Delta: radius of base and platform, upper arm and forearm [m].
DELTA_BASE, DELTA_PLATFORM, DELTA_ARM, DELTA_FOREARM = 0.2, 0.06, 0.25, 0.55


def delta(seed=0, law=NOTHING, passive=NOTHING, rotor=0.02):
    """Three arms, their forearms on universal joints, and a platform: 12 joints, 3 independent.

    ``passive``: friction law of the universal joints.
    """
    rng = np.random.default_rng(seed)
    joints, links, posture, closures = [], [], [], []
    bent = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    q = 0.4
    across = DELTA_PLATFORM - DELTA_BASE - DELTA_ARM * np.cos(q)
    down = np.sqrt(DELTA_FOREARM**2 - across**2)
    for k in range(3):
        turn = 2.0 * np.pi * k / 3.0
        radial, tangent = rotation_z(turn)[:, 0], rotation_z(turn)[:, 1]
        frame = np.column_stack([radial, [0.0, 0.0, -1.0], tangent])
        i = len(joints)
        joints += [
            hinge(
                f"arm{k + 1}", -1, DELTA_BASE * radial, frame, law=law, position_limits=(0.0, 0.8)
            ),
            hinge(f"fork{k + 1}", i, (DELTA_ARM, 0.0, 0.0), law=passive),
            hinge(f"rod{k + 1}", i + 1, rotation=bent, law=passive),
        ]
        links += [
            Link(f"upper{k + 1}", random_body(rng, (DELTA_ARM / 2.0, 0.0, 0.0))),
            Link(f"cross{k + 1}", is_body=False),
            Link(f"forearm{k + 1}", random_body(rng, (DELTA_FOREARM / 2.0, 0.0, 0.0))),
        ]
        posture += [q, np.arctan2(down, across) - q, 0.0]
        corner = at(*(DELTA_PLATFORM * radial))
        closures.append(Closure(f"ball{k + 1}", (i + 2, 11), (at(DELTA_FOREARM, 0, 0), corner)))
    along = [rotation_from_z_to(np.eye(3)[axis]) for axis in range(3)]
    frames = (along[0], along[0].T @ along[1], along[1].T)
    for axis, (name, frame) in enumerate(zip("xyz", frames, strict=True)):
        joints.append(hinge(name, 8 + axis if axis else -1, rotation=frame, kind="prismatic"))
        body = random_body(rng, (0.0, 0.0, -0.03)) if axis == 2 else np.zeros(10)
        links.append(Link(f"platform {name}", body, is_body=axis == 2))
    posture += [0.0, 0.0, -(down + DELTA_ARM * np.sin(q))]
    rotors = np.zeros(12)
    rotors[[0, 3, 6]] = rotor
    tree = tree_of("delta", joints, links, rotors)
    names = ["arm1", "arm2", "arm3"]
    return with_viscous_values(closed_robot(tree, names, closures, posture=np.array(posture)))


#: Random loops whose passive joints are faster are drawn again: they are next to singular.
LARGEST_GAIN = 3.0

#: Independent joints of random loops move so far from where they are closed [rad or m].
NEAR = 0.05

#: Equations of a closure of each kind, which all count in a spatial loop.
EQUATIONS = {"point": 3, "axis": 5, "full": 6}


def spatial_loop(seed, kind, independent=1, on_base=False):
    """A loop of joints in general directions, one of them prismatic, closed at a random posture.

    Two branches of a tree meet in a closure of some kind, or a chain and the base (``on_base``).
    """
    rng = np.random.default_rng(seed)
    size = EQUATIONS[kind] + independent
    left = 0 if on_base else size // 2
    parents = [*range(-1, left - 1), -1, *range(left, size - 1)]
    sliding = int(rng.integers(1, size))
    joints = [
        hinge(
            f"j{i + 1}",
            parent,
            rng.uniform(-0.4, 0.4, 3),
            random_rotation(rng),
            "prismatic" if i == sliding else "revolute",
            VISCOUS,
        )
        for i, parent in enumerate(parents)
    ]
    links = [Link(f"L{i + 1}", random_body(rng)) for i in range(size)]
    posture = rng.uniform(-1.0, 1.0, size)
    tree = tree_of("spatial loop", joints, links)
    ends = poses(tree, posture)
    first, second = at(0.0, 0.0, 0.0) if on_base else ends[left - 1], ends[size - 1]
    frame = at(*rng.uniform(-0.3, 0.3, 3), rotation=random_rotation(rng))
    here = first @ frame
    other = Pose(
        second.rotation.T @ here.rotation,
        second.rotation.T @ (here.translation - second.translation),
    )
    if kind == "point":
        other = Pose(random_rotation(rng), other.translation)
    if kind == "axis":
        other = Pose(other.rotation @ rotation_z(rng.uniform(-2.0, 2.0)), other.translation)
    loop = Closure("loop", (left - 1, size - 1), (frame, other), kind)
    slope = equations(tree, Constraints(tuple(range(independent)), (loop,)), posture)[1]
    gain = np.linalg.lstsq(slope[:, independent:], slope[:, :independent])[0]
    if np.abs(gain).max() > LARGEST_GAIN:
        return spatial_loop(seed + 1000, kind, independent, on_base)
    limited = [
        replace(joint, position_limits=(position - NEAR, position + NEAR))
        for joint, position in zip(joints, posture, strict=True)
    ]
    tree = replace(tree, joints=tuple(limited))
    names = [f"j{i + 1}" for i in range(independent)]
    return with_viscous_values(closed_robot(tree, names, [loop], posture=posture))


def geared(seed=0, ratio=0.7, offset=0.3):
    """A chain in space whose third joint turns with the second, q_3 = ratio q_2 + offset."""
    rng = np.random.default_rng(seed)
    joints = [
        hinge(f"g{i + 1}", i - 1, rng.uniform(-0.4, 0.4, 3), random_rotation(rng), law=VISCOUS)
        for i in range(3)
    ]
    links = [Link(f"G{i + 1}", random_body(rng)) for i in range(3)]
    tree = tree_of("geared", joints, links, (0.1, 0.2, 0.0))
    belt = LinearConstraint("belt", np.array([0.0, -ratio, 1.0]), offset)
    return with_viscous_values(closed_robot(tree, ["g1", "g2"], linear=[belt]))


def start(robot):
    """Independent positions of the posture in which the description's loops are closed."""
    return robot.constraints.posture[list(robot.places)]


def reach(robot, wanted=0.2):
    """How far independent joints move from there, within their limits, (joints,) [rad or m]."""
    middle = start(robot)
    limits = [joint.position_limits or (-np.inf, np.inf) for joint in robot.joints]
    room = [min(at - low, high - at) for at, (low, high) in zip(middle, limits, strict=True)]
    return np.minimum(wanted, room)


def states(robot, count, seed, speed=1.0):
    """``q dq ddq`` near that posture, each (count, joints)."""
    rng = np.random.default_rng(seed)
    shape = (count, robot.size)
    q = start(robot) + reach(robot) * rng.uniform(-1.0, 1.0, shape)
    return q, *rng.uniform(-speed, speed, (2, *shape))


def smooth_path(robot, samples, step):
    """``q dq ddq`` along sines of other frequencies and phases, time last, (joints, samples)."""
    rates = 1.3 + 0.9 * np.arange(robot.size)[:, None]
    angle = rates * step * np.arange(samples) + np.arange(robot.size)[:, None]
    middle, far = start(robot)[:, None], reach(robot)[:, None]
    return (
        middle + far * np.sin(angle),
        far * rates * np.cos(angle),
        -far * rates**2 * np.sin(angle),
    )


def poses(tree, q):
    """Pose of each link in the base, by chains of matrices of size four."""
    placed = []
    for joint, position in zip(tree.joints, q, strict=True):
        mount, move = np.eye(4), np.eye(4)
        mount[:3, :3], mount[:3, 3] = joint.rotation, joint.translation
        if joint.kind == "prismatic":
            move[2, 3] = position
        else:
            c, s = np.cos(position), np.sin(position)
            move[:2, :2] = [[c, -s], [s, c]]
        before = placed[joint.parent] if joint.parent >= 0 else np.eye(4)
        placed.append(before @ mount @ move)
    return [Pose(m[:3, :3], m[:3, 3]) for m in placed]


def energy(tree, q, dq):
    """Kinetic energy of all links and rotors, and potential energy [J]."""
    kinetic, potential = 0.5 * float(tree.rotor_inertia @ dq**2), 0.0
    placed = poses(tree, q)
    turning, moving = [], []
    for i, joint in enumerate(tree.joints):
        pose, axis = placed[i], placed[i].rotation[:, 2]
        turn, speed = np.zeros(3), np.zeros(3)
        if joint.parent >= 0:
            before = placed[joint.parent]
            turn = turning[joint.parent]
            speed = moving[joint.parent] + np.cross(turn, pose.translation - before.translation)
        if joint.kind == "prismatic":
            speed = speed + axis * dq[i]
        else:
            turn = turn + axis * dq[i]
        turning.append(turn)
        moving.append(speed)
        ten = tree.links[i].inertia
        if ten[9] == 0.0:
            continue
        body = Body.of_parameters(ten)
        arm = pose.rotation @ body.center_of_mass
        center_speed = speed + np.cross(turn, arm)
        local = pose.rotation.T @ turn
        kinetic += (
            0.5 * body.mass * center_speed @ center_speed + 0.5 * local @ body.inertia @ local
        )
        potential -= body.mass * tree.gravity @ (pose.translation + arm)
    return kinetic, potential


#: One mechanism of every kind, by name.
MECHANISMS = {
    "five bar": five_bar,
    "five bar with a hinge": lambda: five_bar(kind="axis", law=VISCOUS),
    "parallelogram": lambda: parallelogram(law=VISCOUS),
    "delta": lambda: delta(law=VISCOUS, passive=VISCOUS),
    "geared": geared,
    "ball": lambda: spatial_loop(4, "point", 2),
    "hinge": lambda: spatial_loop(2, "axis", 2),
    "weld": lambda: spatial_loop(3, "full", 2),
    "hinge on the base": lambda: spatial_loop(5, "axis", 2, on_base=True),
}
