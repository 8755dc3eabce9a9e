"""Files of one run side by side: an array each, tables without headers, samples along any axis."""

import numpy as np
import pytest
import scipy.io

from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.assumption import DraftError
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.errors import FileFormatError
from tests.planar_log import planar_log

TABLE = planar_log()
TIME, Q, REFERENCE, TAU = (
    TABLE[:, 0],
    *(np.radians(TABLE[:, k : k + 2]) for k in (1, 3)),
    TABLE[:, 5:],
)


def read_back(files, path, **options):
    """The recording that the first experiment file of some logs reads."""
    draft = draft_experiment(files, "planar_2r", out=path, **options)
    assert not draft.troubles
    path.write_text(draft.text)
    (recording,) = load_experiment(path).recordings()
    return recording


def assert_is_the_log(recording, reference=False):
    np.testing.assert_allclose(recording.q, Q, atol=1e-8)
    np.testing.assert_allclose(recording.tau, TAU, rtol=1e-7)
    assert recording.rate == pytest.approx(1000.0, rel=1e-6)
    if reference:
        np.testing.assert_allclose(recording.q_ref, REFERENCE, atol=1e-8)


@pytest.mark.parametrize("save", [np.savez, lambda path, **arrays: scipy.io.savemat(path, arrays)])
@pytest.mark.parametrize("turned", ["", "q", "q q_ref", "q q_ref tau"])
def test_samples_run_along_any_axis(tmp_path, save, turned):
    arrays = {"q": Q, "q_ref": REFERENCE, "tau": TAU}
    arrays = {n: x.T if n in turned.split() else x for n, x in arrays.items()}
    log = tmp_path / ("log.npz" if save is np.savez else "log.mat")
    save(log, t=TIME, gains=np.ones((2, 2)), plan=np.zeros((2, 60)), **arrays)
    assert_is_the_log(read_back([log], tmp_path / "experiment.toml"), reference=True)


def test_arrays_of_other_lengths_and_square_ones_are_named(tmp_path):
    rng = np.random.default_rng(0)
    square, long = rng.normal(size=(300, 300)), rng.normal(size=(2, 90_000))
    np.savez(
        tmp_path / "log.npz", t=TIME[:300], q=Q[:300].T, tau=TAU[:300], long=long, square=square
    )
    draft = draft_experiment([tmp_path / "log.npz"], "planar_2r", out=tmp_path / "e.toml")
    (line,) = [a for a in draft.assumptions if a.key == "files"]
    assert "long: other samples (2 × 90000, the log has 300)" in line.seen
    assert "square: square (300 × 300), its first axis" in line.seen


@pytest.mark.parametrize("names", [("t", "q", "tau"), ("time", "pos", "effort")])
def test_arrays_of_a_file_each_are_one_run(tmp_path, names):
    """As saved one by one: t.mat, q.mat, tau.mat; or all under one name."""
    arrays = dict(zip(names, (TIME, Q.T, TAU), strict=True))
    files = [tmp_path / f"{name}.mat" for name in names]
    for file, (name, values) in zip(files, arrays.items(), strict=True):
        scipy.io.savemat(file, {name if names[0] == "t" else "data": values})
    assert_is_the_log(read_back(files, tmp_path / "experiment.toml"))


def bare(folder, **arrays):
    """Tables without headers."""
    for name, values in arrays.items():
        np.savetxt(folder / f"{name}.csv", values, fmt="%.9g", delimiter=",")
    return [folder / f"{name}.csv" for name in arrays]


def test_names_of_files_stand_for_headers(tmp_path):
    files = bare(tmp_path, t=TIME, q=Q, tau=TAU)
    assert_is_the_log(read_back(files, tmp_path / "experiment.toml"))


def test_columns_of_several_files_are_named_file_after_file(tmp_path):
    files = bare(tmp_path, a=TIME, b=Q, c=TAU)
    with pytest.raises(DraftError, match=r"a.csv, b.csv, c.csv have no headers.*file after file"):
        draft_experiment(files, "planar_2r", out=tmp_path / "experiment.toml")
    with pytest.raises(DraftError, match=r"3 columns are named.*\(a.csv 1, b.csv 2, c.csv 2\)"):
        read_back(files, tmp_path / "experiment.toml", column_names=["t", "q1..q2"])
    named = ["t", "q1..q2", "tau1..tau2"]
    assert_is_the_log(read_back(files, tmp_path / "experiment.toml", column_names=named))
    assert_is_the_log(read_back(files[1:], tmp_path / "e.toml", column_names=named[1:]))


def test_a_folder_names_the_logs_in_it(tmp_path):
    (tmp_path / "record" / "data" / "chunk-000").mkdir(parents=True)
    for k in range(5):
        (tmp_path / "record" / "data" / "chunk-000" / f"episode_{k}.parquet").touch()
    with pytest.raises(FileFormatError, match=r"episode_2.parquet …\).*chunk-000/\*.parquet"):
        draft_experiment([tmp_path / "record"], "planar_2r", out=tmp_path / "experiment.toml")
