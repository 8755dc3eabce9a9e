"""One result in a comparison: its files, its parameters with their intervals, what it came from.

Results from their files: folders of ``pivident identify``, and models made from them.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.methods import METHODS
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.stored_identification import json_of_file, load_identification
from pivident.foundation.errors import IdentificationFileError, PividentError
from pivident.judgement.diagnostics.stored_verdict import RESULT
from pivident.models.consistency.metric import HALF_INTERVAL
from pivident.models.model_json import MODEL, read_model
from pivident.models.runnable_model import RunnableModel
from pivident.models.stored_model import stored_model
from pivident.robot.description import Robot
from pivident.studies.comparison.groups import Groups, base_of, groups_of


class ComparisonError(PividentError, ValueError):
    """Results that cannot be compared: fewer than two, none in a folder, names that do not fit."""


Kind = Literal["identification", "consistent", "model"]


@dataclass(frozen=True)
class Source:
    """The file that a result was read from."""

    path: str  # as it was given
    sha256: str  # of its bytes
    modified: str  # when it was last written, in ISO 8601, UTC


@dataclass(frozen=True, eq=False)
class Entry:
    """One result.

    Intervals are ±2σ as in all tables, see `Identification.std`. Those of consistent parameters are
    profile intervals, drawn from 95 % to 2σ.
    """

    label: str  # name in the comparison, unique
    kind: Kind  # ``identification``, ``consistent`` or ``model``
    method: str
    robot: Robot
    names: tuple[str, ...]  # estimated base parameters
    value: np.ndarray  # estimates, shape (parameters,)
    low: np.ndarray  # lower ends of their intervals, likewise, NaN where there is none
    high: np.ndarray  # upper ends, likewise
    #: of the estimates, shape (parameters, parameters); None where only intervals are known
    covariance: np.ndarray | None
    relative_error: float  # ‖τ - Φθ‖/‖τ‖ on the fitted record, NaN where it is not known
    version: str
    #: SHA-256 of every input file by its name
    inputs: Mapping[str, str] = field(default_factory=dict)
    source: Source | None = None  # the file, None for a result in memory
    identification: Identification | None = None  # the estimate itself; None for models
    notes: tuple[str, ...] = ()  # sentences about this result

    @cached_property
    def groups(self) -> Groups:
        """All base parameters of the robot, those that were left out included."""
        return groups_of(base_of(self.robot, self.names))

    @cached_property
    def place(self) -> Mapping[str, int]:
        """Index of each estimated parameter by its name."""
        return {name: k for k, name in enumerate(self.names)}

    @cached_property
    def all_values(self) -> np.ndarray:
        """All base parameters, zero for those that were left out, shape (base,)."""
        place = self.place
        return np.array([self.value[place[n]] if n in place else 0.0 for n in self.groups.names])

    @property
    def left_out(self) -> tuple[str, ...]:
        """Base parameters of the robot that were not estimated, which the torque takes for zero."""
        return tuple(name for name in self.groups.names if name not in self.place)

    @property
    def condition(self) -> float:
        """Condition number of the column-scaled observation matrix, NaN where it is not known."""
        return math.nan if self.identification is None else self.identification.condition

    @property
    def samples(self) -> int | None:
        """Rows in use, all joints together; None where it is not known."""
        if self.identification is None:
            return None
        return sum(fit.rows for fit in self.identification.joints)

    @property
    def converged(self) -> bool | None:
        """Whether the iteration converged; None where it is not known."""
        return None if self.identification is None else self.identification.converged


def entry_of(identification: Identification, label: str, source: Source | None = None) -> Entry:
    """An identification as an entry."""
    covariance, notes = identification.robust_covariance, []
    if not np.isfinite(covariance).all():
        covariance = identification.covariance
        notes.append(
            f"{label} has no robust standard errors; the method's own are taken, which are too "
            "small where the residual is correlated."
        )
    if not identification.converged:
        notes.append(f"{label} has not converged; its values and intervals are provisional.")
    ends = np.array([row.interval() for row in parameter_rows(identification)])
    return Entry(
        label=label,
        kind="identification",
        method=identification.method,
        robot=identification.robot,
        names=identification.names,
        value=identification.theta,
        low=ends[:, 0],
        high=ends[:, 1],
        covariance=covariance,
        relative_error=identification.relative_error,
        version=identification.version,
        inputs=dict(identification.sources),
        source=source,
        identification=identification,
        notes=tuple(notes),
    )


def at_two_sigma(
    value: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of 95 % intervals moved out to 2σ, each side by itself; NaN and infinity stay."""
    factor = 2.0 / HALF_INTERVAL
    return value - factor * (value - low), value + factor * (high - value)


def load_entries(paths: Iterable[str | PathLike[str]]) -> list[Entry]:
    """Results from files and folders, each named so that no two have the same name.

    Paths are ``identification.json``, ``consistent.json``, ``model.json``, folders that hold an
    identification, or folders of several methods, whose results are all taken, least squares first.
    """
    files = [file for path in paths for file in _files(Path(path))]
    entries = [_entry(file) for file in files]
    labels = distinct_labels([e.method for e in entries], [_place(file) for file in files])
    return [relabelled(entry, label) for entry, label in zip(entries, labels, strict=True)]


