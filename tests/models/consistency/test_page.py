"""The page on physical consistency: its Python runs, its table loads, its names exist."""

import re
from pathlib import Path

from pivident.experiment.consistency_table import read_consistency
from pivident.models.consistency.options import CONSISTENT_METHODS
from pivident.robot.gallery import load_robot
from tests.synthetic_identification import synthetic_identification

TEXT = (Path(__file__).resolve().parents[3] / "docs" / "consistency.md").read_text("utf-8")


def test_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    synthetic_identification(relative_std=0.02).save(tmp_path / "results")
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    exec(compile(code, "docs/consistency.md", "exec"), {})
    assert "forearm" in capsys.readouterr().out


def test_table_of_the_page_is_read(tmp_path):
    (table,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    path = tmp_path / "bounds.toml"
    path.write_text(table, encoding="utf-8")
    options = read_consistency(path, load_robot("staubli_tx40"))
    assert options.bounds.total_mass == (20.0, 25.0)
    assert set(options.bounds.mass) == {"link_4", "link_5", "link_6"}


def test_every_method_is_named():
    for name in CONSISTENT_METHODS:
        assert f"`{name}`" in TEXT
