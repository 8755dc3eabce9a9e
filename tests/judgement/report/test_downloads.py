"""Files inside the page: complete, small, with names that no file system stumbles over."""

import csv
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identification_file import to_csv
from pivident.judgement.report.downloads import (
    MAX_NUMBERS,
    downloads,
    signal_step,
    signals_csv,
    to_latex,
)
from tests.synthetic_identification import synthetic_identification

NAMES = ("../../etc/passwd", "a\\b:c*?", "", "x" * 300, 'q"<b>', "con", "Größe")


def test_every_method_has_its_parameters_and_the_best_its_signals():
    methods = [synthetic_identification("IDIM-LS"), synthetic_identification()]
    files = downloads(methods, ["IDIM-LS", "IDIM-PIV"], methods[1].recordings, 1)
    assert [file.name for file in files] == [
        "planar_2R_IDIM_LS_parameters.csv",
        "planar_2R_IDIM_LS_parameters.tex",
        "planar_2R_IDIM_PIV_parameters.csv",
        "planar_2R_IDIM_PIV_parameters.tex",
        "planar_2R_IDIM_PIV_identification.json",
        "run1_planar_2R_IDIM_PIV_signals.csv",
    ]
    assert files[0].text == to_csv(methods[0])
    assert json.loads(files[4].text)["method"] == "IDIM-PIV"
    assert [file.method for file in files] == [0, 0, 1, 1, 1, 1]
    assert len({file.holder for file in files}) == len(files)


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files_are_safe_and_different(name):
    own = synthetic_identification(samples=50)
    own = replace(own, robot=replace(own.robot, name=name), method=name)
    recordings = [replace(own.recordings[0], name=name)] * 2
    files = downloads([own, own], [name, f"{name}2"], recordings, 0)
    names = [file.name for file in files]
    assert len(set(names)) == len(names)
    for one in names:
        assert re.fullmatch(r"[A-Za-z0-9_]{1,100}\.(csv|json|tex)", one)


def test_signals_are_those_of_the_recording():
    own = synthetic_identification(samples=300)
    recording = replace(own.recordings[0], t=1.7e9 + own.recordings[0].t)
    recording.tau[6, 1] = np.nan
    rows = list(csv.DictReader(io.StringIO(signals_csv(own, recording, 3))))
    assert len(rows) == 100
    assert float(rows[1]["time [s]"]) - 1.7e9 == pytest.approx(0.003, abs=1e-5)
    for j, joint in enumerate(own.robot.joint_names):
        found = [float(row[f"{joint} speed [rad/s]"]) for row in rows]
        np.testing.assert_allclose(found, recording.dq[::3, j], rtol=1e-5, atol=1e-9)
        used = [row[f"{joint} used [0 or 1]"] == "1" for row in rows]
        np.testing.assert_array_equal(used, recording.used[::3, j])
    assert rows[2]["elbow measured torque [N m]"] == ""


def test_tables_of_signals_stay_small():
    own = synthetic_identification(samples=20_000)
    step = signal_step(own, own.recordings)
    rows = list(csv.reader(io.StringIO(signals_csv(own, own.recordings[0], step))))
    assert 0.5 * MAX_NUMBERS < len(rows) * len(rows[0]) < 1.1 * MAX_NUMBERS


def test_latex_has_every_parameter_escaped():
    own = synthetic_identification(samples=50)
    hostile = replace(own, method="50 % of $x_1$ & \\input{y}", expressions=("#1 & x",) * 13)
    text = to_latex(hostile)
    assert text.count(r" \\") == len(own.names) + 1
    assert r"50 \% of \$x\_1\$ \& \textbackslash{}input\{y\}" in text
    assert r"\#1 \& x" in text
    assert r"$\mathit{zz}_{1r}$" in text
    assert r"$\mathrm{kg\,m^{2}}$" in text
