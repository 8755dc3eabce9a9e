"""Tables of consistent models and of their intervals."""

from __future__ import annotations

from pivident.foundation.document.table import Table
from pivident.models.consistency.consistent_model import ConsistentModel
from pivident.models.consistency.profile_intervals import ENDS, ProfileIntervals

consistent_links, consistent_moved = ConsistentModel.table, ConsistentModel.moved_table
profile_intervals = ProfileIntervals.table


def consistent_parameters(model: ConsistentModel) -> Table:
    """All standard parameters with their 95 % intervals, which take a second or two."""
    made = model.intervals(of="standard").table().columns
    tree = model.robot.tree
    head = {
        "parameter": made["quantity"],
        "joint": [tree.joints[p.joint].name for p in model.parameters],
        "link": [tree.links[p.joint].name for p in model.parameters],
    }
    return Table("parameters", head | {k: own for k, own in made.items() if k != "quantity"}, ENDS)
