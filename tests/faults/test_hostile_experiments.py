"""Experiments and folders of studies made to harm: recordings and manifests that cannot be."""

import numpy as np
import pytest

from pivident.data.logs.timestamps import uniform_grid
from pivident.data.recording.load import load_recording
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import PividentError
from pivident.studies.many.study.scenario import read_scenario
from tests.faults.hostile import STUDY, written

LOG = "time,q1,q2,tau1,tau2\n" + "".join(
    f"{k / 1000},{np.sin(k):.5f},{np.cos(k):.5f},{np.sin(2 * k):.5f},{np.cos(3 * k):.5f}\n"
    for k in range(60)
)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("resample = true\nrate = 1e300", "unlike any robot"),
        ("resample = true\nrate = 9e5", "samples of 60, more than"),
        ("part = [5.0, 1e308]", "no sample of recording"),
        ("part = [-1e308, -1e307]", "no sample of recording"),
        ('side = {q = ["motor"]}', "choose joint or motor"),
        ("units = {q = 1e400}", "number other than 0"),
        (f"units = {{q = {'9' * 400}}}", "beyond the 64 bits"),
        ("units = {t = 1979-05-27}", "is not known here"),
        ("position_offset = [1e308, 1e308]", "far beyond its limits"),
    ],
)
def test_recordings_that_cannot_be(tmp_path, more, message):
    written(tmp_path, "log.csv", LOG)
    columns = 'columns = {t = "time", q = ["q1", "q2"], tau = ["tau1", "tau2"]}'
    path = written(tmp_path, "e.toml", f'robot = "planar_2r"\n[recording]\nfiles = "log.csv"\n'
                   f"{columns}\n{more}\n")  # fmt: skip
    with pytest.raises(PividentError, match=message):
        load_experiment(path).recordings()


def test_one_stamp_far_away_does_not_fill_the_memory():
    """A grid at the rate of the others would have 10^15 samples."""
    t = np.append(np.arange(100) / 1000.0, 1e12)
    with pytest.raises(PividentError, match="samples of 101, more than"):
        uniform_grid(t)


@pytest.mark.parametrize("spec", [{"file": ["a"], "columns": "q1"}, {"file": {}, "columns": "q1"}])
def test_files_that_are_no_names(tmp_path, spec):
    path = written(tmp_path, "log.csv", LOG)
    with pytest.raises(PividentError, match="the file of q is named"):
        load_recording(path, {"t": "time", "q": spec, "tau": ["tau1", "tau2"]})


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, "3", "null", "[]", '{"layout": 1}', '{"layout": 1, "hash": 3}', "{", "\x00",
     '{"layout": 1, "programs": 3}', '{"scenario": []}'],
)  # fmt: skip
def test_manifests_that_are_none(tmp_path, text):
    from pivident.studies.many.batch.batch_errors import StudyFolderError
    from pivident.studies.many.study.run import MANIFEST, Store

    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(StudyFolderError, match=r"manifest\.json"):
        with Store(tmp_path).opened(read_scenario(STUDY, "s"), 6):
            pass
    assert (tmp_path / MANIFEST).read_text() == text


def test_a_broken_trajectory_is_named(tmp_path):
    from pivident.studies.many.batch.batch_errors import StudyFolderError
    from pivident.studies.many.study.scenario_tables import FILE, optimised_series

    scenario = read_scenario(f'{STUDY}[trajectory]\ntype = "fourier"\n', "s")
    for text in ("{", "[" * 100_000, "[]", "{}", '{"belongs_to": 1'):
        (tmp_path / FILE).write_text(text)
        with pytest.raises(StudyFolderError, match="delete it to recompute it"):
            optimised_series(scenario, tmp_path)
