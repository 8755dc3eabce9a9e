"""Whether each torque belongs to the position beside it.

The inverse model of joint j is fitted to the torque of every joint k. Friction follows the speed
of its own joint and of no other, so that the right column leaves the smallest error. The
assignment with the smallest product of errors is the order of the torques.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import Reordered, Repair
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.judgement.audit.spoilt_checks import COMPARISONS

ORDER = FindingKind(
    Topic("order", "Order of the joints"),
    "order",
    ("recording", "columns", "tau"),
    reservation=True,
    spoils=COMPARISONS,
)

#: Another order must shrink the error of each joint that it moves by this factor, on average.
BETTER = 2.0


@dataclass(frozen=True, eq=False)
class Order:
    """Which torque fits which joint."""

    findings: tuple[Finding, ...]
    errors: np.ndarray  # relative, of torque k on the columns of joint j, (joints, joints)
    torque_of: tuple[int, ...]  # index of the torque that fits each joint best as a whole


class OrderCheck(LogCheck):
    """The order of the torques; they are put into the one that fits."""

    name = "order"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        order = check_order(seen.model)
        is_wrong = any(finding.severity == "error" for finding in order.findings)
        right = seen.model.reordered(order.torque_of) if is_wrong else None
        return seen.after(self.name, order.findings, order, right)


def check_order(model: InverseModel) -> Order:
    """Find the order of the torque columns that fits the joints."""
    tau, joints = model.tau(), model.robot.size
    errors = np.ones((joints, joints))
    for j in range(joints):
        if model.usable(j):
            errors[j] = model.relative_error(j, tau)
    cost = np.log(np.clip(np.nan_to_num(errors, nan=1.0), 1e-6, 1.0))
    rows = np.arange(joints)
    best = cost.argmin(axis=1)
    if np.unique(best).size < joints:  # two joints fit one torque best: which order loses least?
        from scipy.optimize import linear_sum_assignment

        rows, best = linear_sum_assignment(cost)
    moved = np.flatnonzero(best != rows)
    gain = float(np.sum(cost[moved, moved] - cost[moved, best[moved]]))
    names = model.robot.joint_names
    if not moved.size or gain < moved.size * np.log(BETTER):
        text = "Each torque fits its own joint better than in any other order of the columns."
        if joints == 1:
            return Order((), errors, (0,))
        return Order((ORDER.finding("ok", text),), errors, tuple(range(joints)))
    pairs = ", ".join(f"{names[j]} takes the torque of {names[best[j]]}" for j in moved)
    factor = float(np.exp(gain / moved.size))
    text = (
        f"The torque columns fit in another order: {pairs}; the errors of these joints shrink "
        f"by a factor of {factor:.3g}."
    )
    step = "Change the order of the columns of tau, or that of q."
    evidence = {"factor": Quantity(factor, bound=BETTER)}
    order = tuple(int(k) for k in best)
    repair = Repair((Reordered(channel="tau", order=order),))
    whose = ", ".join(names[j] for j in moved)
    finding = ORDER.finding("error", text, whose, step, evidence, repairs=[repair])
    return Order((finding,), errors, order)
