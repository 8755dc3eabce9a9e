"""The records and tables of benchmarks/reservations, in short."""

import numpy as np
import pytest
from benchmarks.reservations.judged import names_fault
from benchmarks.reservations.records import FAMILIES, Wanted, wanted
from benchmarks.reservations.tables import coverage, share, tables

from pivident.experiment import simulated_tx40 as scenarios


def row(fault, z, *findings, repairs=(), expected=()):
    """A record that was judged."""
    keys = ("severity", "topic", "kind", "subject", "message")
    return {
        "family": "scara", "fault": fault, "seed": 1, "size": 2.0, "unit": "%",
        "expected": [list(one) for one in expected],
        "names": [f"p{k}" for k in range(len(z))], "z": z,
        "findings": [dict(zip(keys, one, strict=True)) for one in findings],
        "repairs": list(repairs),
        "uses": dict.fromkeys(("torque", "simulation", "parameters"), "yes"),
    }  # fmt: skip


GEAR = ("warning", "model", "gear ratio", "J2", "Gear ratio: J2, excess: 2 ± 0.1 %.")
NOTE = ("note", "scale", "gain", "J1", "The torque of J1 is 1.4 times that of the description.")


def test_right_records_come_with_the_wrong_ones_of_their_seed():
    records = list(wanted(list(FAMILIES), ["gear-ratio"], 2, 1, 5))
    assert len(records) == len(set(records)) == 7 + 4 + 7
    assert records[0] == Wanted("tx40-fine", "none", 5)
    assert {own.family for own in records if own.fault != "none"}.isdisjoint({"tx40-fine"})
    assert not list(wanted(["scara"], ["link-length"], 0, 1, 0))  # it would not show there


@pytest.mark.parametrize(
    ("said", "cause", "named"),
    [
        ([GEAR], ("gear ratio", "J2"), True),
        ([NOTE, GEAR], ("gear ratio", "J2"), True),
        ([GEAR], ("gear ratio", "J1"), False),
        ([GEAR], ("geometry", "J2"), False),
        ([NOTE], ("torque gain", "J1"), False),
        ([], ("delay", None), False),
        ([("error", "delay", "late", "", "Late.")], ("delay", None), True),
        ([("warning", "timing", "lost", "", "Lost.")], ("lost samples", None), True),
    ],
)
def test_the_first_reservation_has_to_name_the_fault(said, cause, named):
    assert names_fault(row("some", [1.0], *said, expected=[cause])) == named


def test_a_repair_comes_before_reservations():
    edit = {"edit": "Multiplied", "channel": "tau", "factors": [["J1", 2.0]]}
    repairs = [{"cause": "Twice.", "effect": "", "edits": [edit]}]
    made = [
        row("torque-gain", [9.0], GEAR, repairs=repairs, expected=[("torque gain", joint)])
        for joint in ("J1", "J2")
    ]
    assert [names_fault(own) for own in made] == [True, False]


def test_tables_count_reservations_and_list_what_is_silent():
    rows = [
        row("none", [0.5, -1.0, 1.9, 2.1], NOTE),
        row("none", [0.1] * 4, GEAR),
        row("gear-ratio", [8.0, 1.0], GEAR, expected=[("gear ratio", "J2")]),
        row("gear-ratio", [0.0, -7.0], expected=[("gear ratio", "J2")]),
        {"family": "scara", "fault": "none", "seed": 2, "refused": "no loop"},
    ]
    text = "\n".join(tables(rows))
    assert "2 right records, 2 wrong ones, 1 refused." in text
    assert "| warning | model: gear ratio | 1 of 2 (9 to 91 %) | 1 of 2 (9 to 91 %) |" in text
    assert "| scara | gear-ratio | 2 % | 1 | 7.0 | p1 |" in text
    assert coverage(rows[:2]).startswith("87.5 % (")
    assert share([], []) == "–"


def test_pinocchio_moves_the_tx40_as_its_own_simulator_does():
    pytest.importorskip("pinocchio")
    from benchmarks.reservations.tx40 import simulate

    problem, truth = scenarios.tx40_scenario("fine", 3, 3000)
    noise = scenarios.NOISES["fine"]
    q, tau = simulate(problem, truth, noise.in_loop(3, problem.recordings[0].q.shape))
    expected = scenarios.simulate_tx40(noise, 3, 3000)
    assert np.abs(q - expected.q).max() < 1e-6
    assert np.abs(tau - expected.tau).max() < 0.02
