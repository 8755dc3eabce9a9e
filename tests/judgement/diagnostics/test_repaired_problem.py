"""A repair of samples that were read, and of the file they are read from, give one problem."""

import numpy as np
import pytest

from pivident.experiment.edited_file import with_repair
from pivident.experiment.experiment import load_experiment
from pivident.experiment.explained import plain_form
from pivident.experiment.repairs import FileContent, edits_of
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.repair import (
    Edit,
    LeftOut,
    Multiplied,
    NotRead,
    Reordered,
    Repair,
    Retimed,
    Reversed,
    Shifted,
    setting,
)
from pivident.judgement.diagnostics.repaired_problem import repaired
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 100.0, 12.0, 0.0, 0.005, "true", 0.8)

FILE = """
robot = "arm.urdf"

[recording]
files = "log.csv"
columns = {t = "t", q = ["q_1", "q_2", "q_3"], dq = ["dq_1", "dq_2", "dq_3"], tau = ["tau_1", "tau_2", "tau_3"]}
"""  # noqa: E501


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("repaired")
    log = make_log(2, SETTING, joints=3)
    (path / "arm.urdf").write_text(log.arm.urdf)
    channels = {"q": log.q, "dq": log.dq, "tau": log.tau}
    names = ["t", *(f"{c}_{k}" for c in channels for k in (1, 2, 3))]
    table = np.column_stack([log.t, *channels.values()])
    np.savetxt(path / "log.csv", table, delimiter=",", header=",".join(names), comments="")
    return path


REPAIRS = {
    "sign": lambda a, b: Reversed(channel="tau", joints=(a,)),
    "signs": lambda a, b: Reversed(channel="", joints=(b,)),
    "factor": lambda a, b: Multiplied(channel="tau", factors=((a, 0.5), (b, 2.0))),
    "unit": lambda a, b: Multiplied(channel="q", factors=((a, 0.25),)),
    "order": lambda a, b: Reordered(channel="tau", order=(1, 0, 2)),
    "order of all": lambda a, b: Reordered(channel="", order=(0, 2, 1)),
    "zero": lambda a, b: Shifted(offsets=((b, 0.5),)),
    "clock": lambda a, b: Retimed(factor=2.0),
    "delay": lambda a, b: Edit(("recording", "delay"), 0.01),
    "part": lambda a, b: Edit(("recording", "part"), [2.0, 9.0]),
    "gravity": lambda a, b: Edit(("robot", "gravity"), [9.81, 0.0, 0.0]),
    "speeds": lambda a, b: NotRead(channel="dq"),
}


@pytest.mark.parametrize("zeros", ["", "position_offset = [0.4, -0.2, 0.3]"])
@pytest.mark.parametrize("name", REPAIRS)
def test_samples_and_file_agree(folder, name, zeros):
    text = f"{FILE}{zeros}\n"
    path = folder / f"{name.replace(' ', '_')}.toml"
    path.write_text(text)
    experiment = load_experiment(path)
    given = experiment.problem()
    repair = Repair((REPAIRS[name](*given.robot.joint_names[:2]),))
    path.write_text(with_repair(text, repair, given.robot.joint_names)[0])
    read, made = load_experiment(path).problem(), repaired(given, repair)
    (a,), (b,) = read.recordings, made.recordings
    for channel in ("q", "tau", "dq"):
        left, right = getattr(a, channel), getattr(b, channel)
        assert (left is None) == (right is None)
        if left is not None:
            np.testing.assert_allclose(left, right, rtol=1e-5, atol=1e-12)
    assert a.rate == pytest.approx(b.rate)
    assert (a.delay, a.torque_timing) == (b.delay, b.torque_timing)
    np.testing.assert_array_equal(read.robot.gravity, made.robot.gravity)


def test_what_only_the_file_can_do_is_refused(folder):
    path = folder / "refused.toml"
    path.write_text(FILE)
    given = load_experiment(path).problem()
    for edit in (LeftOut(at=(("joint_1", 0.0),)), Edit(("recording", "files"), "other.csv")):
        with pytest.raises(ExperimentError, match="read the log again"):
            repaired(given, Repair((edit,)))


def test_a_clock_without_stamps_is_a_rate():
    content = plain_form({"robot": "arm.urdf", "recording": {"files": "a.csv", "rate": 100.0}})
    repair = Repair((Retimed(factor=2.0),)).below(("recording", 0))
    assert edits_of(repair, FileContent(content, ())).edits == ((("recording", 0, "rate"), 50.0),)
    without = plain_form({"robot": "arm.urdf", "recording": {"files": "a.csv"}})
    with pytest.raises(ExperimentError, match="neither stamps nor a rate"):
        edits_of(repair, FileContent(without, ()))


def test_a_part_outside_of_the_record_is_an_error(folder):
    path = folder / "outside.toml"
    path.write_text(FILE)
    with pytest.raises(Exception, match="no sample"):
        repaired(load_experiment(path).problem(), setting("part", value=[100.0, 200.0]))


def test_times_on_the_stamps_change_with_the_clock():
    content = plain_form(
        {"robot": "arm.urdf", "recording": {"files": "a.csv", "columns": {"t": "t"},
                                            "part": [1.0, 5.0], "delay": 0.01}}
    )  # fmt: skip
    repair = Repair((Retimed(factor=2.0),)).below(("recording", 0))
    edits = {place[2:]: value for place, value in edits_of(repair, FileContent(content, ())).edits}
    assert edits == {("units", "t"): 2.0, ("part",): [2.0, 10.0], ("delay",): 0.02}
