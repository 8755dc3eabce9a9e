"""A consistent model in words, tables and plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.text.numbers import format_significant
from pivident.text.plain_table import plain_table

if TYPE_CHECKING:
    from pivident.consistency.consistent_model import ConsistentModel
    from pivident.consistency.pseudo_inertia import LinkBody


def headline(model: ConsistentModel) -> str:
    """What was found, in a sentence or two."""
    if model.was_consistent:
        text = f"The estimate of {model.free.method} is physically consistent as it is."
    else:
        text = (
            f"The estimate of {model.free.method} is not physically consistent; the least distance "
            f"to consistent parameters is {format_significant(model.least_distance)} σ "
            f"(p = {model.p_value:.2g}), that to those taken "
            f"{format_significant(model.distance)} σ."
        )
    if np.isfinite(model.torque_error):
        text += (
            f" Torque error on the fitted record: {100 * model.torque_error_free:.3g} % free, "
            f"{100 * model.torque_error:.3g} % consistent."
        )
    return text


def link_table(bodies: Sequence[LinkBody], *further: tuple[str, str, Sequence[str]]) -> str:
    """Links as bodies: mass, centre of mass, principal moments."""
    columns: list[tuple[str, str, Sequence[str]]] = [
        ("link", "<", [b.name for b in bodies]),
        ("mass [kg]", ".", [format_significant(b.mass) for b in bodies]),
        *further,
    ]
    for k, title in enumerate(("centre x [mm]", "y", "z")):
        columns.append((title, ".", [millimetres(b.center_of_mass[k]) for b in bodies]))
    for k, title in enumerate(("I1 [kg m²]", "I2", "I3")):
        columns.append((title, ".", [format_significant(b.principal_moments[k]) for b in bodies]))
    return plain_table(columns)


def millimetres(metres: float) -> str:
    """A length in millimetres, to a tenth."""
    return f"{round(1e3 * metres, 1) + 0.0:.1f}"


def moved_table(model: ConsistentModel) -> str:
    """Base parameters: free, consistent, moved."""
    return plain_table(
        [
            ("parameter", "<", list(model.names)),
            ("free", ".", [format_significant(v) for v in model.free.theta]),
            ("consistent", ".", [format_significant(v) for v in model.theta]),
            ("moved [σ]", ".", [f"{v:+.2f}" for v in model.moved]),
            ("unit", "<", list(model.free.units)),
        ]
    )


def summary(model: ConsistentModel) -> str:
    """Everything that is printed."""
    parts = [headline(model), link_table(model.links), moved_table(model)]
    if model.active:
        parts.append("Held back by:\n" + "\n".join(f"  {a}" for a in model.active))
    return "\n\n".join([*parts, *model.notes])


def plain_values(model: ConsistentModel) -> dict[str, Any]:
    """The result as plain values, ready for JSON."""
    return {
        "method": model.method,
        "robot": model.robot.name,
        "prior": model.prior,
        "was_consistent": model.was_consistent,
        "least_distance": model.least_distance,
        "p_value": model.p_value,
        "distance": model.distance,
        "torque_error_free": _number(model.torque_error_free),
        "torque_error": _number(model.torque_error),
        "seconds": model.seconds,
        "standard": [
            {"name": p.name, "value": float(v), "unit": p.unit}
            for p, v in zip(model.parameters, model.values, strict=True)
        ],
        "base": [
            {"name": n, "free": float(f), "value": float(v), "moved": float(m), "unit": u}
            for n, f, v, m, u in zip(
                model.names, model.free.theta, model.theta, model.moved, model.free.units,
                strict=True,
            )
        ],
        "links": [
            {
                "name": b.name,
                "mass": b.mass,
                "center_of_mass": b.center_of_mass.tolist(),
                "inertia": b.inertia.tolist(),
            }
            for b in model.links
        ],
        "active": [
            {
                "subject": a.subject,
                "constraint": a.constraint,
                "multiplier": a.multiplier,
                "share": a.share,
            }
            for a in model.active
        ],
        "notes": list(model.notes),
    }  # fmt: skip


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
