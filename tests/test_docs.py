"""The list of an experiment file's keys is complete, and its defaults are those of the code."""

import dataclasses
import re
from pathlib import Path

import pytest
from pydantic_core import PydanticUndefined

from pivident.estimation.methods import (
    Adaline,
    Algebraic,
    Bandpass,
    CentralDifferenceKalman,
    FrequencyDomain,
    Hopfield,
    OutputError,
    Particles,
    PrefilteredIV,
    PriorRegression,
    RandomWalk,
    Ridge,
    RobustRegression,
    UnscentedKalman,
)
from pivident.estimation.noise_options import Arma, AutoRegressive
from pivident.experiment import consistency_keys as consistency_tables
from pivident.experiment import excite_keys, schema
from pivident.experiment import method_keys as method_tables
from pivident.recording.recording import Recording
from pivident.robot.mdh_schema import Entry, FrictionEntry

TEXT = (Path(__file__).resolve().parents[1] / "docs" / "experiment_file.md").read_text("utf-8")

#: Tables that one list of keys describes together.
REGRESSIONS = (
    method_tables.RegressionEntry,
    method_tables.IterationEntry,
    method_tables.RobustEntry,
    method_tables.RidgeEntry,
    method_tables.PriorEntry,
    method_tables.SetMembershipEntry,
    method_tables.AdalineEntry,
    method_tables.HopfieldEntry,
)
FILTERS = (
    method_tables.FilterEntry,
    method_tables.UnscentedEntry,
    method_tables.CentralDifferenceEntry,
    method_tables.ParticlesEntry,
)

#: Heading of each table, its schema, and the classes whose defaults its keys leave alone.
TABLES = {
    "Tables": (schema.ExperimentFile, ()),
    "`[robot]`": (schema.RobotEntry, ()),
    "friction terms": (FrictionEntry, ()),
    "couplings": (schema.CouplingEntry, ()),
    "`[[wrench]]`": (schema.WrenchEntry, ()),
    "`[[contact]]`": (schema.ContactEntry, ()),
    "`[recording]`": (schema.RecordingEntry, (Recording,)),
    "columns": (schema.ColumnsEntry, ()),
    "units": (schema.UnitsEntry, ()),
    "`[controller]`": (schema.ControllerEntry, ()),
    "`[identify]`": (method_tables.IdentifyEntry, (PrefilteredIV,)),
    "methods": (method_tables.MethodEntry, (PrefilteredIV,)),
    "frequency": (method_tables.FrequencyEntry, (FrequencyDomain,)),
    "regressions": (REGRESSIONS, (RobustRegression, Ridge, PriorRegression, Adaline, Hopfield)),
    "filters": (FILTERS, (UnscentedKalman, CentralDifferenceKalman, Particles)),
    "simulation methods": (method_tables.SimulationEntry, (OutputError,)),
    "bandpass": (method_tables.BandpassEntry, (Bandpass,)),
    "algebraic": (method_tables.AlgebraicEntry, (Algebraic,)),
    "random_walk": (method_tables.RandomWalkEntry, (RandomWalk,)),
    "noise": (method_tables.NoiseEntry, (AutoRegressive, Arma)),
    "`[validation]`": (schema.ValidationEntry, ()),
    "`[output]`": (schema.OutputEntry, ()),
    "`[gains]`": (schema.GainsEntry, ()),
    "payload": (schema.PayloadEntry, ()),
    "`[consistency]`": (consistency_tables.ConsistencyEntry, ()),
    "bounds": (consistency_tables.LinkBoundsEntry, ()),
    "`[payload]`": (schema.LoadEntry, ()),
    "frame": (schema.ToolFrameEntry, ()),
    "`[excite]`": (excite_keys.ExciteEntry, ()),
    "joint limits": (excite_keys.JointLimitEntry, ()),
    "load": (excite_keys.LoadBodyEntry, ()),
    "body": (excite_keys.BodyEntry, ()),
    "obstacle": (excite_keys.ObstacleEntry, ()),
    "tool_box": (excite_keys.ToolBoxEntry, ()),
}

#: Keys whose default the code finds out instead of reading it from a class.
FOUND_OUT = {"control_rate", "name", "signals", "position_offset", "rate", "inputs"}


def sections() -> dict[str, list[list[str]]]:
    """Rows of the table below each heading."""
    found = {}
    for part in re.split(r"^#{2,3} ", TEXT, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        lines = [line.strip("| ") for line in body.splitlines() if line.startswith("|")]
        found[heading] = [line.split(" | ") for line in lines[2:]]
    return found


def models_of(own) -> tuple[type[Entry], ...]:
    """The schema of a table, or those that one list of keys describes."""
    return own if isinstance(own, tuple) else (own,)


def toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return "{}" if isinstance(value, (dict, Entry)) else repr(value)


def default_of(name, field, classes):
    """The default as text, or None where words have to say it."""
    if field.is_required():
        return "needed"
    value = field.get_default(call_default_factory=True)
    if value is None and name not in FOUND_OUT:
        known = {f.name: f.default for cls in classes for f in dataclasses.fields(cls)}
        value = known.get(name)
        value = None if value is dataclasses.MISSING else value
    return None if value is None or value is PydanticUndefined else f"`{toml(value)}`"


def test_every_table_is_documented():
    assert set(sections()) == set(TABLES)
    modules = (schema, method_tables, consistency_tables, excite_keys)
    names = {name: value for module in modules for name, value in vars(module).items()}
    models = {m for m in names.values() if isinstance(m, type) and issubclass(m, Entry)}
    described = {model for own, _ in TABLES.values() for model in models_of(own)}
    others = {Entry, method_tables.SharedOptions, consistency_tables.ConsistencyFile}
    others |= {excite_keys.RoomEntry}  # keys of [excite]
    assert models - described <= others


@pytest.mark.parametrize("heading", TABLES)
def test_every_key_is_documented_with_its_default(heading):
    model, classes = TABLES[heading]
    fields = {
        field.alias or name: field
        for own in models_of(model)
        for name, field in own.model_fields.items()
    }
    rows = sections()[heading]
    assert all(len(row) == 5 and all(row) for row in rows)
    assert sorted(row[0].strip("`") for row in rows) == sorted(fields)
    for key, _, default, *_ in rows:
        name = key.strip("`")
        expected = default_of(name, fields[name], classes)
        if expected is not None:
            assert default == expected, key


def test_controllers_and_methods_are_named():
    for name in schema.LAW_KEYS:
        assert f'"{name}"' in TEXT, name
    for name in method_tables.METHOD_NAMES:
        assert f"`{name}`" in TEXT, name


def test_readme_links_to_it():
    readme = Path(__file__).resolve().parents[1] / "README.md"
    assert "(docs/experiment_file.md)" in readme.read_text("utf-8")
