"""Topics at rates of their own: nothing is invented, nothing folds down, delays are found."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.clock_alignment import ClockedChannel, onto_one_clock
from pivident.data.recording.load import load_recording
from pivident.estimation.problem import Problem
from pivident.experiment.check.audit_file import audit_file
from pivident.foundation.errors import ClocksDisagree, GapInClock, RecordingError
from pivident.robot.gallery import load_robot
from tests.bags import EPOCH, MIDNIGHT, joint_states, typestore, write_bag
from tests.planar_log import RATE, planar_log, planar_truth

T = np.arange(2000) / 500.0


def channel(name, t, wave, clock="/a/stamp", **more):
    return ClockedChannel(name, clock, t, wave(t)[:, None], **more)


def jittered(t, deviation, seed=3):
    return np.sort(t + np.random.default_rng(seed).uniform(-deviation, deviation, len(t)))


def test_rates_that_differ_are_brought_onto_the_slower_one():
    fast = jittered(T, 0.5e-3)
    slow = jittered(np.arange(480) / 125.0 + 0.0031, 2e-3, 4)
    aligned = onto_one_clock(
        [
            channel("q", fast, lambda t: np.sin(5 * t)),
            channel("tau", slow, lambda t: np.cos(3 * t), clock="/b/stamp"),
        ],
        rate=125.0,
    )
    assert aligned.rate == 125.0
    np.testing.assert_allclose(np.diff(aligned.t), 1 / 125.0, rtol=1e-9)
    inner = slice(30, -30)  # ends of the low-pass
    np.testing.assert_allclose(
        aligned.values["q"][inner, 0], np.sin(5 * aligned.t[inner]), atol=1e-5
    )
    np.testing.assert_allclose(aligned.values["tau"][:, 0], np.cos(3 * aligned.t), atol=5e-4)
    assert "q by /a/stamp (500" in aligned.notes[0]
    assert "low-passed at 50 Hz" in aligned.notes[1]


@pytest.mark.parametrize("fault", ["repeated", "backward", "not a number"])
def test_stamps_beyond_the_part_may_be_anything(fault):
    """A log is cut where its stamps are wrong; the part that is left is the same as without."""
    clean = channel("q", T, np.sin)
    t = T.copy()
    t[300:310] = {"repeated": T[309], "backward": T[300] - np.arange(10), "not a number": np.nan}[
        fault
    ]
    part = (float(T[400]), float(T[1800]))
    spoilt = replace(clean, t=t)
    kept, same = onto_one_clock([spoilt], 500.0, part), onto_one_clock([clean], 500.0, part)
    np.testing.assert_array_equal(kept.t, same.t)
    np.testing.assert_array_equal(kept.values["q"], same.values["q"])
    with pytest.raises(RecordingError):
        onto_one_clock([spoilt], 500.0, (float(T[200]), float(T[1800])))


def test_a_part_that_ends_or_begins_beside_wrong_stamps_is_whole():
    t = T.copy()
    t[300:310] = T[309]
    channels = [replace(channel("q", T, np.sin), t=t)]
    behind = onto_one_clock(channels, 500.0, (float(T[310]), float(T[-1])))
    before = onto_one_clock(channels, 500.0, (0.0, float(T[299])))
    assert behind.t[0] == pytest.approx(T[310]) and before.t[-1] == pytest.approx(T[299])


def test_what_the_lower_rate_cannot_hold_does_not_fold_down():
    tone = 2 * np.pi * 120.0  # folds to 5 Hz at 125 Hz
    aligned = onto_one_clock(
        [
            channel("q", T, lambda t: np.sin(tone * t)),
            channel("tau", T[::4].copy(), np.sin, clock="/b/stamp"),
        ]
    )
    assert aligned.rate == 125.0
    assert np.abs(aligned.values["q"][60:-60]).max() < 1e-3


def test_nothing_is_interpolated_over_a_gap_and_the_longest_stretch_is_named():
    holes = np.delete(T, np.s_[600:680])
    channels = [
        channel("q", T, np.sin),
        channel("tau", holes, np.cos, clock="/b/stamp"),
    ]
    with pytest.raises(GapInClock, match=r"tau has no samples .* part = \[1\.36, 3\.998\]") as gap:
        onto_one_clock(channels)
    aligned = onto_one_clock(channels, part=gap.value.stretches.longest)
    assert aligned.t[0] == T[680]
    np.testing.assert_allclose(aligned.values["tau"][:, 0], np.cos(aligned.t), atol=1e-6)


def test_a_single_lost_message_is_bridged():
    aligned = onto_one_clock([channel("q", np.delete(T, 700), np.sin), channel("tau", T, np.cos)])
    np.testing.assert_allclose(aligned.values["q"][:, 0], np.sin(aligned.t), atol=1e-9)


@pytest.mark.parametrize(
    ("shift", "leads", "message"),
    [
        (1.7e9, (None, None), "they share no time"),
        (2.0, (0.0, 2.0), "two clocks, 2.000 s apart"),
    ],
)
def test_clocks_that_are_not_one_are_told_apart_by_name(shift, leads, message):
    with pytest.raises(ClocksDisagree, match=message) as caught:
        onto_one_clock(
            [
                channel("q", T, np.sin, lead=leads[0]),
                channel("tau", T + shift, np.cos, clock="/torque/stamp", lead=leads[1]),
            ]
        )
    assert "/torque/stamp" in str(caught.value)


def test_two_files_with_clocks_of_their_own(tmp_path):
    torque_times = T[5:-5:2] + 0.4e-3
    np.savetxt(
        tmp_path / "q.csv",
        np.column_stack([T, np.sin(T)]),
        delimiter=",",
        header="time,p",
        comments="",
    )
    np.savetxt(
        tmp_path / "tau.csv", np.column_stack([torque_times, np.cos(torque_times)]), delimiter=",",
        header="stamp,m", comments="",
    )  # fmt: skip
    files = {"q": tmp_path / "q.csv", "tau": tmp_path / "tau.csv"}
    columns = {"q": ["p"], "tau": ["m"], "t": {"q": "time", "tau": "stamp"}}
    with pytest.raises(RecordingError, match=r"clocks of their own: .*resample = true"):
        load_recording(files, columns)
    made = load_recording(files, columns, resample=True)
    assert made.rate == 250.0
    np.testing.assert_allclose(made.tau[:, 0], np.cos(made.t), atol=1e-5)
    np.testing.assert_allclose(made.q[20:-20, 0], np.sin(made.t[20:-20]), atol=1e-5)
    with pytest.raises(RecordingError, match=r"t is given for 'dq'"):
        load_recording(files, columns | {"t": {"dq": "time"}})


DELAY, SAMPLES = 7.3e-3, 4000


@pytest.fixture(scope="module")
def two_topics(tmp_path_factory):
    """Positions at 1 kHz with jitter, torques at 500 Hz stamped 7.3 ms late."""
    folder = tmp_path_factory.mktemp("two")
    t, q, tau = (planar_log()[:SAMPLES, k] for k in (0, slice(1, 3), slice(5, 7)))
    q = np.deg2rad(q)
    rng = np.random.default_rng(8)
    seen = np.sort(t + 0.1e-3 * rng.standard_normal(len(t)))
    q_seen = _spline(t, q)(np.clip(seen, t[0], t[-1]))
    late = t[::2] + DELAY
    store = typestore("mcap")
    names = load_robot("planar_2r").joint_names
    nothing = np.zeros((len(late), len(names)))
    topics = [
        joint_states(store, False, names, seen, q_seen, None, "/joint_states"),
        joint_states(store, False, names, late, nothing, tau[::2], "/torques"),
    ]
    return write_bag(folder, "mcap+storage", store, topics), q, tau


def _spline(t, x):
    from scipy.interpolate import CubicSpline

    return CubicSpline(t, x)


COLUMNS = {"q": "/joint_states/position", "tau": "/torques/effort"}


def test_the_delay_of_a_topic_is_found_within_its_interval(two_topics, tmp_path):
    path, _, _ = two_topics
    experiment = tmp_path / "arm.toml"
    experiment.write_text(
        'robot = "planar_2r"\n[recording]\nresample = true\n'
        f'files = "{path}"\ncolumns = {{q = "{COLUMNS["q"]}", tau = "{COLUMNS["tau"]}"}}\n'
        "control_rate = 1000.0\n"
    )
    (audit,) = audit_file(experiment)
    mean, deviation = audit.delay.common
    assert abs(mean - DELAY) < 2 * deviation + 0.05e-3
    assert deviation < 1e-3
    assert any("Resampled to 500 Hz" in note for note in audit.log.notes)
    (finding,) = [f for f in audit.of("delay") if f.kind == "late"]
    assert (
        finding.quantity.interval[0] < 1e3 * DELAY + 0.05
        and finding.quantity.interval[1] > 1e3 * DELAY - 0.05
    )


def test_estimates_agree_with_those_of_the_clean_record(two_topics):
    import pivident as pv

    path, q, tau = two_topics
    robot = load_robot("planar_2r")
    clean = pv.Recording("clean", robot.joint_names, q, tau, RATE)
    made = load_recording(path, COLUMNS, robot=robot, resample=True, delay=DELAY, control_rate=RATE)
    assert made.start_time == pytest.approx(EPOCH - MIDNIGHT + DELAY, abs=1e-3)
    results = [pv.identify(Problem(robot, (recording,)), "ls") for recording in (clean, made)]
    (one, spread), (other, deviation) = (
        (dict(zip(r.names, x, strict=True)) for x in (r.theta, np.sqrt(np.diag(r.covariance))))
        for r in results
    )
    truth = planar_truth()
    for name, value in other.items():
        apart = 3 * np.hypot(deviation[name], spread[name])
        assert abs(value - one[name]) < apart + 0.01 * abs(truth[name])


def test_a_part_between_gaps_is_read(two_topics):
    path, _, _ = two_topics
    begin = EPOCH - MIDNIGHT + 1.0
    made = load_recording(
        path, COLUMNS, robot=load_robot("planar_2r"), resample=True, part=(begin, begin + 2.0)
    )
    assert made.start_time == pytest.approx(begin)
    assert made.duration == pytest.approx(2.0)
    assert replace(made).notes == made.notes
