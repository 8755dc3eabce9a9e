"""The list of a scenario's keys is complete, and its defaults are those of the schema."""

import re
from pathlib import Path

import pytest
from pydantic_core import PydanticUndefined

from pivident.robot.mdh_keys import Entry
from pivident.studies.many.study import scenario_keys as schema
from pivident.studies.many.study.scenario import shipped_scenarios

TEXT = (Path(__file__).resolve().parents[4] / "docs" / "studies.md").read_text("utf-8")

TABLES = {
    "Tables": schema.ScenarioFile,
    "`[truth]`": schema.TruthEntry,
    "`[start]`": schema.StartEntry,
    "`[record]`": schema.RecordEntry,
    "`[trajectory]`": schema.TrajectoryEntry,
    "`[noise]`": schema.NoiseEntry,
}


def rows(heading: str) -> dict[str, list[str]]:
    body = TEXT.partition(f"### {heading}\n")[2].partition("\n#")[0]
    lines = [line.strip("| ").split(" | ") for line in body.splitlines() if line.startswith("|")]
    return {cells[0].strip("`"): cells for cells in lines[2:]}


@pytest.mark.parametrize("heading", TABLES)
def test_all_keys_are_listed_with_their_defaults(heading):
    listed, fields = rows(heading), TABLES[heading].model_fields
    assert list(listed) == list(fields)
    for name, field in fields.items():
        said = listed[name][2]
        if field.default is PydanticUndefined:
            needed = field.default_factory is None
            assert said == ("needed" if needed else "`{}`"), name
        elif isinstance(field.default, bool):
            assert said == f"`{str(field.default).lower()}`", name
        elif isinstance(field.default, (int, float)):
            assert said == f"`{field.default!r}`", name
        elif isinstance(field.default, str):
            assert said == f'`"{field.default}"`' if field.default else '`""`', name
        elif isinstance(field.default, Entry):
            assert said == "`{}`", name
        else:
            assert said not in ("needed", "`{}`"), name


def test_all_shipped_scenarios_are_listed():
    listed = re.findall(r"^\| `(\w+)` \|", TEXT.partition("## Shipped")[2], re.MULTILINE)
    assert sorted(set(shipped_scenarios()) - set(listed)) == []


def test_the_condition_example_has_the_conditions_it_says():
    from pivident.studies.many.study.scenario import read_scenario
    from tests.studies.many.study.small import TEXT as SMALL

    example = TEXT.partition("### conditions")[2].partition("```toml\n")[2].partition("```")[0]
    names = [c.condition for c in read_scenario(SMALL + example, "example").conditions]
    assert names == ["low-soft", "low-stiff", "high-soft", "high-stiff"]
