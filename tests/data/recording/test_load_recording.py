import h5py
import numpy as np
import polars as pl
import pytest
import scipy.io

from pivident.data.logs.described_log import described_log
from pivident.data.logs.read_log import read_log
from pivident.data.logs.source_files import SourceFile
from pivident.data.recording.load import load_recording, recording_from
from pivident.foundation.errors import (
    BadCell,
    FileFormatError,
    IrregularSampling,
    NonFiniteSamples,
    RecordingError,
    SaturatedSignal,
    ShapeMismatch,
    UnknownColumn,
)
from pivident.robot.drives import with_drives
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission

RATE = 200.0
T = np.arange(600) / RATE
Q = np.column_stack([np.sin(T), 0.5 * np.cos(2.0 * T)])
TAU = np.column_stack([np.cos(3.0 * T), np.sin(T) + 0.2 * np.cos(9.0 * T)])
NAMES = {"q": ["q1", "q2"], "tau": ["tau1", "tau2"], "t": "t"}
TABLE = {"t": T, "q1": Q[:, 0], "q2": Q[:, 1], "tau1": TAU[:, 0], "tau2": TAU[:, 1]}

COUPLED = Transmission(
    reduction=np.array([[50.0, 0.0], [30.0, -40.0]]),
    drive_gain=np.array([0.5, 2.0]),
    position_offset=np.array([0.1, -0.2]),
)


def write_csv(path, table):
    pl.DataFrame(table).write_csv(path)


def write_parquet(path, table):
    pl.DataFrame(table).write_parquet(path)


def write_npz(path, table):
    np.savez(path, **table)


def write_mat(path, table):
    scipy.io.savemat(path, table)


def write_mat_v73(path, table):
    with h5py.File(path, "w") as file:
        for name, values in table.items():
            file[name] = np.atleast_2d(values).T


@pytest.fixture
def log(tmp_path):
    np.savez(tmp_path / "log.npz", q=Q, tau=TAU, t=T, level=TAU[:, 0] > 0)
    return tmp_path / "log.npz"


ARRAYS = {"q": "q", "tau": "tau"}


@pytest.mark.parametrize(
    ("write", "name"),
    [
        (write_csv, "run.csv"),
        (write_parquet, "run.parquet"),
        (write_npz, "run.npz"),
        (write_mat, "run.mat"),
        (write_mat_v73, "run.mat"),
    ],
)
def test_every_kind_of_file_gives_the_same_recording(tmp_path, write, name):
    write(tmp_path / name, TABLE)
    made = load_recording(tmp_path / name, NAMES)
    np.testing.assert_array_equal(made.q, Q)
    np.testing.assert_array_equal(made.tau, TAU)
    assert (made.name, made.rate, made.joint_names) == ("run", RATE, ("joint_1", "joint_2"))
    assert made.sources == (SourceFile.of(tmp_path / name),)
    assert made.sources[0].name == name


def test_positions_and_torques_may_be_in_separate_files(tmp_path):
    for key, values in (("q", Q), ("tau", TAU)):
        write_csv(tmp_path / f"{key}.csv", {"t": T, "a": values[:, 0], "b": values[:, 1]})
    made = load_recording(
        {"q": tmp_path / "q.csv", "tau": tmp_path / "tau.csv"},
        {"q": ["a", "b"], "tau": ["a", "b"], "t": {"file": "q", "columns": "t"}},
    )
    np.testing.assert_array_equal(made.tau, TAU)
    assert [source.name for source in made.sources] == ["q.csv", "tau.csv"]


def test_a_file_that_is_not_needed_is_not_opened(tmp_path, log):
    files = {"log": log, "spare": tmp_path / "missing.csv"}
    columns = {key: {"file": "log", "columns": key} for key in ("q", "tau")}
    assert len(load_recording(files, columns, rate=RATE).sources) == 1


def test_transposed_arrays_are_turned(tmp_path):
    np.savez(tmp_path / "log.npz", q=Q.T, tau=TAU, q_ref=Q.T)
    made = load_recording(tmp_path / "log.npz", ARRAYS | {"q_ref": "q_ref"}, rate=RATE)
    np.testing.assert_array_equal(made.q, Q)
    np.testing.assert_array_equal(made.q_ref, Q)


