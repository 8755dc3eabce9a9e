"""Tangents of the simulated loop against central differences of the simulation."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.foundation.errors import ExperimentError, SimulationDiverged
from pivident.loop.simulation.closed_loop import simulate
from pivident.loop.simulation.controllers import PD, PID, Cascade, PythonController
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.gravity_compensation import GravityCompensated, GravityModel
from pivident.loop.simulation.linear_law import LinearLaw
from pivident.loop.simulation.tangents import (
    has_compiled_tangents,
    simulate_with_tangents,
    tangent_blocks,
)
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    load_dependent,
    offset,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot
from tests.loop.simulation.loops import CHANNELS, TX40_KD, TX40_KP, reversals, signals_of

RATE = 1000.0
KP, KD = np.array([900.0, 300.0]), np.array([60.0, 20.0])

#: Size of a direction whose value says nothing about it.
SCALES = {
    "delay": 1e-3,
    "initial_position": 1e-2,
    "initial_speed": 1.0,
    "encoder_offset": 1e-2,
    "torque_offset": 5.0,
}


def planar(controller=None, samples=300, friction=None, delay=0.4e-3, **changes):
    """The planar arm on sines that reverse, started off its reference."""
    robot = load_robot("planar_2r")
    if friction is not None:
        robot = robot.with_friction(FrictionLaw(friction))
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    rng = np.random.default_rng(5)
    for k, p in enumerate(parameters):
        if p.friction is not None and theta[k] == 0.0:
            theta[k] = rng.uniform(0.5, 1.5)
    q_ref, dq_ref = reversals(samples, RATE, [0.4, 0.6], [1.0, 1.5])
    signals = signals_of(RATE, q_ref, dq_ref, drive_delay=delay, **changes)
    law = PID(KP, KD, np.array([500.0, 200.0]), 1e-3) if controller is None else controller
    return ParametrisedLoop(robot, parameters, theta, law, signals, (q_ref[0] + 0.01, dq_ref[0]))


def motion_of(loop):
    return simulate(loop.model, loop.controller, loop.signals, loop.robot.joint_names, loop.begin)


def difference(loop, direction, step):
    """Central differences of q, dq and tau."""
    ahead, behind = motion_of(loop.moved(direction, step)), motion_of(loop.moved(direction, -step))
    return [(getattr(ahead, c) - getattr(behind, c)) / (2.0 * step) for c in ("q", "dq", "tau")]


def deviation(loop, direction, found, measure=np.max, enough=1e-7):
    """Largest difference of the tangents, relative, with the best of some steps.

    A long step passes a place where the scheme decides otherwise, a short one shows rounding; what
    lies between may be less than a decade. None is tried after one that is good ``enough``.
    """
    value = abs(loop.value(direction))
    scale = SCALES.get(direction.kind, value if direction.kind == "shape" else max(value, 0.05))
    # where the whole scale moves the signal by less than this, differences are rounding
    motion = motion_of(loop)
    least = [1e-4 * abs(getattr(motion, c)).max() / scale for c in ("q", "dq", "tau")]
    best = np.inf
    for step in (1e-4, 1e-3, 1e-2, 1e-5, 1e-6, 3e-4, 3e-3, 3e-5, 3e-6):
        pairs = zip(found, difference(loop, direction, step * scale), least, strict=True)
        errors = [measure(abs(a - b)) / max(abs(b).max(), floor) for a, b, floor in pairs]
        best = min(best, max(errors))
        if best < enough:
            break
    return best


def assert_tangents(loop, directions, tolerance=1e-6):
    assert has_compiled_tangents(loop)
    found = simulate_with_tangents(loop, directions)
    plain = motion_of(loop)
    for channel in CHANNELS:
        np.testing.assert_array_equal(getattr(found.motion, channel), getattr(plain, channel))
    worst = {
        str(direction): deviation(
            loop, direction, [x[..., d] for x in found[2:]], enough=0.3 * tolerance
        )
        for d, direction in enumerate(directions)
    }
    assert {name: e for name, e in worst.items() if not e < tolerance} == {}


def every_parameter(loop):
    return [Direction("parameter", p.name) for p in loop.parameters]


def others(joints):
    """One direction of each kind that every loop has."""
    kinds = ("drive_gain", "encoder_offset", "torque_offset", "initial_position", "initial_speed")
    return [Direction("delay")] + [
        Direction(kind, joint=i % joints) for i, kind in enumerate(kinds)
    ]


def test_all_parameters_and_kinds_of_the_planar_arm():
    loop = planar()
    laws = [Direction("law", name, i % 2) for i, name in enumerate(("kp", "kd", "ki"))]
    both = [Direction("law", "kp"), Direction("law", "derivative_time"), Direction("drive_gain")]
    shapes = [Direction("shape", "gamma", 1)]
    assert_tangents(loop, every_parameter(loop) + laws + both + shapes + others(2))


def test_cascade_with_feed_forward_share():
    loop = planar(Cascade(np.array([15.0, 15.0]), KD, np.array([4.0, 3.0]), True, 0.7))
    laws = [Direction("law", "kp", 0), Direction("law", "kv", 1), Direction("law", "ki", 0)]
    assert_tangents(loop, [*laws, Direction("law", "speed_feed_forward"), *others(2)])


def test_linear_law():
    one = np.ones(2)
    law = LinearLaw(KP, KD, 300.0 * one, 20.0 * one, 0.5 * one, 0.1 * one, 1e-3 * one)
    names = ("kp", "kd", "ki", "speed_reference", "acceleration_reference", "offset")
    directions = [Direction("law", name, i % 2) for i, name in enumerate(names)]
    assert_tangents(planar(law), [*directions, Direction("law", "derivative_time", 0)])


def test_known_inputs_and_gravity_at_the_measured_position():
    robot = replace(load_robot("planar_2r"), gravity=(0.0, -9.81, 0.0))
    inputs = np.random.default_rng(2).normal(size=(300, 2))
    law = GravityCompensated(PD(KP, KD), GravityModel.nominal(robot))
    loop = replace(planar(law, inputs=inputs), robot=robot)
    directions = [Direction("inputs"), Direction("inputs", joint=1), Direction("law", "kp", 0)]
    assert_tangents(loop, [*directions, Direction("parameter", "mx2"), *others(2)])


def test_constants_of_stribeck_friction():
    laws = {
        "atan": (viscous(), coulomb(gamma=60.0), stribeck(0.2, 1.5, gamma=60.0), offset()),
        "tanh": (viscous(), *asymmetric_coulomb("tanh", 60.0), stribeck(0.3, 2.0, "tanh", 60.0)),
        "by direction": (*asymmetric_viscous(), coulomb(gamma=60.0), stribeck(0.2, gamma=60.0)),
    }
    for friction in laws.values():
        loop = planar(friction=friction)
        names = sorted({s.name for term in friction for s in term.shapes} | {"gamma"})
        shapes = [Direction("shape", name, j) for name in names for j in range(2)]
        of_friction = [
            Direction("parameter", p.name) for p in loop.parameters if p.friction is not None
        ]
        assert_tangents(loop, shapes + of_friction)


def tx40(samples, delay=0.0):
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    q_ref, dq_ref = reversals(samples, 5000.0, [0.3] * 6, [0.9, 1.1, 1.3, 1.7, 1.9, 2.3])
    signals = signals_of(5000.0, q_ref, dq_ref, drive_delay=delay)
    return ParametrisedLoop(robot, base.parameters, theta, PD(TX40_KP, TX40_KD), signals)


def test_base_parameters_of_the_tx40():
    """61 base parameters, with a coupling, over a motion without a reversal."""
    loop = tx40(500, 0.3 / 5000.0)
    gains = [Direction("law", "kd", j) for j in range(6)]
    assert_tangents(loop, every_parameter(loop) + gains + others(6))


def test_an_axis_like_emps():
    robot = load_robot("emps")
    parameters = standard_parameters(robot)
    theta = np.array(
        [{"m": 95.0, "fv": 203.0, "fc": 20.0, "off": -3.2}.get(p.stem, 0.0) for p in parameters]
    )
    q_ref, dq_ref = reversals(400, RATE, [0.1], [1.3])
    law = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    signals = signals_of(RATE, q_ref, dq_ref, drive_gain=np.array([35.15]), limit=np.array([10.0]))
    loop = ParametrisedLoop(robot, parameters, theta, law, signals)
    names = [p.name for p in parameters if p.stem in ("m", "fv", "fc", "off")]
    directions = [Direction("parameter", name) for name in names]
    laws = [Direction("law", "kp", 0), Direction("law", "kv", 0), Direction("drive_gain")]
    kinds = ("encoder_offset", "torque_offset", "initial_position", "initial_speed")
    rest = [Direction(kind, joint=0) for kind in kinds]
    assert_tangents(loop, directions + laws + rest)


def test_friction_that_reverses_agrees_in_the_mean():
    """Through reversals the scheme decides on its steps: the tangents agree on the average."""
    loop = tx40(4000)
    names = ("zz1", "fv1", "fc1", "fc3", "mx4", "ia5", "fc6", "fcm6")
    directions = [Direction("parameter", name) for name in names]
    directions += [Direction("law", "kp", 2), Direction("shape", "gamma", 1)]
    found = simulate_with_tangents(loop, directions)
    for d, direction in enumerate(directions):
        tangent = [x[..., d] for x in found[2:]]
        mean = deviation(loop, direction, tangent, lambda e: np.sqrt(np.mean(e**2)))
        assert mean < 1e-4, direction


def test_blocks_are_the_whole():
    loop = planar()
    directions = [*every_parameter(loop)[:12], *others(2)]
    whole = simulate_with_tangents(loop, directions)
    for block in (1, 37, 300):
        parts = []
        for part in tangent_blocks(loop, directions, block):
            assert len(part.q) == part.samples.stop - part.samples.start <= block
            parts.append([np.array(x) for x in part[2:]] + [np.array(part.motion.q)])
        for k, channel in enumerate((*whole[2:], whole.motion.q)):
            np.testing.assert_array_equal(np.concatenate([p[k] for p in parts]), channel)


def test_a_delay_of_whole_periods_is_the_limit_of_others():
    """There the drive's torque changes at a sample: there is no step whose length changes.

    What the sample holds jumps: the motion is that before the torque changes, as with a longer
    delay, the torque that after it, as with a shorter one.
    """
    directions = [Direction("delay"), Direction("law", "kp", 0)]
    whole = simulate_with_tangents(planar(delay=1e-3), directions)
    later = simulate_with_tangents(planar(delay=1.002e-3), directions)
    earlier = simulate_with_tangents(planar(delay=0.998e-3), directions)
    for a, b in ((whole.q, later.q), (whole.dq, later.dq), (whole.tau, earlier.tau)):
        assert abs(a - b).max() < 2e-3 * abs(b).max()


def test_at_the_limit_the_law_is_without_effect():
    """A saturated law does not answer to anything: its tangent is zero meanwhile."""
    loop = planar(PD(KP, KD), limit=np.array([12.0, 4.0]))
    assert (abs(motion_of(loop).command) >= 4.0).any()
    assert_tangents(loop, [Direction("law", "kp", 0), Direction("parameter", "zz2"), *others(2)])


def test_counts_of_the_encoder_are_passed_over():
    """The mean over places between two counts: many differences that are larger than a count."""
    count = 1e-5
    loop = planar(PD(KP, KD), count=np.full(2, count))
    smooth = simulate_with_tangents(planar(PD(KP, KD)), others(2))
    counted = simulate_with_tangents(loop, others(2))
    for a, b in zip(counted[2:], smooth[2:], strict=True):
        assert np.sqrt(np.mean((a - b) ** 2)) < 5e-2 * np.sqrt(np.mean(b**2))


class PDInPython:
    """The law ``PD(KP, KD)`` as a Python function."""

    def reset(self):
        self.last = None

    def __call__(self, k, q, q_ref, dq_ref):
        last = q if self.last is None else self.last
        self.last = q
        return KP * (q_ref - q) + KD * (dq_ref - (q - last) * RATE)


def test_a_python_law_is_differentiated_by_differences():
    law = PDInPython()
    python = planar(PythonController(law, law.reset), samples=120)
    assert not has_compiled_tangents(python)
    directions = [Direction("parameter", "zz1"), Direction("initial_position", joint=1)]
    ours = simulate_with_tangents(planar(PD(KP, KD), samples=120), directions)
    (theirs,) = tangent_blocks(python, directions, 10)
    for a, b in zip(ours[2:], theirs[2:], strict=True):
        np.testing.assert_allclose(b, a, atol=1e-4 * abs(a).max())


def test_friction_of_the_load_is_differentiated_by_differences():
    loop = planar(PD(KP, KD), samples=120, friction=(viscous(), coulomb(), load_dependent()))
    loop.theta[[p.stem == "fl" for p in loop.parameters]] = 0.1
    assert not has_compiled_tangents(loop)
    names = [p.name for p in loop.parameters if p.friction is not None][:3]
    directions = [Direction("parameter", name) for name in names]
    found = simulate_with_tangents(loop, directions)
    for d, direction in enumerate(directions):
        assert deviation(loop, direction, [x[..., d] for x in found[2:]]) < 1e-4


BAD = {
    "no parameter 'zz9'; it has": Direction("parameter", "zz9"),
    "no direction of kind 'colour'": Direction("colour"),
    "joint = 2; give a joint's index from 0 to 1": Direction("initial_speed", joint=2),
    "no constant 'v_s'; it has gamma": Direction("shape", "v_s", 0),
    "PID has no gain 'kq' to differentiate by; it has kp": Direction("law", "kq"),
    "one number for all joints": Direction("law", "derivative_time", 1),
    "the loop has no known inputs": Direction("inputs"),
    "this kind has no name": Direction("delay", "slow"),
    "name what is meant": Direction("parameter"),
}


@pytest.mark.parametrize("message", BAD)
def test_directions_that_are_not_there_are_refused(message):
    with pytest.raises(ExperimentError, match=message):
        simulate_with_tangents(planar(), [BAD[message]])


def test_a_loop_that_diverges_says_so_as_in_the_simulation():
    loop = planar(PD(KP, KD), samples=2000, drive_gain=-np.ones(2))
    with pytest.raises(SimulationDiverged) as plain:
        motion_of(loop)
    with pytest.raises(SimulationDiverged) as ours:
        simulate_with_tangents(loop, others(2))
    assert str(ours.value) == str(plain.value)


def test_no_directions_are_the_simulation():
    found = simulate_with_tangents(planar(), [])
    np.testing.assert_array_equal(found.motion.q, motion_of(planar()).q)
    assert found.q.shape == (300, 2, 0)
