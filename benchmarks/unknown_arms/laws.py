"""Hidden control laws. A user knows none of this; gains and forms change with the seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .arms import Arm
from .motion import Motion
from .truth import Machine

#: What a law adds: a function of tick, reference and measured position.
FeedForward = Callable[[int, np.ndarray], np.ndarray]


class Law:
    """A sampled law with proportional, derivative and integral part and a feed-forward.

        u = kp e + kd ė + ∫ (kip e + kiv ė) dt + feed-forward,    e = q_ref - q,  ė = dq_ref - v

    with v the difference of the measured positions over one period, low-passed. A position loop
    α around a velocity PI has kp = α kd and kip = α kiv; a PID has kiv = 0.
    """

    def __init__(
        self,
        gains: dict[str, np.ndarray],
        motion: Motion,
        feed_forward: FeedForward,
        limits: np.ndarray,
        describes: str,
    ) -> None:
        self.gains, self.describes = gains, describes
        self._motion, self._feed_forward, self._limits = motion, feed_forward, limits
        self._integral = np.zeros(motion.q.shape[1])
        self._last: np.ndarray | None = None
        self._speed = np.zeros(motion.q.shape[1])

    def torque(self, k: int, q: np.ndarray) -> np.ndarray:
        """Joint torque from tick k on [N m or N], for measured positions q, shape (joints,)."""
        g, m = self.gains, self._motion
        if self._last is None:
            self._last = q
        difference = (q - self._last) * m.rate
        self._last = q
        self._speed = self._speed + g["smoothing"] * (difference - self._speed)
        error, slip = m.q[k] - q, m.dq[k] - self._speed
        self._integral = self._integral + (g["kip"] * error + g["kiv"] * slip) / m.rate
        u = g["kp"] * error + g["kd"] * slip + self._integral + self._feed_forward(k, q)
        return np.clip(u, -self._limits, self._limits)


def hidden_law(made: Machine, motion: Motion, vendor, inertia: np.ndarray) -> Law:
    """The law of a machine.

    Args:
        made: the machine; arm and seed choose the form.
        motion: what it shall follow.
        vendor: rigid-body model of the controller, `simulator.RigidModel`.
        inertia: inertia of each joint at home [kg m² or kg], shape (joints,).
    """
    rng = np.random.default_rng([made.seed, 2])
    n = made.arm.size
    make = {"cobot6": _velocity_mode, "link7": _impedance, "scara": _pid}[made.arm.name]
    gains, words = make(made, inertia, rng.uniform(0.8, 1.2, (3, n)))
    form, feed_forward = _feed_forward(made, motion, vendor)
    gains = {"kip": np.zeros(n), "kiv": np.zeros(n), "smoothing": np.ones(n), **gains}
    return Law(gains, motion, feed_forward, made.arm.efforts, f"{words}; feed-forward: {form}")


def _velocity_mode(made: Machine, inertia: np.ndarray, f: np.ndarray):
    """Position P around velocity PI: 16 Hz of the velocity loop, 1.3 Hz of the position loop."""
    kv = 2 * np.pi * 16.0 * inertia * f[0]
    position = 2 * np.pi * 1.3 * f[1]
    integral = kv * 2 * np.pi * 1.6 * f[2]
    smoothing = np.full(made.arm.size, 0.6)
    gains = {"kp": kv * position, "kd": kv, "kip": integral * position, "kiv": integral}
    return {**gains, "smoothing": smoothing}, "velocity commands; position P, velocity PI"


def _impedance(made: Machine, inertia: np.ndarray, f: np.ndarray):
    """Stiffness and damping of a joint impedance: 4 Hz, damping ratio 0.8."""
    w = 2 * np.pi * 4.0 * f[0]
    return {"kp": inertia * w**2, "kd": 1.6 * inertia * w * f[1]}, "joint impedance"


def _pid(made: Machine, inertia: np.ndarray, f: np.ndarray):
    """PD for even seeds, PID for odd ones: 11 Hz, damping ratio 0.8, integral time 0.2 s."""
    w = 2 * np.pi * 11.0 * f[0]
    gains = {"kp": inertia * w**2, "kd": 1.6 * inertia * w * f[1]}
    if made.seed % 2 == 0:
        return gains, "PD"
    return {**gains, "kip": gains["kp"] / (0.2 * f[2])}, "PID"


def _feed_forward(made: Machine, motion: Motion, vendor) -> tuple[str, FeedForward]:
    """The form that the seed chooses."""
    arm: Arm = made.arm
    n = arm.size
    drawn = np.array(arm.coulomb)

    def none(k: int, q: np.ndarray) -> np.ndarray:
        return np.zeros(n)

    def gravity_of_reference(k: int, q: np.ndarray) -> np.ndarray:
        return vendor.gravity(motion.q[k])

    def gravity_and_friction(k: int, q: np.ndarray) -> np.ndarray:
        return vendor.gravity(motion.q[k]) + 0.7 * drawn * np.tanh(motion.dq[k] / 0.02)

    def gravity_of_measurement(k: int, q: np.ndarray) -> np.ndarray:
        return vendor.gravity(q)

    def computed_torque(k: int, q: np.ndarray) -> np.ndarray:
        return vendor.inverse_dynamics(motion.q[k], motion.dq[k], motion.ddq[k])

    def gravity_and_inertia(k: int, q: np.ndarray) -> np.ndarray:
        return vendor.gravity(q) + vendor.inertia(motion.q[k]) @ motion.ddq[k]

    forms = {
        "cobot6": (
            ("none", none),
            ("gravity of the reference", gravity_of_reference),
            ("gravity of the reference and part of the dry friction", gravity_and_friction),
        ),
        "link7": (
            ("gravity of the measurement", gravity_of_measurement),
            ("computed torque of the reference", computed_torque),
            ("gravity of the measurement, inertia of the reference", gravity_and_inertia),
        ),
        "scara": (("none", none),),
    }[arm.name]
    return forms[made.seed % len(forms)]