def test_units_are_turned_into_si(log):
    made = load_recording(
        log,
        ARRAYS | {"q_ref": "q", "dq_ref": "q", "ddq_ref": "q", "t": "t", "inputs": {"u": "tau"}},
        units={
            "q": ["deg", "mm"],
            "q_ref": {"unit": "counts", "per_revolution": 100},
            "dq_ref": "rpm",
            "ddq_ref": 3.0,
            "tau": [{"unit": "A", "gain": 2.0}, "N m"],
            "t": "ms",
            "inputs": {"u": 1.5},
        },
    )
    np.testing.assert_allclose(made.q, Q * [np.pi / 180, 1e-3], rtol=1e-15)
    np.testing.assert_allclose(made.q_ref, Q * 2 * np.pi / 100, rtol=1e-15)
    np.testing.assert_allclose(made.dq_ref, Q * 2 * np.pi / 60, rtol=1e-15)
    np.testing.assert_allclose(made.ddq_ref, Q * 3.0, rtol=1e-15)
    np.testing.assert_allclose(made.tau, TAU * [2.0, 1.0], rtol=1e-15)
    np.testing.assert_allclose(made.inputs["u"], TAU * 1.5, rtol=1e-15)
    assert made.rate == 1000.0 * RATE


def test_motor_side_signals_come_out_on_the_joint_side(tmp_path):
    motor_q, motor_tau = COUPLED.motor_positions(Q), COUPLED.motor_torques(TAU)
    motor_speed = Q @ COUPLED.reduction.T
    command = motor_tau / COUPLED.drive_gain
    np.savez(tmp_path / "log.npz", q=motor_q, tau=command, dq=motor_speed)
    made = load_recording(
        tmp_path / "log.npz",
        ARRAYS | {"q_ref": "q", "dq_ref": "dq"},
        units={"tau": "A"},
        side="motor",
        transmission=COUPLED,
        rate=RATE,
    )
    np.testing.assert_allclose(made.q, Q, atol=1e-13)
    np.testing.assert_allclose(made.q_ref, Q, atol=1e-13)
    np.testing.assert_allclose(made.dq_ref, Q, atol=1e-13)
    np.testing.assert_allclose(made.tau, TAU, atol=1e-13)


def test_sides_and_offsets_can_differ_by_channel(tmp_path):
    np.savez(tmp_path / "log.npz", q=Q, tau=COUPLED.motor_torques(TAU), q_ref=Q)
    arguments = (tmp_path / "log.npz", ARRAYS | {"q_ref": "q_ref"})
    options = {"side": {"tau": "motor"}, "transmission": COUPLED, "rate": RATE}
    made = load_recording(*arguments, **options)
    np.testing.assert_allclose(made.q, Q, atol=0.0)
    np.testing.assert_allclose(made.tau, TAU, atol=1e-12)
    moved = load_recording(*arguments, **options, position_offset=[1.0, -2.0])
    expected = Q + np.array([1.0, -2.0])
    np.testing.assert_allclose(moved.q, expected, atol=1e-15)
    np.testing.assert_allclose(moved.q_ref, expected, atol=1e-15)


def test_a_given_offset_replaces_the_transmissions(tmp_path):
    np.savez(tmp_path / "log.npz", q=COUPLED.motor_positions(Q), tau=TAU)
    made = load_recording(
        tmp_path / "log.npz",
        ARRAYS,
        side={"q": "motor"},
        transmission=COUPLED,
        rate=RATE,
        position_offset=[0.0, 0.0],
    )
    np.testing.assert_allclose(made.q, Q - COUPLED.position_offset, atol=1e-13)


def test_a_robot_gives_names_gains_and_sides(log):
    robot = load_robot("planar_2r")
    made = load_recording(log, ARRAYS, robot=robot, rate=RATE, control_rate=1000.0, delay=2e-3)
    assert made.joint_names == robot.joint_names
    assert (made.control_rate, made.delay) == (1000.0, 2e-3)
    with pytest.raises(RecordingError, match="does not suit the revolute joint"):
        load_recording(log, ARRAYS, robot=robot, rate=RATE, units={"q": "mm"})


