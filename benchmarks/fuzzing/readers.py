"""The readers that are fuzzed: what they begin with, how inputs are made, and what is called.

A reader is one entry of `READERS`. What it calls gets a file and may return anything or raise a
`PividentError`; everything else is a finding.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from fuzzing import (
    array_inputs,
    bag_inputs,
    command_inputs,
    json_inputs,
    table_inputs,
    toml_inputs,
    urdf_inputs,
)
from fuzzing.mutations import (
    Rewrite,
    inside_gzip,
    inside_mat,
    inside_zip,
    packed,
    spoilt_bag,
    spoilt_bytes,
    spoilt_text,
)


@dataclass(frozen=True)
class Reader:
    """One reader under test.

    Attributes:
        file: name of the file that it reads.
        seeds: files to begin with.
        spoil: changes a file in the manner of its format.
        read: what is called with the file.
        grow: makes a new file; None: changes only.
        guided: whether the parser is ours, so that its branches can guide the search.
        patience: processor time that one input may take [s].
    """

    file: str
    seeds: Callable[[], tuple[bytes, ...]]
    spoil: Rewrite
    read: Callable[[Path], object]
    grow: Callable[[random.Random], bytes] | None = None
    guided: bool = True
    patience: float = 1.0

    def mutated(self, data: bytes, rng: random.Random) -> bytes:
        """The next input from an earlier one, or from a seed: those reach deepest."""
        choice = rng.random()
        if choice < 0.1 and self.grow is not None:
            return self.grow(rng)
        if choice < 0.2:
            return spoilt_bytes(data, rng)
        if choice < 0.6:
            data = rng.choice(_seeds(self))
        try:
            return self.spoil(data, rng)
        except Exception:  # a change that cannot be written in this format
            return spoilt_bytes(data, rng)


@cache
def _seeds(reader: Reader) -> tuple[bytes, ...]:
    return reader.seeds()


def _text(chunks: tuple[str, ...]) -> Rewrite:
    return lambda data, rng: spoilt_text(data, rng, chunks)


def _urdf(path: Path) -> object:
    from pivident.robot.urdf import read_urdf

    return read_urdf(path)


def _robot(path: Path) -> object:
    from pivident.robot.modified_dh import read_modified_dh

    return read_modified_dh(path)


def _experiment(path: Path) -> object:
    """The file, its robot and its recordings, of which public ones are left out."""
    from pivident import load_experiment

    log = path.parent / "log.csv"
    if not log.exists():
        log.write_bytes(table_inputs.log_csv())
    experiment = load_experiment(path)
    experiment.robot  # noqa: B018 - building it is the check
    if any(entry.dataset for entry in experiment.content.recording):
        return experiment
    return experiment.recordings()


def _study(path: Path) -> object:
    from pivident.studies.many.study.scenario import load_scenario

    return load_scenario(path).hash


def _table(path: Path) -> object:
    from pivident.data.logs.tables.tables import names_in, read_table, unread_in

    names = names_in(path)
    unread_in(path)
    return read_table(path, names[:1] if len(names) % 3 == 2 else None)


def _audited(path: Path) -> object:
    """Reading as the audit does it, which forgives more."""
    from pivident.data.logs.described_log import bare_log

    return bare_log(path)


def _manifest(path: Path) -> object:
    """Opening the results folder of a study whose manifest this is."""
    from pivident.studies.many.study.run import Store
    from pivident.studies.many.study.scenario import read_scenario

    store = Store(path.parent)
    store.programs()
    scenario = read_scenario(toml_inputs.STUDY.decode().split("[vary")[0], "study")
    with store.opened(scenario, 6):
        return store.done()


def _grown_toml(*bases: bytes) -> Callable[[random.Random], bytes]:
    return lambda rng: toml_inputs.grown_toml(rng, bases)


def _identification(path: Path) -> object:
    """A result, and everything that is made of it first."""
    from pivident.estimation.stored_identification import load_identification

    found = load_identification(path)
    motion = np.full((3, 1, found.robot.size), 0.1)
    return found.summary(), found.predict(*motion)


def _model(path: Path) -> object:
    from pivident.models.model_json import read_model

    return read_model(path).values


def _consistent(path: Path) -> object:
    from pivident.models.stored_model import stored_model

    return stored_model(path)[0].values


def _design(path: Path) -> object:
    """A design, and what its page shows of it."""
    from pivident.studies.excitation.design_file import load_design

    found = load_design(path)
    return found.binding, found.reasons, found.motion.one_round.at(np.zeros(1))


def _json(data: bytes, rng: random.Random) -> bytes:
    """Values at any depth changed, or tokens of the text."""
    if rng.random() < 0.7:
        return json_inputs.inside_json(data, rng)
    return spoilt_text(data, rng, json_inputs.JSON_CHUNKS)


def _bounds(path: Path) -> object:
    from pivident.experiment.consistency_table import read_consistency
    from pivident.robot.gallery import load_robot

    return read_consistency(path, load_robot("planar_2r"))


@cache
def manifest() -> tuple[bytes, ...]:
    """The manifest of a study."""
    return (json_inputs.manifest_seed(),)


_TOML = _text(toml_inputs.TOML_CHUNKS)
_CSV = _text(table_inputs.CSV_CHUNKS)
_URDF = _text(urdf_inputs.URDF_CHUNKS)

READERS: dict[str, Reader] = {
    "urdf": Reader("arm.urdf", lambda: (urdf_inputs.URDF,), _URDF, _urdf, urdf_inputs.grown_urdf),
    "urdf.gz": Reader(
        "arm.urdf.gz",
        lambda: (packed(urdf_inputs.URDF),),
        inside_gzip(_URDF),
        _urdf,
        lambda rng: packed(urdf_inputs.grown_urdf(rng)),
        guided=False,
    ),
    "robot": Reader(
        "arm.toml",
        toml_inputs.gallery_toml,
        _TOML,
        _robot,
        lambda rng: toml_inputs.grown_toml(rng, toml_inputs.gallery_toml()),
    ),
    "experiment": Reader(
        "experiment.toml",
        lambda: (toml_inputs.EXPERIMENT, toml_inputs.EXPERIMENT_2),
        _TOML,
        _experiment,
        _grown_toml(toml_inputs.EXPERIMENT, toml_inputs.EXPERIMENT_2),
    ),
    "study": Reader(
        "study.toml", lambda: (toml_inputs.STUDY,), _TOML, _study, _grown_toml(toml_inputs.STUDY)
    ),
    "csv": Reader(
        "log.csv", lambda: (table_inputs.log_csv(),), _CSV, _table, table_inputs.grown_csv, False
    ),
    "csv.gz": Reader(
        "log.csv.gz",
        lambda: (packed(table_inputs.log_csv()),),
        inside_gzip(_CSV),
        _table,
        lambda rng: packed(table_inputs.grown_csv(rng)),
        guided=False,
    ),
    "csv-audit": Reader(
        "log.csv", lambda: (table_inputs.log_csv(),), _CSV, _audited, table_inputs.grown_csv, False
    ),
    "npz": Reader("log.npz", array_inputs.npz_seeds, inside_zip, _table),
    "npy": Reader("log.npy", array_inputs.npy_seeds, spoilt_bytes, _table),
    "mat-v5": Reader("log.mat", array_inputs.mat_seeds, inside_mat, _table, guided=False),
    "mat-v7.3": Reader("log.mat", array_inputs.hdf5_seeds, spoilt_bytes, _table, guided=False),
    "parquet": Reader(
        "log.parquet", array_inputs.parquet_seeds, spoilt_bytes, _table, guided=False
    ),
    "bag": Reader("log.bag", bag_inputs.bag_seeds, spoilt_bag, _table),
    "mcap": Reader("log.mcap", bag_inputs.mcap_seeds, spoilt_bag, _table),
    "db3": Reader("log.db3", bag_inputs.db3_seeds, spoilt_bag, _table),
    "bag-audit": Reader("log.mcap", bag_inputs.mcap_seeds, spoilt_bag, _audited),
    "csv-habits": Reader("log.txt", table_inputs.habit_seeds, _CSV, _table, None, False),
    "identification": Reader(
        "identification.json",
        lambda: (
            *json_inputs.result_seeds()[:1],
            *json_inputs.stored_seeds("identification-*.json"),
        ),
        _json,
        _identification,
        lambda rng: json_inputs.grown_json(rng, json_inputs.result_seeds()[0]),
    ),
    "model": Reader(
        "model.json",
        lambda: (*json_inputs.result_seeds()[1:], *json_inputs.stored_seeds("model*.json")),
        _json,
        _model,
        lambda rng: json_inputs.grown_json(rng, json_inputs.result_seeds()[1]),
    ),
    "consistent": Reader(
        "consistent.json", lambda: json_inputs.stored_seeds("consistent.json"), _json, _consistent
    ),
    "design": Reader(
        "design.json", lambda: json_inputs.stored_seeds("design.json"), _json, _design
    ),
    "bounds": Reader(
        "bounds.toml",
        lambda: (toml_inputs.BOUNDS,),
        _TOML,
        _bounds,
        _grown_toml(toml_inputs.BOUNDS),
    ),
    "command": Reader(
        "command.txt",
        command_inputs.command_seeds,
        command_inputs.spoilt_command,
        command_inputs.run_command,
        command_inputs.grown_command,
        guided=False,
        patience=20.0,
    ),
    "manifest": Reader(
        "manifest.json",
        manifest,
        _text(json_inputs.JSON_CHUNKS),
        _manifest,
        lambda rng: json_inputs.grown_json(rng, manifest()[0]),
        guided=False,
    ),
}
