"""Which tables each kind of result has; none of them is imported before it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from pivident.foundation.document.document import Accounted
from pivident.foundation.document.table import Table as Table, TableError as TableError
from pivident.robot.naming import nearest

_HERE, _MANY = "pivident.studies.tables.", "pivident.studies.many.accounts"

#: By class: the module that has its tables, and their names, the first of
#: which is taken where none is named. A table ``x`` of a class ``Y`` is made by ``y_x``.
TABLES: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "pivident.estimation.identification.Identification": (
        _HERE + "identifications",
        "identification",
        ("parameters", "covariance", "joints", "iterations", "history", "signals"),
    ),
    "pivident.estimation.problem.Problem": (
        _HERE + "inputs",
        "problem",
        ("parameters", "recordings", "signals"),
    ),
    "pivident.data.recording.recording.Recording": (_HERE + "inputs", "recording", ("signals",)),
    "pivident.robot.description.Robot": (
        _HERE + "inputs",
        "robot",
        ("joints", "parameters"),
    ),
    "pivident.judgement.audit.audit.Audit": (_HERE + "inputs", "audit", ("findings",)),
    "pivident.judgement.validation.residuals.residual_tests.ResidualTests": (
        _HERE + "identifications",
        "residual",
        ("tests",),
    ),
    "pivident.judgement.validation.held_out.cross_validation.CrossValidation": (
        _HERE + "identifications",
        "validation",
        ("folds", "joints"),
    ),
    "pivident.judgement.diagnostics.verdict.Verdict": (
        _HERE + "identifications",
        "verdict",
        ("statements",),
    ),
    "pivident.models.consistency.consistent_model.ConsistentModel": (
        _HERE + "inputs",
        "consistent",
        ("parameters", "links", "moved"),
    ),
    "pivident.models.consistency.profile_intervals.ProfileIntervals": (
        _HERE + "inputs",
        "profile",
        ("intervals",),
    ),
    "pivident.studies.comparison.compare.Comparison": (
        _HERE + "many_results",
        "comparison",
        ("parameters", "results", "torques", "friction"),
    ),
    "pivident.studies.many.study.summary.Summary": (
        _MANY,
        "study",
        ("parameters", "methods"),
    ),
    "pivident.studies.many.fleet.identify_fleet.Fleet": (
        _MANY,
        "fleet",
        ("parameters",),
    ),
    "pivident.studies.many.fleet.judgement.Judgement": (
        _MANY,
        "judgement",
        ("parameters", "alarms", "wear"),
    ),
    "pivident.studies.friction.friction_study.FrictionStudy": (
        _HERE + "many_results",
        "friction",
        ("curves",),
    ),
}


def table(thing: Any, name: str | None = None) -> Table:
    """A table of a result, ready for pandas, polars or a sheet.

    Args:
        thing: an identification, problem, recording, robot, audit, comparison, study, fleet,
            prediction, payload, or a result of validation and consistency.
        name: which of its tables; None: the first of `table_names`.

    Returns:
        The table; ``to_pandas``, ``to_polars`` and ``to_csv`` hand it on.

    Raises:
        TableError: there is no table of that thing, or none of that name.

    Example:
        >>> robot = pv.load_robot("planar_2r")
        >>> print(pv.table(robot, "parameters"))
        parameter  joint     kind   nominal  unit       group
        zz1r       shoulder  zz     0.864    kg m²      zz1 + ia1 + 0.16 m2
        ...
        off2       elbow     off   -0.2      N m        off2
        >>> frame = pv.table(robot, "parameters").to_pandas()
        >>> frame[frame.kind == "fc"].nominal.tolist()  # Coulomb friction [N m]
        [4.0, 2.0]
    """
    module, prefix, names = _entry(thing)
    chosen = names[0] if name is None else name
    if chosen not in names:
        raise TableError(
            f"a {type(thing).__name__} has no table {chosen!r}",
            advice=f"{nearest(str(chosen), names)}; there are {', '.join(names)}",
        )
    if isinstance(thing, Accounted):
        return thing.account().tables[chosen]
    return getattr(import_module(module), f"{prefix}_{chosen}")(thing)


def table_names(thing: Any) -> tuple[str, ...]:
    """Names of the tables that a result has.

    Args:
        thing: as for `table`.

    Returns:
        The names, the default first.

    Raises:
        TableError: it has none.
    """
    return _entry(thing)[2]


def _entry(thing: Any) -> tuple[str, str, tuple[str, ...]]:
    if isinstance(thing, Accounted):
        return "", "", tuple(thing.account().tables)
    for cls in type(thing).__mro__:
        entry = TABLES.get(f"{cls.__module__}.{cls.__qualname__}")
        if entry is not None:
            return entry
    known = ", ".join(key.rpartition(".")[2] for key in TABLES)
    raise TableError(
        f"there is no table of a {type(thing).__name__}", advice=f"there are tables of {known}"
    )
