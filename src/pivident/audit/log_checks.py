"""The checks that compare torque and motion, in their order.

Other distributions add some by entry points of the group ``pivident.findings``.
"""

from __future__ import annotations

from pivident.audit.examination import LogCheck
from pivident.registry import Registry

#: Checks that compare torque and motion, in their order; those of other distributions come last.
CHECKS: Registry[LogCheck] = Registry(
    "pivident.findings",
    LogCheck,
    {
        "order": "pivident.audit.order:OrderCheck",
        "delay": "pivident.audit.delay:DelayCheck",
        "gravity": "pivident.audit.gravity:GravityCheck",
        "power": "pivident.audit.power:PowerCheck",
        "scale": "pivident.audit.scale:ScaleCheck",
        "model": "pivident.audit.unexplained:UnexplainedCheck",
        "excitation": "pivident.audit.excitation:ExcitationCheck",
    },
)
