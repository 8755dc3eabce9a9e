import numpy as np
import pytest

from pivident.data.recording.checks import clipped_samples
from pivident.data.recording.datasets import dataset_files
from pivident.data.recording.load import load_recording
from pivident.data.recording.public_records import (
    EMPS,
    KR300_TRANSMISSION,
    load_emps,
    load_emps_pulses,
    load_kuka_kr300,
    load_staubli_tx40,
)
from pivident.foundation.errors import IrregularSampling, RecordingError
from pivident.robot.gallery import load_robot

pytestmark = pytest.mark.record


@pytest.fixture(autouse=True)
def local(data_dir, monkeypatch):
    monkeypatch.setenv("PIVIDENT_DATA", str(data_dir))


def test_the_tx40_moves_through_its_published_joint_ranges():
    made = load_staubli_tx40()
    assert (made.samples, made.joints, made.rate, made.torque_timing) == (45_000, 6, 5000.0, "held")
    # The published ranges count joints 2 and 3 from a zero that is a quarter turn away.
    turn = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
    lowest, highest = (made.q + turn).min(axis=0), (made.q + turn).max(axis=0)
    np.testing.assert_allclose(lowest, [-1.75, -1.64, -0.79, -4.19, -1.57, -3.49], atol=6e-3)
    np.testing.assert_allclose(highest, [2.10, 0.35, 2.10, 1.40, 1.88, 3.49], atol=6e-3)


def test_the_tx40_is_supplied_with_its_published_energy():
    made = load_staubli_tx40()
    speed = np.gradient(made.q, made.dt, axis=0)
    energy = (made.tau * speed).sum(axis=0) * made.dt
    assert energy.sum() == pytest.approx(1690.0, rel=5e-3)
    assert np.all(energy > 0.0)
    assert made.slice(8.0, 9.0).tau[:, 1].mean() == pytest.approx(-26.0, abs=1.0)


def test_the_emps_drive_input_follows_from_its_control_law():
    for made, residual in ((load_emps(), 0.0040), (load_emps_pulses(), 0.0050)):
        assert (made.samples, made.rate, made.joint_names) == (24_841, 1000.0, ("carriage",))
        filtered = 0.5 * (made.q[1:] + made.q[:-1])
        speed = np.diff(filtered, axis=0) / made.dt
        law = 243.45 * (160.18 * (made.q_ref - made.q)[2:] - speed)
        law += sum(values[2:] for values in made.inputs.values())
        difference = law - made.tau[2:] / 35.15065188248547
        assert np.sqrt(np.mean(difference**2)) < residual


def test_the_gain_of_the_emps_record_is_the_gallerys():
    gain = load_robot("emps").transmission.drive_gain
    assert gain.tolist() == [EMPS["units"]["tau"]["gain"]]


@pytest.mark.parametrize("motion", ["A", "B"])
def test_the_kr300_follows_its_reference(motion):
    made = load_kuka_kr300(motion)
    assert (made.samples, made.joints, made.rate) == (2501, 6, 250.0)
    assert np.abs(made.q - made.q_ref)[:, :3].max() < np.deg2rad(0.5)
    np.testing.assert_allclose(made.q_ref[0], [0, -np.pi / 2, np.pi / 2, 0, 0, 0], atol=1e-9)
    speed = np.gradient(made.q_ref, made.dt, axis=0)
    np.testing.assert_allclose(made.dq_ref[5:-5], speed[5:-5], atol=0.02)
    motor_torque = KR300_TRANSMISSION.motor_torques(made.tau)
    assert np.corrcoef(motor_torque[:, 0], made.inputs["feed_forward"][:, 0])[0, 1] > 0.9


def test_the_kr300_has_no_third_motion_here():
    with pytest.raises(RecordingError, match="A and B"):
        load_kuka_kr300("C")


@pytest.mark.parametrize("load", [load_staubli_tx40, load_emps, load_emps_pulses, load_kuka_kr300])
def test_real_records_are_not_taken_for_saturated(load):
    made = load()
    for j in range(made.joints):
        assert not clipped_samples(made.tau[:, j], made.q[:, j]).any()


def test_the_tiago_log_is_irregular_and_can_be_resampled():
    joints = ["torso_lift", *(f"arm_{i}" for i in range(1, 8))]
    files = dataset_files("tiago", "q", "tau")
    columns = {
        "q": [f"- {joint}_joint_position" for joint in joints],
        "tau": [f"- {joint}_joint_effort" for joint in joints],
        "t": {"file": "q", "columns": "t"},
    }
    with pytest.raises(IrregularSampling) as caught:
        load_recording(files, columns, joint_names=joints)
    assert caught.value.kind == "jitter"
    made = load_recording(files, columns, joint_names=joints, rate=100.0, resample=True)
    assert made.duration == pytest.approx(80.2, abs=0.05)
