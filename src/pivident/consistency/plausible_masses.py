"""Plausible masses: within a factor of the reference's, unless the user or the data say otherwise.

Descriptions of vendors are off by some tens of percent, bodies of the geometry alone by a factor of
a few. The bounds apply to the choice among near parameters only (see `nearest_consistent`); least
distance and intervals do not use them, since they are no knowledge of the machine.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.consistency.constraints import Bounds, Constraint, mass_interval, place_of_link
from pivident.consistency.reference import Reference, body_links, link_places
from pivident.dynamics.parameters import Parameter
from pivident.robot.description import Robot

#: Largest mass of a link over that of the description, and least under it; the same of the total.
MAX_FACTOR, MAX_TOTAL_FACTOR = 3.0, 2.0

#: The same for bodies of the geometry alone.
MAX_ASSUMED_FACTOR, MAX_ASSUMED_TOTAL_FACTOR = 10.0, 4.0


def plausible_masses(
    robot: Robot,
    standard: Sequence[Parameter],
    reference: Reference,
    bounds: Bounds | None = None,
) -> tuple[Constraint, ...]:
    """Bounds of every mass and of their total, where the user declares none."""
    declared = bounds or Bounds()
    places = link_places(robot, standard)
    own = {place_of_link(robot, name) for name in declared.mass}
    made: list[Constraint] = []
    names = [robot.tree.links[i].name for i in body_links(robot)]
    for i, place in enumerate(places):
        if i not in own:
            factor = MAX_ASSUMED_FACTOR if reference.assumed[i] else MAX_FACTOR
            made += _within(names[i], "mass", place[9:], factor, reference)
    if declared.total_mass is None and not own:
        factor = MAX_ASSUMED_TOTAL_FACTOR if reference.assumed.any() else MAX_TOTAL_FACTOR
        made += _within("all links", "total mass", places[:, 9], factor, reference)
    return tuple(made)


def _within(
    subject: str, what: str, places: np.ndarray, factor: float, reference: Reference
) -> list[Constraint]:
    """Between the reference over ``factor`` and ``factor`` times the reference."""
    mass = float(reference.values[places].sum())
    return mass_interval(subject, what, (mass / factor, mass * factor), places, reference)
