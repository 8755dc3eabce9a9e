"""Mechanisms with closed loops for tests of symbolic models, and their motion by the kernels."""

from functools import lru_cache

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.robot_regressor import regressor_of
from pivident.robot.closed_chains import closed_robot
from pivident.robot.constraints import Closure, LinearConstraint
from pivident.robot.description import Link
from pivident.robot.frames import Pose
from pivident.robot.gallery import load_robot
from tests.dynamics.closed.mechanisms import (
    UPRIGHT,
    VISCOUS,
    at,
    five_bar,
    geared,
    hinge,
    parallelogram,
    random_body,
    random_rotation,
    spatial_loop,
    tree_of,
    with_viscous_values,
)

GALLERY = ("five_bar", "parallelogram_palletizer", "scara", "delta", "orthoglide")


def slider_crank(independent="crank", seed=1):
    """A crank drives a slider by a rod: one loop with a sliding joint."""
    rng = np.random.default_rng(seed)
    upright = np.array(
        [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]
    )  # z along x of the base
    joints = (
        hinge("crank", -1, rotation=UPRIGHT, law=VISCOUS),
        hinge("rod", 0, (0.2, 0.0, 0.0), law=VISCOUS),
        hinge("slider", -1, (0.0, 0.0, 0.05), upright, kind="prismatic", law=VISCOUS),
    )
    links = tuple(Link(name, random_body(rng)) for name in ("C", "R", "S"))
    tree = tree_of("slider crank", joints, links, (0.1, 0.0, 0.2))
    loop = Closure("pin", (1, 2), (at(0.6, 0.0, 0.0), at(0.0, 0.0, 0.0)))
    robot = closed_robot(tree, [independent], [loop], posture=np.array([0.9, -1.1, 0.7]))
    return with_viscous_values(robot)


def geared_five_bar():
    """A five-bar whose tip drives a wheel: a gear at a joint that a loop moves."""
    tree = five_bar(kind="axis", law=VISCOUS).tree
    rng = np.random.default_rng(5)
    wheel = hinge("wheel", 3, (0.5, 0.0, 0.0), law=VISCOUS)
    tree = tree_of(
        "geared five bar",
        (*tree.joints, wheel),
        (*tree.links, Link("W", random_body(rng))),
        (0.1, 0.0, 0.05, 0.0, 0.0),
    )
    gear = LinearConstraint("gear", np.array([0.0, 0.3, 0.0, 0.5, 1.0]), 0.2)
    tip = Closure("tip", (1, 3), (at(0.5, 0.0, 0.0), at(0.5, 0.0, 0.0)), "axis")
    posture = np.array([2.0, -1.2, 1.1, 1.2, 0.0])
    return with_viscous_values(closed_robot(tree, ["a1", "b1"], [tip], [gear], posture))


def four_bar_cut_at_the_base(seed=2):
    """A chain whose end turns about a point of the base: both passive joints are in one chain."""
    rng = np.random.default_rng(seed)
    joints = (
        hinge("crank", -1, rotation=UPRIGHT, law=VISCOUS),
        hinge("coupler", 0, (0.3, 0.0, 0.0), law=VISCOUS),
        hinge("rocker", 1, (0.5, 0.0, 0.0), law=VISCOUS),
    )
    links = tuple(Link(name, random_body(rng)) for name in ("C", "K", "R"))
    tree = tree_of("four bar", joints, links, (0.1, 0.0, 0.0))
    loop = Closure("pin", (2, -1), (at(0.35, 0.02, 0.0), at(0.55, 0.0, 0.05)))
    posture = np.array([1.1, -0.9, -1.8])
    return with_viscous_values(closed_robot(tree, ["crank"], [loop], posture=posture))


