"""The faults: one each, of a size, a joint and a sign that the seed draws.

A fault is a function of a setup and a random generator. It answers with the changed setup, the
size, and the causes that are right to name: what, and the joint, or None where it concerns all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from benchmarks.unknown_arms.arms import JointPlace
from benchmarks.unknown_arms.simulator import RigidModel
from scipy.spatial.transform import Rotation

from .machines import Extra, Payload, Setup, Spring

#: What is right to name as the cause of a fault: the kind, and the joint or None.
Cause = tuple[str, str | None]


@dataclass(frozen=True)
class Planted:
    """A setup with a fault.

    Attributes:
        setup: machine, log and belief.
        expected: causes of which each is right.
        size: how large the fault is, in ``unit``.
        unit: its unit.
        corrected: joints as the user should describe them; None: the fault is not in them.
    """

    setup: Setup
    expected: tuple[Cause, ...] = ()
    size: float = 0.0
    unit: str = ""
    corrected: tuple[JointPlace, ...] | None = None


Fault = Callable[[Setup, np.random.Generator], Planted]

#: Joints whose distance from the one before, whose zero or whose axis matters for the torques. An
#: arm that moves in a plane without gravity shows neither lengths nor zeros.
LENGTHS = {"cobot6": (2, 3, 5), "link7": (2, 3, 4, 6), "telescope": (1,)}
ZEROS = {"cobot6": (1, 2, 3, 4), "link7": (1, 2, 3, 4, 5), "telescope": (1, 3, 4)}
AXES = {
    "scara": (0, 1),
    "cobot6": (1, 2, 3, 4),
    "link7": (1, 2, 3, 4, 5),
    "telescope": (1, 2, 3, 4),
}

#: Smallest and largest amplitude of an encoder's sine on the joint side [rad], tenfold of it [m].
SINE = (1e-4, 3e-4)

#: Joints with a gear that may be elastic: rotating ones of which no shaft is shared.
GEARED = {"scara": (0, 1), "cobot6": (0, 1, 2), "link7": (0, 1, 2, 3), "telescope": (0, 1, 3)}


def none(setup: Setup, rng: np.random.Generator) -> Planted:
    """The user's model is right."""
    return Planted(setup)


def link_length(setup: Setup, rng: np.random.Generator) -> Planted:
    """A joint is 1 mm farther out or in than described."""
    j, size = int(rng.choice(LENGTHS[setup.arm.name])), 1e-3 * float(rng.choice([-1.0, 1.0]))
    place = np.array(setup.arm.joints[j].xyz)
    moved = place * (1.0 + size / np.linalg.norm(place))
    return _misplaced(setup, j, size, "m", xyz=tuple(moved.tolist()))


def axis_angle(setup: Setup, rng: np.random.Generator) -> Planted:
    """An axis is turned by 0.1° about a random direction normal to it; the description is not."""
    j, size = int(rng.choice(AXES[setup.arm.name])), float(np.deg2rad(0.1))
    joint = setup.arm.joints[j]
    along = np.cross(joint.axis, rng.standard_normal(3))
    return _misplaced(setup, j, size, "rad", rpy=_turned(joint, size * _unit(along)))


def joint_offset(setup: Setup, rng: np.random.Generator) -> Planted:
    """The zero of a joint's position is 0.1° off."""
    j = int(rng.choice(ZEROS[setup.arm.name]))
    size = float(np.deg2rad(0.1) * rng.choice([-1.0, 1.0]))
    joint = setup.arm.joints[j]
    corrected = list(setup.believed)
    corrected[j] = replace(joint, rpy=_turned(joint, -size * _unit(joint.axis)))
    return Planted(
        replace(setup, zero=_one(setup, j, size)),
        (("zero position", joint.name), ("geometry", joint.name)),
        size,
        "rad",
        tuple(corrected),
    )


def torque_late(setup: Setup, rng: np.random.Generator) -> Planted:
    """The log holds each torque one sample late."""
    return Planted(replace(setup, logged_late=1), (("delay", None),), 1e3 / setup.rate, "ms")


def drive_late(setup: Setup, rng: np.random.Generator) -> Planted:
    """The drives act one sample after the command that is logged."""
    causes: tuple[Cause, ...] = (("delay", None), ("drive delay", None))
    return Planted(replace(setup, late=1), causes, 1e3 / setup.rate, "ms")


