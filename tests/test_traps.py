"""The traps of the benchmark: what is planted, and when a verdict names it."""

import numpy as np
import pytest
from benchmarks.trapped_logs.judging import judge
from benchmarks.trapped_logs.logs import LOGS, Source
from benchmarks.trapped_logs.plain_log import PlainLog
from benchmarks.trapped_logs.planting import NAMES, TRAPS, apply_trap
from benchmarks.trapped_logs.running import Outcome
from benchmarks.trapped_logs.visible import INAPPLICABLE, VISIBLE

JOINTS = ("one", "two", "three")

SOURCE = Source("", "arm.toml", joint=1, pair=(0, 2))


@pytest.fixture
def log() -> PlainLog:
    random = np.random.default_rng(1)
    run = {channel: random.standard_normal((500, 3)) for channel in ("q", "dq", "tau", "q_ref")}
    entry = {"files": "log_1.csv", "part": [1.0, 4.0], "units": {"q": "rad", "tau": "N m"}}
    experiment = {"robot": {"model": "arm.toml"}, "recording": [entry]}
    run = {"t": np.arange(500) / 100.0, **run}
    return PlainLog(experiment, [run], JOINTS, "mass = 5\nmass = 2\n", np.ones(3))


@pytest.mark.parametrize(
    ("trap", "channels"),
    [
        ("clock x2", {"t"}),
        ("sign of torque", {"tau"}),
        ("sign of position", {"q", "dq", "q_ref"}),
        ("joint reversed", {"q", "dq", "q_ref", "tau"}),
        ("torques exchanged", {"tau"}),
        ("zero 90 deg off", {"q", "q_ref"}),
        ("degrees as rad", {"q", "q_ref"}),
        ("torque 20 ms late", {"tau"}),
        ("rows repeated", {"q", "dq", "q_ref", "tau"}),
        ("torque x1.5", {"tau"}),
        ("gravity along x", set()),
        ("3 kg missing", set()),
    ],
)
def test_a_trap_changes_its_channels_and_no_other(log, tmp_path, trap, channels):
    (run,) = log.runs
    (spoilt,) = apply_trap(trap, log, SOURCE, tmp_path).runs
    assert {key for key in run if not np.array_equal(run[key], spoilt[key])} == channels


def test_a_clock_takes_the_used_part_with_it(log, tmp_path):
    spoilt = apply_trap("clock x2", log, SOURCE, tmp_path)
    assert spoilt.experiment["recording"][0]["part"] == [2.0, 8.0]
    assert log.experiment["recording"][0]["part"] == [1.0, 4.0]


def test_a_fifth_of_the_rows_repeats_the_row_before(log, tmp_path):
    (spoilt,) = apply_trap("rows repeated", log, SOURCE, tmp_path).runs
    repeated = (np.diff(spoilt["q"], axis=0) == 0.0).all(axis=1)
    assert abs(repeated.mean() - 0.2) < 0.05


def test_the_last_link_is_made_heavier(log, tmp_path):
    assert apply_trap("3 kg missing", log, SOURCE, tmp_path).robot == "mass = 5\nmass = 5\n"


def reservation(topic: str, kind: str, subject: str, severity: str = "error") -> dict[str, str]:
    words = {"topic": topic, "kind": kind, "subject": subject, "message": f"{kind} {subject}"}
    return {"severity": severity, **words}


def outcome(*statements: dict[str, str], repairs=()) -> Outcome:
    severity = "error" if statements else "ok"
    return Outcome(0, 1.0, 1.0, "", severity, list(statements), 5.0, 5.0, repairs=list(repairs))


def test_the_first_new_reservation_names_the_trap():
    old, sign = reservation("physics", "negative", ""), reservation("power", "sign", "two")
    other = reservation("order", "order", "one")
    clean = outcome(old)
    assert judge("sign of torque", ["two"], outcome(old, sign), clean).named == "first"
    assert judge("sign of torque", ["two"], outcome(old, other, sign), clean).named == "2"
    assert judge("sign of torque", ["one"], outcome(old, sign), clean).named == "no"
    assert judge("sign of torque", ["two"], outcome(old), clean).taken == "unnoticed"
    assert judge("sign of torque", ["two"], outcome(), clean).taken == "silently"


def test_where_there_are_repairs_the_first_one_counts():
    edit = {"edit": "Reversed", "table": ["recording"], "channel": "tau", "joints": ["two"]}
    repairs = [{"number": 1, "repair": {"edits": [edit], "words": ""}}]
    noticed = outcome(reservation("physics", "negative", ""), repairs=repairs)
    right = judge("sign of torque", ["two"], noticed, outcome())
    assert (right.named, right.by) == ("first", "repair")
    assert judge("sign of position", ["two"], noticed, outcome()).named == "no"


def test_every_trap_of_every_log_has_its_evidence():
    for log in LOGS:
        seen, cannot = VISIBLE[log].keys(), INAPPLICABLE.get(log, {}).keys()
        assert not seen & cannot
        assert seen | cannot == set(NAMES[1:])
    assert set(TRAPS) < set(NAMES)
