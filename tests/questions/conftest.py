"""How a question is asked: in a folder of its own, through the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pivident.app.cli import main
from tests.questions.material import Case, csv


@pytest.fixture
def ask(tmp_path, monkeypatch, capsys):
    """Lay out the files of a case, type its command, and return exit code and lines."""

    def asked(case: Case) -> tuple[int, list[str]]:
        monkeypatch.chdir(tmp_path)
        lay_out(case, tmp_path)
        code = main(list(case.command))
        printed = capsys.readouterr()
        lines = [*printed.out.splitlines(), *printed.err.splitlines()]
        assert not any("Traceback" in line or "unexpected" in line for line in lines)
        return code, lines

    return asked


def lay_out(case: Case, folder: Path) -> None:
    """Write the files of a case."""
    contents: dict[str, str | bytes] = {"experiment.toml": case.text, **case.files}
    if case.log is not None:
        contents["log.csv"] = csv(case.log) if isinstance(case.log, dict) else case.log
    for name, content in contents.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)


def answered(lines: list[str], words: tuple[str, ...]) -> bool:
    """Whether one line says all of it, whatever its capitals."""
    return any(all(word.lower() in line.lower() for word in words) for line in lines)
