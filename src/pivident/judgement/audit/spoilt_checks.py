"""Checks that make no sense behind some faults, by name: what a kind of finding says it spoils."""

from __future__ import annotations

#: Checks of the description against the torques.
GEOMETRY = ("geometry", "torque side")

#: Those, and that of the control law: channels are not what they are called, or not in time.
COMPARISONS = ("gains", *GEOMETRY)
