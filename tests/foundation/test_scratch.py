"""Working arrays in files: the same results, nothing left behind, and a full folder says so."""

import dataclasses
import pickle

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.foundation.errors import PividentError
from pivident.foundation.scratch import Blocks, working_array


def test_small_arrays_are_plain_memory():
    array = working_array((3, 4))
    assert array.shape == (3, 4) and array.base is None


def test_large_ones_lie_in_a_file_without_a_name(tmp_path, monkeypatch):
    monkeypatch.setenv("PIVIDENT_SCRATCH_ABOVE", "1000")
    monkeypatch.setenv("PIVIDENT_SCRATCH", str(tmp_path))
    array = working_array((2, 5000))
    array[:] = np.arange(10000.0).reshape(2, 5000)
    assert array.flags.writeable and array.flags.c_contiguous and array.base is not None
    assert array.sum() == 49995000.0
    assert not list(tmp_path.iterdir())


def test_identification_does_not_depend_on_where_its_arrays_lie(tmp_path, monkeypatch):
    problem, _ = tx40_fine(0, 8000)
    plain = identify(problem, "piv")
    monkeypatch.setenv("PIVIDENT_SCRATCH_ABOVE", "100000")
    monkeypatch.setenv("PIVIDENT_SCRATCH", str(tmp_path))
    filed = identify(dataclasses.replace(problem), "piv")
    np.testing.assert_array_equal(filed.theta, plain.theta)
    np.testing.assert_array_equal(filed.covariance, plain.covariance)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("PIVIDENT_SCRATCH_ABOVE", "2 GB", "give a number of bytes"),
        ("PIVIDENT_SCRATCH", "/no/such/folder", "name a folder with more in PIVIDENT_SCRATCH"),
    ],
)
def test_what_cannot_be_used_is_named(monkeypatch, name, value, message):
    monkeypatch.setenv("PIVIDENT_SCRATCH_ABOVE", "1000")
    monkeypatch.setenv(name, value)
    with pytest.raises(PividentError, match=message):
        working_array((1000,))


def test_a_full_folder_is_an_error_and_no_signal(monkeypatch):
    monkeypatch.setenv("PIVIDENT_SCRATCH_ABOVE", "1000")
    with pytest.raises(PividentError, match="no room for"):
        working_array((2**50,))


def blocks_of(limit: int) -> tuple[Blocks, list[np.ndarray]]:
    arrays = [np.random.default_rng(k).normal(size=(2, 3, k)) for k in (5, 0, 7, 2)]
    kept = Blocks(limit)
    for own in arrays:
        kept.append(own)
    return kept, arrays


@pytest.mark.parametrize("limit", [0, 300, 10**6])
def test_blocks_are_what_was_appended(tmp_path, monkeypatch, limit):
    monkeypatch.setenv("PIVIDENT_SCRATCH", str(tmp_path))
    kept, arrays = blocks_of(limit)
    assert len(kept) == 4 and not list(tmp_path.iterdir())
    for own in (kept, pickle.loads(pickle.dumps(kept))):
        for k, array in enumerate(arrays):
            np.testing.assert_array_equal(own.read(k), array)
            np.testing.assert_array_equal(own.read(k, (1, 2)), array[1, 2])


def test_blocks_say_where_there_is_no_room(monkeypatch):
    monkeypatch.setenv("PIVIDENT_SCRATCH", "/no/such/folder")
    with pytest.raises(PividentError, match="name a folder with more in PIVIDENT_SCRATCH"):
        blocks_of(0)
