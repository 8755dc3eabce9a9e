"""The Python of the guides runs as it stands, and their tables are complete."""

import re
import shutil
from pathlib import Path

import pytest

from pivident import studies
from pivident.app.cli.app import app
from pivident.studies.tables.chosen import TABLES
from tests.planar_log import write_experiment
from tests.studies.comparison.results import result

DOCS = Path(__file__).resolve().parents[3] / "docs"


def blocks(name):
    return re.findall(r"```python\n(.*?)```", (DOCS / name).read_text("utf-8"), flags=re.DOTALL)


def test_the_guide_to_comparisons_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pandas")
    result(1).save(tmp_path / "monday")
    result(3, fv1=1.25).save(tmp_path / "friday")
    monkeypatch.chdir(tmp_path)
    for code in blocks("compare.md"):
        exec(compile(code, "compare.md", "exec"), {})
    said = capsys.readouterr().out
    assert "('fv1',)" in said
    shown = re.search(r"```text\n(.*?)```", (DOCS / "compare.md").read_text("utf-8"), re.DOTALL)
    for line in shown[1].splitlines():
        if "±" in line and not line.startswith("Parameters"):
            assert line.split() in [own.split() for own in said.splitlines()], line
    assert (tmp_path / "comparison" / "comparison.tex").is_file()
    assert app["compare"]


def test_the_guide_to_notebooks_runs(tmp_path, monkeypatch):
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib")
    write_experiment(tmp_path)
    shutil.move(next(tmp_path.glob("*.toml")), tmp_path / "my_robot.toml")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for code in blocks("notebooks.md"):
        exec(compile(code, "notebooks.md", "exec"), names)
    assert len(names["frame"]) == 13
    assert (tmp_path / "torques.pdf").is_file() and (tmp_path / "joints.csv").is_file()


def test_every_table_and_figure_is_listed():
    text = (DOCS / "notebooks.md").read_text("utf-8")
    for name, (_, _, tables) in TABLES.items():
        line = f"| `{name.rpartition('.')[2]}` | {', '.join(f'`{t}`' for t in tables)} |"
        assert line in text, line
    for name in studies.__all__:
        assert not name.startswith("figure_of") or f"`{name}" in text, name
