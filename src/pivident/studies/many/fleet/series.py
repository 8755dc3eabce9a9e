"""One parameter of one robot over time, the data of a control chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.foundation.extras import require
from pivident.robot.naming import nearest
from pivident.studies.many.fleet.identify_fleet import FleetError
from pivident.studies.many.fleet.logs import FleetLog

if TYPE_CHECKING:
    import polars as pl

#: Stands for all friction levels and slopes under ``watch``.
FRICTION = "friction"


@dataclass(frozen=True, eq=False)
class Series:
    """Estimates of one parameter of one robot, in the order of time."""

    robot: str  # name of the robot
    parameter: str  # name of the parameter
    joint: str  # its joint
    unit: str  # unit of the values
    logs: tuple[str, ...]  # the records, shape (records,)
    times: tuple[str, ...]  # their times as text, likewise
    position: np.ndarray  # place on the time axis, likewise
    value: np.ndarray  # estimates, likewise
    std: np.ndarray  # their standard errors, likewise
    temperature: np.ndarray  # mean temperature of the joint, NaN if unknown, likewise
    baseline: int  # number of first records of the robot that set the level

    @property
    def records(self) -> int:
        """Number of records."""
        return self.value.size


def watched_series(
    rows: pl.DataFrame, logs: Sequence[FleetLog], watch: Sequence[str], baseline: int
) -> list[Series]:
    """The watched series, without estimates that did not converge.

    ``watch``: names of parameters, or ``friction`` for every friction level and slope. The first
    ``baseline`` records of each robot that gave an estimate set its level.
    """
    pl = require("polars", extra="tables", purpose="the study of a fleet")
    good = rows.filter(pl.col("error").is_null() & pl.col("converged"))
    if good.is_empty():
        return []
    robust = pl.col("robust_std")
    error = pl.when(robust.is_finite()).then(robust).otherwise(pl.col("std"))
    good = good.with_columns(error.alias("shown_std"))  # as `Identification.std`
    chosen = _chosen(good, watch)
    place = {log.name: k for k, log in enumerate(logs)}
    table: Mapping[str, list[Any]] = (
        good.filter(
            pl.col("parameter").is_in(chosen)
            & (pl.col("shown_std") > 0)
            & pl.col("shown_std").is_finite()
        )
        .with_columns(pl.col("task").replace_strict(place, return_dtype=pl.Int64).alias("place"))
        .sort("place")
        .to_dict(as_series=False)
    )
    groups: dict[tuple[str, str], list[int]] = {}
    for i, (k, parameter) in enumerate(zip(table["place"], table["parameter"], strict=True)):
        groups.setdefault((logs[k].robot, parameter), []).append(i)

    def column(name: str, own: Sequence[int]) -> np.ndarray:
        values = table[name]
        return np.array([np.nan if values[i] is None else values[i] for i in own], dtype=float)

    made = []
    for (robot, parameter), own in groups.items():
        theirs = [logs[table["place"][i]] for i in own]
        made.append(
            Series(
                robot,
                parameter,
                table["joint"][own[0]],
                table["unit"][own[0]],
                tuple(log.name for log in theirs),
                tuple(log.time or f"{log.position:g}" for log in theirs),
                np.array([log.position for log in theirs]),
                column("value", own),
                column("shown_std", own),
                column("temperature", own),
                baseline,
            )
        )
    order = {name: k for k, name in enumerate(chosen)}
    return sorted(made, key=lambda s: (order[s.parameter], s.robot))


def _chosen(good: pl.DataFrame, watch: Sequence[str]) -> list[str]:
    """Names of the watched parameters, in the order of the model."""
    known = good.unique("parameter", keep="first", maintain_order=True)
    names = known["parameter"].to_list()
    friction = [n for n, f in zip(names, known["friction"], strict=True) if f]
    wanted: set[str] = set()
    for name in watch:
        if name == FRICTION:
            if not friction:
                raise FleetError(
                    "[fleet] watch: no friction was estimated",
                    advice=f"name parameters, such as {', '.join(names[:3])}",
                )
            wanted |= set(friction)
            continue
        meant = [n for n in names if name.lower() in (n.lower(), n.lower().removesuffix("r"))]
        if not meant:
            raise FleetError(
                f"[fleet] watch: no parameter {name!r} was estimated",
                advice=nearest(name, [FRICTION, *names]),
            )
        wanted |= set(meant)
    return [n for n in names if n in wanted]
