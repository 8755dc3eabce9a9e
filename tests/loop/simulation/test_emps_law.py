"""The EMPS drive's law, recomputed from the recorded reference and position."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.data.recording.public_records import EMPS, load_emps, load_emps_pulses
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import Cascade
from tests.loop.simulation.loops import command_of, nominal_model

pytestmark = pytest.mark.record

GAIN = EMPS["units"]["tau"]["gain"]
LAW = Cascade([160.18], [243.45], averaged=True)
RATE = 1000.0


def recomputed(record):
    """Drive input from the law on the recorded signals [V]."""
    law = LAW.law(RATE, record.q_ref, np.zeros_like(record.q_ref))
    return law.reference[:, 0] - lfilter(law.feedback[0], law.pole[0], record.q[:, 0])


@pytest.fixture(scope="module")
def record(data_dir):
    return load_emps(data_dir / "emps" / "DATA_EMPS.mat")


@pytest.fixture(scope="module")
def pulses(data_dir):
    return load_emps_pulses(data_dir / "emps" / "DATA_EMPS_PULSES.mat")


def test_the_recorded_drive_input_follows_to_one_count_of_the_encoder(record):
    recorded = record.tau[:, 0] / GAIN
    difference = (recomputed(record) - recorded)[2:]  # two samples lack their history
    assert np.sqrt(np.mean(difference**2)) < 0.004
    plain = command_of(LAW, RATE, record.q[:, 0].tolist(), record.q_ref[:, 0].tolist(), None)
    np.testing.assert_allclose(plain[2:], recomputed(record)[2:], atol=1e-9)


def test_pulses_are_added_to_the_drive_input(pulses):
    recorded = pulses.tau[:, 0] / GAIN
    difference = (recomputed(pulses) + pulses.inputs["pulses"][:, 0] - recorded)[2:]
    assert np.sqrt(np.mean(difference**2)) < 0.005


@pytest.mark.parametrize(("name", "bound"), [("record", 2.0e-6), ("pulses", 3.0e-6)])
def test_the_simulated_machine_stays_within_micrometres_of_the_real_one(name, bound, request):
    measured = request.getfixturevalue(name)
    robot, model = nominal_model("emps")
    inputs = measured.inputs.get("pulses")
    signals = LoopSignals(
        RATE, measured.q_ref, None, inputs, None, np.array([GAIN]), np.array([10.0]),
        np.array([0.1]), np.array([10.0]),
    )  # fmt: skip
    made = simulate(model, LAW, signals, robot.joint_names, (measured.q[0], np.zeros(1)))
    difference = (made.q - measured.q)[100:]
    assert np.sqrt(np.mean(difference**2)) < bound
