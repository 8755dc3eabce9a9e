"""Logs are predicted between their gaps, and without what is no measurement."""

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.studies.prediction.new_logs import new_logs, stored_result
from tests.planar_log import HEADER, planar_log, write_experiment


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A result of the right log."""
    folder = tmp_path_factory.mktemp("arm")
    experiment = write_experiment(folder)
    assert main(["identify", str(experiment), "--folds", "0", "--out", str(folder / "r")]) == 0
    return folder / "r"


def written(folder, table):
    path = folder / "new.csv"
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=HEADER, comments="")
    return path


def test_stretches_between_gaps_are_predicted(results, tmp_path, capsys):
    path = written(tmp_path, np.delete(planar_log(), np.s_[3000:3600], axis=0))
    first, second = new_logs(path, stored_result(results))
    assert (first.recording.samples, second.recording.samples) == (2999, 4399)
    assert "are used, in 2 stretch(es)" in first.note
    assert main(["predict", str(results), str(path)]) == 0
    assert capsys.readouterr().out.count("Torques of") == 2


def test_a_lost_torque_is_no_error_of_the_prediction(results, tmp_path):
    table = planar_log().copy()
    right = stored_result(results)
    (clean,) = new_logs(written(tmp_path, table), right)
    table[3000:4500, 6] = np.nan
    (holed,) = new_logs(written(tmp_path, table), right)
    wanted, made = (right.predict(new.recording) for new in (clean, holed))
    np.testing.assert_allclose(made.error.errors.rms, wanted.error.errors.rms, rtol=0.2)
    assert np.isnan(made.tau[:, 1]).sum() >= 1500 and np.isfinite(made.tau[:, 0]).all()
    assert "left out of the equations of elbow" in holed.note
