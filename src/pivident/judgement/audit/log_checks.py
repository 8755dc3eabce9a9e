"""The checks that compare torque and motion, in their order.

Other distributions add some by entry points of the group ``pivident.findings``.
"""

from __future__ import annotations

from pivident.foundation.registry import Registry
from pivident.judgement.audit.examination import LogCheck

#: Checks that compare torque and motion, in their order; those of other distributions come last.
CHECKS: Registry[LogCheck] = Registry(
    "pivident.findings",
    LogCheck,
    {
        "order": "pivident.judgement.audit.order:OrderCheck",
        "delay": "pivident.judgement.audit.delay:DelayCheck",
        "gravity": "pivident.judgement.audit.gravity:GravityCheck",
        "power": "pivident.judgement.audit.power:PowerCheck",
        "scale": "pivident.judgement.audit.scale:ScaleCheck",
        "model": "pivident.judgement.audit.excitation:UnexplainedCheck",
        "excitation": "pivident.judgement.audit.excitation:ExcitationCheck",
    },
)