def gear_ratio(setup: Setup, rng: np.random.Generator) -> Planted:
    """The ratio of a gear is 2 % off, in positions and in torques."""
    j, size = _any(setup, rng), 0.02 * float(rng.choice([-1.0, 1.0]))
    factor = _one(setup, j, size)
    wrong = replace(setup, gear=1.0 / (1.0 + factor), drive=1.0 / (1.0 + factor))
    return Planted(wrong, (("gear ratio", setup.arm.joints[j].name),), 100 * size, "%")


def torque_gain(setup: Setup, rng: np.random.Generator) -> Planted:
    """The torque of a joint is logged 5 % too large or small."""
    j, size = _any(setup, rng), 0.05 * float(rng.choice([-1.0, 1.0]))
    wrong = replace(setup, drive=1.0 / (1.0 + _one(setup, j, size)))
    return Planted(wrong, (("torque gain", setup.arm.joints[j].name),), 100 * size, "%")


def lost_samples(setup: Setup, rng: np.random.Generator) -> Planted:
    """The log lacks 0.5 % of the samples and does not say so."""
    return Planted(replace(setup, lost=0.005), (("lost samples", None),), 0.5, "%")


def hidden_jitter(setup: Setup, rng: np.random.Generator) -> Planted:
    """Positions are read at instants that tremble by a quarter period, 0.5 ms at 500 Hz."""
    size = 0.25 / setup.rate
    return Planted(replace(setup, tremble=size), (("jitter", None),), 1e3 * size, "ms")


def encoder_sine(setup: Setup, rng: np.random.Generator) -> Planted:
    """The encoder of one motor has a sine once per turn."""
    j = _any(setup, rng)
    size = float(rng.uniform(*SINE)) * (0.1 if setup.arm.joints[j].kind == "prismatic" else 1.0)
    ripple = np.zeros((3, setup.arm.size))
    ripple[:, j] = size, setup.arm.gear_ratio[j], rng.uniform(-np.pi, np.pi)
    joint = setup.arm.joints[j]
    unit = "rad" if joint.kind == "revolute" else "m"
    return Planted(replace(setup, ripple=ripple), (("encoder", joint.name),), size, unit)


def stribeck(setup: Setup, rng: np.random.Generator) -> Planted:
    """The friction of a joint is larger at low speed than the user's law."""
    j, share = _any(setup, rng), float(rng.uniform(0.2, 0.5))
    level = setup.made.coulomb[j] or setup.made.shafts[0].coulomb
    wrong = replace(
        setup,
        stribeck=_one(setup, j, share * level),
        stribeck_speed=setup.arm.speeds * float(rng.uniform(0.04, 0.12)),
    )
    return Planted(wrong, (("friction", setup.arm.joints[j].name),), 100 * share, "% of fc")


def tanh(setup: Setup, rng: np.random.Generator) -> Planted:
    """The sign of all friction is a hyperbolic tangent of another slope."""
    size = float(rng.uniform(1.5, 3.0))
    causes = (("friction", None), *(("friction", joint.name) for joint in setup.arm.joints))
    return Planted(replace(setup, tanh=True, gamma=size * setup.gamma), causes, size, "of γ")


def backlash(setup: Setup, rng: np.random.Generator) -> Planted:
    """A gear has a play of 0.3 to 1 mrad; its flanks are stiff, 80 Hz with the motor locked."""
    return _elastic(setup, rng, 80.0, 0.1, 1e-3 * float(rng.uniform(0.3, 1.0)))


def elastic_joint(setup: Setup, rng: np.random.Generator) -> Planted:
    """A gear is a spring, 15 to 40 Hz with the motor locked."""
    return _elastic(setup, rng, float(rng.uniform(15.0, 40.0)), 0.02, 0.0)


def temperature(setup: Setup, rng: np.random.Generator) -> Planted:
    """Viscous and Coulomb friction fall by 20 to 30 % over the records."""
    size = float(rng.uniform(0.2, 0.3))
    causes = (("warming up", None), *(("warming up", j.name) for j in setup.arm.joints))
    return Planted(replace(setup, drift=size), causes, 100 * size, "%")


def payload(setup: Setup, rng: np.random.Generator) -> Planted:
    """The second of two records is taken with a load of 0.5 to 2 kg."""
    load = _load(setup, rng)
    return Planted(replace(setup, payload=load), (("payload", None),), load.mass, "kg")