def test_jitter_is_refused_or_resampled(tmp_path):
    t = T + np.random.default_rng(5).uniform(-1e-3, 1e-3, len(T))
    columns = ARRAYS | {"t": "t", "q_ref": "q", "inputs": {"u": "u"}}
    signals = {"q": np.column_stack([np.sin(t), np.cos(t)]), "tau": TAU}
    np.savez(tmp_path / "log.npz", t=t, u=np.round(TAU), **signals)
    with pytest.raises(IrregularSampling):
        load_recording(tmp_path / "log.npz", columns)
    made = load_recording(tmp_path / "log.npz", columns, rate=RATE, resample=True)
    assert made.rate == RATE
    np.testing.assert_allclose(made.q[:, 0], np.sin(made.t), atol=1e-9)
    np.testing.assert_array_equal(made.q, made.q_ref)
    assert set(np.unique(made.inputs["u"])) <= set(np.unique(np.round(TAU)))


def test_a_given_rate_overrides_coarse_stamps(tmp_path):
    np.savez(tmp_path / "log.npz", q=Q, tau=TAU, t=np.round(T + 3.0, 2))
    with pytest.raises(IrregularSampling) as caught:
        load_recording(tmp_path / "log.npz", ARRAYS | {"t": "t"})
    assert caught.value.kind == "duplicate"
    made = load_recording(tmp_path / "log.npz", ARRAYS | {"t": "t"}, rate=RATE)
    assert (made.rate, made.start_time) == (RATE, 3.0)


def test_saturation_is_judged_before_couplings_and_interpolation_blur_it(tmp_path):
    command = COUPLED.motor_torques(TAU)
    command[:, 1] = np.clip(command[:, 1], -0.01, 0.01)
    np.savez(tmp_path / "log.npz", q=COUPLED.motor_positions(Q), tau=command)
    options = {"side": "motor", "transmission": COUPLED, "rate": RATE}
    with pytest.raises(SaturatedSignal) as caught:
        load_recording(tmp_path / "log.npz", ARRAYS, **options)
    assert caught.value.joint == "joint_2"
    assert load_recording(tmp_path / "log.npz", ARRAYS, **options, saturation="allow").joints == 2


def test_a_bad_sample_is_named_with_joint_and_sample(tmp_path):
    wrong = TAU.copy()
    wrong[123, 1] = np.nan
    np.savez(tmp_path / "log.npz", q=Q, tau=wrong)
    options = {"rate": RATE, "joint_names": ["shoulder", "elbow"]}
    made = load_recording(tmp_path / "log.npz", ARRAYS, **options)
    assert np.argwhere(~made.valid).tolist() == [[123, 1]]
    assert "tau of elbow is empty, NaN or infinite at sample 123" in made.notes[0]
    wrong[:, 1] = np.nan
    np.savez(tmp_path / "log.npz", q=Q, tau=wrong)
    with pytest.raises(NonFiniteSamples, match=r"joint 'elbow'.*sample 0"):
        load_recording(tmp_path / "log.npz", ARRAYS, **options)


def test_a_bad_cell_is_named_with_file_line_and_column(tmp_path):
    write_csv(tmp_path / "run.csv", TABLE)
    lines = (tmp_path / "run.csv").read_text().splitlines()
    lines[42] = lines[42].rpartition(",")[0] + ",error"
    (tmp_path / "run.csv").write_text("\n".join(lines))
    with pytest.raises(BadCell, match=r"run\.csv, line 43, column 'tau2': 'error'"):
        load_recording(tmp_path / "run.csv", NAMES)


def test_a_log_is_made_strict(log):
    columns = ARRAYS | {"t": "t"}
    units = {"q": "deg", "tau": {"unit": "A", "gain": 2.0}}
    lenient = read_log(log, columns, units=units)
    assert not lenient.channels and np.array_equal(lenient.logged["q"], Q)
    made, read = recording_from(lenient), load_recording(log, columns, units=units)
    assert made.rate == read.rate == RATE and made.sources == read.sources
    for channel, values in read.channels().items():
        assert np.array_equal(made.channels()[channel], values)
    judged = described_log(log, columns, units=units)
    for channel, values in judged.channels.items():
        assert np.array_equal(values, read.channels()[channel])


