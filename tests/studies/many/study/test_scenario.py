"""Scenario files: what is accepted, what is refused and how, and what the shipped ones are."""

import numpy as np
import pytest

from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import load_scenario, read_scenario, shipped_scenarios
from tests.studies.many.study.small import TEXT, small


def test_shipped_scenarios_are_named():
    assert shipped_scenarios() == ("birdy", "coarse", "coloured", "fine", "loop", "paper")


@pytest.mark.parametrize("name", ["fine", "loop", "coloured", "coarse"])
def test_tx40_scenarios_are_those_of_the_simulation_bit_for_bit(name):
    content = load_scenario(name).changed(trajectory={"duration": 0.2})
    problem = Bench(content).problem(3)
    expected, truth = tx40_scenario(name, 3, samples=1000)
    ours, theirs = problem.recordings[0], expected.recordings[0]
    for channel in ("q", "tau", "q_ref", "dq_ref", "ddq_ref"):
        assert np.array_equal(getattr(ours, channel), getattr(theirs, channel)), channel
    assert problem.names == expected.names
    assert np.array_equal(problem.initial_values(), expected.initial_values())
    assert Bench(content).truth == truth


def test_birdy_has_two_robots_five_noises_and_two_decimations():
    scenario = load_scenario("birdy")
    assert len(scenario.conditions) == 20
    names = [c.condition for c in scenario.chosen_conditions(["tx40-*-d4"])]
    assert names == [f"tx40-n{k}-d4" for k in range(1, 6)]
    first = scenario.conditions[0]
    assert first.content.runs == 25 * 52
    assert len(Bench(first).estimated) == 52
    noisy = scenario.chosen_conditions(["rv2sq-n5-d4"])[0]
    assert noisy.robot.name == "Mitsubishi RV-2SQ"
    assert noisy.content.noise.encoder == pytest.approx(np.deg2rad(1e-2))
    assert noisy.methods["ls"].signals.decimation == 4
    assert noisy.hash != first.hash


METHODS = 'methods = ["ls", "iv-full-rate"]'
LAW = 'type = "pd"\nkp = [6000, 2500]\nkd = [180, 60]'
COLOURED = "torque = 0.05\ncoloured = {std = 1e-6, frequency = 300}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("runs = 6", "run = 6", "unknown table 'run'; did you mean 'runs'"),
        ('"planar_2r"', '"planar_2x"', "did you mean 'planar_2r'"),
        ("rate = 500", "rate = -500.0", r"\[record\] key 'rate' = -500.0: must be greater than 0"),
        ("rate = 500", "rat = 500", r"\[record\] unknown key 'rat'; did you mean 'rate'"),
        ("rate = 500", "rate = 500\ncontrol_rate = 1200", "must be a whole multiple of rate = 500"),
        ("kd = [180, 60]", "", "a pd controller needs kd"),
        ("kd = [180, 60]", "kd = [180, 60, 5]", "kd has 3 numbers for 2 joints"),
        (LAW, 'type = "virtual_pd"', "cannot be simulated"),
        ("reach = 1.5", 'type = "fourier"\nreach = 1.5', "a fourier trajectory has no reach"),
        ("reach = 1.5", "reach = [1, 1, 1]", "trajectory.reach has 3 numbers for 2 joints"),
        ("duration = 2.0", "duration = 0.1", "a record of 50 samples at 500 Hz; at least 200"),
        ("encoder = 2e-6", "encoder = -2e-6", "is a standard deviation and cannot be negative"),
        ("encoder = 2e-6\ntorque = 0.05", "", "there is no noise, so"),
        ("torque = 0.05", 'rounding = "loop"', "but no counts to round to"),
        ("torque = 0.05", COLOURED, "is not below half the control rate"),
        (METHODS, 'methods = ["pif"]', "there is no method 'pif'; did you mean 'piv'"),
        (METHODS, "initial = {fv1 = 2.0}", "contradicts the table"),
        (METHODS, 'parameters = ["zz9"]', "has no base parameter 'zz9'"),
        (METHODS, "ls = {tolerance = 0.1}", "has no tolerance"),
        ("[controller]", "[start]\ncount = 3\n\n[controller]", "spread are identical"),
        ("rate = 500", "rate = 500\nrecords = 3", "would repeat themselves"),
    ],
)
def test_a_contradiction_names_key_value_and_way_out(old, new, message):
    assert old in TEXT
    with pytest.raises(PividentError, match=message) as caught:
        read_scenario(TEXT.replace(old, new), "bad")
    assert "bad.toml" in str(caught.value) + "".join(getattr(caught.value, "__notes__", ()))


def test_what_is_not_there_is_said():
    with pytest.raises(ExperimentError, match="did you mean 'fine'"):
        load_scenario("fin")
    with pytest.raises(ExperimentError, match="cannot be read"):
        load_scenario("nothing.toml")
    with pytest.raises(ExperimentError, match="is not TOML"):
        read_scenario("robot =", "bad")
    with pytest.raises(ExperimentError, match="has no conditions"):
        small().chosen_conditions(["a"])
    with pytest.raises(ExperimentError, match="did you mean 'tx40-n1-d"):
        load_scenario("birdy").chosen_conditions(["tx40-n1-d"])


def test_the_hash_is_of_what_the_numbers_depend_on():
    scenario = small()
    assert scenario.hash == small().hash
    assert scenario.hash == scenario.with_runs(200).hash
    assert scenario.hash == small(record={"rate": 500.0}).hash
    assert scenario.hash != small(seed=8).hash
    assert scenario.hash != small(noise={"torque": 0.06}).hash


def test_methods_take_the_options_of_an_experiment_file():
    scenario = small(identify={"methods": ["piv"], "piv": {"noise": {"criterion": "bic"}}})
    assert scenario.methods["piv"].noise.criterion == "bic"