def missing_parameter(setup: Setup, rng: np.random.Generator) -> Planted:
    """Rotor inertia or dry friction of one joint is not among the parameters."""
    j = int(rng.choice([j for j in range(2, setup.arm.size) if setup.made.rotor[j]]))
    name = f"{rng.choice(['ia', 'fc'])}{j + 1}"
    joint = setup.arm.joints[j].name
    kind = "rotor" if name.startswith("ia") else "friction"
    causes: tuple[Cause, ...] = (("missing parameter", joint), (kind, joint))
    return Planted(replace(setup, left_out=(name,)), causes, 1.0, name)


def counter_spring(setup: Setup, rng: np.random.Generator) -> Planted:
    """A spring holds a joint to the base, whose torque at one radian is that of dry friction."""
    j = int(rng.choice(GEARED[setup.arm.name]))
    size = float(rng.uniform(0.3, 1.5)) * setup.made.coulomb[j]
    extra = Extra(stiffness=tuple(_one(setup, j, size)))
    return _with_extra(setup, extra, ("spring", setup.arm.joints[j].name), size, "N m/rad")


def encoder_share(setup: Setup, rng: np.random.Generator) -> Planted:
    """The encoder of a joint turns with 2 to 6 % of the joint before it."""
    turns = [joint.kind == "revolute" for joint in setup.arm.joints]
    j = int(rng.choice([j for j in range(1, len(turns)) if turns[j] and turns[j - 1]]))
    size = float(rng.uniform(0.02, 0.06) * rng.choice([-1.0, 1.0]))
    shares = np.zeros((setup.arm.size, setup.arm.size))
    shares[j, j - 1] = size
    extra = Extra(shares=tuple(map(tuple, shares)))
    return _with_extra(
        setup, extra, ("encoder coupling", setup.arm.joints[j].name), 100 * size, "%"
    )


def tilted_frame(setup: Setup, rng: np.random.Generator) -> Planted:
    """A joint is mounted with its axis off by 0.5 to 2°, and what it carries with it."""
    j, size = int(rng.choice(AXES[setup.arm.name])), float(np.deg2rad(rng.uniform(0.5, 2.0)))
    joint = setup.arm.joints[j]
    along = np.cross(joint.axis, rng.standard_normal(3))
    return _misplaced(setup, j, size, "rad", rpy=_turned(joint, size * _unit(along)))


def tilted_axis(setup: Setup, rng: np.random.Generator) -> Planted:
    """The axis of a joint alone is off by 0.5 to 2°: at zero all links are as drawn."""
    j, size = int(rng.choice(AXES[setup.arm.name])), float(np.deg2rad(rng.uniform(0.5, 2.0)))
    joint = setup.arm.joints[j]
    along = _unit(np.cross(joint.axis, rng.standard_normal(3)))
    axis = Rotation.from_rotvec(size * along).apply(joint.axis)
    return _misplaced(setup, j, size, "rad", axis=tuple(axis.tolist()))


def offset_drift(setup: Setup, rng: np.random.Generator) -> Planted:
    """The offset of a torque drifts by 0.3 to 1 times the dry friction over all records."""
    j = _with_friction(setup, rng)
    size = float(rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0])) * setup.made.coulomb[j]
    extra = Extra(drift=tuple(_one(setup, j, size / (2 * 8.0))))
    return _with_extra(setup, extra, ("offset drift", setup.arm.joints[j].name), size, "N m")


def offset_jump(setup: Setup, rng: np.random.Generator) -> Planted:
    """The offset of a torque jumps by 0.3 to 1 times the dry friction."""
    j = _with_friction(setup, rng)
    size = float(rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0])) * setup.made.coulomb[j]
    extra = Extra(jump=tuple(_one(setup, j, size)), instant=float(rng.uniform(0.2, 0.8)))
    return _with_extra(setup, extra, ("offset jump", setup.arm.joints[j].name), size, "N m")


def load_jump(setup: Setup, rng: np.random.Generator) -> Planted:
    """A load of 0.5 to 2 kg is taken up during the records."""
    load, instant = _load(setup, rng), float(rng.uniform(0.2, 0.8))
    extra = Extra(load=load, instant=instant)
    # where one record ends and the next begins both are the same
    causes: tuple[Cause, ...] = (("load jump", None), ("payload", None))
    return Planted(replace(setup, extra=extra), causes, load.mass, "kg")