def test_what_a_recording_refuses_is_a_fault_of_the_log(tmp_path):
    path = tmp_path / "log.csv"
    write_csv(path, TABLE)
    lines = path.read_text().splitlines()
    lines[7] = lines[7].rpartition(",")[0] + ",overflow"
    path.write_text("\n".join(lines))
    lenient = read_log(path, NAMES)
    (fault,) = lenient.faults
    assert isinstance(fault, BadCell) and (fault.line, fault.column) == (8, "tau2")
    assert np.flatnonzero(np.isnan(lenient.logged["tau"][:, 1])).tolist() == [6]
    with pytest.raises(BadCell, match="'overflow' is not a number"):
        recording_from(lenient)


def test_an_array_of_more_columns_than_joints_is_a_fault_of_the_log(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, q=np.hstack([Q, Q]), tau=TAU)
    lenient = read_log(path, {"q": "q", "tau": "tau"}, joint_names=("a", "b"), rate=RATE)
    assert lenient.logged["q"].shape == (600, 4) and lenient.joint_names == ("a", "b")
    with pytest.raises(RecordingError, match="no axis as long as there are joints"):
        recording_from(lenient)
    narrow = described_log(path, {"q": "q[:, :1]", "tau": "tau"}, joint_names=("a", "b"), rate=RATE)
    assert narrow.joint_names == ("a",) and narrow.channels["tau"].shape == (600, 1)


