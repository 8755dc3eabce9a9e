"""What docs/export.md says is so: its code runs, its formats are those of the program."""

import re
import sys
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.app.cli.export import export
from pivident.models.model_json import read_model
from tests.synthetic_identification import synthetic_identification

TEXT = (Path(__file__).resolve().parents[3] / "docs" / "export.md").read_text("utf-8")


def test_all_formats_are_in_the_table():
    rows = re.findall(r"^\| `(\w+)` \|", TEXT, flags=re.MULTILINE)
    assert rows == list(get_args(get_type_hints(export)["to"]))


def test_python_blocks_run(tmp_path, monkeypatch, capsys):
    synthetic_identification().save(tmp_path / "my_robot-results")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["export", "my_robot-results", "--to", "numpy", "--out", "arm.py"]) == 0
    of_pinocchio, of_arm, of_python = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    names: dict = {}
    exec(compile(of_arm, "docs/export.md", "exec"), names)
    np.testing.assert_allclose(names["tau"], names["same"], atol=1e-12)
    assert names["mass"].shape == (1000, 2, 2) and names["weight"].shape == (1000, 2)
    exec(compile(of_python, "docs/export.md", "exec"), names)
    assert names["tau"].shape == (1000, 2)
    assert read_model("model.json").consistent
    if sys.platform == "win32":
        pytest.skip("there is no Pinocchio for Windows")
    model, (q, dq, ddq) = names["model"], np.random.default_rng(1).uniform(0.5, 1.5, (3, 2))
    names |= {"q": q, "dq": dq, "ddq": ddq}
    exec(compile(of_pinocchio, "docs/export.md", "exec"), names)
    smooth = model.torque(q[None], dq[None], ddq[None])[0]
    np.testing.assert_allclose(names["tau_pinocchio"], smooth, rtol=0.02, atol=0.02)
