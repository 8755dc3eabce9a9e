"""Tables written as TOML are read back as they were."""

from pivident.foundation.text.toml import parse_toml, toml_lines


def test_lines_are_toml_again():
    tables = {
        "runs": 3,
        "robot": {"model": 'my "arm".urdf', "frozen": {"elbow": 0.5}},
        "recording": [{"files": "a.csv", "columns": {"q": ["q1", "q2"]}}],
        "noise": {"encoder": [2e-6, 1e-5], "empty": {}},
    }
    assert parse_toml("\n".join(toml_lines(tables))) == tables


def test_keys_without_a_value_are_left_out():
    assert toml_lines({"a": None, "b": {"c": None, "d": 1}}) == ["b.d = 1"]
    assert toml_lines({"a": [{"b": None, "c": 2}]}) == ["a = [{c = 2}]"]
