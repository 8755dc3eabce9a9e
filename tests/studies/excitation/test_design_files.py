import os
import sys

import numpy as np
import pytest

from pivident.foundation.errors import PividentError
from pivident.studies import load_design, write_design
from pivident.studies.excitation import design_view
from tests.studies.excitation.designs import made_design


def test_the_folder_holds_what_is_returned(tmp_path):
    design = made_design("staubli_tx40", "postures")
    paths = write_design(design, tmp_path / "motion", rate=200.0)
    assert [p.name for p in paths] == [
        "design.json", "motion.csv", "motion.npz", "postures.csv", "trajectory.yaml",
        "trajectory_slow.yaml", "pivident_motion.script", "pivident_motion_slow.script",
        "pivident_motion.src", "pivident_motion.mod", "design.html",
    ]  # fmt: skip
    assert sorted(os.listdir(tmp_path / "motion")) == sorted(p.name for p in paths)
    with np.load(tmp_path / "motion" / "motion.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["q"], design.motion.sampled(200.0)[0])
        assert tuple(arrays["joint_names"]) == design.robot.joint_names
    assert load_design(tmp_path / "motion").seconds == design.seconds


def test_programs_of_another_motion_do_not_stay(tmp_path):
    write_design(made_design("staubli_tx40", "postures"), tmp_path, rate=100.0)
    (tmp_path / "notes.txt").write_text("mine")
    paths = write_design(made_design("planar_2r", "fourier"), tmp_path, rate=100.0)
    assert sorted(os.listdir(tmp_path)) == sorted([*(p.name for p in paths), "notes.txt"])


def test_a_write_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(design_view, "render_page", fail)
    with pytest.raises(KeyboardInterrupt):
        write_design(made_design(), tmp_path / "motion")
    assert os.listdir(tmp_path) == []


def test_a_write_that_fails_leaves_the_design_before(tmp_path, monkeypatch):
    write_design(made_design(), tmp_path)
    before = {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)}
    monkeypatch.setattr(np, "savez_compressed", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_design(made_design("planar_2r", "splines"), tmp_path)
    assert before == {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)}


def test_other_files_in_the_folder_stay(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    write_design(made_design(), tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_without_plotly_there_is_no_page(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly", None)
    paths = write_design(made_design(), tmp_path)
    assert "design.html" not in [p.name for p in paths]
    assert not (tmp_path / "design.html").exists()


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan"), float("inf"), 1e9])
def test_a_rate_that_means_nothing_is_refused(rate, tmp_path):
    with pytest.raises(PividentError, match="Hz"):
        write_design(made_design(), tmp_path, rate)
    assert os.listdir(tmp_path) == []


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "motion").write_text("")
    with pytest.raises(PividentError, match="motion is a file; name a folder"):
        write_design(made_design(), tmp_path / "motion")
