"""The manual of the experiment file is that of the schema, with the defaults of the code."""

from pathlib import Path

import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.methods import METHODS
from pivident.experiment import consistency_keys, excite_keys, file_keys, identify_table
from pivident.experiment.manual import words_of
from pivident.foundation.options import declarations, default_of
from pivident.foundation.text.toml import value_text
from pivident.robot.mdh_keys import Entry, declared_of, fields_of
from tests.manual_page import PAGE, TABLES, heading_of, page, sections

TEXT = PAGE.read_text("utf-8")

#: Tables that others are made from, or that are described with another.
PARTS_OF_OTHERS = {
    Entry,
    identify_table.IdentifyKeys,
    identify_table.SharedKeys,
    identify_table.DecimatedEntry,
    identify_table.BandpassKeys,
    identify_table.NoiseKeys,
    consistency_keys.ConsistencyFile,
    excite_keys.RoomEntry,
}


def test_the_page_is_that_of_the_schema():
    assert page(TEXT) == TEXT  # python -m tests.manual_page
    headings = [heading_of(section) for section in sections(TEXT)[1:]]
    assert set(headings) == set(TABLES) and len(headings) == len(TABLES)


def test_every_table_is_documented():
    modules = (file_keys, identify_table, consistency_keys, excite_keys)
    values = [value for module in modules for value in vars(module).values()]
    models = {m for m in values if isinstance(m, type) and issubclass(m, Entry)}
    assert models - set(TABLES.values()) <= PARTS_OF_OTHERS


@pytest.mark.parametrize("heading", TABLES)
def test_every_key_has_its_words(heading):
    for name, field in fields_of(TABLES[heading]).items():
        words = words_of(field)
        assert declared_of(field) is not None, name
        assert words.kind and words.default and words.meaning, name
        for text in (words.kind, words.default, words.unit, words.meaning):
            assert " | " not in text and "\n" not in text, name


def test_defaults_in_numbers_are_those_of_the_code():
    """Keys that a file may leave out say what the class behind them has."""
    for name, method in METHODS.items():
        for key, field in fields_of(identify_table.METHOD_ENTRIES[name]).items():
            declared = declarations(type(method)).get(key)
            if declared is not None and not declared.shown and key not in ("signals", "noise"):
                default = default_of(type(method), key)
                expected = "none" if default is None else f"`{value_text(default)}`"
                assert words_of(field).default == expected, key
    for key, field in fields_of(file_keys.RecordingEntry).items():
        default = getattr(Recording, key, None)
        found_out = key in ("control_rate", "name", "rate", "torque_timing")
        if isinstance(default, (str, float, bool)) and not found_out:
            assert words_of(field).default == f"`{value_text(default)}`", key


def test_controllers_and_methods_are_named():
    for name in file_keys.LAW_KEYS:
        assert f'"{name}"' in TEXT, name
    for name in METHODS:
        assert f"`{name}`" in TEXT, name


def test_readme_links_to_it():
    readme = Path(__file__).resolve().parents[1] / "README.md"
    assert "(docs/experiment_file.md)" in readme.read_text("utf-8")
