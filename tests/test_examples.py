"""The examples run, and say what their comments promise."""

import importlib.util
import shutil
from pathlib import Path

import numpy as np
import pytest

from pivident.experiment import load_experiment

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def script(name: str):
    path = EXAMPLES / name / f"identify_{name}.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def public_data(data_dir, monkeypatch):
    monkeypatch.setenv("PIVIDENT_DATA", str(data_dir))


@pytest.mark.parametrize("name", ["emps", "simulated_tx40", "staubli_tx40"])
def test_example_is_indexed_and_its_experiment_loads(name):
    assert f"({name})" in (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert "piv" in load_experiment(EXAMPLES / name / "experiment.toml").methods()
    assert len(script(name).__doc__.splitlines()) > 3


def test_simulated_tx40(tmp_path, capsys):
    shutil.copy(EXAMPLES / "simulated_tx40" / "experiment.toml", tmp_path)
    example = script("simulated_tx40")
    results = example.main(tmp_path, seed=1)
    truth = example.write_record(tmp_path / "record.npz", seed=1)
    median, coverage = example.judgement(results["piv"], truth)
    assert results["piv"].converged and median < 0.03 and coverage > 85
    assert median < example.judgement(results["ls"], truth)[0]
    assert (tmp_path / "report.html").is_file()
    assert "within 2σ" in capsys.readouterr().out


@pytest.mark.record
def test_emps(public_data, capsys):
    rows = script("emps").main()
    theta, force, position = rows["authors"]
    assert np.allclose(theta, rows["published"][0], atol=1e-4)
    for name in ("ls", "iv", "iv-full-rate", "piv"):
        assert rows[name][1] < 5.85 and rows[name][2] < 2.6, name
    assert force < 5.85 and position < 2.6
    assert "unseen force" in capsys.readouterr().out


@pytest.mark.record
def test_staubli_tx40(public_data, capsys):
    results = script("staubli_tx40").main()
    laboratory, _ = results["laboratory"]
    assert len(laboratory.names) == 61 and abs(100 * laboratory.relative_error - 6.0) < 0.2
    for name in ("ls", "iv", "iv-full-rate", "piv"):
        result, unseen = results[name]
        assert result.converged and result.iterations <= 8, name
        assert unseen < 7.5, name
    assert "laboratory" in capsys.readouterr().out
