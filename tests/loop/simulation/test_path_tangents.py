"""Tangents with friction of position and path against central differences of the simulation."""

import numpy as np
import pytest

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.loop.simulation.controllers import PD, Cascade
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.tangents import simulate_with_tangents
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    dahl,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    viscous,
)
from pivident.robot.gallery import load_robot
from tests.loop.simulation.loops import TX40_KD, TX40_KP, reversals, signals_of
from tests.loop.simulation.test_tangents import (
    KD,
    KP,
    RATE,
    assert_tangents,
    deviation,
    others,
    planar,
)

LAWS = {
    "ripple": (viscous(), *ripple(7.0), offset()),
    "springs": (viscous(), spring(), *counterbalance(0.4, 0.3), coulomb(gamma=20.0)),
    "dahl": (viscous(), dahl(2e-2), offset()),
    "lugre": (viscous(), *lugre(2e-2, 0.4, 0.1), offset()),
    "short lugre": (viscous(), *lugre(2e-3, 0.4, 0.1), offset()),
    "slip": (viscous(), *maxwell_slip([3e-3, 1e-2]), offset()),
    "power": (*asymmetric_viscous(), power_viscous(1.5), coulomb(gamma=20.0)),
    "root": (viscous(), power_viscous(1 / 3, gamma=20.0), coulomb(gamma=20.0)),
}


def directions_of(loop, terms):
    """Along all friction, constants of shape, and one of each other kind."""
    names = {shape.name for term in terms for shape in term.shapes}
    if any(term.has_sign for term in terms):
        names.add("gamma")
    # an element that begins to slip has a corner there, which differences of its distance straddle
    names -= {"slip_distance1"}
    return (
        [Direction("parameter", p.name) for p in loop.parameters if p.friction is not None]
        + [Direction("shape", name, j) for name in sorted(names) for j in range(loop.robot.size)]
        + [Direction("parameter", "zz2"), Direction("law", "kp", 0), *others(loop.robot.size)]
    )


@pytest.mark.parametrize("name", LAWS)
def test_all_constants_of_friction(name):
    loop = planar(PD(KP, KD), samples=150, friction=LAWS[name])
    assert_tangents(loop, directions_of(loop, LAWS[name]), 2e-6)


def emps(distance, samples=1000):
    """An axis with presliding, through reversals."""
    law = FrictionLaw((viscous(), *lugre(distance, 0.3, 0.02), offset()))
    robot = load_robot("emps").with_friction(law)
    parameters = standard_parameters(robot)
    values = {"m": 95.0, "fv": 203.0, "fc": 20.0, "fd": 100.0, "off": -3.2}
    theta = np.array([values.get(p.stem, 0.0) for p in parameters])
    q_ref, dq_ref = reversals(samples, RATE, [0.1], [1.3])
    controller = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    gain, limit = np.array([35.15]), np.array([10.0])
    signals = signals_of(RATE, q_ref, dq_ref, drive_gain=gain, limit=limit)
    return ParametrisedLoop(robot, parameters, theta, controller, signals)


def test_presliding_of_an_axis_like_emps_through_reversals():
    loop = emps(1e-3)
    stems = ("m", "fv", "fc", "fd", "off")
    directions = [Direction("parameter", p.name) for p in loop.parameters if p.stem in stems]
    shapes = ("presliding_distance", "stribeck_excess", "stribeck_speed")
    directions += [Direction("shape", name, 0) for name in shapes]
    assert_tangents(loop, [*directions, Direction("law", "kv", 0)])


def test_presliding_with_a_coupling_agrees_in_the_mean():
    """The TX40, whose wrist motors turn two joints, through reversals."""
    robot = load_robot("staubli_tx40")
    dry = [robot.friction_nominal[f"fc{j + 1}"] for j in range(robot.size)]
    damping = [robot.friction_nominal[f"fv{j + 1}"] for j in range(robot.size)]
    robot = robot.with_friction(FrictionLaw((viscous(), *lugre(1e-3, 0.4, 0.1), offset())))
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    for k, p in enumerate(parameters):
        if p.friction is not None:
            level = {"fc": dry, "fv": damping, "fd": damping}.get(p.stem)
            theta[k] = level[p.joint] if level else 0.1
    q_ref, dq_ref = reversals(1500, 5000.0, [0.3] * 6, [0.9, 1.1, 1.3, 1.7, 1.9, 2.3])
    signals = signals_of(5000.0, q_ref, dq_ref)
    loop = ParametrisedLoop(robot, parameters, theta, PD(TX40_KP, TX40_KD), signals)
    names = ("zz1", "fc2", "fd5", "fc6", "fvm6", "fcm6")
    directions = [Direction("parameter", name) for name in names]
    directions.append(Direction("shape", "presliding_distance", 4))
    found = simulate_with_tangents(loop, directions)
    for d, direction in enumerate(directions):
        tangent = [x[..., d] for x in found[2:]]
        mean = deviation(loop, direction, tangent, lambda e: np.sqrt(np.mean(e**2)))
        assert mean < 1e-4, direction
