"""Logs as arrays to begin with: NumPy, MATLAB, HDF5 and Parquet."""

from __future__ import annotations

import io
import struct
from datetime import date

import numpy as np

from fuzzing.table_inputs import log_table


def arrays() -> dict[str, np.ndarray]:
    """What a log in arrays may hold."""
    table = log_table()
    return {
        "t": table[:, 0], "q": table[:, 1:3], "tau": table[:, 5:7].T.copy(), "n": np.arange(9),
        "flag": np.array([True, False]), "single": np.float32(table[:5]), "empty": np.zeros((0, 2)),
    }  # fmt: skip


def npz_seeds() -> tuple[bytes, ...]:
    packed, plain, odd = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez_compressed(packed, **arrays())
    np.savez(plain, **arrays())
    strange = {"o": np.array([{}], dtype=object), "s": np.array(["a"]), "z": np.array([1j])}
    np.savez(odd, allow_pickle=True, **strange, x=np.arange(3.0))
    return packed.getvalue(), plain.getvalue(), odd.getvalue()


def npy_seeds() -> tuple[bytes, ...]:
    made = []
    for array in (*arrays().values(), np.asfortranarray(log_table()), log_table().astype("i2")):
        stream = io.BytesIO()
        np.save(stream, array)
        made.append(stream.getvalue())
    return tuple(made)


def mat_seeds() -> tuple[bytes, ...]:
    from scipy.io import savemat

    made = []
    for options in ({}, {"do_compression": True}):
        stream = io.BytesIO()
        content = {
            name: np.atleast_2d(np.asarray(v, float)) for name, v in arrays().items() if v.size
        }
        content |= {"text": "abc", "cell": np.array([1, "a"], dtype=object), "st": {"a": 1.0}}
        content |= {"c": np.array([[1j]]), "u": np.uint8([[1, 2]]), "l": np.array([[True]])}
        savemat(stream, content, **options)
        made.append(stream.getvalue())
        made.append(_structures(options))
    return tuple(made)


def _structures(options: dict[str, bool]) -> bytes:
    """Structures inside each other, an array of them, and an object of a newer class."""
    from scipy.io import savemat

    stream, t = io.BytesIO(), np.arange(9.0)
    axes = np.array([(t,), (2 * t,)], [("tau", object)])
    inner = {"values": np.ones((9, 2)), "label": "q", "none": [], "deep": {"x": {"y": t}}}
    savemat(stream, {"out": {"time": t, "signals": inner}, "axis": axes, "t": t}, **options)
    parts = [(6, struct.pack("<II", 17, 0)), *((1, x) for x in (b"robot", b"MCOS", b"table"))]
    inside = b"".join(struct.pack("<II", k, len(x)) + x.ljust(8, b"\0") for k, x in parts)
    return stream.getvalue() + struct.pack("<II", 14, len(inside)) + inside


def hdf5_seeds() -> tuple[bytes, ...]:
    import h5py

    made = []
    for options in ({}, {"compression": "gzip", "chunks": True}):
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=512) as file:
            for name, values in arrays().items():
                own = options if values.size and values.ndim else {}
                file.create_dataset(name, data=values, **own).attrs["MATLAB_class"] = np.bytes_(
                    "double"
                )
            file.create_group("#refs#")
            file["s/x/tau"] = np.arange(6.0).reshape(2, 3)
            file["s/again"] = file["s"]
            file["text"] = "abc"
            file["soft"] = h5py.SoftLink("/q")
        made.append(stream.getvalue())
    return tuple(made)


def parquet_seeds() -> tuple[bytes, ...]:
    import polars as pl

    made = []
    table = {f"c{k}": column for k, column in enumerate(log_table().T)}
    odd = {
        "i": [1, 2, None],
        "s": ["a", "b", "c"],
        "l": [[1.0], [], [2.0]],
        "b": [True, False, None],
        "u": [1.5, 2.5, 3.5],
    }
    nested = {"n": [{"a": {"b": [1]}}], "d": [date(2020, 1, 1)], "f": [1.0]}
    for content, packing in (
        (table, "zstd"),
        (table, "uncompressed"),
        (table, "snappy"),
        (odd, "zstd"),
        (nested, "gzip"),
    ):
        stream = io.BytesIO()
        pl.DataFrame(content).write_parquet(stream, compression=packing)
        made.append(stream.getvalue())
    return (*made, _lists("zstd"), _lists("none"))


def _lists(packing: str) -> bytes:
    """Lists of fixed and of variable length, with and without empty ones, and structures."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    stream, q = io.BytesIO(), log_table()[:, 1:3]
    table = {
        "t": log_table()[:, 0],
        "q": pa.FixedSizeListArray.from_arrays(pa.array(q.ravel(), pa.float32()), 2),
        "tau": pa.array(q.tolist(), pa.large_list(pa.float64())),
        "ragged": pa.array([[1.0] * (k % 3) for k in range(len(q))]),
        "gone": pa.array([[1.0, None] if k % 7 else None for k in range(len(q))]),
        "motor": pa.array([{"speed": float(k), "on": {"mode": k}} for k in range(len(q))]),
    }
    pq.write_table(pa.table(table), stream, compression=packing, row_group_size=25)
    return stream.getvalue()
