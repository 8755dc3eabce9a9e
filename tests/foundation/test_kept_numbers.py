"""Numbers of records, kept beside an experiment file: never those of another record or program."""

import json
import os
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.foundation import common_work
from pivident.foundation.common_work import MAX_KEPT, NUMBERS, kept_numbers, numbers_beside
from pivident.judgement.audit import delay
from tests.planar_log import write_experiment

RECORD = np.random.default_rng(3).normal(size=(50, 2))
FOUND = np.array([[np.pi, np.nan, -0.0], [np.inf, 5e-324, 1.0 / 3.0]])


class Search:
    """A search that counts how often it is made."""

    def __init__(self, found=FOUND):
        self.found, self.made = found, 0

    def __call__(self):
        self.made += 1
        return self.found


def searched(folder, *of, search=None, shape=FOUND.shape):
    """Whether a command beside an experiment had to search, once for each of ``of``."""
    search = search or Search()
    with numbers_beside(folder / "experiment.toml"):
        for part in of:
            found = kept_numbers(("what", part, 0.5), shape, search)
            assert found.tobytes() == search.found.tobytes()  # to the last bit
    return search.made


def test_the_next_command_takes_them_up(tmp_path):
    assert searched(tmp_path, RECORD, RECORD) == 1
    assert searched(tmp_path, RECORD) == 0
    (tmp_path / NUMBERS).unlink()
    assert searched(tmp_path, RECORD) == 1


@pytest.mark.parametrize(
    "other",
    [RECORD[:-1], RECORD.T, RECORD + 0j, np.nextafter(RECORD, 1.0), RECORD.astype("f4"), 0.5, "q"],
)
def test_whatever_a_number_depends_on_is_in_its_key(tmp_path, other):
    searched(tmp_path, RECORD)
    assert searched(tmp_path, other) == 1
    assert searched(tmp_path, RECORD, other) == 0


def test_without_a_folder_nothing_is_kept(tmp_path):
    search = Search()
    for _ in range(2):
        kept_numbers(("what", RECORD), FOUND.shape, search)
    with numbers_beside(tmp_path / "experiment.toml"):
        pass
    assert search.made == 2 and not [*tmp_path.iterdir()]


def test_another_program_searches_anew(tmp_path, monkeypatch):
    searched(tmp_path, RECORD)
    monkeypatch.setattr(common_work, "_installation", lambda: b"0.1.0 1234")
    assert searched(tmp_path, RECORD) == 1
    monkeypatch.undo()
    assert searched(tmp_path, RECORD) == 0  # both are kept


def test_an_edited_source_is_another_program(tmp_path, monkeypatch):
    (tmp_path / "pivident" / "foundation").mkdir(parents=True)
    source = tmp_path / "pivident" / "foundation" / "common_work.py"
    source.touch()
    monkeypatch.setattr(common_work, "__file__", str(source))
    stamp = common_work._installation.__wrapped__
    before = stamp()
    os.utime(source, (2e9, 2e9))
    assert stamp() != before


@pytest.mark.parametrize("size", [0, 1, 100, -1])
def test_a_damaged_file_is_as_none(tmp_path, size):
    searched(tmp_path, RECORD)
    whole = (tmp_path / NUMBERS).read_bytes()
    (tmp_path / NUMBERS).write_bytes(whole[:size])
    assert searched(tmp_path, RECORD) == 1
    assert (tmp_path / NUMBERS).read_bytes() == whole


def test_no_changed_byte_is_believed(tmp_path):
    searched(tmp_path, RECORD)
    whole = (tmp_path / NUMBERS).read_bytes()
    for place in range(len(whole)):
        changed = bytes([*whole[:place], whole[place] ^ 1, *whole[place + 1 :]])
        (tmp_path / NUMBERS).write_bytes(changed)
        assert searched(tmp_path, RECORD) == 1


@pytest.mark.parametrize("numbers", [None, [], 3, {"a": 3}, {"a": "%"}, {"a": "AAAA"}, "key"])
def test_a_forged_file_does_no_harm(tmp_path, numbers):
    """Also one whose sum is right; numbers of another shape are none."""
    searched(tmp_path, RECORD)
    content = json.loads((tmp_path / NUMBERS).read_text("utf-8"))
    if numbers == "key":
        numbers = dict.fromkeys(content["numbers"], "AAAAAAAA8D8=")
    forged = {"sha256": common_work._sha256_of(numbers), "numbers": numbers}
    (tmp_path / NUMBERS).write_text(json.dumps(forged), encoding="utf-8")
    assert searched(tmp_path, RECORD) == 1


def test_what_cannot_be_written_is_searched_each_time(tmp_path):
    (tmp_path / NUMBERS / "a folder").mkdir(parents=True)
    assert [searched(tmp_path, RECORD) for _ in range(2)] == [1, 1]
    assert searched(tmp_path / "no folder", RECORD) == 1


def test_an_interrupted_command_keeps_what_it_has_found(tmp_path):
    with pytest.raises(KeyboardInterrupt), numbers_beside(tmp_path / "experiment.toml"):
        kept_numbers(("what", RECORD, 0.5), FOUND.shape, Search())
        raise KeyboardInterrupt
    assert searched(tmp_path, RECORD) == 0


def test_the_file_does_not_grow(tmp_path):
    assert searched(tmp_path, *range(MAX_KEPT + 10)) == MAX_KEPT + 10
    assert searched(tmp_path, *range(MAX_KEPT + 9, 9, -1)) == 0
    assert searched(tmp_path, *range(10)) == 10


def test_commands_at_once_do_not_harm_each_other(tmp_path):
    with ProcessPoolExecutor(4) as pool:
        list(pool.map(searched, [tmp_path] * 40, range(40)))
    assert [file.name for file in tmp_path.iterdir()] == [NUMBERS]
    assert searched(tmp_path, *range(40)) < 40  # of those that ended at one instant, some are lost
    assert searched(tmp_path, *range(40)) == 0


def test_identify_takes_up_what_check_has_searched_for(tmp_path, monkeypatch, capsys):
    """With the same results as without, number for number."""
    path = write_experiment(tmp_path)
    assert main(["check", str(path)]) == 0
    said = capsys.readouterr().out.rpartition("expected time")[0]
    (tmp_path / NUMBERS).rename(tmp_path / "aside")
    assert main(["identify", str(path), "--out", str(tmp_path / "anew")]) == 0
    (tmp_path / "aside").rename(tmp_path / NUMBERS)
    monkeypatch.setattr(delay, "_searched", None)
    assert main(["identify", str(path), "--out", str(tmp_path / "again")]) == 0
    assert main(["check", str(path)]) == 0
    assert said in capsys.readouterr().out
    for name in ("verdict.json", "identification.json"):
        anew, again = ((tmp_path / out / name).read_text("utf-8") for out in ("anew", "again"))
        assert anew.replace("/anew ", "/again ") == again  # which its next steps name
