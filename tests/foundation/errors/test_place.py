"""An error knows the keys whose value it is about, whatever its message says."""

import pickle

import pytest

from pivident.foundation.errors import (
    ExperimentError,
    FileFormatError,
    PositionsBeyondLimits,
    RecordingError,
    UnknownColumn,
    concerning,
)


def test_the_innermost_place_counts():
    with pytest.raises(RecordingError) as found, concerning("columns", "t"), concerning("rate"):
        raise RecordingError("columns of q are wrong")
    assert found.value.place == ("rate",)
    with pytest.raises(RecordingError) as found, concerning("columns", "t"):
        raise RecordingError("the rate is wrong").about("part")
    assert found.value.place == ("part",)


def test_an_error_that_nobody_placed_is_about_the_table():
    assert RecordingError("columns of q are wrong").place == ()


def test_a_file_that_cannot_be_read_is_about_the_files_and_a_column_about_its_channel():
    for error, place in (
        (FileFormatError("log.csv is empty"), ("files",)),
        (UnknownColumn("log.csv", "q1", [], ["a"]), ("columns", "q")),
    ):
        with pytest.raises(FileFormatError) as found, concerning("columns", "q"):
            raise error
        assert found.value.place == place


def test_an_error_of_a_channel_is_about_its_columns():
    error = PositionsBeyondLimits("q_ref", "elbow", 100.0, (-1.0, 1.0), "rad", "", "check it")
    assert error.place == ("columns", "q_ref")


def test_what_stands_in_front_of_a_message_leaves_sentence_and_place_alone():
    inner = ExperimentError("[controller] 3: it has no p", advice="its keys are q").about("p")
    error = inner.within("identify.piv").headed("arm.toml:")
    assert str(error) == f"arm.toml: [identify.piv] {inner}"
    assert error.sentence == str(inner)
    assert (error.table, error.place) == (("identify", "piv"), ("p",))


def test_a_place_survives_another_process():
    error = ExperimentError("it has no p").within("identify", "p").headed("arm.toml:")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.sentence) == (str(error), "it has no p")
    assert (again.table, again.place) == (("identify",), ("p",))
