"""The page of the robot file lists every key of its schema with the default of the code."""

import re
from pathlib import Path

import pytest

from pivident.foundation.text.toml import value_text
from pivident.robot import mdh_keys as schema
from pivident.robot.mdh_keys import Entry

DOCS = Path(__file__).resolve().parents[1] / "docs"
TEXT = (DOCS / "robot_file.md").read_text("utf-8")

TABLES = {
    "file": schema.TableFile,
    "joints": schema.JointEntry,
    "link": schema.LinkEntry,
    "transmission": schema.TransmissionEntry,
    "couplings": schema.CouplingEntry,
    "loops": schema.LoopEntry,
    "ends of a loop": schema.EndEntry,
    "gears": schema.GearEntry,
    "friction terms": schema.FrictionEntry,
}


def rows_below(heading: str) -> list[list[str]]:
    body = re.split(r"^#{2,3} ", TEXT.split(f"### {heading}\n", 1)[1], flags=re.MULTILINE)[0]
    lines = [line.strip("| ") for line in body.splitlines() if line.startswith("|")]
    return [line.split(" | ") for line in lines[2:]]


def test_every_table_of_the_schema_has_its_own():
    models = {m for m in vars(schema).values() if isinstance(m, type) and issubclass(m, Entry)}
    assert models - {Entry} == set(TABLES.values())


@pytest.mark.parametrize("heading", TABLES)
def test_every_key_is_listed_with_its_default(heading):
    fields = {f.alias or name: f for name, f in TABLES[heading].model_fields.items()}
    rows = rows_below(heading)
    assert all(len(row) == 5 and all(row) for row in rows)
    assert sorted(row[0].strip("`") for row in rows) == sorted(fields)
    for key, _, default, *_ in rows:
        field = fields[key.strip("`")]
        if field.is_required():
            assert default.startswith("needed"), key
        elif (value := field.get_default(call_default_factory=True)) is not None:
            value = {} if isinstance(value, Entry) else value
            gravity = {tuple(v): f'"{n}"' for n, v in schema.GRAVITY_BY_NAME.items()}
            shown = gravity[tuple(value)] if key == "`gravity`" else value_text(value)
            assert default == f"`{shown}`", key
        else:
            assert not default.startswith("`"), f"{key} has no default that a file could hold"


def test_every_kind_and_term_is_named():
    for word in ("revolute", "prismatic", "fixed", "radians", "degrees", *schema.GRAVITY_BY_NAME):
        shown = word in ("-x", "+x", "-y", "+z")  # one of each stands for the others
        assert shown or f'"{word}"' in TEXT, word
    listed = (DOCS / "experiment_file.md").read_text("utf-8")
    for term in schema.TERM_KEYS:
        assert f'"{term}"' in listed, term
