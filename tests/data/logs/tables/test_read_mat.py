import struct

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from pivident.data.logs import source_files as files
from pivident.data.logs.tables.read_mat import mat_names, mat_unread, read_mat
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.foundation.errors import FileFormatError

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def save_v5(path, variables):
    scipy.io.savemat(path, variables, do_compression=True)


def save_v73(path, variables):
    """As MATLAB does: 512 bytes of its own, columns first, the class as an attribute."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in variables.items():
            dataset = file.create_dataset(name, data=np.atleast_2d(values).T)
            kind = "double" if values.dtype == float else str(values.dtype)
            dataset.attrs["MATLAB_class"] = np.bytes_(kind)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


BOTH = pytest.mark.parametrize("save", [save_v5, save_v73])


@BOTH
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25)
@given(arrays(float, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=FINITE))
def test_variables_come_back_in_their_matlab_shape(tmp_path, save, values):
    save(tmp_path / "log.mat", {"q": values, "other": np.zeros((2, 2))})
    table = read_mat(tmp_path / "log.mat", ["q"])
    assert list(table) == ["q"]
    np.testing.assert_array_equal(table["q"], values)


@BOTH
def test_integers_and_all_names_are_found(tmp_path, save):
    save(tmp_path / "log.mat", {"pulses": np.array([[0], [5]], np.uint8), "kp": np.ones((1, 1))})
    assert set(names_in(tmp_path / "log.mat")) == {"pulses", "kp"}
    assert read_table(tmp_path / "log.mat")["pulses"].ravel().tolist() == [0, 5]


KINDS = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"]


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("shape", [(1, 1), (7, 1), (1, 3), (4, 5), (2, 3, 4), (0, 3)])
def test_arrays_of_all_kinds_are_those_that_scipy_reads(tmp_path, packed, shape):
    rng = np.random.default_rng(len(shape))
    written = {f"a_{k}": (200 * rng.random(shape)).astype(k) for k in KINDS}
    written["a_name_of_more_than_eight_letters"] = np.arange(3.0)
    scipy.io.savemat(tmp_path / "log.mat", written, do_compression=packed)
    expected = scipy.io.loadmat(tmp_path / "log.mat")
    found = read_mat(tmp_path / "log.mat")
    assert set(found) == set(written)
    for name, values in found.items():
        assert values.shape == expected[name].shape
        np.testing.assert_array_equal(values, expected[name])


def element(kind, content, order=">"):
    size = -(-len(content) // 8) * 8
    return struct.pack(order + "II", kind, len(content)) + content.ljust(size, b"\0")


def test_whole_numbers_that_stand_for_doubles_in_the_other_order_of_bytes(tmp_path):
    """As MATLAB writes doubles that are small whole numbers, on a machine of the other kind."""

    matrix = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 2, 3))
    matrix += element(1, b"counts") + element(3, struct.pack(">6h", 1, 2, 300, -4, 5, 6))
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(">H", 0x0100) + b"MI"
    (tmp_path / "log.mat").write_bytes(header + element(14, matrix))
    found = read_mat(tmp_path / "log.mat")["counts"]
    np.testing.assert_array_equal(found, [[1, 300, 5], [2, -4, 6]])
    np.testing.assert_array_equal(found, scipy.io.loadmat(tmp_path / "log.mat")["counts"])


def test_files_of_version_4_are_told_apart(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"q": np.ones((30, 1))}, format="4")
    with pytest.raises(FileFormatError, match="save it with -v7"):
        read_mat(tmp_path / "log.mat")


def test_text_and_cells_are_not_offered_but_named(tmp_path):
    content = {"q": np.ones((3, 1)), "note": "fast", "c": np.array(["x"], object)}
    scipy.io.savemat(tmp_path / "log.mat", content)
    assert mat_names(tmp_path / "log.mat") == ("q",)
    assert mat_unread(tmp_path / "log.mat") == {"note": "text", "c": "a cell array"}


@pytest.mark.parametrize("packed", [False, True])
def test_fields_of_structures_are_variables(tmp_path, packed):
    """As Simulink saves a scope, and as one structure for each axis."""
    rng = np.random.default_rng(7)
    q, counts = rng.normal(size=(40, 2)), rng.integers(-9, 9, (3, 40)).astype(np.int16)
    axes = np.array([(rng.normal(size=(40, 1)),) for _ in range(2)], [("tau", object)])
    content = {
        "scope": {"time": np.arange(40.0), "signals": {"values": q, "label": "q", "none": []}},
        "drive": {"counts": counts}, "axis": axes, "kp": 3.0,
    }  # fmt: skip
    scipy.io.savemat(tmp_path / "log.mat", content, do_compression=packed)
    table = read_mat(tmp_path / "log.mat")
    truth = {
        "scope.time": np.arange(40.0)[None], "scope.signals.values": q, "drive.counts": counts,
        "axis(1).tau": axes[0]["tau"], "axis(2).tau": axes[1]["tau"], "kp": np.array([[3.0]]),
    }  # fmt: skip
    assert {n for n, v in table.items() if v.size} == set(truth)
    for name, values in truth.items():
        np.testing.assert_array_equal(table[name], values, err_msg=name)
    assert mat_unread(tmp_path / "log.mat") == {"scope.signals.label": "text"}


def test_objects_beside_numbers_are_named(tmp_path):
    """An object of a class such as timetable has no size, but two more names."""
    scipy.io.savemat(tmp_path / "log.mat", {"q": np.ones((30, 2)), "t": np.arange(30.0)})
    names = [element(1, name, "<") for name in (b"robot", b"MCOS", b"SerialLink")]
    inside = element(6, struct.pack("<II", 17, 0), "<") + b"".join(names)
    inside += element(14, element(6, struct.pack("<II", 13, 0), "<") + b"\0" * 24, "<")
    with (tmp_path / "log.mat").open("ab") as stream:
        stream.write(element(14, inside, "<"))
    assert mat_unread(tmp_path / "log.mat") == {"robot": "an object of class SerialLink"}
    assert read_mat(tmp_path / "log.mat")["q"].shape == (30, 2)


def test_structures_inside_each_other_without_end_are_named(tmp_path):
    deep = {"q": np.ones(30)}
    for _ in range(9):
        deep = {"s": deep}
    scipy.io.savemat(tmp_path / "log.mat", {"t": np.arange(30.0), "deep": deep})
    assert mat_names(tmp_path / "log.mat") == ("t",)
    assert "too many structures" in mat_unread(tmp_path / "log.mat")["deep" + 8 * ".s"]


def test_complex_variables_are_passed_over_and_refused_by_name(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"q": np.ones((3, 1)) * 1j, "t": np.arange(3.0)})
    assert set(read_mat(tmp_path / "log.mat")) == {"t"}
    with pytest.raises(FileFormatError, match="complex"):
        read_mat(tmp_path / "log.mat", ["q"])


def test_text_groups_and_empty_variables_of_version_73_are_not_offered(tmp_path):
    with h5py.File(tmp_path / "log.mat", "w") as file:
        file["q"] = np.ones((1, 3))
        file["note"] = np.array([[102, 97]], np.uint16)
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
        file["nothing"] = np.array([0, 0], np.uint64)
        file["nothing"].attrs["MATLAB_empty"] = np.uint8(1)
        file["s/x/tau"] = np.arange(6.0).reshape(2, 3)
        file["s/robot"] = np.array([1, 2], np.uint32)
        file["s/robot"].attrs["MATLAB_class"] = np.bytes_("SerialLink")
        file["s/again"] = file["s"]
        file["#refs#/a"] = np.ones((1, 3))
    table = read_mat(tmp_path / "log.mat")
    assert set(table) == {"q", "s.x.tau"}
    np.testing.assert_array_equal(table["s.x.tau"], [[0, 3], [1, 4], [2, 5]])
    why = mat_unread(tmp_path / "log.mat")
    assert why["s.robot"] == "of class SerialLink" and why["nothing"] == "empty"
    assert set(why) == {"note", "nothing", "s.robot"}


def test_numbers_kept_in_another_file_are_refused(tmp_path):
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["q"] = np.ones((1, 30))
    (tmp_path / "raw.bin").write_bytes(np.ones(30).tobytes())
    with h5py.File(tmp_path / "log.mat", "w") as file:
        file["linked"] = h5py.ExternalLink("secret.h5", "/q")
        file.create_dataset("raw", (1, 30), float, external=[(tmp_path / "raw.bin", 0, 240)])
        layout = h5py.VirtualLayout((1, 30), float)
        layout[:] = h5py.VirtualSource(tmp_path / "secret.h5", "q", (1, 30))
        file.create_virtual_dataset("virtual", layout)
    assert "linked" not in mat_names(tmp_path / "log.mat")
    for name in ("raw", "virtual"):
        with pytest.raises(FileFormatError, match="in another file"):
            read_mat(tmp_path / "log.mat", [name])


def test_what_is_no_matlab_file_is_refused(tmp_path):
    path = tmp_path / "log.mat"
    for content in (b"", b"hello world", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" * 3):
        path.write_bytes(content)
        with pytest.raises(FileFormatError):
            read_mat(path, ["q"])


@BOTH
def test_a_file_cut_short_is_refused(tmp_path, save):
    path = tmp_path / "log.mat"
    save(path, {"q": np.random.default_rng(0).standard_normal((2000, 2))})
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FileFormatError, match=r"log\.mat"):
        read_mat(path, ["q"])


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "HARMLESS_SIZE", 2**20)
    save_v5(tmp_path / "log.mat", {"q": np.zeros((2**19, 1))})
    with pytest.raises(FileFormatError, match="200 times"):
        read_mat(tmp_path / "log.mat", ["q"])
