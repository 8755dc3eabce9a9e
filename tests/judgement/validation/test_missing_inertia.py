"""A simulation that starts without rotors diverges, and its error says what to give."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import SimulationDiverged
from pivident.judgement.diagnostics.failed_simulation import identify
from pivident.judgement.validation import divergence_cause
from pivident.judgement.validation.divergence_cause import missing_inertia
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import read_scenario

ARM = """
robot = "planar_2r"

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[record]
rate = 1000

[trajectory]
duration = 4.0

[noise]
encoder = 2e-6
torque = 0.05
"""


@pytest.fixture(scope="module")
def bare():
    """A record of an arm with rotors, and a description of it that has none."""
    problem = Bench(read_scenario(ARM, "arm")).problem(0)
    assert problem.robot.rotor_inertia[1] == 0.1
    robot = replace(problem.robot, rotor_inertia=np.zeros(2))
    return replace(problem, robot=robot, initial={})


def test_the_error_names_the_rotors_the_key_and_how_much_is_missing(bare):
    with pytest.raises(SimulationDiverged) as caught:
        identify(bare, InstrumentalVariables(RandomWalk(), start="initial"))
    (note,) = caught.value.__notes__
    assert "the rotor inertia of 'shoulder', 'elbow' is zero" in note
    assert "rotor_inertia = {shoulder = …, elbow = …} under [robot], in kg m²" in note
    # the elbow alone: z² - (2 - (kp h²/2 + kd h)/J) z + …, unstable for J < kd h/2 + kp h²/4
    assert "the loop of 'elbow' is unstable at 1000 Hz below about 0.03" in note
    assert "the loop of 'shoulder'" not in note


def test_least_squares_finds_the_rotors_to_start_from(bare):
    found = identify(bare, "iv-full-rate")
    assert found.converged and found.value("ia2") == pytest.approx(0.1, rel=0.02)


def test_with_rotors_given_the_same_record_is_identified(bare):
    known = replace(bare, robot=replace(bare.robot, rotor_inertia=np.array([0.2, 0.08])))
    assert missing_inertia(known) == []
    assert identify(known, "iv-full-rate").converged


def test_an_initial_value_stands_for_a_rotor(bare):
    (note,) = missing_inertia(replace(bare, initial={"ia2": 0.1}))
    assert "the rotor inertia of 'shoulder' is zero" in note
    assert missing_inertia(replace(bare, initial={"ia2": 0.1, "zz1r": 0.9})) == []


def test_what_a_record_does_not_show_stays_nominal_beside_least_squares(bare, monkeypatch):
    shown = bare.names[1:]
    found = SimpleNamespace(names=shown, theta=np.arange(1.0, len(shown) + 1.0))
    monkeypatch.setattr(divergence_cause, "identify", lambda *_: found)
    first, *others = divergence_cause._least_squares(bare)
    assert first == bare.initial_values()[0] and others == found.theta.tolist()
