"""What the smoother takes from a motion, given back from the simulated one or from forces.

The smoother S keeps noise out of the accelerations, and with it what the motion has above its band:
where dry friction turns round, an acceleration that changes within milliseconds. The torque and the
instruments have that, so E[Zᵀ(τ - Φ(Sq)θ)] is not zero, and the estimate is biased. S is linear,
and the simulated motion q_s shares no noise with the record; what S takes from q_s is what it takes
from q. Smoothing the difference of the two,

    q̂ = q_s + S (q - q_s) = S q + (1 - S) q_s,

leaves the noise of q̂ as it was, and of its bias only that of what the model does not explain.

Where the record shows another one, q_s is no guide: a simulated loop that rings, since its
parameters are far off, has a detail that the real one has not, and adding it spoils the
accelerations. Then what S took from q is farther from that detail than from none.

Rounding to counts that are visible is a function of the position, not noise: what S makes of it
depends on the motion, and such joints are left as they are.

What it takes from a floating base is given back from the forces on it. The pose of a base is
measured less finely than joints are by their encoders, and its smoother S has a band of some ten
hertz. Legs that turn round jolt the base faster than that; S takes it from the base's acceleration,
the instruments and the other rows have it, and the estimate is biased by several standard errors.
No loop that could be simulated moves the base. But no motor acts on it either, so that its six rows
say how it accelerates where legs move like this and forces from outside are these,

    M_bb ddq_f = τ_b - h_b(q, dq) - M_bl ddq_l,        ddq_b = S ddq_b + (1 - S) P ddq_f

with M and h of the last estimate. Noise of the wrenches comes in; instruments do not share it. The
low-pass P keeps what the smoothers of the legs have left alone: what a foot's force does to its own
leg above their band would be taken for a motion of the base.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.foundation.scratch import working_array
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import Kinematics, SimulatedMotion
from pivident.signals.instants import differences_at_instants
from pivident.signals.random_walk import WalkSmoother
from pivident.signals.random_walk_model import nvr_from_f50

#: Growth of the square that S took from the record by a detail that it contradicts.
CONTRADICTED = 0.05


def with_simulated_detail(kinematics: Kinematics, motion: SimulatedMotion) -> Kinematics:
    """The measured motion with (1 - S) q_s added, at the joints that have an S.

    A motion from the record has noise of its own, which it would bring along: then nothing is
    added, nor at joints where the record contradicts it.
    """
    known = [j for j, smoother in enumerate(kinematics.smoothers) if smoother is not None]
    if motion.from_record or not known:
        return kinematics
    inside = slice(kinematics.start, kinematics.stop)
    q, dq, ddq = (working_array(kinematics.q.shape) for _ in range(3))

    def add(j: int) -> None:
        own, smoother = slice(j, j + 1), kinematics.smoothers[j]
        detail = np.zeros((1, q.shape[1]))
        if smoother is not None:
            detail[0] = motion.q[j] - smoother.smoothed(motion.q[j])
            taken = kinematics.recording.q[inside, j] - kinematics.q[j, inside]
            if np.sum((taken - detail[0, inside]) ** 2) > (1.0 + CONTRADICTED) * np.sum(taken**2):
                detail[:] = 0.0
        differences_at_instants(detail, motion.rate, 0, dq[own], ddq[own])
        q[j] = kinematics.q[j] + detail[0]
        dq[j] += kinematics.dq[j]
        ddq[j] += kinematics.ddq[j]

    run_in_threads(add, range(len(q)))
    return replace(kinematics, q=q, dq=dq, ddq=ddq)


#: Share of its band up to which a smoother S of third order leaves 98 % of a motion.
SHARE_OF_BAND = 0.5

#: Order of P.
ORDER = 3


def with_forced_detail(
    regressor: Regressor, kinematics: Kinematics, theta: np.ndarray
) -> Kinematics:
    """The measured motion with (1 - S) P ddq_f added to the accelerations of a floating base.

    Nothing is added where no S is known, where θ has a base that no force could accelerate (initial
    values of a base of which nothing is known), or on feet that stand: motors act on that base, and
    all rows there are would be made to hold. Speeds and positions hardly change above the band of
    S.
    """
    robot = regressor.robot
    floats = robot.base_motion == "measured" and robot.constraints is None
    base = robot.base_joints
    known = [j for j, s in enumerate(kinematics.smoothers[:base]) if s is not None]
    if not floats or not known:
        return kinematics
    mass, left = _base_rows(regressor, kinematics, theta, base)
    if not np.linalg.eigvalsh(mass)[:, 0].min() > 0.0:
        return kinematics
    forced = np.ascontiguousarray(np.linalg.solve(mass, left[..., None])[..., 0].T)
    ddq, known_band = kinematics.ddq.copy(), _band_of_legs(kinematics, base)

    def add(j: int) -> None:
        smoother = kinematics.smoothers[j]
        assert smoother is not None
        own = forced[j] if known_band is None else known_band.smoothed(forced[j])
        ddq[j] += own - smoother.smoothed(own)

    run_in_threads(lambda k: add(known[k]), range(len(known)))
    return replace(kinematics, ddq=ddq)


def _band_of_legs(kinematics: Kinematics, base: int) -> WalkSmoother | None:
    """P: half the band of the leg whose smoother has the narrowest; None: it has no legs."""
    rate = kinematics.recording.rate
    smoothers = list(zip(kinematics.smoothers, kinematics.f50.tolist(), strict=True))[base:]
    bands = [f50 if s is None else s.band(rate) for s, f50 in smoothers]
    narrowest = min(bands, default=np.inf)
    if not np.isfinite(narrowest):
        return None
    return WalkSmoother(nvr_from_f50(SHARE_OF_BAND * narrowest, ORDER, rate), ORDER)


def _base_rows(
    regressor: Regressor, kinematics: Kinematics, theta: np.ndarray, base: int
) -> tuple[np.ndarray, np.ndarray]:
    """M_bb, shape (samples, base, base), and τ_b - h_b - M_bl ddq_l, shape (samples, base).

    The rows are linear in the accelerations: each column of M is the torque of one of them.
    """
    q, dq = kinematics.q.T, kinematics.dq.T
    legs = np.array(kinematics.ddq.T)
    legs[:, :base] = 0.0
    left = kinematics.tau[:base].T - regressor.torque(q, dq, legs, theta)[:, :base]
    still, mass = np.zeros_like(legs), np.empty((len(legs), base, base))
    at_rest = regressor.torque(q, still, still, theta)[:, :base]
    for i in range(base):
        one = still.copy()
        one[:, i] = 1.0
        mass[:, :, i] = regressor.torque(q, still, one, theta)[:, :base] - at_rest
    return mass, left
