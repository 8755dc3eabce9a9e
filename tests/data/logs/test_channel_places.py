from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.data.logs.channel_places import ChannelPlace, array_of, assemble, locate
from pivident.foundation.errors import RecordingError, UnknownColumn

TALL = np.arange(60.0).reshape(20, 3)


def channel(*columns, per_joint=None):
    return ChannelPlace("q", "log", columns, len(columns) > 1 if per_joint is None else per_joint)


def test_the_only_file_is_the_channels_file():
    assert locate("q", "qm", ["log"]) == ChannelPlace("q", "log", ("qm",), False)


def test_a_file_with_the_channels_name_is_its_file():
    assert locate("tau", ["a", "b"], ["q", "tau"]) == ChannelPlace("tau", "tau", ("a", "b"), True)


def test_a_named_file_wins():
    spec = {"file": "q", "columns": "clock"}
    assert locate("t", spec, ["q", "tau"]) == ChannelPlace("t", "q", ("clock",), False)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("clock", "is not decided"),
        ({"file": "other", "columns": "clock"}, "'other'"),
        ({"file": "q"}, "needs the keys"),
        ({"columns": "clock", "fiel": "q"}, "fiel"),
        ([], "a name or a list"),
        ([1, 2], "a name or a list"),
        (3, "a name or a list"),
        ("", "a name or a list"),
    ],
)
def test_a_description_that_decides_nothing_is_refused(spec, message):
    with pytest.raises(RecordingError, match=message):
        locate("t", spec, ["q", "tau"])


def test_a_part_names_its_array_and_a_literal_name_is_taken_as_it_is():
    assert array_of("data[:, 0:6]", ["data"], Path("x.npz")) == "data"
    assert array_of("position[0]", ["position[0]", "position"], Path("x.csv")) == "position[0]"


def test_an_unknown_column_is_answered_with_near_ones():
    with pytest.raises(UnknownColumn, match="did you mean Joint_1") as caught:
        array_of("joint_1", ["Joint_1", "time"], Path("/some/folder/log.csv"))
    assert caught.value.near == ("Joint_1",)
    assert "/some/folder" not in str(caught.value)


def test_an_unknown_column_without_near_ones_is_answered_with_what_there_is():
    with pytest.raises(UnknownColumn, match="and 3 more"):
        array_of("qm", [f"signal_{i}" for i in range(15)], Path("log.csv"))


def test_columns_are_put_side_by_side():
    table = {"a": TALL[:, 0], "b": TALL[:, 1:2], "c": TALL[:, 2:].T}
    np.testing.assert_array_equal(assemble(channel("a", "b", "c"), table, 3), TALL)


@pytest.mark.parametrize("array", [TALL, TALL.T, TALL.astype(np.uint8), TALL.T.tolist()])
@pytest.mark.parametrize("joints", [3, None])
def test_an_array_is_turned_so_that_time_is_axis_0(array, joints):
    values = assemble(channel("a"), {"a": np.asarray(array)}, joints)
    np.testing.assert_array_equal(values, TALL)
    assert values.dtype == np.float64


def test_a_vector_is_one_joint():
    for array in (TALL[:, 0], TALL[:, :1], TALL[:, :1].T):
        assert assemble(channel("a"), {"a": array}, 1).shape == (20, 1)


def test_a_square_array_needs_the_axis_of_time():
    square = np.arange(9.0).reshape(3, 3)
    with pytest.raises(RecordingError, match="both axes"):
        assemble(channel("a"), {"a": square}, 3)
    np.testing.assert_array_equal(assemble(channel("a"), {"a": square}, 3, 0), square)
    np.testing.assert_array_equal(assemble(channel("a"), {"a": square}, 3, 1), square.T)


@given(st.integers(0, 2), st.integers(1, 3), st.integers(0, 5), st.integers(8, 20))
def test_a_part_is_what_numpy_would_select(first, width, start, stop):
    last = min(first + width, 3)
    joints = last - first
    part = f"a[{start}:{stop}, {first}:{last}]"
    expected = TALL[start:stop, first:last]
    np.testing.assert_array_equal(
        assemble(channel(part, per_joint=False), {"a": TALL}, joints, 0), expected
    )


def test_single_columns_of_an_array_can_be_listed():
    spec = channel("a[:, 2]", "a[:, 0]", "b[-1, :]")
    values = assemble(spec, {"a": TALL, "b": TALL.T}, 3)
    np.testing.assert_array_equal(values, TALL[:, [2, 0, 2]])


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (("a[:, 5]", "a[:, 0]"), "does not fit"),
        (("a[0, 0, 0]", "a[:, 0]"), "does not fit"),
        (("a[1:2:3:4, 0]", "a[:, 0]"), "does not fit"),
        (("a", "a[:, 0]"), "one joint's samples"),
        (("a[:, 0]", "a[:5, 0]"), "differ in length"),
        (("a[:, 0]", "a[:, 1]", "a[:, 2]"), "3 column"),
        (("a",), "no axis"),
        (("cube",), "an array of samples and joints"),
        (("a[:, 0]",), "1 column"),
    ],
)
def test_columns_that_do_not_fit_are_refused(columns, message):
    with pytest.raises(RecordingError, match=message):
        assemble(channel(*columns), {"a": TALL, "cube": np.zeros((2, 2, 2))}, 2)


def test_code_in_brackets_is_a_name_and_nothing_else():
    with pytest.raises(UnknownColumn):
        array_of("a[__import__('os').getcwd()]", ["a"], Path("log.npz"))
