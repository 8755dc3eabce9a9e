"""The README is a front page: its Python runs as it stands, its commands lead to a URDF."""

import re
import shlex
from pathlib import Path

import pytest

from pivident.app.cli import main
from pivident.app.cli.app import app
from tests.docs.preparations import first_logs
from tests.planar_log import planar_truth, write_log

REPOSITORY = Path(__file__).resolve().parents[1]
README = (REPOSITORY / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_it_is_a_front_page():
    assert len(README.split()) <= 1200
    assert README.count("![") == 1 and len(re.findall(r"^\|---", README, flags=re.MULTILINE)) == 1


def test_its_links_lead_to_files():
    for target in re.findall(r"\]\((?!https?://)([^)#]+)", README):
        assert (REPOSITORY / target).is_file(), target
    assert (REPOSITORY / "docs" / "_static" / "report.png").stat().st_size < 250_000


def test_python_block_identifies_a_log(tmp_path, monkeypatch, capsys):
    (code,) = blocks("python")
    assert code in (REPOSITORY / "docs" / "first_steps.md").read_text(encoding="utf-8")
    assert 10 <= len([line for line in code.splitlines() if line]) <= 12
    write_log(tmp_path / "log.csv")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)
    assert "IDIM-PIV" in capsys.readouterr().out
    assert (tmp_path / "report.html").stat().st_size > 10_000
    for name, value in planar_truth().items():
        assert names["results"][-1].value(name) == pytest.approx(value, rel=0.05, abs=0.01), name


def test_commands_lead_from_urdf_and_log_to_another_urdf(tmp_path, monkeypatch):
    first = next(b for b in re.findall(r"```\n(.*?)```", README, flags=re.DOTALL) if " init " in b)
    lines = [shlex.split(line, comments=True) for line in first.splitlines()]
    assert [line[1] for line in lines] == ["init", "check", "identify", "export", "predict"]
    monkeypatch.chdir(tmp_path)
    first_logs()
    (tmp_path / "new_log.csv").write_bytes((tmp_path / "log.csv").read_bytes())
    for _, *words in lines:
        quick = ["--folds", "0"] if words[0] == "identify" else []
        assert main([*words, *quick]) in ((0, 4) if words[0] == "check" else (0,)), words
    assert (tmp_path / "experiment-results" / "report.html").is_file()
    assert b'<robot name="' in (tmp_path / "identified.urdf").read_bytes()


def test_commands_of_the_readme_exist():
    fences = re.findall(r"^```(\w*)\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    code = [text for language, text in fences if not language]
    code += re.findall(r"`(pivident [^`]*)`", README)
    named = {name for text in code for name in re.findall(r"\bpivident ([a-z]\w+)", text)}
    assert {"demo", "init", "check", "identify", "export", "friction", "laws"} <= named
    for command in named:
        assert app[command]
