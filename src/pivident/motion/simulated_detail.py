"""What the smoother takes from a motion, given back from the simulated one.

The smoother S keeps noise out of the accelerations, and with it what the motion has above its band:
where dry friction turns round, an acceleration that changes within milliseconds. The torque and the
instruments have that, so E[Zᵀ(τ - Φ(Sq)θ)] is not zero, and the estimate is biased. S is linear,
and the simulated motion q_s shares no noise with the record; what S takes from q_s is what it takes
from q. Smoothing the difference of the two,

    q̂ = q_s + S (q - q_s) = S q + (1 - S) q_s,

leaves the noise of q̂ as it was, and of its bias only that of what the model does not explain.

Rounding to counts that are visible is a function of the position, not noise: what S makes of it
depends on the motion, and such joints are left as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion
from pivident.scratch import working_array
from pivident.signals.instants import differences_at_instants
from pivident.threads import run_in_threads


def with_simulated_detail(kinematics: Kinematics, motion: SimulatedMotion) -> Kinematics:
    """The measured motion with (1 - S) q_s added, at the joints that have an S.

    A motion from the record has noise of its own, which it would bring along: then nothing is
    added.
    """
    known = [j for j, smoother in enumerate(kinematics.smoothers) if smoother is not None]
    if motion.from_record or not known:
        return kinematics
    q, dq, ddq = (working_array(kinematics.q.shape) for _ in range(3))

    def add(j: int) -> None:
        own, smoother = slice(j, j + 1), kinematics.smoothers[j]
        detail = np.zeros((1, q.shape[1]))
        if smoother is not None:
            detail[0] = motion.q[j] - smoother.smoothed(motion.q[j])
        differences_at_instants(detail, motion.rate, 0, dq[own], ddq[own])
        q[j] = kinematics.q[j] + detail[0]
        dq[j] += kinematics.dq[j]
        ddq[j] += kinematics.ddq[j]

    run_in_threads(add, range(len(q)))
    return replace(kinematics, q=q, dq=dq, ddq=ddq)
