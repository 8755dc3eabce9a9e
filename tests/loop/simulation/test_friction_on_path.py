"""Friction with kinks, of position, path and load: the oracle, closed forms, energy."""

import numpy as np
import pytest

from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.loop.simulation.controllers import PD, PID, PythonController
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    viscous,
)
from pivident.robot.gallery import load_robot
from tests.forward_dynamics import friction_states
from tests.loop.simulation.loops import TX40_KD, TX40_KP, relative_rms, reversals, run, signals_of
from tests.loop.simulation.test_accuracy import CONTRACT, TX40_MOTIONS

SMOOTH = (viscous(), coulomb(), offset())
LAWS = {
    "by direction": (*asymmetric_viscous(), coulomb(), offset()),
    "slopes alone": (*asymmetric_viscous(), offset()),
    "power": (*asymmetric_viscous(), power_viscous(1 / 3), coulomb(), offset()),
    "ripple": (*SMOOTH, *ripple(200.0)),
    "springs": (*SMOOTH, spring(), *counterbalance(0.4, 0.3)),
    "load": (*SMOOTH, load_dependent()),
    "dahl": (viscous(), dahl(1e-3), offset()),
    "lugre": (viscous(), *lugre(1e-3, 0.5, 0.1), offset()),
    "short lugre": (viscous(), *lugre(1e-4, 0.5, 0.05), offset()),
    "slip": (viscous(), *maxwell_slip([3e-4, 1e-3, 1e-2]), offset()),
    "weakening slip": (viscous(), *maxwell_slip([1e-4, 1e-3], 0.4, 0.1), offset()),
    "all": (viscous(), *lugre(1e-3, 0.4, 0.1), load_dependent(), *ripple(50.0), spring()),
}


def robot_with(name, terms):
    """A robot of the gallery with that law; levels in proportion to its Coulomb friction."""
    plain = load_robot(name)
    robot = plain.with_friction(FrictionLaw(tuple(terms)))
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    shares = {"fc": 1.0, "fvx": 0.2, "ks": 2.0, "cbf": 1.0, "cbk": 1.0, "off": 0.1}
    shares |= {"fma": 0.5, "fmb": 0.3, "fmc": 0.2}
    for k, p in enumerate(parameters):
        if p.friction is None:
            continue
        dry, damping = (plain.friction_nominal[f"{stem}{p.joint + 1}"] for stem in ("fc", "fv"))
        if p.stem == "fl":
            theta[k] = 0.1
        elif p.stem.startswith("r"):
            theta[k] = 0.1 * dry
        elif p.stem in shares:
            theta[k] = shares[p.stem] * dry
        else:
            theta[k] = {"fv": 1.0, "fvp": 1.0, "fvn": 0.8, "fd": 0.5}[p.stem] * damping
    return robot, parameters, theta


@pytest.mark.parametrize("name", LAWS)
def test_accelerations_of_the_tx40_agree_with_the_oracle(name):
    robot, parameters, theta = robot_with("staubli_tx40", LAWS[name])
    model = make_model(robot, parameters, theta)
    motion = reversals(2000, 5000.0, *TX40_MOTIONS["faster"])
    signals, law = signals_of(5000.0, *motion), PD(TX40_KP, TX40_KD)
    fast = run(robot, model, law, signals)
    exact = run(robot, model, law, signals, oracle=32)
    error = relative_rms(fast.ddq, exact.ddq)
    assert (error < CONTRACT).all(), error
    assert fast.friction_states.shape == (2000, len(friction_states(robot, parameters)))
    assert np.allclose(fast.friction_states, exact.friction_states, atol=5e-3)


@pytest.mark.parametrize("name", LAWS)
def test_the_regressor_has_the_torque_of_the_simulated_motion(name):
    robot, parameters, theta = robot_with("planar_2r", LAWS[name])
    signals = signals_of(4000.0, *reversals(4000, 4000.0, [0.4, 0.6], [1.0, 1.5]))
    law = PID([800.0, 300.0], [60.0, 20.0], [500.0, 200.0])
    made = run(robot, make_model(robot, parameters, theta), law, signals)
    again = Regressor.build(robot, parameters).torque(made.q, made.dq, made.ddq, theta)
    # the simulation extrapolates M⁻¹ between renewals; states follow the sampled path here
    remembers = bool(friction_states(robot, parameters))
    assert (relative_rms(again, made.tau) < (1e-3 if remembers else 1e-5)).all()


