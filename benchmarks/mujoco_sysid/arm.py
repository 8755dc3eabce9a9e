"""Arms in MuJoCo, the model that the search starts from, and the motions.

Position actuators of MuJoCo, τ = kp (u - q) - kv dq, move the joints; the gains are known. Bodies,
armature, damping and frictionloss are not: the search starts from a file in which all of them are
wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

#: Time step [s]; it is also the period of the log.
STEP = 0.002

#: Time constants of the constraint that dry friction is in MuJoCo [s]: the default, and the
#: shortest that the time step allows.
DEFAULT_TIME, SHORT_TIME = 0.02, 2.0 * STEP

#: Reach of the three axes [rad].
REACH = np.array([1.2, 0.8, 1.2])


@dataclass(frozen=True, eq=False)
class Chain:
    """What is known of an arm; one entry for each joint."""

    joints: tuple[str, ...]
    axes: tuple[str, ...]  # of the joints, in the frames of their bodies
    places: np.ndarray  # of each body in the one before it [m], shape (joints, 3)
    turns: np.ndarray  # of each body about x of the one before it [rad], shape (joints,)
    kp: np.ndarray  # gains of the position actuators [N m/rad], likewise
    kv: np.ndarray  # [N m s/rad], likewise


@dataclass(frozen=True, eq=False)
class Bodies:
    """What is unknown of an arm; one row or entry for each joint and the body that it moves."""

    chain: Chain
    mass: np.ndarray  # [kg], shape (joints,)
    centre: np.ndarray  # of mass, in the body's frame [m], shape (joints, 3)
    inertia: np.ndarray  # about it, xx yy zz xy xz yz [kg m²], shape (joints, 6)
    armature: np.ndarray  # [kg m²], shape (joints,)
    damping: np.ndarray  # [N m s/rad], likewise
    friction: np.ndarray  # frictionloss [N m], likewise


THREE_AXES = Chain(
    joints=("base", "shoulder", "elbow"),
    axes=("0 0 1", "0 1 0", "0 1 0"),
    places=np.array([[0.0, 0.0, 0.3], [0.0, 0.08, 0.1], [0.4, 0.0, 0.0]]),
    turns=np.zeros(3),
    kp=np.array([600.0, 800.0, 400.0]),
    kv=np.array([40.0, 50.0, 20.0]),
)

TRUE = Bodies(
    chain=THREE_AXES,
    mass=np.array([4.0, 3.0, 2.0]),
    centre=np.array([[0.01, 0.03, 0.05], [0.18, 0.02, 0.01], [0.12, -0.02, 0.02]]),
    inertia=np.array([
        [0.020, 0.018, 0.015, 0.001, -0.001, 0.002],
        [0.008, 0.045, 0.047, 0.001, 0.002, -0.001],
        [0.005, 0.018, 0.019, -0.001, 0.001, 0.001],
    ]),
    armature=np.array([0.30, 0.30, 0.15]),
    damping=np.array([2.0, 2.5, 1.2]),
    friction=np.array([2.0, 2.5, 1.2]),
)  # fmt: skip


def without_friction(bodies: Bodies) -> Bodies:
    """The same arm without frictionloss."""
    return replace(bodies, friction=np.zeros_like(bodies.friction))


def wrong(bodies: Bodies) -> Bodies:
    """Where the search starts: a third more mass, centres 2 cm off, drives wrong by factors."""
    return Bodies(
        chain=bodies.chain,
        mass=1.3 * bodies.mass,
        centre=bodies.centre + np.array([0.02, -0.02, 0.02]),
        inertia=1.5 * bodies.inertia,
        armature=0.5 * bodies.armature,
        damping=2.0 * bodies.damping,
        friction=0.5 * bodies.friction,
    )


def mjcf(bodies: Bodies, friction_time: float = DEFAULT_TIME) -> str:
    """The arm as an MJCF file, with sensors of position, speed and torque of each joint.

    ``friction_time``: time constant of MuJoCo's soft dry friction [s].
    """
    opened, chain = [], bodies.chain
    for j, name in enumerate(chain.joints):
        opened.append(
            f'<body name="{name}_link" pos="{_text(chain.places[j])}" '
            f'euler="{chain.turns[j]:.17g} 0 0">'
            f'<inertial pos="{_text(bodies.centre[j])}" mass="{bodies.mass[j]:.17g}" '
            f'fullinertia="{_text(bodies.inertia[j])}"/>'
            f'<joint name="{name}" axis="{chain.axes[j]}" armature="{bodies.armature[j]:.17g}" '
            f'damping="{bodies.damping[j]:.17g}" frictionloss="{bodies.friction[j]:.17g}" '
            f'solreffriction="{friction_time} 1"/>'
        )
    actuators = "".join(
        f'<position name="{n}" joint="{n}" kp="{chain.kp[j]}" kv="{chain.kv[j]}"/>'
        for j, n in enumerate(chain.joints)
    )
    sensors = "".join(
        f'<{kind} name="{n}_{short}" {of}="{n}"/>'
        for kind, short, of in (
            ("jointpos", "q", "joint"), ("jointvel", "dq", "joint"),
            ("actuatorfrc", "tau", "actuator"),
        )
        for n in chain.joints
    )  # fmt: skip
    return (
        f'<mujoco model="arm"><compiler angle="radian"/><option timestep="{STEP}" integrator="RK4">'
        '<flag contact="disable"/></option>'
        f"<worldbody>{''.join(opened)}{'</body>' * len(chain.joints)}</worldbody>"
        f"<actuator>{actuators}</actuator><sensor>{sensors}</sensor></mujoco>"
    )


def reference(seed: int, seconds: float, reach: np.ndarray = REACH) -> np.ndarray:
    """Sums of five sines that begin at rest, shape (samples, joints) [rad].

    ``reach``: of each joint [rad], shape (joints,).
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds / STEP)) * STEP
    omega = 2.0 * np.pi * np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    size = rng.normal(size=(len(reach), 5))
    phase = omega * t[:, None, None] + rng.uniform(0.0, 2.0 * np.pi, (len(reach), 5))
    q = (size * np.sin(phase)).sum(axis=2)
    q *= reach / np.abs(q).max(axis=0)
    ramp = np.minimum(t / 1.0, 1.0)[:, None]
    return q * ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)


def _text(numbers) -> str:
    return " ".join(f"{x:.17g}" for x in numbers)
