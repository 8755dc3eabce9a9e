"""Names for the columns of a table without a header."""

import numpy as np
import pytest

from pivident.data.logs.tables.tables import named_columns, written_out
from pivident.experiment.check.audit_file import audit_file
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.assumption import DraftError
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.errors import (
    ExperimentError,
    FileFormatError,
    RecordingError,
    UnknownColumn,
)
from tests.planar_log import EXPERIMENT, planar_log, write_log

NAMES = ["time", "q1..q2", "r1..r2", "tau1..tau2"]


@pytest.fixture
def bare(tmp_path):
    """The planar log without its header."""
    path = tmp_path / "log.csv"
    np.savetxt(path, planar_log(), fmt="%.9g", delimiter=",")
    return path


def experiment(folder, names) -> str:
    path = folder / "experiment.toml"
    text = EXPERIMENT.replace('files = "log.csv"', f'files = "log.csv"\ncolumn_names = {names}')
    path.write_text(text, encoding="utf-8")
    return path


def test_ranges_are_written_out():
    assert written_out(["t", "q_1..q_3", "a[0]", "x8..11"]) == [
        *("t", "q_1", "q_2", "q_3", "a[0]", "x8", "x9", "x10", "x11")
    ]
    for wrong in ("q3..q1", "q1..r3", "q1..q99999", f"q1..q{'9' * 5000}"):
        with pytest.raises(RecordingError, match="no range of columns"):
            written_out([wrong])


def test_names_stand_for_columns_in_their_order(bare):
    named = named_columns(bare, ["time", "q1..q2", "-", "-", "tau1..tau2"])
    assert named["time"] == "column_1" and named["tau2"] == "column_7"
    assert named["column_4"] == "column_4", "what nobody needs keeps its number"


@pytest.mark.parametrize(
    ("names", "said"),
    [(["t", "q1"], "has 7 columns, but 2 are named"), (["q1"] * 7, "'q1' is given twice")],
)
def test_names_that_do_not_fit(bare, names, said):
    with pytest.raises(RecordingError, match=said):
        named_columns(bare, names)


def test_a_table_with_a_header_has_names(tmp_path):
    path = write_log(tmp_path / "log.csv")
    with pytest.raises(RecordingError, match=r"names its columns itself \(time, q1"):
        named_columns(path, NAMES)


def test_an_experiment_reads_the_same_as_with_a_header(bare, tmp_path):
    found = load_experiment(experiment(tmp_path, NAMES)).recordings()[0]
    headed = tmp_path / "headed"
    headed.mkdir()
    write_log(headed / "log.csv")
    (headed / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    same = load_experiment(headed / "experiment.toml").recordings()[0]
    for channel, values in same.channels().items():
        assert np.array_equal(found.channels()[channel], values)
    assert found.rate == same.rate
    assert not [r for r in check_experiment(tmp_path / "experiment.toml").remarks if r.refused]


def test_a_column_that_nobody_named_is_answered_with_near_ones(bare, tmp_path):
    names = ["time", "p1..p2", "r1..r2", "tau1..tau2"]
    with pytest.raises(UnknownColumn, match="'q1'; it has 'time', 'p1', 'p2'"):
        load_experiment(experiment(tmp_path, names)).recordings()
    (remark,) = [r for r in check_experiment(tmp_path / "experiment.toml").remarks if r.refused]
    assert remark.place == ("recording", 0, "columns", "q")


def test_names_of_several_files_are_refused(bare, tmp_path):
    path = experiment(tmp_path, NAMES)
    text = path.read_text().replace('files = "log.csv"', 'files = {q = "log.csv", tau = "log.csv"}')
    path.write_text(text)
    with pytest.raises(ExperimentError, match="column_names are those of one file"):
        load_experiment(path)


def test_init_and_audit_say_what_to_do_and_do_it(bare, tmp_path):
    with pytest.raises(DraftError, match=r"has no header.*--columns t,q1"):
        draft_experiment([bare], "planar_2r")
    with pytest.raises(FileFormatError, match=r"has no header.*--columns t,q1"):
        audit_file(bare)
    draft = draft_experiment(
        [bare], "planar_2r", column_names=NAMES, out=tmp_path / "experiment.toml"
    )
    assert 'column_names = ["time", "q1..q2", "r1..r2", "tau1..tau2"]' in draft.text
    (tmp_path / "experiment.toml").write_text(draft.text, encoding="utf-8")
    assert load_experiment(tmp_path / "experiment.toml").recordings()[0].q_ref is not None
    (audit,) = audit_file(bare, column_names=NAMES)
    assert set(audit.log.channels) == {"q", "q_ref", "tau"}
    with pytest.raises(RecordingError, match="leave --columns out"):
        audit_file(tmp_path / "experiment.toml", column_names=NAMES)
