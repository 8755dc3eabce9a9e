"""The example from a CSV file to a frame: its numbers are the true ones, and those of the API."""

from importlib import import_module

import numpy as np
import pytest

import pivident as pv
from tests.conftest import REPOSITORY
from tests.planar_log import planar_log, planar_truth, write_log

EXAMPLES = REPOSITORY / "examples" / "python"
MOST_LINES = 40


@pytest.fixture
def frame(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return import_module("csv_to_frame").estimates(write_log(tmp_path / "log.csv"))


def test_the_frame_holds_the_truth(frame):
    truth = planar_truth()
    assert list(frame.columns) == ["parameter", "value", "std", "low", "high", "unit", "method"]
    assert list(frame["method"].unique()) == ["ls", "iv", "piv"]
    piv = frame[frame["method"] == "piv"].set_index("parameter")
    assert set(piv.index) == set(truth)
    error = piv["value"] - [truth[name] for name in piv.index]
    assert (error.abs() < 4.0 * piv["std"]).all()
    inside = (frame["low"] <= frame["parameter"].map(truth)) & (
        frame["parameter"].map(truth) <= frame["high"]
    )
    assert inside.groupby(frame["method"]).mean().min() > 0.75
    np.testing.assert_allclose(frame["high"] - frame["value"], 1.959964 * frame["std"], rtol=1e-6)


def test_its_numbers_are_those_of_the_arrays(frame):
    table, robot = planar_log(), pv.load_robot("planar_2r")
    q, q_ref = np.deg2rad(table[:, 1:3]), np.deg2rad(table[:, 3:5])
    run = pv.Recording.from_arrays(q, table[:, 5:7], 1000.0, q_ref=q_ref)
    loop = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))
    result = pv.identify(pv.Problem(robot, (run,), loop), "piv")
    own = frame[frame["method"] == "piv"]
    np.testing.assert_allclose(own["value"], result.theta, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", ["csv_to_frame", "monte_carlo", "own_axes"])
def test_the_example_is_short_and_indexed(name):
    text = (EXAMPLES / f"{name}.py").read_text("utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    assert f"python/{name}.py" in (REPOSITORY / "examples" / "README.md").read_text("utf-8")
