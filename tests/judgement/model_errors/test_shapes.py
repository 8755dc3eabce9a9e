"""Records whose torques Pinocchio makes: each shape of error is named first and measured."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import pivident as pv
from pivident.judgement.model_errors.named_causes import named_causes
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.robot.urdf import parse_urdf

RATE, SECONDS, GAMMA = 200.0, 20.0, 20.0
AXES = {"turn": "0 0 1", "lift": "0 1 0", "elbow": "0 1 0", "roll": "1 0 0"}
#: Instant of jumps, none of those that are tried first [s].
INSTANT = 13.1


def urdf(axes):
    """An arm of four joints whose axes are given."""
    parts, parent = ['<robot name="arm"><link name="base"/>'], "base"
    for name, axis in axes.items():
        parts.append(
            f'<joint name="{name}" type="revolute">'
            f'<parent link="{parent}"/><child link="{name}_l"/>'
            f'<origin xyz="0.35 0.02 0.1"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" velocity="3" effort="99"/></joint>'
            f'<link name="{name}_l"><inertial><origin xyz="0.15 0.03 0.05"/><mass value="4"/>'
            '<inertia ixx=".05" iyy=".09" izz=".07" ixy=".01" ixz=".005" iyz="-.01"/>'
            "</inertial></link>"
        )
        parent = f"{name}_l"
    return "".join([*parts, "</robot>"])


def torques(text, q, dq, ddq, load=lambda t: 0.0):
    """By Pinocchio, with friction and a point mass [kg] at the flange; shape (samples, joints)."""
    model = pin.buildModelFromXML(text)
    bare, data = model.inertias[4].copy(), model.createData()
    made = []
    for k, (a, b, c) in enumerate(zip(q, dq, ddq, strict=True)):
        flange = pin.Inertia(load(k / RATE), np.array([0.1, 0.0, 0.05]), np.zeros((3, 3)))
        model.inertias[4] = bare + flange
        made.append(pin.rnea(model, data, a, b, c))
    return np.array(made) + 3.0 * dq + 2.0 * 2.0 / np.pi * np.arctan(GAMMA * dq) + 0.5


@cache
def motion():
    """Sums of sines, each (samples, joints)."""
    rng = np.random.default_rng(3)
    t = np.arange(int(SECONDS * RATE)) / RATE
    q, dq, ddq = np.zeros((3, t.size, 4))
    for frequency in (0.15, 0.35, 0.6, 0.9):
        w, phase = 2.0 * np.pi * frequency, rng.uniform(0.0, 6.0, 4)
        size, angle = rng.uniform(0.2, 0.4, 4) / frequency**0.7, w * t[:, None] + phase
        q += 0.4 * size * np.sin(angle)
        dq += 0.4 * w * size * np.cos(angle)
        ddq -= 0.4 * w**2 * size * np.sin(angle)
    return t, q, dq, ddq


def record(fault):
    """Positions and torques with one thing wrong."""
    t, q, dq, ddq = motion()
    axes, load, seen, further = dict(AXES), lambda t: 0.0, q.copy(), np.zeros_like(q)
    match fault:
        case "spring":
            further[:, 1] = 12.0 * (q[:, 1] - 0.2)
        case "encoder coupling":
            seen[:, 2] += 0.05 * q[:, 1]
        case "geometry":
            axes["elbow"] = "0 1 0.02"
        case "offset drift":
            further[:, 2] = 3.0 * t / 60.0
        case "offset jump":
            further[:, 2] = -2.1 * (t >= INSTANT)
        case "load drift":
            load = lambda t: 1.5 * t / 60.0  # noqa: E731
        case "load jump":
            load = lambda t: 1.5 * (t >= INSTANT)  # noqa: E731
    return seen, torques(urdf(axes), q, dq, ddq, load) + further


@cache
def found(fault):
    """The causes that are named."""
    robot = parse_urdf(urdf(AXES))
    law = FrictionLaw((viscous(), coulomb(gamma=GAMMA), offset()))
    robot = robot.with_friction(dict.fromkeys(robot.joint_names, law))
    q, tau = record(fault)
    rng = np.random.default_rng(7)
    q = q + 1e-5 * rng.standard_normal(q.shape)
    tau = tau + 0.05 * rng.standard_normal(tau.shape)
    recording = pv.Recording.from_arrays(
        q, tau, RATE, joint_names=robot.joint_names, torque_timing="sampled"
    )
    problem = pv.Problem(robot, (recording,))
    return named_causes(problem, pv.identify(problem, "ls"))


#: Kind of the fault, joint, size, and what is said of it.
SHAPES = [
    ("spring", "lift", 12.0, "a spring of 1"),
    ("encoder coupling", "elbow", 5.0, "% of lift"),
    ("geometry", "elbow", np.degrees(np.arctan(0.02)), "the axis of elbow is tilted by 1.1"),
    ("offset drift", "elbow", 3.0, "N m/min"),
    ("offset jump", "elbow", -2.1, "the offset of elbow jumped by -2.1"),
    ("load drift", "roll", 1.5, "kg/min"),
    ("load jump", "roll", 1.5, "the load at the flange jumped by 1."),
]


@pytest.mark.parametrize(("kind", "joint", "size", "said"), SHAPES)
def test_each_shape_is_named_first_with_its_size(kind, joint, size, said):
    first = found(kind).named[0]
    assert (first.cause.kind, first.cause.subject) == (kind, joint)
    value, std = first.size
    assert abs(value - size) < 4.0 * std + 0.03 * abs(size)
    assert std < 0.15 * abs(size) and said in first.text
    if kind.endswith("jump"):
        assert abs(first.cause.instant - INSTANT) < 0.1
        assert f"at {first.cause.instant:.1f} s" in first.text


def test_a_right_record_has_none_of_them():
    assert found("nothing").named == ()


def test_a_size_of_no_consequence_is_not_named():
    """Half a per cent of the torque; a spring may be named by its effect."""
    from pivident.judgement.model_errors.cause import NEGLIGIBLE

    for kind, *_ in SHAPES:
        for one in found(kind).named:
            if one.cause.least_torque == NEGLIGIBLE and not one.cause.by_effect:
                assert one.torques.max() > NEGLIGIBLE


def test_a_jump_between_two_recordings_is_told_in_the_time_of_one():
    from pivident.judgement.model_errors.time_errors import Instants

    instants = Instants((), ("one", "two"), (0.0, 10.0), 1.0)
    assert instants.text(14.2) == "4.2 s of two"
    assert replace(instants, names=("one",), starts=(0.0,)).text(14.2) == "14.2 s"
