"""Tables of consistent models and of their intervals."""

from __future__ import annotations

import numpy as np

from pivident.consistency.consistent_model import ConsistentModel
from pivident.consistency.profile_intervals import ProfileIntervals
from pivident.document.table import Table, Values

_ENDS = {
    "low": "lower end, -∞ where nothing bounds it, NaN where the solver found none",
    "high": "upper end, likewise",
}


def profile_intervals(found: ProfileIntervals) -> Table:
    """One row for each quantity."""
    columns: dict[str, Values] = {
        "quantity": tuple(found.names),
        "value": np.asarray(found.values, dtype=float),
        "low": np.asarray(found.low, dtype=float),
        "high": np.asarray(found.high, dtype=float),
        "unit": tuple(found.units),
        "confidence": np.full(len(found.names), found.confidence),
    }
    return Table("intervals", columns, _ENDS)


def consistent_parameters(model: ConsistentModel) -> Table:
    """All standard parameters with their 95 % intervals, which take a second or two."""
    made = profile_intervals(model.intervals(of="standard"))
    joints = [model.robot.tree.joints[p.joint].name for p in model.parameters]
    links = [model.robot.tree.links[p.joint].name for p in model.parameters]
    head: dict[str, Values] = {
        "parameter": made["quantity"],
        "joint": tuple(joints),
        "link": tuple(links),
    }
    rest = {name: made[name] for name in made.columns if name != "quantity"}
    return Table("parameters", head | rest, _ENDS)


def consistent_links(model: ConsistentModel) -> Table:
    """Mass, centre of mass and inertia about it of every link, in the link's frame."""
    rows = []
    for body in model.links:
        x, y, z = (float(c) for c in body.center_of_mass)
        tensor = np.asarray(body.inertia, dtype=float)
        rows.append(
            {
                "link": body.name,
                "mass_kg": float(body.mass),
                "x_m": x,
                "y_m": y,
                "z_m": z,
                "ixx_kg_m2": float(tensor[0, 0]),
                "ixy_kg_m2": float(tensor[0, 1]),
                "ixz_kg_m2": float(tensor[0, 2]),
                "iyy_kg_m2": float(tensor[1, 1]),
                "iyz_kg_m2": float(tensor[1, 2]),
                "izz_kg_m2": float(tensor[2, 2]),
            }
        )
    meanings = {"x_m": "centre of mass", "ixx_kg_m2": "inertia about the centre of mass"}
    return Table.of_rows("links", rows, meanings)


def consistent_moved(model: ConsistentModel) -> Table:
    """How far every estimate had to move to become consistent."""
    columns: dict[str, Values] = {
        "parameter": tuple(model.names),
        "free": np.asarray(model.free.theta, dtype=float),
        "free_std": np.asarray(model.free.std, dtype=float),
        "value": np.asarray(model.theta, dtype=float),
        "unit": tuple(model.free.units),
        "moved_sigmas": np.asarray(model.moved, dtype=float),
    }
    return Table("moved", columns, {"moved_sigmas": "(value - free)/free_std"})
