"""A law cannot be found without a torque, nor from one that a law gave."""

import numpy as np
import pytest

from pivident.estimation.control_law.identified_law import identify_controller
from pivident.estimation.control_law.unknown_loop import feedback_from_noise, reconstruct_loop
from pivident.estimation.drives.drive_gains import identify_drive_gains
from pivident.estimation.drives.log_units import identify_in_log_units
from pivident.estimation.drives.motor_temperature import identify_motor_temperature
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import RecordingError
from pivident.linear.free_law import identify_free_law
from pivident.studies.flexibility.compliance import identify_compliances
from pivident.studies.flexibility.resonance import find_resonance
from pivident.studies.flexibility.two_mass import identify_two_mass
from tests.positions_only import write_positions


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return load_experiment(write_positions(tmp_path_factory.mktemp("log"))).problem()


@pytest.mark.parametrize(
    "find",
    [
        lambda p: identify_controller(p.recordings),
        lambda p: feedback_from_noise(p.recordings[0], np.ones(2)),
        lambda p: reconstruct_loop(p.robot, p.recordings),
        lambda p: identify_free_law(p.recordings[0]),
        identify_drive_gains,
        identify_in_log_units,
        identify_motor_temperature,
        lambda p: find_resonance(p.recordings[0]),
        lambda p: identify_compliances(p.recordings[0], np.ones(2), np.ones(2)),
        lambda p: identify_two_mass(p.recordings[0]),
    ],
)
def test_it_asks_for_a_measured_torque(find, problem):
    with pytest.raises(RecordingError, match="no measured torque"):
        find(problem)
