"""The page about the audit: its example runs, its tables name every check and severity."""

import re
from pathlib import Path

import pytest

from pivident.foundation.text.finding import SEVERITIES
from pivident.judgement.audit.audit import TOPICS

TEXT = (Path(__file__).resolve().parents[3] / "docs" / "audit.md").read_text("utf-8")


@pytest.mark.usefixtures("without_plotly")
def test_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    exec(compile(code, "docs/audit.md", "exec"), {})
    assert (tmp_path / "log-audit" / "audit.html").is_file()
    assert "ok speed dq of joint_1 is 1 times" in capsys.readouterr().out


def test_tables_name_everything():
    rows = re.findall(r"^\| (\w+) \|", TEXT, re.MULTILINE)
    assert set(SEVERITIES) <= set(rows)
    assert {topic.name for topic in TOPICS} - {"reading"} <= set(rows)
