"""The list of the keys of ``[fleet]`` is complete, its defaults are those of the schema."""

import re
from pathlib import Path

from pivident.experiment.explained import checked, plain_form
from pivident.foundation.text.toml import parse_toml
from pivident.studies.many.fleet.control_chart import FORGETTING
from pivident.studies.many.fleet.fleet_keys import FleetEntry, FleetFile, as_template

TEXT = (Path(__file__).resolve().parents[4] / "docs" / "fleet.md").read_text("utf-8")


def test_all_keys_are_listed_with_their_defaults():
    body = TEXT.partition("## Keys of `[fleet]`\n")[2].partition("\n\nIn a pattern")[0]
    rows = [line.strip("| ").split(" | ") for line in body.splitlines() if line.startswith("|")]
    listed = {cells[0].strip("`"): cells[2] for cells in rows[2:]}
    assert list(listed) == list(FleetEntry.model_fields)
    for name, value in FleetEntry.model_validate({}).model_dump().items():
        if value is not None:
            shown = str(value).replace("'", '"') if not isinstance(value, str) else f'"{value}"'
            assert listed[name] == f"`{shown}`", name


def test_the_example_is_a_template():
    example = re.search(r"```toml\n(.*?)```", TEXT, re.DOTALL)[1]
    content = checked(as_template(plain_form(parse_toml(example))), FleetFile)
    assert content.recording[0].files == content.fleet.pattern == "{robot}/{day}.parquet"


def test_the_forgetting_that_is_told_is_the_one_that_is_used():
    assert f"λ = {FORGETTING:g}" in TEXT