def boom(independent, seed=3):
    """A boom in a plane at an odd angle, lifted by a cylinder."""
    rng = np.random.default_rng(seed)
    plane = random_rotation(rng)
    across = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # z along x
    joints = (
        hinge("boom", -1, rotation=plane, law=VISCOUS),
        hinge("barrel", -1, 0.4 * plane[:, 0], plane, law=VISCOUS),
        hinge("piston", 1, rotation=across, kind="prismatic", law=VISCOUS),
    )
    links = tuple(Link(name, random_body(rng)) for name in ("B", "Y", "P"))
    tree = tree_of("boom", joints, links, (0.0, 0.0, 2.0))
    # the hinge's axis is the third of the boom, which the piston has as its first
    turned = Pose(across.T, np.array([0.0, 0.0, 0.1]))
    loop = Closure("eye", (2, 0), (turned, at(0.6, 0.1, 0.0)), "axis")
    posture = np.array([0.9, 1.8, 0.4])
    return with_viscous_values(closed_robot(tree, [independent], [loop], posture=posture))


def geared_ball(seed=4):
    """A loop in space, a wheel that one of its passive joints turns, and an arm on the wheel."""
    loop = spatial_loop(seed, "point", 2)
    size, rng = loop.tree.size, np.random.default_rng(seed)
    wheel = hinge("wheel", -1, (0.3, 0.1, 0.0), random_rotation(rng), law=VISCOUS)
    arm = hinge("arm", size, (0.2, 0.0, 0.1), random_rotation(rng), law=VISCOUS)
    links = (*loop.tree.links, Link("W", random_body(rng)), Link("A", random_body(rng)))
    tree = tree_of("geared ball", (*loop.tree.joints, wheel, arm), links)
    ratios = np.zeros((2, size + 2))
    ratios[0, [2, size]], ratios[1, [size, size + 1]] = (0.7, -1.0), (2.0, 1.0)
    gears = [LinearConstraint("wheel", ratios[0], 0.1), LinearConstraint("arm", ratios[1])]
    posture = np.append(loop.constraints.posture, [0.0, 0.0])
    names = list(loop.joint_names)
    robot = closed_robot(tree, names, loop.constraints.closures, gears, posture)
    return with_viscous_values(robot)


MADE = {
    "geared ball": geared_ball,
    "geared": geared,
    "geared five bar": geared_five_bar,
    "parallelogram": lambda: parallelogram(law=VISCOUS),
    "slider moved by a crank": slider_crank,
    "crank moved by a slider": lambda: slider_crank("slider"),
    "four bar cut at the base": four_bar_cut_at_the_base,
    "cylinder that a boom moves": lambda: boom("boom"),
    "boom that a cylinder moves": lambda: boom("piston"),
    "ball": lambda: spatial_loop(4, "point", 2),
    "hinge": lambda: spatial_loop(2, "axis", 2),
    "weld on the base": lambda: spatial_loop(6, "full", 2, on_base=True),
}


@lru_cache(maxsize=32)
def mechanism(name):
    """A robot of the gallery or of ``MADE``."""
    return load_robot(name) if name in GALLERY else MADE[name]()


@lru_cache(maxsize=32)
def base_of(name):
    """Its base parameters."""
    return base_parameters(mechanism(name))


def closed_states(robot, count, seed=0):
    """``q dq ddq`` at closed postures at random, each (count, joints)."""
    rng = np.random.default_rng(seed)
    q = ClosedChains(robot).random_postures(rng, count)
    return q, *rng.uniform(-2.0, 2.0, (2, *q.shape))


def motion_of_all(robot, q, dq, ddq):
    """Motion of all joints at each state by the kernels: positions, speeds, accelerations, N."""
    chains = ClosedChains(robot)
    each = [chains.motion(*(x[:, None] for x in state)) for state in zip(q, dq, ddq, strict=True)]
    return tuple(np.array([one[k][..., 0] for one in each]) for k in range(4))


def observation(robot, parameters, q, dq, ddq):
    """Nᵀ Y at each state by the kernels."""
    regressor = regressor_of(robot, parameters)
    return np.concatenate(
        [regressor.matrix(*(x[None] for x in state)) for state in zip(q, dq, ddq, strict=True)]
    )


def posture_order(program):
    """Joints of the tree in the order of the program's posture."""
    return [
        int(s.name[1:]) - 1 for s in (*program.inputs[0].symbols, *program.closing.unknown.symbols)
    ]
