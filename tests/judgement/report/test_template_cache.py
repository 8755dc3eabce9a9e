"""Compiled templates are found again, and what is damaged or foreign is not believed."""

import sys

import pytest
from jinja2 import DictLoader, Environment

from pivident.judgement.report.builder import TemplateCache


@pytest.fixture(autouse=True)
def bytecode_is_written(monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)


def rendered(folder, source="{{ 6 * x }}"):
    environment = Environment(
        loader=DictLoader({"page": source}), bytecode_cache=TemplateCache(folder), autoescape=True
    )
    return environment.get_template("page").render(x=7)


def test_a_template_is_translated_once(tmp_path, monkeypatch):
    folder = tmp_path / "__pycache__"
    assert rendered(folder) == "42"
    (kept,) = folder.iterdir()
    monkeypatch.setattr(Environment, "_generate", None)  # what translates
    assert rendered(folder) == "42"
    assert list(folder.iterdir()) == [kept]


def test_another_source_is_another_template(tmp_path):
    assert rendered(tmp_path) == "42"
    assert rendered(tmp_path, "{{ x }}") == "7"


@pytest.mark.parametrize("damaged", [b"", b"\xff", b"no code", b"i*\0\0\0"])
def test_a_damaged_file_is_replaced(tmp_path, damaged):
    rendered(tmp_path)
    (kept,) = tmp_path.iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(damaged)
    assert rendered(tmp_path) == "42"
    assert kept.read_bytes() == whole


def test_a_folder_that_cannot_be_made_is_done_without(tmp_path):
    (tmp_path / "file").write_text("")
    assert rendered(tmp_path / "file" / "__pycache__") == "42"


def test_nothing_is_written_where_python_writes_no_bytecode(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert rendered(tmp_path) == "42"
    assert not list(tmp_path.iterdir())
