"""Recordings from tables in memory: frames of pandas and polars, and dictionaries of arrays."""

from collections import UserDict

import numpy as np
import pandas as pd
import polars as pl
import pytest

from pivident.data.recording.load import load_recording
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import RecordingError, UnknownColumn
from pivident.robot.gallery import load_robot

T = np.arange(2000) / 500.0
Q = np.column_stack([np.sin(5 * T), np.cos(3 * T)])
TAU = np.column_stack([np.cos(5 * T), np.sin(2 * T)])
TABLE = {
    "time": 10.0 + T, "q1": np.rad2deg(Q[:, 0]), "q2": np.rad2deg(Q[:, 1]),
    "i1": TAU[:, 0] / 2.0, "i2": TAU[:, 1] / 3.0, "mode": ["auto"] * len(T),
}  # fmt: skip
COLUMNS = {"t": "time", "q": ["q1", "q2"], "tau": ["i1", "i2"]}
UNITS = {"q": "deg", "tau": [{"unit": "A", "gain": 2.0}, {"unit": "A", "gain": 3.0}]}


class Bare(UserDict):
    """No frame of any library: columns by name, and their names."""

    @property
    def columns(self):
        return list(self.data)


@pytest.mark.parametrize("frame", [dict, pd.DataFrame, pl.DataFrame, Bare])
def test_columns_by_name_with_units(frame):
    made = load_recording(frame(TABLE), COLUMNS, units=UNITS, robot=load_robot("planar_2r"))
    assert made.joint_names == ("shoulder", "elbow") and made.rate == pytest.approx(500.0)
    np.testing.assert_allclose(made.q, Q, atol=1e-12)
    np.testing.assert_allclose(made.tau, TAU, atol=1e-12)
    assert made.start_time == 10.0 and made.name == "the frame"
    assert made.sources == load_recording(dict(TABLE), COLUMNS, units=UNITS).sources


def test_whole_arrays_and_a_rate():
    made = load_recording({"q": Q, "tau": TAU}, {"q": "q", "tau": "tau"}, rate=500.0, name="run")
    np.testing.assert_array_equal(made.q, Q)
    assert (made.name, made.rate, made.joint_names) == ("run", 500.0, ("joint_1", "joint_2"))


def test_times_of_day_are_seconds():
    stamps = pd.Timestamp("2026-03-01 12:00:00") + pd.to_timedelta(T, unit="s")
    made = load_recording(pd.DataFrame(TABLE | {"time": stamps}), COLUMNS, units=UNITS)
    assert made.start_time == 0.0 and made.rate == pytest.approx(500.0)


def test_what_no_frame_can_give_is_refused():
    with pytest.raises(
        UnknownColumn, match="the frame has no column or array 'qq2'; did you mean q2"
    ):
        load_recording(TABLE, COLUMNS | {"q": ["q1", "qq2"]}, units=UNITS)
    with pytest.raises(RecordingError, match="column 'mode' of the frame holds no numbers"):
        load_recording(TABLE, COLUMNS | {"tau": ["i1", "mode"]}, units=UNITS)
    with pytest.raises(RecordingError, match="NaN"):
        load_recording(TABLE | {"q1": np.full(len(T), np.nan)}, COLUMNS, units=UNITS)


def test_a_part_in_samples_or_seconds():
    made = Recording.from_arrays(Q, TAU, 500.0, start_time=10.0)
    for part in (
        made.part(500, 1000),
        made.part(samples=(500, 1000)),
        made.part(seconds=(11.0, 12.0)),
        made.part(500).part(stop=500),
    ):
        np.testing.assert_array_equal(part.q, Q[500:1000])
        assert part.start_time == 11.0
    with pytest.raises(RecordingError, match=r"no whole numbers; give part\(seconds=\(1.5, 20"):
        made.part(11.0, 12.0)


def test_keywords_of_arrays_are_named():
    made = Recording.from_arrays(Q, TAU, 500.0, q_ref=Q, dq=Q, inputs={"u": TAU}, delay=0.001)
    assert set(made.channels()) == {"q", "tau", "q_ref", "dq", "u"} and made.delay == 0.001
    with pytest.raises(TypeError, match="qref"):
        Recording.from_arrays(Q, TAU, 500.0, qref=Q)
    with pytest.raises(TypeError, match="inputs is of type int; give arrays by name"):
        Recording.from_arrays(Q, TAU, 500.0, inputs=3)
