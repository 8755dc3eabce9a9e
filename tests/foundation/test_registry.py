"""Entries by name, built in or of other distributions."""

import importlib
import sys
from pathlib import Path

import pytest

from pivident.foundation import registry
from pivident.foundation.registry import BrokenExtension, ExtensionWarning, Registry

GROUP = "pivident.tests"
MODULE = """
class Kind:
    pass

class Sub(Kind):
    pass

ready = Sub()
other = 3
"""


@pytest.fixture
def distribution(tmp_path, monkeypatch):
    """Installs a distribution with some entry points in the group."""

    def install(**points: str) -> type:
        (tmp_path / "foreign_entries.py").write_text(MODULE)
        (tmp_path / "foreign_broken.py").write_text("import not_there\n")
        folder = tmp_path / "foreign-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1.0\n")
        lines = [f"{name} = {value}" for name, value in points.items()]
        (folder / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *lines, ""]))
        monkeypatch.syspath_prepend(str(tmp_path))
        importlib.invalidate_caches()
        _forget()
        return importlib.import_module("foreign_entries").Kind

    yield install
    for name in ("foreign_entries", "foreign_broken"):
        sys.modules.pop(name, None)
    monkeypatch.undo()
    _forget()


def _forget() -> None:
    registry._declared.cache_clear()
    registry._anyone_declares.cache_clear()


def test_names_import_nothing():
    entries = Registry("pivident.tests", Path, {"a": "not_there:Thing", "b": "also_not:Thing"})
    assert tuple(entries) == ("a", "b")
    assert len(entries) == 2
    assert "a" in entries and "c" not in entries
    with pytest.raises(KeyError):
        entries["c"]


def test_built_in_entry_is_imported_once():
    entries = Registry("pivident.tests", dict, {"empty": "builtins:dict"})
    assert entries["empty"] == {}
    assert entries["empty"] is entries["empty"]


def test_class_of_another_distribution_stands_for_its_instance(distribution):
    kind = distribution(sub="foreign_entries:Sub", ready="foreign_entries:ready")
    entries = Registry(GROUP, kind, {})
    assert tuple(entries) == ("ready", "sub") == entries.foreign
    assert isinstance(entries["sub"], kind)
    assert entries.usable().keys() == {"ready", "sub"}


def test_broken_entries_are_named_and_do_not_stop_the_others(distribution):
    kind = distribution(
        good="foreign_entries:Sub", bad="foreign_broken:X", odd="foreign_entries:other"
    )
    entries = Registry(GROUP, kind, {})
    with pytest.raises(
        BrokenExtension, match=r"'bad' of the distribution foreign .*not_there"
    ) as error:
        entries["bad"]
    assert error.value.distribution == "foreign"
    with pytest.raises(BrokenExtension, match="it is of type int, not a Kind"):
        entries["odd"]
    with pytest.warns(ExtensionWarning, match="pip uninstall foreign"):
        assert list(entries.usable()) == ["good"]


def test_built_in_entry_wins(distribution):
    kind = distribution(mine="foreign_entries:other")
    entries = Registry(GROUP, kind, {"mine": "foreign_entries:ready"})
    assert isinstance(entries["mine"], kind)
    assert entries.foreign == ()
