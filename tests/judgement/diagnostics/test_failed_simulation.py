"""Errors of simulations that fail name the cause and the log's faults, each once."""

from dataclasses import replace

import numpy as np
import pytest

import pivident as pv
from pivident.estimation.identify import identify
from pivident.foundation.errors import SimulationDiverged
from pivident.judgement.diagnostics.failed_simulation import explain, explained_failures
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import read_scenario
from tests.judgement.validation.test_missing_inertia import ARM

METHOD = pv.InstrumentalVariables(pv.RandomWalk(), start="initial")


@pytest.fixture(scope="module")
def turned():
    """A record whose torque has the other sign, of an arm described without rotors."""
    problem = Bench(read_scenario(ARM, "arm")).problem(0)
    robot = replace(problem.robot, rotor_inertia=np.zeros(2))
    recordings = tuple(replace(own, tau=-own.tau) for own in problem.recordings)
    return replace(problem, robot=robot, initial={}, recordings=recordings)


def notes_of(run) -> list[str]:
    with pytest.raises(SimulationDiverged) as caught:
        run()
    return list(getattr(caught.value, "__notes__", ()))


def test_the_front_explains_what_the_estimation_only_raises(turned):
    assert notes_of(lambda: identify(turned, METHOD)) == []
    cause, *faults = notes_of(lambda: pv.identify(turned, METHOD))
    assert "can be simulated" in cause or "rotor" in cause
    assert any("sign" in fault for fault in faults)


def test_it_is_explained_once(turned):
    def run():
        with explained_failures(), explained_failures():
            identify(turned, METHOD)

    assert notes_of(run) == notes_of(lambda: pv.identify(turned, METHOD))


def test_other_notes_come_after(turned):
    try:
        identify(turned, METHOD)
    except SimulationDiverged as error:
        error.add_note("of the motion")
        explain(error)
        assert error.__notes__[-1] == "of the motion" and len(error.__notes__) > 1


def test_an_error_from_elsewhere_stays_as_it_is():
    error = SimulationDiverged("elbow", 1.0, 2.0, 0.5)
    explain(error)
    assert not hasattr(error, "__notes__")
