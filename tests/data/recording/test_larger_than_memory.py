"""Logs of every kind that are read part by part, or mapped, are what they are when read whole."""

import numpy as np
import polars as pl
import pytest

from pivident.data.logs.tables import read_npz, read_parquet
from pivident.data.logs.tables.tables import read_table
from pivident.data.recording.load import load_recording
from pivident.foundation.errors import BadCell, FileFormatError

SAMPLES = 5000


@pytest.fixture
def signals():
    rng = np.random.default_rng(5)
    return np.cumsum(rng.standard_normal((2, SAMPLES, 2)), axis=1)


@pytest.fixture
def in_parts(monkeypatch, tmp_path):
    """Every array of more than a kilobyte lies in a file, and parts are small."""
    monkeypatch.setenv("PIVIDENT_SCRATCH_ABOVE", "1000")
    monkeypatch.setenv("PIVIDENT_SCRATCH", str(tmp_path))
    monkeypatch.setattr(read_npz, "PART", 3000)
    monkeypatch.setattr(read_parquet, "ROWS", 700)


def written(kind, signals, folder):
    """The same log as a file of some kind, and where its channels are."""
    q, tau = signals
    path = folder / f"log.{kind}"
    if kind == "parquet":
        names = ("q1", "q2", "tau1", "tau2")
        pl.DataFrame(dict(zip(names, np.hstack([q, tau]).T, strict=True))).write_parquet(
            path, row_group_size=500
        )
        return path, {"q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
    if kind == "npy":
        np.save(path, np.hstack([q, tau]))
        return path, {"q": "data[:, 0:2]", "tau": "data[:, 2:4]"}
    save = np.savez_compressed if kind == "compressed.npz" else np.savez
    save(path, q=q, tau=np.asfortranarray(tau))
    return path, {"q": "q", "tau": "tau"}


@pytest.mark.parametrize("kind", ["parquet", "npy", "npz", "compressed.npz"])
def test_a_log_in_parts_is_the_log(kind, signals, in_parts, tmp_path):
    path, columns = written(kind, signals, tmp_path)
    log = load_recording(path, columns, rate=1000.0, units={"q": "deg"})
    np.testing.assert_allclose(log.q, np.deg2rad(signals[0]), rtol=1e-15)
    np.testing.assert_array_equal(log.tau, signals[1])
    assert log.q.base is not None


def test_an_empty_cell_far_down_is_named_by_its_row(in_parts, tmp_path):
    values = [0.5] * 2000
    values[1723] = None
    path = tmp_path / "log.parquet"
    pl.DataFrame({"q": values}).write_parquet(path)
    with pytest.raises(BadCell, match="1724"):
        read_table(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x93NUMPY\x01\x00\x08\x00notadict", "damaged"),
        (b"PK\x03\x04", "damaged"),
    ],
)
def test_damaged_arrays_are_named(content, message, tmp_path):
    path = tmp_path / "log.npy"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        read_table(path)


def test_a_short_array_is_named(signals, tmp_path):
    path, _ = written("npy", signals, tmp_path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(FileFormatError, match=r"log\.npy"):
        read_table(path)


def test_pickled_objects_are_refused(tmp_path):
    path = tmp_path / "log.npy"
    np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(FileFormatError, match="pickled"):
        read_table(path)
