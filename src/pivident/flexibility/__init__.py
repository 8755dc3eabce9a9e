"""Flexible joints: compliance, two-mass models, resonances, and their effect on rigid models.

With encoders on both sides of the gear: `identify_compliance` (slow motion: stiffness, hysteresis,
transmission error) and `identify_two_mass` (both inertias, stiffness, damping). With the motor's
encoder alone: `find_resonance`. Effect of compliance on a rigid model: `rigid_validity`. Names are
imported when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pivident.flexibility.compliance import identify_compliance
    from pivident.flexibility.resonance import find_resonance
    from pivident.flexibility.rigid_validity import rigid_validity
    from pivident.flexibility.simulated_joint import TwoMassJoint, simulate_joint
    from pivident.flexibility.two_mass import identify_two_mass

#: Where each name lives.
_HOME = {
    "TwoMassJoint": "simulated_joint",
    "find_resonance": "resonance",
    "identify_compliance": "compliance",
    "identify_two_mass": "two_mass",
    "rigid_validity": "rigid_validity",
    "simulate_joint": "simulated_joint",
}

__all__ = [
    "TwoMassJoint",
    "find_resonance",
    "identify_compliance",
    "identify_two_mass",
    "rigid_validity",
    "simulate_joint",
]


def __getattr__(name: str) -> Any:
    """A name of the front door, imported from its home at first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'pivident.flexibility' has no attribute {name!r}")
    return getattr(import_module(f"pivident.flexibility.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
