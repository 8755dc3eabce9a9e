"""A leg fitted once for all tests of the package."""

from collections import namedtuple

import pytest

from pivident.experiment.experiment import load_experiment
from pivident.studies.simulators.simulator_of_experiment import simulator_of
from tests.studies.simulators.leg import write_leg

Fitted = namedtuple("Fitted", "folder truth fit file judged")


@pytest.fixture(scope="session")
def leg(tmp_path_factory):
    folder = tmp_path_factory.mktemp("leg")
    truth = write_leg(folder)
    experiment = load_experiment(folder / "leg.toml")
    return Fitted(folder, truth, *simulator_of(experiment, "mjcf", folder / "out"))
