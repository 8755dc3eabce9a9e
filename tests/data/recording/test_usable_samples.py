"""What is no measurement is left out of the equations that it concerns, and the rest is used."""

import numpy as np
import pytest
from tests.planar_log import planar_log

from pivident import Problem, identify, load_recording, load_robot
from pivident.data.recording.usable_samples import filled
from pivident.foundation.errors import BrokenMotion, NonFiniteSamples

COLUMNS = {"t": "t", "q": ["q1", "q2"], "q_ref": ["r1", "r2"], "tau": ["tau1", "tau2"]}
UNITS = {"q": "deg", "q_ref": "deg", "t": "s"}
NAMES = ("t", "q1", "q2", "r1", "r2", "tau1", "tau2")


def read(folder, table, **options):
    path = folder / "log.npz"
    np.savez(path, **dict(zip(NAMES, table.T, strict=True)))
    return load_recording(path, COLUMNS, units=UNITS, robot=load_robot("planar_2r"), **options)


def estimates(*recordings, method="ls"):
    found = identify(Problem(load_robot("planar_2r"), recordings), method)
    return found.theta, found.std


def zeros(table):
    table[[900, 2500, 4111], 1:] = 0.0
    return [900, 2500, 4111], [900, 2500, 4111]


def cell(table):
    table[2000, 1] = 1e200
    return [2000], [2000]


def missing_torque(table):
    table[3000:3400, 6] = np.nan
    return [], list(range(3000, 3400))


def frozen_torque(table):
    table[3000:3120, 6] = table[3000, 6]
    return [], list(range(3000, 3120))


def glitch(table):
    table[5000:5003, 2] += 20.0
    return list(range(5000, 5003)), list(range(5000, 5003))


@pytest.mark.parametrize("fault", [zeros, cell, missing_torque, frozen_torque, glitch])
@pytest.mark.parametrize("method", ["ls", "iv-full-rate", "piv"])
def test_estimates_are_those_of_the_right_log(tmp_path, fault, method):
    right = read(tmp_path, planar_log())
    table = planar_log().copy()
    first, second = fault(table)
    recording = read(tmp_path, table)
    assert np.flatnonzero(~recording.valid[:, 0]).tolist() == first
    assert set(second) <= set(np.flatnonzero(~recording.valid[:, 1]).tolist())
    assert any("left out of the equations" in note for note in recording.notes)
    (wanted, std), (theta, _) = (estimates(r, method=method) for r in (right, recording))
    assert (np.abs(theta - wanted) < std).all()


def test_without_the_mask_they_would_not_be(tmp_path):
    wanted, std = estimates(read(tmp_path, planar_log()))
    table = planar_log().copy()
    missing_torque(table)
    recording = read(tmp_path, table)
    object.__setattr__(recording, "valid", None)
    assert np.abs((estimates(recording)[0] - wanted) / std).max() > 2.0


def test_an_encoder_that_freezes_costs_the_samples_beside_it_too(tmp_path):
    table = planar_log().copy()
    table[2001:2060, 1] = table[2000, 1]
    recording = read(tmp_path, table)
    unused = np.flatnonzero(~recording.valid[:, 1])
    assert unused[0] == 2001 - 50 and unused[-1] == 2059 + 50
    wanted, std = estimates(read(tmp_path, planar_log()))
    assert (np.abs(estimates(recording)[0] - wanted) < std).all()
    assert recording.notes[0].startswith("q of shoulder keeps its value while its joint moves on")
    assert "at samples 2001 to 2059; left out of the equations of all joints" in recording.notes[0]


def test_an_unknown_motion_is_not_guessed(tmp_path):
    table = planar_log().copy()
    table[2000:2600, 1] = np.nan
    with pytest.raises(BrokenMotion, match=r"not known for 0\.601 s at sample 2600"):
        read(tmp_path, table)
    behind = read(tmp_path, table, part=(2.6, 8.0)).valid
    assert not behind[:50].any() and behind[50:].all()


def test_a_channel_of_nothing_is_refused(tmp_path):
    table = planar_log().copy()
    table[:, 6] = np.nan
    with pytest.raises(NonFiniteSamples, match="tau"):
        read(tmp_path, table)


def test_rows_twice_and_wrong_stamps(tmp_path):
    table = planar_log()
    twice = np.insert(table, [1000, 2000], table[[999, 1999]], axis=0)
    recording = read(tmp_path, twice)
    assert np.array_equal(recording.q, np.deg2rad(table[:, 1:3])) and recording.valid is None
    assert "2 belong to rows that were logged twice" in recording.notes[0]
    table = table.copy()
    table[1000, 0] = table[999, 0]
    recording = read(tmp_path, table)
    assert np.array_equal(recording.q, np.deg2rad(table[:, 1:3]))
    assert "corrected" in recording.notes[0]


def test_a_source_that_is_slower_than_the_log(tmp_path):
    table = planar_log().copy()
    held = np.arange(len(table)) // 4 * 4
    table[:, 1:] = table[held, 1:]
    recording = read(tmp_path, table)
    assert recording.rate == 250.0 and recording.samples == len(table) // 4
    assert "only one in 4 has" in recording.notes[0]


def test_samples_keep_their_mask_on_a_new_clock(tmp_path):
    table = planar_log().copy()
    table[3000:3400, 6] = np.nan
    recording = read(tmp_path, table, resample=True, rate=500.0)
    unused = np.flatnonzero(~recording.valid[:, 1])
    assert unused[0] == 1500 and unused[-1] in (1699, 1700)
    assert recording.valid[:, 0].all()
    assert not recording.part(1400, 1600).valid[100:, 1].any()


def test_what_is_filled_is_near_the_truth():
    t = np.arange(2000) / 500.0
    truth = np.column_stack([np.sin(3.0 * t), np.cos(2.0 * t)])
    holes = truth.copy()
    holes[500:560, 0], holes[900, 1], holes[:3, 1] = np.nan, np.nan, np.nan
    made = filled(holes, True)
    assert np.abs(made - truth)[500:560, 0].max() < 2e-4
    assert np.abs(made - truth)[900, 1] < 1e-7
    assert (made[:3, 1] == truth[3, 1]).all()
    assert filled(truth, True) is truth
