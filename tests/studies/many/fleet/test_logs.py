"""Which robot, which day, which files belong together."""

import pytest

from pivident.foundation.errors import ExperimentError
from pivident.studies.many.fleet.logs import find_logs


@pytest.fixture
def made(tmp_path):
    def make(*files):
        for file in files:
            path = tmp_path / "logs" / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(file)
        return tmp_path / "logs"

    return make


def test_robots_and_days_are_read_from_paths_in_the_order_of_time(made):
    folder = made("b/2026-03-10.csv", "b/2026-03-09.csv", "a/20260311.csv", "a/notes.txt", "x.csv")
    logs, axis = find_logs(folder, "{robot}/{day}.csv")
    assert [(log.robot, log.time) for log in logs] == [
        ("a", "2026-03-11"),
        ("b", "2026-03-09"),
        ("b", "2026-03-10"),
    ]
    assert logs[2].position - logs[1].position == 1.0
    assert (axis.kind, axis.unit) == ("date", "day")
    assert logs[0].paths == (str(folder / "a/20260311.csv"),)


def test_moments_within_a_day_and_numbers_are_times_too(made):
    logs, _ = find_logs(
        made("a/2026-03-10T08-30.csv", "a/2026-03-10T20-30.csv"), "{robot}/{time}.csv"
    )
    assert logs[1].position - logs[0].position == pytest.approx(0.5)
    logs, axis = find_logs(made("n/9_x.csv", "n/10_x.csv"), "{robot}/{shift}_x.csv", time="shift")
    assert [log.time for log in logs] == ["9", "10"] and axis.unit == "shift"


def test_without_times_the_names_give_the_order(made):
    logs, axis = find_logs(made("a/cold.csv", "a/warm.csv", "b/cold.csv"), "{robot}/{name}.csv")
    assert [log.position for log in logs] == [1.0, 2.0, 1.0] and axis.kind == "order"


def test_without_a_pattern_robots_are_folders_and_dates_are_found_in_names(made):
    folder = made("hall/a/log_2026-03-02.csv", "hall/a/log_2026-03-01.npz", "hall/a/readme.md")
    logs, axis = find_logs(folder, "*")
    assert [(log.robot, log.time) for log in logs] == [
        ("hall/a", "2026-03-01"),
        ("hall/a", "2026-03-02"),
    ]
    assert axis.kind == "date"


def test_the_first_part_of_a_name_takes_as_much_as_it_can(made):
    (log,), _ = find_logs(made("arm_3_2026-03-01.csv"), "{robot}_{day}.csv")
    assert log.robot == "arm_3" and log.time == "2026-03-01"


def test_a_pattern_without_robot_is_one_robot(made):
    logs, _ = find_logs(made("2026-03-01.csv", "2026-03-02.csv"), "{day}.csv")
    assert {log.robot for log in logs} == {"logs"} and len(logs) == 2


def test_runs_of_a_day_can_be_one_problem(made):
    folder = made("a/1/x.csv", "a/1/y.csv", "a/2/x.csv")
    logs, _ = find_logs(folder, "{robot}/{day}/{run}.csv", together=["robot", "day"])
    assert [len(log.records) for log in logs] == [2, 1]
    assert logs[0].name == "a/1"


def test_files_of_one_record_belong_together_and_a_missing_one_is_a_fault(made):
    folder = made("a/1/q.csv", "a/1/tau.csv", "a/2/q.csv")
    pattern = {"q": "{robot}/{day}/q.csv", "tau": "{robot}/{day}/tau.csv"}
    whole, half = find_logs(folder, pattern)[0]
    assert [key for key, _ in whole.records[0]] == ["q", "tau"] and not whole.fault
    assert "no file for 'tau'" in half.fault.fact and "day 2" in half.fault.fact


def test_the_digest_follows_the_content(made):
    folder = made("a/1.csv")
    (log,), _ = find_logs(folder, "{robot}/{day}.csv")
    before = log.digest()
    (folder / "a/1.csv").write_text("other")
    assert log.digest() != before


def test_one_day_that_is_none_is_a_fault_of_its_own(made):
    folder = made("a/2026-03-01.csv", "a/2026-03-02.csv", "a/old.csv")
    faults = {log.name: log.fault for log in find_logs(folder, "{robot}/{day}.csv")[0]}
    assert "'old' is not a date" in faults["a/old"].fact
    assert not faults["a/2026-03-01"]


def test_the_results_folder_is_not_searched(made):
    folder = made("a/1.csv", "out/a/1.csv", ".hidden/1.csv")
    logs, _ = find_logs(folder, "*", without=folder / "out")
    assert [log.robot for log in logs] == ["a"]


@pytest.mark.parametrize(
    ("pattern", "options", "said"),
    [
        ("{robot}{day}.csv", {}, "follows another part directly"),
        ("{robot}/{no name}.csv", {}, "is not a valid name"),
        ("{robot/x.csv", {}, "needs parts in braces"),
        ("x.csv", {}, "needs parts in braces"),
        ("{robot}/{day}.txt", {}, "there is no file that matches.*a/1.csv"),
        ("{robot}/{day}.csv", {"together": ["day"]}, "different robots"),
        ("{robot}/{day}.csv", {"together": ["robot", "run"]}, "names 'run'"),
        ("{robot}/{day}.csv", {"time": "week"}, "names 'week'"),
        ("{robot}_{a}_{b}_{c}_{d}.csv", {}, "more than 4 parts"),
        ("{robot}/*.csv", {}, "for the same robot a"),
        ({"q": "{robot}/{day}.csv", "tau": "{robot}.csv"}, {}, "need the same parts"),
    ],
)
def test_patterns_that_cannot_work_say_why(made, pattern, options, said):
    with pytest.raises(ExperimentError, match=said):
        find_logs(made("a/1.csv", "a/2.csv"), pattern, **options)


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ExperimentError, match="does not exist"):
        find_logs(tmp_path / "none", "*")
