"""A recording with a second encoder: the same checks, units and zero as the first."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.load import load_recording
from pivident.data.recording.public_records import load_kuka_kr300
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import NonFiniteSamples, RecordingError, ShapeMismatch
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission


def signals():
    t = np.arange(200) / 100
    q = np.column_stack([np.sin(t), np.cos(t)])
    return t, q, q**2 + 1


def test_it_is_checked_cut_and_read_only():
    _, q, tau = signals()
    made = Recording("run", ("a", "b"), q, tau, 100.0, q_link=q - 1e-3)
    np.testing.assert_array_equal(made.part(10, 60).q_link, q[10:60] - 1e-3)
    assert "q_link" in made.channels() and not made.q_link.flags.writeable
    with pytest.raises(ShapeMismatch):
        replace(made, q_link=q[:, :1])
    broken = q.copy()
    broken[7, 1] = np.nan
    with pytest.raises(NonFiniteSamples, match="q_link of joint 'b'"):
        replace(made, q_link=broken)


def test_it_is_read_in_its_unit_and_shares_the_zero_of_the_motor(tmp_path):
    t, q, tau = signals()
    ratio = np.diag([100.0, 50.0])
    np.savez(tmp_path / "log.npz", t=t, m=q @ ratio, link=np.rad2deg(q) + 0.1, tau=tau)
    gear = Transmission(ratio, np.ones(2), np.array([0.5, -0.5]))
    made = load_recording(
        tmp_path / "log.npz",
        {"t": "t", "q": "m", "tau": "tau", "q_link": "link"},
        units={"q_link": "deg"},
        side={"q": "motor", "tau": "joint"},
        transmission=gear,
    )
    np.testing.assert_allclose(made.q, q + np.array([0.5, -0.5]))
    np.testing.assert_allclose(made.q_link - made.q, np.deg2rad(0.1))


def test_its_side_cannot_be_the_motor(tmp_path):
    t, q, tau = signals()
    np.savez(tmp_path / "log.npz", t=t, q=q, tau=tau)
    with pytest.raises(RecordingError, match="its side is joint"):
        load_recording(
            tmp_path / "log.npz",
            {"t": "t", "q": "q", "tau": "tau", "q_link": "q"},
            side={"q_link": "motor"},
        )


@pytest.mark.record
def test_the_kr300s_first_axes_have_it(public_data):
    robot = load_robot("examples/kuka_kr300/kuka_kr300_axes_1_3.toml")
    made = load_kuka_kr300("A", robot=robot)
    assert made.q_link.shape == made.q.shape
    assert np.rad2deg(np.abs(made.q_link - made.q).max()) < 0.4
    assert load_kuka_kr300("A").q_link is None
