"""Joints whose torque the inverse model does not explain."""

from __future__ import annotations

import numpy as np

from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import InverseModel

UNEXPLAINED_TORQUE = FindingKind(Topic("model", "Inverse model"), "unexplained", ("robot",))

#: Share of a joint's torque that its inverse model may leave unexplained.
UNEXPLAINED = 0.5


class UnexplainedCheck(LogCheck):
    """The share of each torque that no parameters explain."""

    name = "model"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        return seen.after(self.name, check_unexplained(seen.model))


def check_unexplained(model: InverseModel) -> list[Finding]:
    """Joints whose torque the inverse model does not explain."""
    findings = []
    for joint, error in zip(model.robot.joints, model.relative_errors, strict=True):
        if not error <= UNEXPLAINED:
            share = "nothing" if not np.isfinite(error) else f"{100 * (1 - error):.3g} %"
            text = f"The inverse model explains {share} of the torque of {joint.name}."
            step = "Check the column, the geometry and the friction law of this joint."
            evidence = {"unexplained": Quantity(100 * float(error), "%", bound=100 * UNEXPLAINED)}
            findings.append(UNEXPLAINED_TORQUE.finding("warning", text, joint.name, step, evidence))
    return findings
