"""A load as files: ``payload.json``, ``payload.csv`` and ``payload.txt``."""

from __future__ import annotations

import json
from os import PathLike
from typing import Any

from pivident.files import atomic_folder
from pivident.payload.joint_masses import JointMasses
from pivident.payload.load_estimate import LoadEstimate
from pivident.payload.payload_identification import PayloadIdentification
from pivident.payload.payload_text import load_rows
from pivident.robot.description import INERTIAL
from pivident.text.plain_values import csv_table, plain

#: Version of the layout of ``payload.json``.
SCHEMA = 1

#: Columns of ``payload.csv``; standard errors and intervals in the unit of their row.
CSV_COLUMNS = ("name", "value", "std", "lower", "upper", "unit")


def save_payload(found: PayloadIdentification, folder: str | PathLike[str]) -> None:
    """Write JSON, CSV and text into a folder, all or nothing."""
    content = json.dumps(payload_values(found), indent=2, allow_nan=False, ensure_ascii=False)
    with atomic_folder(folder) as build:
        for name, text in (
            ("payload.json", content + "\n"),
            ("payload.csv", payload_csv(found.load)),
            ("payload.txt", str(found) + "\n"),
        ):
            # File names may contain bytes that are not text; they become escapes.
            (build / name).write_text(text, encoding="utf-8", errors="backslashreplace")


def payload_values(found: PayloadIdentification) -> dict[str, Any]:
    """The result as plain values; numbers that are not finite are null."""
    load = found.load
    nearest = found.possible
    possible = None
    if nearest is not None:
        possible = {
            "was_possible": nearest.was_possible,
            "distance": nearest.distance,
            "p_value": nearest.p_value,
            "values": nearest.values,
            "intervals": nearest.intervals,
            "not_found": nearest.not_found,
        }
    known = {
        key: getattr(found.known, key)
        for key in ("mass", "mass_std", "center_of_mass", "center_of_mass_std", "inertia",
                    "inertia_std")
    }  # fmt: skip
    content = {
        "schema": SCHEMA,
        "robot": found.arm.robot.name,
        "link": found.link,
        "joint": found.joint,
        "frame": load.frame,
        "method": found.method,
        "converged": found.converged,
        "iterations": found.iterations,
        "load": [
            {
                "name": row.name,
                "value": row.value,
                "std": row.std,
                "interval": row.interval,
                "unit": row.unit,
            }
            for row in load_rows(load)
        ],
        "parameters": INERTIAL,
        "values": load.values,
        "covariance": load.covariance,
        "rank": load.rank,
        "undetermined": load.undetermined.T,
        "possible": possible,
        "known": known,
        "scale": found.scale,
        "masses": _mass_values(found.masses),
        "friction": [
            {"name": name, "change": change, "std": std}
            for name, change, std in zip(
                found.friction_names, found.friction_change, found.friction_std, strict=True
            )
        ],
        "arm": [
            {"name": name, "change_over_std": change}
            for name, change in zip(found.arm.names, found.arm_change, strict=True)
        ],
        "relative_errors": dict(zip(found.joints, found.relative_errors, strict=True)),
        "rms_errors": dict(zip(found.joints, found.rms_errors, strict=True)),
        "recordings": found.recordings,
        "warnings": [warning.as_json() for warning in found.warnings],
        "sources": {"without_load": found.arm.sources, "with_load": found.sources},
        "version": found.version,
    }
    return plain(content)


def _mass_values(masses: JointMasses | None) -> dict[str, Any] | None:
    """The mass by each joint, and whether they agree."""
    if masses is None:
        return None
    joints = zip(masses.joints, masses.mass, masses.std, strict=True)
    return {
        "joints": [{"joint": name, "mass": m, "std": std} for name, m, std in joints],
        "statistic": masses.statistic,
        "p_value": masses.p_value,
        "spread": masses.spread,
        "disagree": masses.disagree,
    }


def payload_csv(load: LoadEstimate) -> str:
    """The load as a table with a header; numbers that are not finite are left empty.

    Args:
        load: the load.
    """
    rows = (
        [r.name, *(plain(n) for n in (r.value, r.std, *r.interval)), r.unit]
        for r in load_rows(load)
    )
    return csv_table(CSV_COLUMNS, rows)
