"""Whether the torques hold the gravity of the robot's description at all.

Some drives log torques from which gravity is taken out. With the description's torques of gravity
g_j and of inertia i_j each joint is fitted by

    τ_j = a g_j + b i_j + c ddq_j + friction.

Where a g_j is nothing of the torque on all joints whose gravity would be more than their inertia,
although little else is left unexplained, the torques hold none. No unit of the torque changes that.
Gravity in another direction is another fault: it leaves much.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.foundation.text.finding import FindingKind, Quantity, Topic
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.repair import Edit, Repair
from pivident.foundation.text.sentences import listed
from pivident.judgement.audit.blocked_fit import blocked_fit, jackknife
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import DescribedTorque, InverseModel

NO_GRAVITY = FindingKind(
    Topic("gravity", "Gravity in the torques"), "none", ("robot", "gravity"), reservation=True
)

#: Joints are asked whose gravity would be so many times their torque of inertia.
LOADED = 1.0

#: Share of gravity in a torque, with its two standard errors, below which it holds none of it.
NONE_OF_IT = 0.03

#: Share of a torque that may be left unexplained without gravity.
UNEXPLAINED = 0.25


class GravityCheck(LogCheck):
    """Torques without gravity; the rows are taken without it."""

    name = "gravity"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        model = seen.model
        shares = gravity_shares(model)
        free = [a + 2.0 * s < NONE_OF_IT and left < UNEXPLAINED for a, s, left in shares.values()]
        if len(free) < 2 or not all(free):
            return seen
        most = max(a + 2.0 * s for a, s, _ in shares.values())
        sizes = [f"{name} {plus_minus(100 * a, 200 * s)} %" for name, (a, s, _) in shares.items()]
        text = (
            "The torques hold no gravity: the drives have taken it out. It makes so much of them: "
            f"{listed(sizes, 3)}."
        )
        finding = NO_GRAVITY.finding(
            "error",
            text,
            next_step="Set gravity = [0, 0, 0] under [robot].",
            evidence={"largest share": Quantity(most, bound=NONE_OF_IT)},
            repairs=[Repair((Edit(("robot", "gravity"), [0.0, 0.0, 0.0]),))],
        )
        nothing = DescribedTorque(lambda: (np.zeros_like(model.gravity), model.inertial))
        return seen.after(self.name, [finding], shares, replace(model, described=nothing))


def gravity_shares(model: InverseModel) -> dict[str, tuple[float, float, float]]:
    """Gravity in the torque, its standard error, and what is left unexplained, by joint.

    All as shares of the torque's rms; only of joints that gravity would load.
    """
    tau, shares = model.tau(), {}
    for j, joint in enumerate(model.robot.joints):
        rows = model.moving[:, j]
        weight, inertial = model.gravity[rows, j], model.inertial[rows, j]
        size = float(np.std(tau[rows, j])) if rows.any() else 0.0
        if not model.usable(j) or size == 0.0 or np.std(weight) <= LOADED * np.std(inertial):
            continue
        parameters = model.base.parameters
        friction = [k for k, p in enumerate(model.own[j]) if parameters[p].friction is not None]
        columns = np.column_stack(
            [weight, inertial, model.ddq[rows, j], model.columns[j][rows][:, friction]]
        )
        length = np.linalg.norm(columns, axis=0)
        kept = length > 0.0
        fit = blocked_fit(columns[:, kept] / length[kept], tau[rows, j], model.block[rows])
        left = tau[rows, j] - (columns[:, kept] / length[kept]) @ fit.estimate
        spread = float(jackknife(fit.replicates[:, :1])[0])
        unit = float(np.std(weight)) / (size * float(length[0]))
        shares[joint.name] = (
            abs(float(fit.estimate[0])) * unit,
            spread * unit,
            float(np.linalg.norm(left) / np.linalg.norm(tau[rows, j])),
        )
    return shares
