"""The list of an experiment file's keys is complete, and its defaults are those of the code."""

import dataclasses
import re
from pathlib import Path

import pytest
from pydantic_core import PydanticUndefined

from pivident.estimation.literature.adaline import Adaline
from pivident.estimation.literature.filters.central_difference_kalman import CentralDifferenceKalman
from pivident.estimation.literature.filters.particle_filter import Particles
from pivident.estimation.literature.filters.unscented_kalman import UnscentedKalman
from pivident.estimation.literature.frequency_domain import FrequencyDomain
from pivident.estimation.literature.hopfield import Hopfield
from pivident.estimation.literature.prior_regression import PriorRegression
from pivident.estimation.literature.ridge import Ridge
from pivident.estimation.literature.robust_regression import RobustRegression
from pivident.estimation.noise_options import Arma, AutoRegressive
from pivident.estimation.output_error.output_error import OutputError
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.signal_recipes import Algebraic, Bandpass, RandomWalk
from pivident.experiment import consistency_keys as consistency_tables
from pivident.experiment import excite_keys, schema
from pivident.experiment import identify_table as method_tables
from pivident.recording.recording import Recording
from pivident.robot.mdh_schema import Entry, FrictionEntry

TEXT = (Path(__file__).resolve().parents[1] / "docs" / "experiment_file.md").read_text("utf-8")


def tables_of(*names):
    """Schemas of methods."""
    return tuple(method_tables.METHOD_ENTRIES[name] for name in names)


#: Tables that one list of keys describes together.
REGRESSIONS = tables_of(
    "tls", "irls", "ridge", "map", "ml-ls", "set-membership", "adaline", "hopfield"
)
FILTERS = tables_of("ekf", "ukf", "cdkf", "particle")
WITH_INSTRUMENTS = tables_of("ols", "ls", "iv", "iv-full-rate", "piv", "didim", "piv-as-printed")
SIMULATIONS = tables_of("cloe", "clie", "ml", "oloe")

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
    "methods": (WITH_INSTRUMENTS, (PrefilteredIV,)),
    "frequency": (tables_of("frequency"), (FrequencyDomain,)),
    "regressions": (REGRESSIONS, (RobustRegression, Ridge, PriorRegression, Adaline, Hopfield)),
    "filters": (FILTERS, (UnscentedKalman, CentralDifferenceKalman, Particles)),
    "simulation methods": (SIMULATIONS, (OutputError,)),
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
    others = {Entry, method_tables.IdentifyKeys, consistency_tables.ConsistencyFile}
    others |= {method_tables.DecimatedEntry, method_tables.NoiseKeys}
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
