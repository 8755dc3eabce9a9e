"""One interval of each parameter, in everything that a run prints and writes."""

import csv
import json
import math
import re

import numpy as np

from pivident.app.cli import main
from pivident.app.notebook.displays import html_of
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.text.numbers import percent, with_spread
from pivident.judgement.diagnostics.estimate_statements import determined
from pivident.studies.comparison.entry import entry_of
from pivident.studies.tables.identifications import identification_parameters
from tests.planar_log import EXPERIMENT, write_experiment

#: Probability within ±2σ of a normal distribution.
TWO_SIGMA = math.erf(math.sqrt(2.0))


def test_one_interval_in_every_output(tmp_path, monkeypatch, capsys):
    """By least squares, whose two kinds of σ differ."""
    monkeypatch.setenv("COLUMNS", "400")
    path = write_experiment(tmp_path, EXPERIMENT)
    out = tmp_path / "out"
    assert main(["identify", str(path), "--folds", "3", "--out", str(out), "--details"]) == 0
    printed = capsys.readouterr().out
    result = load_identification(out)
    assert not np.allclose(result.std, result.method_std, rtol=0.05)
    np.testing.assert_array_equal(result.std, result.robust_std)
    ends = np.column_stack([result.theta - 2.0 * result.std, result.theta + 2.0 * result.std])
    np.testing.assert_allclose(result.conf_int(TWO_SIGMA), ends, rtol=1e-9)

    stored = json.loads((out / "identification.json").read_text("utf-8"))["parameters"]
    with (out / "parameters.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    frame = identification_parameters(result).to_polars().to_dicts()
    entry = entry_of(result, "ls")
    np.testing.assert_allclose(np.column_stack([entry.low, entry.high]), ends)
    for own in (stored, rows, frame):
        numbers = [[float(p[key]) for key in ("std", "low", "high")] for p in own]
        np.testing.assert_allclose(numbers, np.column_stack([result.std, ends]), rtol=1e-9)

    page = (out / "report.html").read_text("utf-8")
    page = page[page.index('id="parameters"') :]
    notebook = html_of(result)
    for name, value, std in zip(result.names, result.theta, result.std, strict=True):
        texts = with_spread(value, 2.0 * std)
        (line,) = [x for x in printed.splitlines() if x.startswith(f"{name} ")]
        assert tuple(line.split()[1:3]) == texts
        row = page[page.index(f'<th scope="row">{name}</th>') :]
        cells = re.findall(r'<td class="number" data-value="(.*?)">(.*?)</td>', row)
        assert [float(cell) for cell, _ in cells[:2]] == [value, std]
        assert tuple(text for _, text in cells[:2]) == texts
        row = notebook[notebook.index(f'<th scope="row">{name}</th>') :]
        assert tuple(re.findall(r'<td class="number">(.*?)</td>', row)[:2]) == texts

    said = json.loads((out / "verdict.json").read_text("utf-8"))
    sentences = " ".join(f"{s['message']} {s['basis']}" for s in said["statements"])
    best = float(np.min(200.0 * result.std / np.abs(result.theta)))
    assert f"2σ from {percent(best)} " in sentences
    assert next(determined(result)).basis in sentences
    ranges = {own["name"]: own for own in said["ranges"]}
    assert set(ranges) == set(result.names) and ranges["zz1r"]["estimates"] == 3
    assert "range: ±2σ of a jackknife over 3 blocks" in printed
