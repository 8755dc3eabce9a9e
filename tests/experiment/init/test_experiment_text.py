"""Whatever columns and files are called, the text is TOML and says the same."""

import tomllib

import pytest

from pivident.experiment.init.assumption import Assumption, experiment_text
from pivident.foundation.text.toml import comment, value_text

NASTY = [
    'a "quoted" name', "it's", "back\\slash", "line\nend", "tab\tand\rreturn", "bell\x07",
    "delete\x7f", "nel\x85", "ls\u2028", "rtl\u202e", "# no comment", "'''", '"""', "[table]",
    "ключ = 1", "{x = 1}", "\x00", "🤖", "",
]  # fmt: skip


@pytest.mark.parametrize("name", NASTY)
def test_strings_keys_and_comments_survive(name):
    assumptions = [
        Assumption("recording", "files", name, "certain", f"seen {name}", f"correct {name}"),
        Assumption("recording.columns", "q", [name, name], "assumed", name),
        Assumption("recording.units", "tau", [{"unit": name, "gain": 1e-300}], "likely", name),
    ]
    frozen = Assumption("robot", "frozen", {name or "empty": -1.5}, "likely", name)
    text = experiment_text([assumptions, assumptions], [frozen], f"heading\n{name}", [name])
    content = tomllib.loads(text)
    assert content["recording"][1]["files"] == name
    assert content["recording"][0]["columns"]["q"] == [name, name]
    assert content["recording"][0]["units"]["tau"] == [{"unit": name, "gain": 1e-300}]
    assert content["robot"]["frozen"] == {name or "empty": -1.5}
    assert set(content) == {"recording", "robot"}


def test_comments_hold_every_line():
    lines = comment("a\nkey = 1\n" + 60 * "word ").splitlines()
    assert len(lines) > 3 and all(line.startswith("# ") for line in lines)


def test_long_lists_take_a_line_for_each_entry():
    names = [f"a_rather_long_column_name_{k}" for k in range(12)]
    text = value_text(names)
    assert text.count("\n") == 13 and tomllib.loads(f"x = {text}")["x"] == names


def test_a_table_without_values_stays_a_comment():
    line = Assumption("controller", "type", None, "likely", "not known", example='"pd"')
    text = experiment_text([[]], [line], "", [])
    assert tomllib.loads(text) == {} and '# type = "pd"' in text
