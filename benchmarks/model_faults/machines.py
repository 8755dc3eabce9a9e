"""Machines, their loops, and what a user believes of them.

The drawings are those of `benchmarks.unknown_arms`. Here the machine's friction is as smooth as
the user's law, (2/π) atan(γ dq), its control law is known but for a cascade's, and its torques are
logged as the drives make them: without a fault the user's model is right.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from benchmarks.unknown_arms.arms import Arm, JointPlace
from benchmarks.unknown_arms.models import urdf
from benchmarks.unknown_arms.simulator import RigidModel
from benchmarks.unknown_arms.truth import Machine, machine

#: Slope of the smoothed sign times rated speed. Steeper signs turn within less time than the
#: smoothing of the positions resolves, and their reversals alone then cost inertias 0.05 %.
SLOPE_AT_RATED_SPEED = 100.0

#: Rate of control and log [Hz], bandwidth of the loop [Hz], lowest and highest frequency of the
#: sines [Hz], what the law adds.
LOOPS = {
    "scara": (1000.0, 10.0, (0.3, 2.5), "none"),
    "cobot6": (500.0, 5.0, (0.12, 1.0), "gravity"),
    "link7": (1000.0, 6.0, (0.12, 1.2), "gravity_measured"),
    "telescope": (1000.0, 6.0, (0.15, 1.5), "none"),
}

#: Integral times of the arms whose law is a cascade, which the user does not know [s].
CASCADES = {"telescope": 0.15}


@dataclass(frozen=True)
class Spring:
    """An elastic gear: torque k (θ - q) beyond a play, and damping.

    Attributes:
        joint: its index.
        stiffness: [N m/rad].
        damping: [N m s/rad].
        play: between both flanks [rad].
    """

    joint: int
    stiffness: float
    damping: float
    play: float = 0.0


@dataclass(frozen=True)
class Payload:
    """A small cube of mass [kg] at a place in the frame of the last link [m], in some records."""

    mass: float
    center: tuple[float, float, float]
    records: tuple[int, ...]


@dataclass(frozen=True)
class Extra:
    """What acts on a machine beside its model; each joint array has a value for every joint.

    Attributes:
        stiffness: of springs to the base [N m/rad or N/m]; they rest in the middle of the travel.
        shares: what each encoder sees of the other joints' positions, by joint.
        drift: by which the offset of each torque grows [N m/s or N/s].
        jump: by which it changes at an instant [N m or N].
        load: at the flange, whose ``records`` are not asked.
        grows: whether the load grows from nothing over all records, or comes at the instant.
        instant: share of all records after which that happens.
    """

    stiffness: tuple[float, ...] = ()
    shares: tuple[tuple[float, ...], ...] = ()
    drift: tuple[float, ...] = ()
    jump: tuple[float, ...] = ()
    load: Payload | None = None
    grows: bool = False
    instant: float = 0.0


@dataclass(frozen=True)
class Setup:
    """A machine as it is, how it is logged, and what the user believes.

    Joint arrays have shape (joints,). The law and the log are on the user's side: they see
    ``gear`` · q + ``zero`` for a position q, and a torque u of theirs is a torque ``drive`` · u.

    Attributes:
        made: bodies, rotors and friction levels.
        rate: of control and log [Hz].
        kp, kd: gains of the law, on the user's side.
        integral_time: in which the law's integral adds as much as the rest [s]; infinite: a PD law.
            With it the law is a position loop kp/kd around a velocity PI.
        feed_forward: what the law adds, in the words of `pivident.Loop`.
        gamma: slope of the smoothed sign [s/rad or s/m].
        tanh: whether the sign is a hyperbolic tangent instead of an arctangent.
        stribeck: excess of the friction at rest [N m or N].
        stribeck_speed: speed over which it fades [rad/s or m/s].
        gear, zero, drive: see above.
        ripple: amplitude [rad or m], periods per rad or m, and phase of the encoders' sines,
            shape (3, joints).
        late: samples after which the drives act.
        tremble: standard deviation of the instants at which the log reads positions [s].
        drift: share by which viscous and Coulomb friction fall over all records.
        spring: an elastic gear, or None.
        payload: a load, or None.
        logged_late: samples by which the log holds an older torque.
        lost: share of samples that the log lacks.
        believed: joints as the user describes them.
        left_out: standard parameters that the user does not estimate.
        extra: what acts beside the model, or None; traces without it keep their names.
    """

    made: Machine
    rate: float
    kp: np.ndarray
    kd: np.ndarray
    feed_forward: str
    gamma: np.ndarray
    tanh: bool
    stribeck: np.ndarray
    stribeck_speed: np.ndarray
    gear: np.ndarray
    zero: np.ndarray
    drive: np.ndarray
    ripple: np.ndarray
    integral_time: float = np.inf
    late: int = 0
    tremble: float = 0.0
    drift: float = 0.0
    spring: Spring | None = None
    payload: Payload | None = None
    logged_late: int = 0
    lost: float = 0.0
    believed: tuple[JointPlace, ...] = ()
    left_out: tuple[str, ...] = ()
    extra: Extra | None = field(default=None, repr=False)

    @property
    def arm(self) -> Arm:
        """The drawing."""
        return self.made.arm

    @property
    def believed_arm(self) -> Arm:
        """The drawing as the user has it."""
        return replace(self.arm, joints=self.believed)

    @property
    def description(self) -> str:
        """The user's URDF: joints as believed, masses off by 10 to 30 %."""
        return urdf(self.believed_arm, self.made.urdf_bodies)


def draw(name: str, seed: int, rate: float | None = None) -> Setup:
    """A machine without fault.

    Args:
        name: of the arm.
        seed: decides bodies, rotors, friction, gains.
        rate: of control and log [Hz]; None: that of `LOOPS`.
    """
    usual, bandwidth, frequencies, feed_forward = LOOPS[name]
    made = machine(name, seed, exact_sheet=True)
    made = replace(made, arm=replace(made.arm, bearing_share=1.0, frequencies=frequencies))
    rng = np.random.default_rng([seed, 11])
    n = made.arm.size
    rigid = RigidModel(made.arm, made.bodies, made.rotor, made.shafts)
    inertia = np.diag(rigid.inertia(np.array(made.arm.home)))
    w = 2 * np.pi * bandwidth * rng.uniform(0.85, 1.15, n)
    zero = np.zeros(n)
    return Setup(
        made=made,
        rate=rate or usual,
        kp=inertia * w**2,
        kd=1.6 * inertia * w * rng.uniform(0.9, 1.1, n),
        feed_forward=feed_forward,
        integral_time=CASCADES.get(name, np.inf),
        gamma=SLOPE_AT_RATED_SPEED / made.arm.speeds,
        tanh=False,
        stribeck=zero,
        stribeck_speed=np.ones(n),
        gear=np.ones(n),
        zero=zero,
        drive=np.ones(n),
        ripple=np.zeros((3, n)),
        believed=made.arm.joints,
    )