def test_channels_of_different_length_are_refused(tmp_path):
    np.savez(tmp_path / "log.npz", q=Q, tau=TAU[:-1], t=T[:-2])
    with pytest.raises(ShapeMismatch):
        load_recording(tmp_path / "log.npz", ARRAYS, rate=RATE)
    with pytest.raises(RecordingError, match="t has 598 samples, q has 600"):
        load_recording(tmp_path / "log.npz", {"q": "q", "tau": "q", "t": "t"})


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ({"tau": "tau"}, {"rate": RATE}, "no columns are given for q"),
        (ARRAYS | {"torque": "q"}, {"rate": RATE}, "'torque'"),
        (ARRAYS, {}, "or give the rate"),
        (ARRAYS, {"rate": RATE, "resample": True}, "resampling needs it"),
        (ARRAYS | {"t": "t"}, {"rate": 1000.0}, "stamps advance at 200 Hz"),
        (ARRAYS, {"rate": RATE, "units": {"q_ref": "deg"}}, "which has no columns"),
        (ARRAYS, {"rate": RATE, "units": {"q": ["deg"]}}, "1 units for 2 joint"),
        (ARRAYS, {"rate": RATE, "units": {"tau": "A"}}, "without a gain"),
        (ARRAYS, {"rate": RATE, "side": "motor"}, "give a robot or a transmission"),
        (ARRAYS, {"rate": RATE, "side": "link"}, "choose joint or motor"),
        (ARRAYS, {"rate": RATE, "side": {"current": "motor"}}, "side of current"),
        (ARRAYS, {"rate": RATE, "position_offset": [1.0]}, "one number for each"),
        (ARRAYS, {"rate": RATE, "joint_names": ["a", "b", "c"]}, "no axis"),
        (ARRAYS, {"rate": RATE, "robot": load_robot("staubli_tx40")}, "no axis"),
        (
            ARRAYS,
            {"rate": RATE, "joint_names": ["a", "b"], "robot": load_robot("staubli_tx40")},
            "has 6 joint",
        ),
        ({"q": "q[:, 0]", "tau": "tau"}, {"rate": RATE, "joint_names": ["a"]}, "2 column|no axis"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(log, columns, options, message):
    with pytest.raises(RecordingError, match=message):
        load_recording(log, columns, **options)


def test_unknown_columns_and_files_are_named(tmp_path, log):
    with pytest.raises(UnknownColumn, match="did you mean tau"):
        load_recording(log, {"q": "q", "tau": "tua"}, rate=RATE)
    with pytest.raises(FileFormatError, match="cannot be opened"):
        load_recording(tmp_path / "missing.npz", ARRAYS, rate=RATE)


@pytest.mark.parametrize(("channel", "unit"), [("q", None), ("q_ref", "rad")])
def test_degrees_taken_for_radians_are_refused(tmp_path, channel, unit):
    angles = {"q": Q, "q_ref": Q} | {channel: np.rad2deg(Q)}
    np.savez(tmp_path / "log.npz", tau=TAU, **angles)
    columns = ARRAYS | {"q_ref": "q_ref"}
    arguments = {"robot": load_robot("planar_2r"), "rate": RATE}
    with pytest.raises(RecordingError) as caught:
        load_recording(tmp_path / "log.npz", columns, units=unit and {channel: unit}, **arguments)
    message = str(caught.value)
    assert f"{channel} of joint 'shoulder' reaches 57.3 rad" in message
    assert "-2.967 to 2.967 rad" in message and f'units = {{{channel} = "deg"}}' in message
    load_recording(tmp_path / "log.npz", columns, units={channel: "deg"}, **arguments)
    with pytest.raises(RecordingError, match="check the unit 'rev', position_offset"):
        load_recording(tmp_path / "log.npz", columns, units={channel: "rev"}, **arguments)
    with pytest.raises(RecordingError, match="check the unit 'rev'"):
        load_recording(tmp_path / "log.npz", columns, units={channel: ["deg", "rev"]}, **arguments)


def test_amperes_need_a_gain_that_somebody_gave(log):
    robot = load_robot("planar_2r")
    options = {"robot": robot, "rate": RATE}
    said = r"joint 'shoulder' is a drive command in 'A'.*gain =.*`pivident gains`.*--in-log-units"
    with pytest.raises(RecordingError, match=said):
        load_recording(log, ARRAYS, units={"tau": "A"}, **options)
    half = with_drives(robot, drive_gain={"shoulder": 2.0})
    with pytest.raises(RecordingError, match=r"joint 'elbow'.*drive_gain under \[robot\]"):
        load_recording(log, ARRAYS, units={"tau": "A"}, robot=half, rate=RATE)
    made = load_recording(log, ARRAYS, units={"tau": ["A", "N m"]}, robot=half, rate=RATE)
    np.testing.assert_allclose(made.tau, TAU * [2.0, 1.0])
    load_recording(log, ARRAYS, units={"tau": {"unit": "A", "gain": 1.0}}, **options)


def test_milliseconds_taken_for_seconds_are_refused(tmp_path):
    np.savez(tmp_path / "log.npz", q=Q, tau=TAU, t=1e3 * T)
    with pytest.raises(RecordingError, match=r'a rate of 0\.2 Hz; are they in ms.*t = "ms"'):
        load_recording(tmp_path / "log.npz", ARRAYS | {"t": "t"})
    for unit, rate in (("ms", 200.0), ("s", 0.2)):
        made = load_recording(tmp_path / "log.npz", ARRAYS | {"t": "t"}, units={"t": unit})
        assert made.rate == pytest.approx(rate)


def test_missing_columns_name_the_joints_and_how_to_freeze_one(log):
    columns = {"q": ["q[:, 0]"], "tau": "tau"}
    with pytest.raises(RecordingError) as caught:
        load_recording(log, columns, rate=RATE, robot=load_robot("planar_2r"))
    assert "q lists 1 column(s) for 2 joint(s) (shoulder, elbow)" in str(caught.value)
    assert "frozen = {elbow = 0.0} under [robot]" in str(caught.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"units": "deg"}, r"units is 'deg'; give a table by channel"),
        ({"robot": "x.urdf"}, r"give a Robot, such as load_robot\('x.urdf'\)"),
        ({"dely": 0.1}, "no option 'dely'; did you mean 'delay'"),
        ({"transmision": None}, "did you mean 'transmission'"),
        ({"tau": TAU}, "no option 'tau'"),
    ],
)
def test_arguments_of_another_kind_are_refused(log, options, message):
    with pytest.raises(RecordingError, match=message):
        load_recording(log, ARRAYS, rate=RATE, **options)
    with pytest.raises(RecordingError, match="columns is 'q'"):
        load_recording(log, "q", rate=RATE)


def test_a_log_without_torque_is_read(log):
    columns = {key: spec for key, spec in ARRAYS.items() if key != "tau"}
    np.savez(log.parent / "positions.npz", q=Q)
    made = load_recording(log.parent / "positions.npz", columns, rate=RATE)
    np.testing.assert_array_equal(made.q, Q)
    assert made.torque_source == "none"
    assert "tau" not in made.reading["columns"]
