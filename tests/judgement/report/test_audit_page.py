"""The files: one strict JSON, one page that needs nothing else, both or neither."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.foundation.errors import PividentError
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.report.audit_account import render_page, write_audit
from tests.judgement.audit.logs import planar, with_torque
from tests.planar_log import write_experiment

pytestmark = pytest.mark.usefixtures("without_plotly")


@pytest.fixture(scope="module")
def faulty():
    return audit_log(with_torque(planar(), 1, np.negative))


def test_page_has_every_section_and_plot(faulty):
    text = render_page([faulty, faulty])
    assert "http-equiv" in text and "src=" not in text.split("<script>")[0]
    for anchor in ("summary-1", "timing-1", "quantisation-2", "delay-1", "power-2", "excitation-1"):
        assert f'id="{anchor}"' in text or anchor.startswith("quantisation")
    figures = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    assert len(figures) >= 2 * 8
    for figure in figures:
        assert json.loads(figure)["data"]
    visible = html.unescape(text)
    assert all(finding.message in visible for finding in faulty.findings)


def test_names_are_escaped():
    hostile = replace(planar(), name="<script>alert(1)</script>")
    text = render_page([audit_log(hostile)])
    assert "<script>alert" not in text and "&lt;script&gt;alert" in text


def test_json_is_strict_and_complete(faulty, tmp_path):
    write_audit([faulty], tmp_path / "out")
    content = json.loads((tmp_path / "out" / "audit.json").read_text("utf-8"))
    assert content["schema"] == 2 and content["severity"] == "error"
    (audit,) = content["audits"]
    assert audit["joints"] == ["shoulder", "elbow"] and audit["rate_hz"] > 999
    wrong = [f for f in audit["findings"] if f["severity"] == "error"]
    assert {f["subject"] for f in wrong} == {"elbow"}
    assert audit["gain"][1] == pytest.approx(-1.0, abs=0.01)
    assert abs(audit["delay"]["common_s"]) < 1e-4
    assert audit["excitation"]["rank"] == len(audit["excitation"]["parameters"])


def test_nothing_is_left_half_written(faulty, tmp_path, monkeypatch):
    target = tmp_path / "out"
    monkeypatch.setattr("pivident.judgement.report.audit_account.render_page", lambda audits: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_audit([faulty], target)
    assert not target.exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(PividentError):
        monkeypatch.undo()
        write_audit([faulty], tmp_path / "file" / "out")


def test_command_line(tmp_path, capsys):
    experiment = write_experiment(tmp_path)
    out = tmp_path / "audit"
    assert main(["audit", str(experiment), "--out", str(out)]) == 0
    assert {p.name for p in out.iterdir()} == {"audit.json", "audit.html"}
    assert "0 errors, 0 warnings" in capsys.readouterr().out
    log = tmp_path / "log.csv"
    assert main(["audit", str(log), "--robot", "planar_2r", "--out", str(out)]) == 4
    text = capsys.readouterr().out
    assert 'units = {q = "deg"}' in text and text.count("error") >= 2
    assert main(["audit", str(tmp_path / "none.csv"), "--out", str(out)]) == 1
    assert main(["audit", str(log), "--robot", "no_such_robot", "--out", str(out)]) == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    assert len(errors) == 2 and "none.csv" in errors[0]
    assert main(["audit", str(log), "--experiment", str(experiment), "--out", str(out)]) == 0
