"""``pivident fleet`` from the command line, and its page."""

import html
import json
import re
import shutil
from concurrent.futures import ThreadPoolExecutor

import pytest

from pivident.app.cli import main
from pivident.studies.many.batch import runner
from tests.browser import needs_browser, seen_on_a_phone
from tests.studies.many.fleet.planar_fleet import write_fleet


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch):
    """Logs are identified without worker processes: the command is tested here, not the pool."""

    class Pool(runner.GivenExecutor):
        def __init__(self, workers=None):
            super().__init__(ThreadPoolExecutor(1), 1)

    monkeypatch.setattr(runner, "Processes", Pool)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet") / "arms"
    write_fleet(folder, robots=4, worn={"arm_2": 1.2})
    return folder


@pytest.fixture
def folder(original, tmp_path):
    return shutil.copytree(original, tmp_path / "arms")


def test_a_fleet_ends_with_table_alarms_and_page(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["fleet", str(folder), "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "4 robot(s), 20 log(s), method ls" in said.out
    assert "! arm_2, shoulder: fc1 has changed since 2026-03-04 by +" in said.out
    assert "20 of 20 logs" in said.err and "20 of 20" not in said.out
    for name in ("parameters.parquet", "alarms.json", "fleet.html"):
        assert (out / name).is_file() and str(out / name) in said.out
    assert main(["fleet", str(folder), "--out", str(out), "--level", "1e-12"]) == 0
    assert json.loads((out / "alarms.json").read_text())["level"] == 1e-12


def test_page_has_figures_and_escapes_names(folder, tmp_path):
    (folder / "arm_4").rename(folder / "<b onload=x>")
    (folder / "<b onload=x>/2026-03-05.npz").write_bytes(b"<script>alert(1)</script>")
    assert main(["fleet", str(folder), "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "fleet.html").read_text("utf-8")
    assert "http-equiv" in text and "<b onload" not in text
    figures = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    kinds = [json.loads(f)["data"][0]["type"] for f in figures]
    assert kinds[0] == "heatmap" and kinds.count("scatter") >= 4
    for anchor in ("alarms", "overview", "charts", "wear", "logs", "provenance"):
        assert f'id="{anchor}"' in text
    assert "arm_2: fc1" in html.unescape(text)


def test_errors_are_one_line(folder, tmp_path, capsys):
    def said(*options):
        assert main(["fleet", *map(str, options)]) == 1
        return capsys.readouterr().err

    assert "no fleet.toml" in said(tmp_path)
    assert "--level 2" in said(folder, "--level", 2)
    assert "--workers is 0" in said(folder, "--workers", 0)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("")
    assert "contains other files" in said(folder, "--out", tmp_path / "other")


def test_a_fleet_without_any_estimate_is_a_failure(folder, tmp_path, capsys):
    for log in folder.glob("*/*.npz"):
        log.write_bytes(b"nothing")
    assert main(["fleet", str(folder), "--out", str(tmp_path / "out")]) == 1
    assert "no log gave an estimate" in capsys.readouterr().err
    assert (tmp_path / "out" / "fleet.html").is_file()


@needs_browser
def test_page_is_drawn_on_a_phone(folder, tmp_path):
    assert main(["fleet", str(folder), "--out", str(tmp_path / "out")]) == 0
    seen = seen_on_a_phone((tmp_path / "out" / "fleet.html").read_text("utf-8"), tmp_path)
    assert seen is None or seen["plots"] == seen["drawn"]