def distinct_labels(methods: Sequence[str], places: Sequence[Sequence[str]]) -> list[str]:
    """The shortest distinct names of results: the method, else with a part of the path.

    ``places`` are the parts of each result's path, the last ones the nearest.
    """
    if len(set(methods)) == len(methods):
        return list(methods)
    labels = list(methods)
    deepest = max(map(len, places), default=0)
    telling = [
        depth
        for depth in range(1, deepest + 1)
        if len({place[-depth] if depth <= len(place) else "" for place in places}) > 1
    ]
    for taken in range(1, len(telling) + 1):
        labels = [
            "/".join(place[-d] for d in reversed(telling[:taken]) if d <= len(place)) or method
            for method, place in zip(methods, places, strict=True)
        ]
        if len(set(labels)) == len(labels):
            return labels
        with_method = [f"{a} {m}" for a, m in zip(labels, methods, strict=True)]
        if len(set(with_method)) == len(with_method):
            return with_method
    return [f"{label} ({k})" for k, label in enumerate(labels, start=1)]


def relabelled(entry: Entry, label: str) -> Entry:
    """The same result under another name."""
    return replace(
        entry, label=label, notes=tuple(n.replace(entry.label, label, 1) for n in entry.notes)
    )


def _files(path: Path) -> list[Path]:
    """The files of results that a path stands for."""
    if not path.is_dir():
        return [path]
    if (path / RESULT).is_file():
        return [path / RESULT]

    refinement = {name: k for k, name in enumerate(METHODS)}
    found = sorted(
        path.glob(f"*/{RESULT}"),
        key=lambda file: (refinement.get(file.parent.name, len(refinement)), file),
    )
    if not found:
        raise ComparisonError(
            f"{path} holds no {RESULT}, nor does a folder in it",
            advice="name the folder that `pivident identify` wrote",
        )
    return found


def _place(file: Path) -> tuple[str, ...]:
    """Parts of a path that may name a result: the folders, and the file where it is not usual."""
    parts = [part for part in file.absolute().parts if part != file.anchor]
    if file.name == RESULT:
        return tuple(parts[:-1])
    return (*parts[:-1], file.name.removesuffix(".json"))


def _entry(file: Path) -> Entry:
    """One result, named by its file for now."""
    content = json_of_file(file)
    source = _source(file)
    label = str(file)
    if content.get("format") == MODEL.name:
        return _model(read_model(file), label, source)
    if "standard" in content and "covariance" not in content:
        model, _ = stored_model(file)
        return _consistent(model, content, label, source)
    return entry_of(load_identification(file), label, source)


def _source(file: Path) -> Source:
    written = datetime.fromtimestamp(file.stat().st_mtime, UTC)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    return Source(str(file), digest, written.isoformat(timespec="seconds"))


def _consistent(model: RunnableModel, content: dict[str, Any], label: str, source: Source) -> Entry:
    """Consistent parameters: estimated base parameters with profile intervals."""
    try:
        base = [(e["name"], e["low"], e["high"]) for e in content["base"]]
        names = tuple(str(name) for name, _, _ in base)
        low, high = (
            np.array([math.nan if end is None else float(end) for end in ends])
            for ends in zip(*((low, high) for _, low, high in base), strict=True)
        )
        error = content.get("torque_error")
        relative = math.nan if error is None else float(error)
    except (KeyError, TypeError, ValueError) as found:
        raise IdentificationFileError(
            str(source.path),
            f"its base parameters cannot be read ({found!r})",
            advice="make it again with `pivident consistent`",
        ) from None
    every = base_of(model.robot, names)
    unknown = sorted(set(names) - set(every.names))
    if unknown:
        raise IdentificationFileError(
            str(source.path),
            f"{unknown[0]!r} is not a base parameter of its robot",
            advice="make it again with `pivident consistent`",
        )
    values = dict(zip(every.names, every.values(model.values).tolist(), strict=True))
    value = np.array([values[name] for name in names])
    low, high = at_two_sigma(value, low, high)
    return _of_model(model, label, source, "consistent", names, (value, low, high), relative)


def _model(model: RunnableModel, label: str, source: Source) -> Entry:
    """A model of which only values are known."""
    base = base_of(model.robot, ())
    value = base.values(model.values)
    unknown = np.full(value.shape, math.nan)
    made = _of_model(model, label, source, "model", base.names, (value, unknown, unknown), math.nan)
    note = (
        f"{label} is a model, whose base parameters have no intervals: differences from it are "
        "not judged."
    )
    return replace(made, notes=(note,))


def _of_model(
    model: RunnableModel,
    label: str,
    source: Source,
    kind: Any,
    names: tuple[str, ...],
    ends: tuple[np.ndarray, np.ndarray, np.ndarray],
    relative: float,
) -> Entry:
    value, low, high = ends
    return Entry(
        label=label,
        kind=kind,
        method=model.origin.method,
        robot=model.robot,
        names=names,
        value=value,
        low=low,
        high=high,
        covariance=None,
        relative_error=relative,
        version=model.origin.version,
        inputs=dict(model.origin.sources),
        source=source,
    )
