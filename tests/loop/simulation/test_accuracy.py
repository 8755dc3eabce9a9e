"""The fast scheme against Runge–Kutta with 64 substeps: 1e-4 on every joint's acceleration."""

import json

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.loop.simulation.closed_loop import steps_of_a_period
from pivident.loop.simulation.controllers import PD, PID, Cascade
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    coulomb,
    offset,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot
from tests.loop.simulation.loops import (
    TX40_KD,
    TX40_KP,
    nominal_model,
    relative_rms,
    reversals,
    run,
    signals_of,
)

CONTRACT = 1e-4

#: Slow, faster, and up to the rated speeds; every joint reverses several times.
TX40_MOTIONS = {
    "slow": ([0.3, 0.2, 0.3, 0.5, 0.6, 0.8], [0.75, 0.6, 0.9, 1.0, 1.25, 1.5]),
    "faster": ([0.3, 0.2, 0.3, 0.5, 0.6, 0.8], [1.5, 1.25, 1.75, 2.0, 2.5, 3.0]),
    "rated": ([0.8, 0.67, 0.8, 0.67, 0.44, 0.65], [1.0, 1.2, 1.5, 1.7, 2.0, 3.0]),
}


def assert_same_motion(ours, theirs, tolerance=CONTRACT):
    for channel in ("q", "dq", "ddq"):
        error = relative_rms(getattr(ours, channel), getattr(theirs, channel))
        assert (error < tolerance).all(), f"{channel}: {error}"


@pytest.mark.parametrize("name", TX40_MOTIONS)
def test_tx40_through_reversals(name):
    robot, model = nominal_model("staubli_tx40")
    signals = signals_of(5000.0, *reversals(3000, 5000.0, *TX40_MOTIONS[name]))
    law = PD(TX40_KP, TX40_KD)
    fast = run(robot, model, law, signals)
    assert_same_motion(fast, run(robot, model, law, signals, oracle=64))


def test_tx40_with_other_friction_laws():
    laws = (
        FrictionLaw(
            (viscous(), coulomb("tanh", 100.0), offset(), stribeck(0.1, 2.0, "tanh", 100.0))
        ),
        FrictionLaw((viscous(), *asymmetric_coulomb("atan", 150.0))),
    )
    for law in laws:
        robot = load_robot("staubli_tx40").with_friction(law)
        parameters = standard_parameters(robot)
        theta = nominal_values(robot, parameters)
        for k, p in enumerate(parameters):
            if p.stem in ("fcp", "fcn", "fs"):
                share = 0.3 if p.stem == "fs" else 1.0
                theta[k] = share * robot.friction_nominal[f"fc{p.joint + 1}"]
        model = make_model(robot, parameters, theta)
        signals = signals_of(5000.0, *reversals(2500, 5000.0, *TX40_MOTIONS["slow"]))
        pd = PD(TX40_KP, TX40_KD)
        fast = run(robot, model, pd, signals)
        assert_same_motion(fast, run(robot, model, pd, signals, oracle=64))


@pytest.mark.parametrize("rate", [500.0, 1000.0, 4000.0])
def test_planar_arm_at_any_control_rate(rate):
    robot, model = nominal_model("planar_2r")
    signals = signals_of(rate, *reversals(int(rate), rate, [0.4, 0.6], [1.0, 1.5]))
    law = PID([800.0, 300.0], [60.0, 20.0], [500.0, 200.0])
    fast = run(robot, model, law, signals)
    assert_same_motion(fast, run(robot, model, law, signals, oracle=64), 2e-4)


def test_emps_at_its_own_rate():
    robot, model = nominal_model("emps")
    q_ref, dq_ref = reversals(2000, 1000.0, [0.1], [1.0])
    signals = signals_of(1000.0, q_ref, dq_ref, drive_gain=np.array([35.15]))
    law = Cascade([160.18], [243.45], averaged=True)
    fast = run(robot, model, law, signals)
    assert_same_motion(fast, run(robot, model, law, signals, oracle=64))


def test_runge_kutta_converges_with_fourth_order():
    robot, model = nominal_model("planar_2r")
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    theta[[k for k, p in enumerate(parameters) if p.stem == "fc"]] = 0.0  # smooth everywhere
    model = make_model(robot, parameters, theta)
    signals = signals_of(50.0, *reversals(60, 50.0, [0.5, 0.8], [1.0, 1.5]))
    law = PD([300.0, 100.0], [10.0, 4.0])
    exact = run(robot, model, law, signals, oracle=64)
    errors = [
        relative_rms(run(robot, model, law, signals, oracle=n).dq, exact.dq) for n in (1, 2, 4)
    ]
    slopes = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(slopes, 4.0, atol=0.3)


def test_the_fast_scheme_converges_with_second_order():
    # a free fall with friction: no controller, so that the rate is the step and nothing else
    robot, model = nominal_model("planar_2r")
    law = PD(np.zeros(2), np.zeros(2))
    ends = []
    for rate in (4000.0, 8000.0, 16000.0):
        signals = signals_of(rate, np.zeros((int(0.4 * rate) + 1, 2)))
        ends.append(run(robot, model, law, signals).dq[-1])
    exact = run(robot, model, law, signals, oracle=8).dq[-1]
    errors = np.abs(np.array(ends) - exact)
    slopes = np.log2(errors[:-1] / errors[1:])
    np.testing.assert_allclose(slopes, 2.0, atol=0.4)


@pytest.mark.record
def test_the_simulated_record_is_met_within_its_encoder_noise(reference_dir):
    facts = json.loads((reference_dir / "tx40_simulated_record.json").read_text())
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    theta = np.zeros(len(base))
    for name, value in facts["parameters"].items():
        theta[base.index(name)] = value
    model = make_model(robot, base.parameters, theta)
    with np.load(reference_dir / "tx40_simulated_record.npz") as record:
        signals = signals_of(facts["rate_hz"], record["q_ref"], record["dq_ref"])
        made = run(robot, model, PD(record["kp"], record["kd"]), signals)
        difference = record["q"] - made.q
    noise = facts["encoder_noise_std_rad"]
    # the noise moves the robot a little, too
    assert (difference.std(axis=0) < 1.1 * noise).all()
    assert (difference.std(axis=0) > 0.9 * noise).all()
    assert (abs(difference.mean(axis=0)) < 0.1 * noise).all()


def test_an_axis_that_slides_takes_one_step_and_one_that_turns_as_many_as_it_needs():
    """M and h of a slide never change; a spring is frozen with them, and moves."""
    _, slide = nominal_model("emps")
    _, arm = nominal_model("planar_2r")
    sprung = load_robot("emps").with_friction(FrictionLaw((viscous(), spring())))
    parameters = standard_parameters(sprung)
    model = make_model(sprung, parameters, nominal_values(sprung, parameters))
    assert [steps_of_a_period(own, 1000.0) for own in (slide, arm, model)] == [1, 4, 4]
    assert steps_of_a_period(arm, 5000.0) == 1