def sledge(terms, inputs, **values):
    """A mass of one kilogram that is pushed with 1 N per unit at 4 kHz and has no controller."""
    robot = load_robot("emps").with_friction(FrictionLaw(tuple(terms)))
    parameters = standard_parameters(robot)
    theta = np.array([({"ia": 1.0} | values).get(p.stem, 0.0) for p in parameters])
    signals = signals_of(4000.0, np.zeros((len(inputs), 1)), inputs=np.asarray(inputs)[:, None])
    return robot, make_model(robot, parameters, theta), signals


def test_below_the_static_level_presliding_is_a_spring():
    push = 0.6 * np.minimum(np.arange(12000) / 6000.0, 1.0)
    law = PD(np.zeros(1), np.zeros(1))
    robot, model, signals = sledge((viscous(), dahl(1e-3)), push, fc=1.0, fv=60.0)
    dahls = run(robot, model, law, signals)
    assert dahls.q[-1, 0] == pytest.approx(-1e-3 * np.log(1.0 - 0.6), rel=1e-3)
    robot, model, signals = sledge((viscous(), *maxwell_slip([1e-3])), push, fma=1.0, fv=60.0)
    assert run(robot, model, law, signals).q[-1, 0] == pytest.approx(0.6e-3, rel=1e-3)


def test_above_it_the_joint_breaks_away_and_below_it_sticks():
    law = PD(np.zeros(1), np.zeros(1))
    for force, moves in ((1.4, False), (1.6, True)):  # the static level is 1.5 N
        push = force * np.minimum(np.arange(8000) / 6000.0, 1.0)
        terms = (viscous(), *lugre(1e-4, 0.5, 0.01))
        robot, model, signals = sledge(terms, push, fc=1.0, fv=5.0, fd=40.0)
        end = run(robot, model, law, signals)
        assert (end.q[-1, 0] > 0.01) == moves
        assert (end.friction_states[-1, 0] < 1.1) == moves


@pytest.mark.parametrize("speed", [-0.2, -0.05, 0.01, 0.1])
def test_sliding_steadily_friction_is_the_stribeck_curve(speed):
    robot, model, _ = sledge((viscous(), *lugre(1e-4, 0.5, 0.05)), [0.0], fc=2.0, fv=3.0, fd=4.0)
    q_ref = speed * np.arange(6000)[:, None] / 4000.0
    made = run(robot, model, PID([4e4], [300.0], [1e5]), signals_of(4000.0, q_ref))
    expected = np.sign(speed) * 2.0 * (1.0 + 0.5 * np.exp(-((speed / 0.05) ** 2))) + 3.0 * speed
    assert made.tau[-200:, 0].mean() == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    "terms", [(dahl(1e-3),), lugre(1e-3, 0.5, 0.05), maxwell_slip([3e-4, 3e-3], 0.3, 0.05)]
)
def test_friction_with_a_state_takes_energy_from_every_swing(terms):
    levels = {"fc": 0.5, "fd": 1.0, "fma": 0.3, "fmb": 0.2}
    robot, model, signals = sledge((spring(), *terms), np.zeros(8000), ks=100.0, **levels)
    start = (np.array([0.1]), np.zeros(1))
    made = run(robot, model, PD(np.zeros(1), np.zeros(1)), signals, start=start)
    energy = 0.5 * made.dq[:, 0] ** 2 + 50.0 * made.q[:, 0] ** 2
    passages = np.flatnonzero(np.diff(np.sign(made.q[:, 0])))
    assert len(passages) > 5
    assert (np.diff(energy[passages]) < 0.0).all()
    assert energy[-1] < 0.2 * energy[0]


def test_a_python_law_is_simulated_with_the_same_friction():
    robot, parameters, theta = robot_with("planar_2r", LAWS["all"])
    model = make_model(robot, parameters, theta)
    signals = signals_of(1000.0, *reversals(300, 1000.0, [0.4, 0.6], [2.0, 3.0]))
    kp, kd = np.array([800.0, 300.0]), np.array([60.0, 20.0])
    last = {"q": signals.q_ref[0]}

    def law(k, q, q_ref, dq_ref):
        speed, last["q"] = (q - last["q"]) * 1000.0, q
        return kp * (q_ref - q) + kd * (dq_ref - speed)

    ours = run(robot, model, PythonController(law), signals)
    theirs = run(robot, model, PD(kp, kd), signals)
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-12)
    np.testing.assert_allclose(ours.friction_states, theirs.friction_states, atol=1e-9)