def load_drift(setup: Setup, rng: np.random.Generator) -> Planted:
    """A load grows from nothing to 0.5 to 2 kg over all records."""
    load = _load(setup, rng)
    return _with_extra(setup, Extra(load=load, grows=True), ("load drift", None), load.mass, "kg")


#: All faults, by the names on the command line.
FAULTS: dict[str, Fault] = {
    function.__name__.replace("_", "-"): function
    for function in (
        none,
        link_length,
        axis_angle,
        joint_offset,
        torque_late,
        drive_late,
        gear_ratio,
        torque_gain,
        lost_samples,
        hidden_jitter,
        encoder_sine,
        stribeck,
        tanh,
        backlash,
        elastic_joint,
        temperature,
        payload,
        missing_parameter,
        counter_spring,
        encoder_share,
        tilted_frame,
        tilted_axis,
        offset_drift,
        offset_jump,
        load_jump,
        load_drift,
    )
}


def is_possible(fault: str, arm: str) -> bool:
    """Whether a fault changes the torques of an arm."""
    return arm in {"link-length": LENGTHS, "joint-offset": ZEROS}.get(fault, (arm,))


def _with_extra(setup: Setup, extra: Extra, cause: Cause, size: float, unit: str) -> Planted:
    return Planted(replace(setup, extra=extra), (cause,), size, unit)


def _load(setup: Setup, rng: np.random.Generator) -> Payload:
    """0.5 to 2 kg beyond the last body, along the last axis."""
    mass = float(rng.uniform(0.5, 2.0))
    out = np.array(setup.arm.boxes[-1].center) + 0.06 * np.array(setup.arm.joints[-1].axis)
    return Payload(mass, tuple((out + rng.uniform(-0.02, 0.02, 3)).tolist()), (1,))


def _with_friction(setup: Setup, rng: np.random.Generator) -> int:
    """A joint with dry friction of its own."""
    return int(rng.choice(np.flatnonzero(setup.made.coulomb)))


def _any(setup: Setup, rng: np.random.Generator) -> int:
    return int(rng.integers(setup.arm.size))


def _one(setup: Setup, joint: int, value: float) -> np.ndarray:
    """A value for one joint, zero for the others."""
    values = np.zeros(setup.arm.size)
    values[joint] = value
    return values


def _misplaced(setup: Setup, j: int, size: float, unit: str, **place: tuple) -> Planted:
    """A joint that is at another place than the user describes, as the drawing has it."""
    joints = list(setup.believed)
    joints[j] = replace(joints[j], **place)
    arm = replace(setup.arm, joints=tuple(joints))
    wrong = replace(setup, made=replace(setup.made, arm=arm))
    return Planted(wrong, (("geometry", joints[j].name),), size, unit, arm.joints)


def _elastic(
    setup: Setup, rng: np.random.Generator, frequency: float, damping: float, play: float
) -> Planted:
    """A gear with a natural frequency [Hz] and a damping ratio, and a play [rad]."""
    arm = setup.arm
    j = int(rng.choice(GEARED[arm.name]))
    bodies = RigidModel(arm, setup.made.bodies, np.zeros(arm.size), setup.made.shafts)
    inertia = bodies.inertia(np.array(arm.home))[j, j]
    w = 2 * np.pi * frequency
    spring = Spring(j, inertia * w**2, 2 * damping * inertia * w, play)
    name = arm.joints[j].name
    causes: tuple[Cause, ...] = (("elasticity", name),)
    if play:
        return Planted(
            replace(setup, spring=spring), (("backlash", name), *causes), 1e3 * play, "mrad"
        )
    return Planted(replace(setup, spring=spring), causes, frequency, "Hz")


def _unit(vector: np.ndarray | tuple[float, ...]) -> np.ndarray:
    return np.asarray(vector) / np.linalg.norm(vector)


def _turned(joint: JointPlace, by: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a joint's frame turned by a rotation vector in its own axes."""
    turned = Rotation.from_euler("xyz", joint.rpy) * Rotation.from_rotvec(by)
    roll, pitch, yaw = turned.as_euler("xyz").tolist()
    return roll, pitch, yaw
