"""Logs that identification would refuse are read all the same, and columns told by name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pivident.data.logs.described_log import bare_log, described_log
from pivident.data.logs.recognition.channel_words import plain_channel
from pivident.data.logs.recognition.log_clock import column_series
from pivident.experiment.check.audit_file import audit_file
from pivident.foundation.errors import (
    ExperimentError,
    FileFormatError,
    RecordingError,
    UnknownColumn,
)
from pivident.judgement.audit.audit import audit_log
from pivident.robot.gallery import load_robot
from tests.judgement.audit.logs import delayed, planar, serious
from tests.planar_log import EXPERIMENT, write_experiment


def channel_of(name):
    """Channel and joint of a single column."""
    (series,) = column_series([name])
    assert series.channel == plain_channel(name)
    (key,) = series.columns
    return series.channel and (series.channel, " ".join((*series.reading.strange, key)))


def recognise_columns(folder, names, robot=None):
    """Columns of each channel, one per joint, and the joints, as a bare log has them."""
    table = np.random.default_rng(0).normal(size=(40, len(names)))
    path = folder / "log.csv"
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    log = bare_log(path, robot)
    found = {
        kind: [names[int(np.flatnonzero((table.T == own).all(axis=1))[0])] for own in values.T]
        for kind, values in log.logged.items()
    }
    return found, list(log.joint_names)


def test_names_of_columns(tmp_path):
    assert channel_of("q1") == ("q", "1")
    assert channel_of("r2") == ("q_ref", "2")
    assert channel_of("tau[:, 3]") == ("tau", "3")
    assert channel_of("- arm_3_joint_effort") == ("tau", "arm 3")
    assert channel_of("position_ref_4") == ("q_ref", "4")
    assert channel_of("joint2_velocity") == ("dq", "2")
    assert channel_of("temperature") is None
    channels, joints = recognise_columns(tmp_path, ["tau2", "tau1", "q1", "q2", "r1", "note"])
    assert channels == {"q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
    assert joints == ["joint_1", "joint_2"]


def test_columns_of_recorders_are_told_by_what_they_differ_in(tmp_path):
    signals = ("target_q", "actual_q", "actual_qd", "actual_current", "actual_TCP_pose")
    names = ["timestamp", *(f"{signal}_{j}" for signal in signals for j in range(6))]
    channels, joints = recognise_columns(tmp_path, names)
    assert channels["q"] == [f"actual_q_{j}" for j in range(6)]
    assert channels["tau"] == [f"actual_current_{j}" for j in range(6)]
    assert channels["dq"] == [f"actual_qd_{j}" for j in range(6)]
    assert channels["q_ref"] == [f"target_q_{j}" for j in range(6)]
    assert joints == [f"joint_{j}" for j in range(6)]
    # Two arms in one log: nothing says which.
    two = [
        f"{arm}_{kind}_{j}" for arm in ("left", "right") for kind in ("q", "tau") for j in (1, 2)
    ]
    assert recognise_columns(tmp_path, two) == ({}, [])


def test_joints_in_words_of_their_own_and_of_one_arm(tmp_path):
    hips = ["q_hip", "q_knee", "tau_hip", "tau_knee"]
    channels, joints = recognise_columns(tmp_path, hips, load_robot("planar_2r"))
    assert channels == {"q": hips[:2], "tau": hips[2:]} and joints == ["shoulder", "elbow"]
    # Of two arms the one that has torques too.
    left = ["left_q_1", "left_q_2", "left_tau_1", "left_tau_2"]
    channels, _ = recognise_columns(tmp_path, ["right_q_1", "right_q_2", *left])
    assert channels == {"q": left[:2], "tau": left[2:]}
    # Columns of whatever are no positions, even beside torques.
    assert recognise_columns(tmp_path, ["gas_1", "gas_2", "tau_1", "tau_2"]) == ({}, [])


def test_bare_csv_with_a_robot(tmp_path):
    path = write_experiment(tmp_path).with_name("log.csv")
    (audit,) = audit_file(path, load_robot("planar_2r"))
    kinds = {(severity, kind) for severity, kind, _ in serious(audit)}
    assert kinds == {("error", "reach"), ("error", "angle unit")}  # the log is in degrees
    assert audit.of("reading")[0].message.startswith("Columns were recognised by their names")
    (without,) = audit_file(path)
    assert serious(without) == set()
    assert "no robot is given" in without.of("reading")[-1].message


def test_experiment_file_and_log_with_experiment(tmp_path):
    experiment = write_experiment(tmp_path)
    (audit,) = audit_file(experiment)
    assert serious(audit) == set()
    other = tmp_path / "other.csv"
    other.write_text((tmp_path / "log.csv").read_text())
    (named,) = audit_file(other, experiment=experiment)
    assert serious(named) == set() and named.log.name == "other.csv"
    with pytest.raises(RecordingError, match="names robot and columns itself"):
        audit_file(experiment, load_robot("planar_2r"))
    with pytest.raises(ExperimentError):
        audit_file(tmp_path / "missing.toml")


def test_cells_that_are_no_numbers(tmp_path):
    path = write_experiment(tmp_path).with_name("log.csv")
    lines = path.read_text().splitlines()
    broken = lines[100].split(",")
    broken[1] = ""
    lines[100] = ",".join(broken)
    lines[200] = lines[200].replace(lines[200].split(",")[5], "overflow", 1)
    path.write_text("\n".join(lines))
    (audit,) = audit_file(tmp_path / "experiment.toml")
    missing = {f.subject: f.sample for f in audit.findings if f.kind == "missing"}
    assert missing == {"q of shoulder": 99, "tau of shoulder": 199}
    assert audit.delay is not None


def test_clock_in_milliseconds_is_understood(tmp_path):
    path = tmp_path / "log.csv"
    log = planar()
    t = np.arange(log.samples)
    table = np.column_stack([t, log.channels["q"], log.channels["tau"]])
    np.savetxt(path, table, delimiter=",", header="t_ms,q1,q2,tau1,tau2", comments="", fmt="%.12g")
    audit = audit_log(bare_log(path, load_robot("planar_2r")))
    assert audit.timing.rate == pytest.approx(1000.0)
    assert any("taken for ms" in note for note in audit.log.notes)
    assert serious(audit) == set()


def test_irregular_clock_does_not_stop_the_rest(tmp_path):
    path = tmp_path / "log.npz"
    log = planar()
    rows = np.delete(np.arange(log.samples), np.s_[3000:3060])
    t = rows * 1e-3
    t[100] = t[99]
    tau = np.column_stack([delayed(x, 10) for x in log.channels["tau"].T])
    np.savez(path, time=t, q=log.channels["q"][rows], tau=tau[rows])
    audit = audit_log(bare_log(path, load_robot("planar_2r")))
    kinds = {kind for _, kind, _ in serious(audit)}
    assert {"gap", "rows left out", "late"} <= kinds
    assert audit.delay.common[0] == pytest.approx(0.01, abs=2e-4)


def test_speed_that_was_filtered_or_scaled(tmp_path):
    log = planar()
    rate = 1000.0
    speed = np.gradient(log.channels["q"], 1 / rate, axis=0)
    filtered = np.zeros_like(speed)
    for k in range(1, len(speed)):
        filtered[k] = 0.95 * filtered[k - 1] + 0.05 * speed[k]
    for name, dq in (("true", speed), ("filtered", filtered), ("degrees", np.rad2deg(speed))):
        path = tmp_path / f"{name}.npz"
        np.savez(
            path, t=np.arange(len(dq)) / rate, q=log.channels["q"], tau=log.channels["tau"], dq=dq
        )
        audit = audit_log(bare_log(path, log.robot))
        found = audit.of("speed")
        assert len(found) == 2
        severity = {"true": "ok", "filtered": "warning", "degrees": "error"}[name]
        assert {f.severity for f in found} == {severity}
        assert {f.place for f in found} == {("recording", "columns", "dq")}
        if name == "filtered":  # the lag of 0.95/0.05 is 19 samples at low frequency
            lag = float(found[0].message.split("(")[1].split(" ")[0])
            assert 15 < lag < 20
        if name == "degrees":
            assert found[0].quantity.value == pytest.approx(180 / np.pi, rel=1e-3)


def test_unknown_columns_and_files(tmp_path):
    path = write_experiment(tmp_path).with_name("log.csv")
    with pytest.raises(UnknownColumn):
        described_log(path, {"q": ["q1", "q9"], "tau": ["tau1", "tau2"]})
    with pytest.raises(FileFormatError):
        bare_log(tmp_path / "nothing.csv")
    with pytest.raises(FileFormatError):
        bare_log(Path(__file__))
    text = EXPERIMENT.replace("tau2", "tau7")
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(UnknownColumn, match="tau7"):
        audit_file(tmp_path / "bad.toml")


def test_fewer_samples_than_any_check_needs():
    from tests.judgement.audit.logs import only_rows

    for samples in (1, 2, 3, 10, 60):
        audit = audit_log(only_rows(planar(), np.arange(samples)))
        assert audit.model is None


def test_units_in_the_names_of_columns_are_used(tmp_path):
    """Degrees, millimetres and amperes, by the joint; what has no unit is in SI."""
    rng = np.random.default_rng(1)
    table = rng.normal(size=(60, 7))
    names = ["t", "A1.Pos [deg]", "A2.Pos [mm]", "A1.Trq [Nm]", "A2.Trq [kN]", "r1", "r2"]
    path = tmp_path / "log.csv"
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    log = bare_log(path)
    assert np.allclose(log.channels["q"], table[:, 1:3] * [np.pi / 180.0, 1e-3])
    assert np.allclose(log.channels["tau"], table[:, 3:5] * [1.0, 1e3])
    assert np.allclose(log.channels["q_ref"], table[:, 5:7])
    assert np.array_equal(log.logged["q"], table[:, 1:3]) and log.commands == ()


def test_currents_of_a_bare_log_are_commands_without_a_gain(tmp_path):
    table = np.random.default_rng(1).normal(size=(60, 4))
    path = tmp_path / "log.csv"
    for names, factor in (
        ("q1,q2,i1 [A],i2 [A]", 1.0),
        ("q_1,q_2,current_1,current_2", 1.0),
        ("q1,q2,i1 [mA],i2 [mA]", 1e-3),
    ):
        np.savetxt(path, table, fmt="%.17g", delimiter=",", header=names, comments="")
        log = bare_log(path)
        assert log.commands == (0, 1), names
        assert np.allclose(log.channels["tau"], factor * table[:, 2:])


def test_a_log_without_torque_is_audited_as_far_as_it_goes():
    log = planar()
    channels = {"q": log.channels["q"]}
    audit = audit_log(replace(log, logged=channels, channels=channels))
    assert audit.model is None
    (left_out,) = [f for f in audit.findings if f.kind == "no torque"]
    assert left_out.severity == "note"
    assert "[controller]" in left_out.next_step
    assert serious(audit) == {("note", "no torque", "")}
    turns = {"q": np.rad2deg(channels["q"])}
    wrong = audit_log(replace(log, logged=turns, channels=turns))
    assert "reach" in [f.kind for f in wrong.findings]


@pytest.mark.parametrize("name", ["tau", "channel"])
def test_a_log_without_positions_is_not_ok(tmp_path, name):
    """Clock and columns are in order, but nothing that is worth knowing was judged."""
    table = np.column_stack(
        [np.arange(500) / 100.0, np.random.default_rng(0).normal(size=(500, 6))]
    )
    header = ",".join(["t", *(f"{name}_{k}" for k in range(1, 7))])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="")
    (audit,) = audit_file(tmp_path / "log.csv")
    (finding,) = [f for f in audit.findings if f.severity == "error"]
    assert finding.message.startswith("log.csv has no positions") and f"{name}_3" in finding.message
    assert audit.severity == "error"


def test_a_last_row_that_breaks_off_behind_its_stamp(tmp_path):
    path = tmp_path / "log.csv"
    table = np.column_stack(
        [np.arange(300) / 500.0, *np.random.default_rng(0).normal(size=(4, 300))]
    )
    rows = ["t,q1,q2,tau1,tau2", *(",".join(map(str, row)) for row in table.tolist()), "0.6"]
    path.write_text("\n".join(rows), encoding="utf-8")
    columns = {"q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
    log = described_log(path, columns, robot=load_robot("planar_2r"), rate=500.0)
    assert log.clock is not None and len(log.clock) == len(log.channels["q"]) == 300
