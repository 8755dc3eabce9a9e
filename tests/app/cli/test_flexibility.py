"""`pivident flexibility`: text, files and errors."""

import json

import numpy as np
import pytest

from pivident.app.cli import main
from tests.studies.flexibility.flexible_joint import RATE, record

FILE = """
[robot]
model = "emps"

[recording]
files = "log.npz"
rate = 1000
columns = {q = "q", tau = "tau", q_ref = "r"%s}
"""


def write(folder, link=True):
    made = record(1)
    np.savez(folder / "log.npz", q=made.q, tau=made.tau, r=made.q_ref, link=made.q_link, rate=RATE)
    path = folder / "axis.toml"
    path.write_text(FILE % (', q_link = "link"' if link else ""))
    return path


def test_both_encoders_and_resonance_come_out_in_text_and_files(tmp_path, capsys):
    assert main(["flexibility", str(write(tmp_path)), "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    for part in ("both encoders, two masses", "motor encoder alone", "rigid model:", "N/m"):
        assert part in text
    # This motion excites the resonance, and only two of the three ways can tell the stiffness.
    assert "above" not in text and "unexplained, more than 50 %, so nothing" in text
    content = json.loads((tmp_path / "out" / "flexibility.json").read_text())
    joint = content["joints"][0]
    assert joint["compliance"]["stiffness"]["low"] is None
    estimates = dict(zip(joint["two_mass"]["names"], joint["two_mass"]["theta"], strict=True))
    assert estimates["stiffness"] == pytest.approx(2e5, rel=0.01)
    assert joint["resonance"]["stiffness"]["value"] == pytest.approx(2e5, rel=0.01)
    page = (tmp_path / "out" / "flexibility.html").read_text()
    assert "Frequency response" in page and "Deflection" in page


def test_one_encoder_is_enough_for_the_resonance(tmp_path, capsys):
    assert main(["flexibility", str(write(tmp_path, False)), "--out", str(tmp_path / "o")]) == 0
    text = capsys.readouterr().out
    assert "both encoders" not in text and "antiresonance at 7.5" in text


def test_a_log_with_neither_is_refused(tmp_path, capsys):
    path = write(tmp_path, False)
    path.write_text(path.read_text().replace(', q_ref = "r"', ""))
    assert main(["flexibility", str(path), "--out", str(tmp_path / "o")]) == 1
    assert "name the columns of one of them" in capsys.readouterr().err


def test_a_bandwidth_that_is_none_is_refused(tmp_path, capsys):
    assert main(["flexibility", str(write(tmp_path)), "--bandwidth", "-3"]) == 1
    assert "--bandwidth -3 is not a frequency" in capsys.readouterr().err
