"""A runnable model from the files of a result: ``identification.json`` or ``consistent.json``.

For an identification the physically consistent parameters are used: those of ``consistent.json``
beside it, if its hash shows that it was made from this file, or else the stage is run now.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.identification import Identification
from pivident.estimation.stored_identification import json_of_file, load_identification
from pivident.foundation.codec import Layout, decode
from pivident.foundation.errors import (
    IdentificationError,
    IdentificationFileError,
    PividentError,
    UnusableValue,
)
from pivident.foundation.text.plain_values import Name
from pivident.models.model_json import StandardValue
from pivident.models.runnable_model import Origin, RunnableModel, impossible_value, runnable_model
from pivident.robot.robot_values import StoredRobot

#: Name of the file of a consistent estimate, and its layout.
CONSISTENT_FILE = "consistent.json"
CONSISTENT = Layout(
    "consistent model",
    1,
    give="give the file consistent.json of a result",
    again="make it again with `pivident consistent`",
)


@dataclass(frozen=True)
class IdentificationUsed:
    """The identification that consistent parameters were made from."""

    passes_over_others: ClassVar[bool] = True
    file: str
    sha256: str


@dataclass(frozen=True)
class ConsistentTable:
    """The part of ``consistent.json`` that is read."""

    passes_over_others: ClassVar[bool] = True
    method: Name
    standard: tuple[StandardValue, ...]
    notes: tuple[str, ...]
    version: str
    sources: dict[str, str]
    identification: IdentificationUsed
    robot_description: StoredRobot


def stored_model(
    path: Path, *, free: bool = False, intervals: bool = False
) -> tuple[RunnableModel, tuple[Path, ...]]:
    """The model of ``identification.json``, ``consistent.json`` or their folder.

    Args:
        path: the file, or the folder that holds it.
        free: whether to take the free estimate as standard parameters, not the consistent one.
        intervals: whether a consistent model that has to be computed gets intervals.

    Returns:
        The model, and the files that were read.

    Raises:
        IdentificationFileError: the file cannot be used, or holds no such estimate.
    """
    if path.is_dir():
        path = path / "identification.json"
    content = json_of_file(path)
    if "standard" in content and "covariance" not in content:
        if free:
            raise IdentificationFileError(
                str(path),
                "holds consistent parameters",
                advice="the free estimate is in identification.json",
            )
        return _consistent_of(path, content), (path,)
    estimate = load_identification(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if free:
        return runnable_model(estimate, identification=digest), (path,)
    beside = path.with_name(CONSISTENT_FILE)
    if not beside.is_file() or beside == path:
        return _made_consistent(estimate, digest, intervals), (path,)
    made_from = _made_from(beside)
    if made_from == digest:
        return _consistent_of(beside, json_of_file(beside), estimate), (path, beside)
    model = _made_consistent(estimate, digest, intervals)
    other = f"SHA-256 {made_from[:12]}…" if made_from else "not named, or the file is damaged"
    note = (
        f"The file {CONSISTENT_FILE} beside {path.name} was made from another identification "
        f"({other}) and was not used; the consistent parameters were computed again."
    )
    return replace(model, notes=(*model.notes, note)), (path,)


def _made_from(path: Path) -> str:
    """SHA-256 of the identification that ``consistent.json`` names; empty where it names none."""
    try:
        source = json_of_file(path).get("identification")
    except IdentificationFileError:
        return ""
    digest = source.get("sha256") if isinstance(source, dict) else ""
    return digest if isinstance(digest, str) else ""


def _made_consistent(estimate: Identification, digest: str, intervals: bool) -> RunnableModel:
    """The stage, run with its defaults."""
    from pivident.models.consistency.consistent_model import make_consistent

    try:
        found = make_consistent(estimate)
    except PividentError as error:
        error.add_note("--free exports the estimate as it is, where the format allows it")
        raise
    model = runnable_model(found, identification=digest)
    if not intervals:
        return model
    try:
        return runnable_model(found, identification=digest, intervals=True)
    except IdentificationError as error:  # a model without them is better than none
        note = f"The intervals of the standard parameters could not be computed: {error}"
        return replace(model, notes=(*model.notes, note))


def _consistent_of(
    path: Path, content: dict[str, Any], estimate: Identification | None = None
) -> RunnableModel:
    """The model of ``consistent.json``."""
    with CONSISTENT.damage(str(path)):
        known = decode(ConsistentTable, CONSISTENT.raised(content, str(path)))
        parameters = standard_parameters(known.robot_description)
        if [p.name for p in parameters] != [entry.name for entry in known.standard]:
            raise UnusableValue("its standard parameters are not those of its robot")
        model = RunnableModel(
            robot=known.robot_description,
            parameters=parameters,
            values=np.array([entry.value for entry in known.standard]),
            consistent=True,
            origin=Origin(known.method, known.version, known.sources, known.identification.sha256),
            notes=known.notes,
            intervals=np.array([(entry.low, entry.high) for entry in known.standard]),
            estimate=estimate,
        )
        if wrong := impossible_value(model):
            raise UnusableValue(f"its parameters are not physically consistent: {wrong}")
    return model
