"""Results from their files: folders of ``pivident identify``, and models made from them."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pivident.comparison.entry import ComparisonError, Entry, Source, at_two_sigma, entry_of
from pivident.comparison.groups import base_of
from pivident.diagnostics.verdict_file import RESULT
from pivident.errors import IdentificationFileError
from pivident.estimation.stored_identification import json_of_file, load_identification
from pivident.models.model_json import FORMAT, read_model
from pivident.models.runnable_model import RunnableModel
from pivident.models.stored_model import stored_model


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
    from pivident.estimation.methods import METHODS

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
    if content.get("format") == FORMAT:
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
            f"its base parameters cannot be read ({found!r}); make it again with "
            "`pivident consistent`",
        ) from None
    every = base_of(model.robot, names)
    unknown = sorted(set(names) - set(every.names))
    if unknown:
        raise IdentificationFileError(
            str(source.path),
            f"{unknown[0]!r} is not a base parameter of its robot; make it again with "
            "`pivident consistent`",
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
