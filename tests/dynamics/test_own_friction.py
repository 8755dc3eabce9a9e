"""Friction that a program declares: as the terms of pivident that it copies, everywhere."""

import math
import pickle
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context

import numpy as np
import pytest
from numba import njit

import pivident as pv
from pivident.dynamics.column_slopes import column_slopes
from pivident.dynamics.own_friction import own_friction
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import ExportError, PividentError
from pivident.loop.simulation.direction import Direction
from pivident.models import runnable_model, to_c, verify_c
from pivident.models.export.c_source import c_compiler
from pivident.models.export.numpy_function import to_numpy, verify_numpy
from pivident.robot.friction import (
    FrictionLaw,
    coulomb,
    law_toml,
    load_dependent,
    offset,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.friction_terms import OWN_COLUMNS
from pivident.robot.gallery import load_robot

pytest.importorskip("sympy")
GAMMA, SPEED = 40.0, 0.5  # s/rad, rad/s


def sign(dq):
    return 2.0 / math.pi * math.atan(GAMMA * dq)


jitted_sign = njit(sign)


@njit
def weak(dq):
    return jitted_sign(dq) * math.exp(-((dq / SPEED) ** 2))


def carried(q, dq, load):
    return abs(load) * jitted_sign(dq)


def stretched(q):
    return q


def lined(q, dq):
    return q + 0.0 * dq


def slope_of_sign(dq):
    return 2.0 / math.pi * GAMMA / (1.0 + (GAMMA * dq) ** 2)


#: Terms of pivident, and what copies them: an expression, a function, one with its slope.
COPIES = {
    "coulomb": (
        lambda: coulomb(gamma=GAMMA),
        "s",
        {},
        sign,
        {"slopes": {"dq": slope_of_sign}},
    ),
    "stribeck": (
        lambda: stribeck(SPEED, gamma=GAMMA),
        "s*exp(-power(abs(dq/0.5), 2))",
        {},
        weak,
        {},
    ),
    "load": (
        lambda: load_dependent(gamma=GAMMA),
        "abs(load)*s",
        {"grows_with": "load", "dissipative": True},
        carried,
        {"grows_with": "load", "dissipative": True},
    ),
}
VALUES = {"coulomb": 3.0, "stribeck": 2.0, "load": 0.2}


def copy(name: str, kind: str):
    """A term of pivident, or its copy."""
    built_in, expression, options, function, further = COPIES[name]
    if kind == "built-in":
        return built_in()
    if kind == "expression":
        return own_friction(f"own_{name}", expression, gamma=GAMMA, **options)
    return own_friction(f"own_{name}_function", function, **further)


def robot_with(term):
    """The planar arm with that friction beside viscous friction and an offset."""
    law = FrictionLaw((viscous(), term, offset()))
    return load_robot("planar_2r").with_friction(law)


@cache
def record(name: str, kind: str):
    """A simulated record of the arm with such friction, with noise."""
    robot = robot_with(copy(name, kind))
    stem = robot.joints[0].friction.terms[1].stem
    values = {f"{stem}{j}": VALUES[name] / j for j in (1, 2)} | {"fv1": 4.0, "fv2": 1.5}
    loop = pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    made = pv.simulate(
        robot, loop, values=values, duration=3.0, encoder=2e-5, torque=[0.3, 0.1], seed=7
    )
    return pv.Problem(robot, (made.recording,), loop)


@pytest.mark.parametrize("kind", ["expression", "function"])
@pytest.mark.parametrize("name", COPIES)
def test_a_copy_is_simulated_and_identified_as_what_it_copies(name, kind):
    original, copied = record(name, "built-in"), record(name, kind)
    # how much friction a joint has at most is known of a term of the load, and not of its copy; the
    # integrator's tolerance follows from it
    tolerance = 1e-9 if name == "load" else 1e-12
    for one, other in zip(original.recordings, copied.recordings, strict=True):
        np.testing.assert_allclose(other.q, one.q, rtol=0, atol=tolerance)
        np.testing.assert_allclose(other.tau, one.tau, rtol=0, atol=1e4 * tolerance)
    # the same record to both, so that nothing but the rounding of the column differs
    same = pv.Problem(copied.robot, original.recordings, original.loop)
    for method in ("ls", "piv"):
        expected, found = pv.identify(original, method), pv.identify(same, method)
        np.testing.assert_allclose(
            found.theta, expected.theta, rtol=0, atol=1e-6 * expected.std.min()
        )
        np.testing.assert_allclose(found.std, expected.std, rtol=1e-6)


@pytest.mark.parametrize("name", COPIES)
def test_the_estimate_finds_the_friction_that_was_simulated(name):
    problem = record(name, "function")
    found = pv.identify(problem, "piv")
    stem = problem.robot.joints[0].friction.terms[1].stem
    for j in (1, 2):
        true, k = VALUES[name] / j, found.names.index(f"{stem}{j}")
        assert abs(found.theta[k] - true) < 4.0 * found.std[k] < 0.2 * true


@pytest.mark.parametrize("name", COPIES)
def test_feed_forward_and_predict_are_the_same(name):
    found = pv.identify(record(name, "function"), "ls")
    q, dq, ddq = np.random.default_rng(1).normal(size=(3, 20, 2))
    expected = found.predict(q, dq, ddq)
    single = [found.torque(*state) for state in zip(q, dq, ddq, strict=True)]
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_springs_as_functions_of_position_and_of_position_and_speed():
    motions = []
    loop = pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    terms = (spring(), own_friction("own_q", stretched), own_friction("own_q_dq", lined))
    for term in terms:
        robot = robot_with(term)
        values = {f"{term.stem}1": 15.0, "fv1": 4.0}
        made = pv.simulate(robot, loop, values=values, duration=2.0, seed=3)
        motions.append(made.recording.q)
    # a spring belongs to the rigid body and is integrated with it, friction of position is not
    np.testing.assert_allclose(motions[1], motions[0], rtol=0, atol=2e-6)
    np.testing.assert_allclose(motions[2], motions[1], rtol=0, atol=1e-9)


def test_slopes_are_exact_to_their_stated_error():
    differences = own_friction("own_atan", sign).column
    assert 0.0 < differences.slope_error < 1e-10
    assert own_friction("own_exact", sign, slopes={"dq": slope_of_sign}).column.slope_error == 0.0
    robot = robot_with(own_friction("own_wave", lambda q, dq: math.cos(3.0 * q) * dq**3))
    regressor = Regressor.build(robot, standard_parameters(robot))
    q, dq = np.random.default_rng(0).uniform(-2.0, 2.0, (2, 300))
    seen = []
    for slope in column_slopes(regressor):
        if regressor.parameters[slope.column].stem == "own_wave":
            seen.append(slope.quantity)
            exact = -3.0 * np.sin(3.0 * q) * dq**3, 3.0 * np.cos(3.0 * q) * dq**2
            np.testing.assert_allclose(
                slope.value(q, dq, dq), exact[slope.quantity], rtol=0, atol=1e-8
            )
    assert seen == [0, 1, 0, 1]


def test_tangents_of_the_simulation():
    from tests.loop.simulation.test_tangents import assert_tangents, planar

    own = own_friction("own_bump", lambda dq: dq / (1.0 + (dq / 0.3) ** 2))
    loop = planar(friction=(viscous(), coulomb(gamma=60.0), own))
    assert_tangents(loop, [Direction("parameter", p.name) for p in loop.parameters if p.friction])


def test_exports_of_expressions_and_of_functions_with_their_c():
    robot = robot_with(own_friction("own_drag", "dq*abs(dq)*cos(q)"))
    values = np.random.default_rng(2).uniform(0.5, 1.0, len(standard_parameters(robot)))
    model = runnable_model(robot)
    model = type(model)(robot, model.parameters, values, False, model.origin)
    assert verify_numpy(to_numpy(model), model).agrees
    if c_compiler():
        assert verify_c(to_c(model), model).agrees
    source = "double own_mix(double load, double dq) { return fabs(load) * tanh(40.0 * dq); }"
    mixed = lambda load, dq: abs(load) * math.tanh(40.0 * dq)  # noqa: E731
    robot = robot_with(own_friction("own_mix", mixed, c_source=source))
    model = runnable_model(robot)
    model = type(model)(robot, model.parameters, values, False, model.origin)
    assert b"static double own_mix(" in to_c(model).content
    if c_compiler():
        assert verify_c(to_c(model), model).agrees
    with pytest.raises(ValueError, match="'own_mix' is known in C only; export it as C"):
        to_numpy(model)
    robot = robot_with(own_friction("own_mix", mixed))
    model = type(model)(robot, model.parameters, values, False, model.origin)
    model = runnable_model(robot)
    with pytest.raises(ExportError, match="compiled function, of which there is no formula"):
        to_c(model)


def test_a_result_is_stored_by_the_name_of_its_friction(tmp_path):
    found = pv.identify(record("coulomb", "function"), "ls")
    found.save(tmp_path)
    back = pv.load_identification(tmp_path)
    assert back.robot.joints[0].friction == found.robot.joints[0].friction
    q, dq, ddq = np.random.default_rng(1).normal(size=(3, 20, 2))
    np.testing.assert_array_equal(back.predict(q, dq, ddq), found.predict(q, dq, ddq))
    kept = OWN_COLUMNS.pop("own_coulomb_function")
    try:
        with pytest.raises(PividentError, match=r"declare it first: own_friction\('own_coulomb_fu"):
            pv.load_identification(tmp_path)
    finally:
        OWN_COLUMNS["own_coulomb_function"] = kept
    with pytest.raises(ValueError, match="which no file names"):
        law_toml(found.robot.joints[0].friction)


def torques(law, motion):
    """In another process: torques of the arm with a law."""
    robot = load_robot("planar_2r").with_friction(law)
    parameters = standard_parameters(robot)
    return Regressor.build(robot, parameters).torque(*motion, np.ones(len(parameters)))


def test_laws_and_plans_reach_other_processes():
    law = FrictionLaw((viscous(), own_friction("own_sent", lambda q, dq: q * dq)))
    motion = np.random.default_rng(0).normal(size=(3, 5, 2))
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        found = pool.submit(torques, law, motion).result()
    np.testing.assert_array_equal(found, torques(law, motion))
    robot = load_robot("planar_2r").with_friction(law)
    regressor = Regressor.build(robot, standard_parameters(robot))
    again = pickle.loads(pickle.dumps(regressor))
    np.testing.assert_array_equal(again.matrix(*motion), regressor.matrix(*motion))


BAD = {
    "sine of nothing": ("own_bad", "sin(", "is no expression"),
    "unknown name": ("own_bad", "dq*speed", "has the name 'speed'; there are q, dq, s, load"),
    "attribute": ("own_bad", "dq.__class__", "has the name '__class__'"),
    "infinite": ("own_bad", "1/dq", "at dq = 0; it needs a finite value"),
    "arity": ("own_bad", lambda dq, speed: dq, r"arguments \(dq, speed\)"),
    "no arguments": ("own_bad", lambda: 1.0, r"arguments \(\)"),
    "list of arguments": ("own_bad", lambda *dq: 1.0, r"arguments \(\*dq\)"),
    "pair": ("own_bad", lambda dq: (dq, dq), "numba cannot compile"),
    "nothing": ("own_bad", lambda dq: None, "numba cannot compile"),
    "python object": ("own_bad", lambda dq: OWN_COLUMNS.get("x"), "numba cannot compile"),
    "no function": ("own_bad", 3.0, "of type float"),
    "a class": ("own_bad", dict, "of type type"),
    "not finite": ("own_bad", lambda dq: math.log(dq), "finite value everywhere"),
    "raises": ("own_bad", lambda dq: math.sqrt(-1.0 - dq * dq), "finite value everywhere"),
    "jump": ("own_bad", lambda dq: np.sign(dq), "jumps at standstill"),
    "name of pivident": ("viscous", "dq", "that of another parameter or term"),
    "stem of pivident": ("fc", "dq", "that of another parameter or term"),
    "inertial": ("xx", "dq", "that of another parameter or term"),
    "no name": ("Bump 2", "dq", "lower-case letters"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_refused(case):
    name, function, message = BAD[case]
    with pytest.raises(ValueError, match=message):
        own_friction(name, function)
    assert "own_bad" not in OWN_COLUMNS


def test_wrong_slopes_and_c_are_refused():
    with pytest.raises(ValueError, match="the slope of 'own_bad' by dq is"):
        own_friction("own_bad", sign, slopes={"dq": sign})
    with pytest.raises(ValueError, match="a slope by 'q', which is no argument"):
        own_friction("own_bad", sign, slopes={"q": sign})
    with pytest.raises(ValueError, match="does not define it"):
        own_friction("own_bad", sign, c_source="double other(double dq) { return dq; }")
    with pytest.raises(ValueError, match="follow from the expression"):
        own_friction("own_bad", "dq", slopes={"dq": sign})
    with pytest.raises(PividentError, match="more than one quantity"):
        robot = load_robot("five_bar")
        robot = robot.with_friction(FrictionLaw((own_friction("own_loop", "q*dq"),)))
        pv.base_parameters(robot)


def test_kinks_at_standstill_are_seen():
    kinked = ("max(dq, 0)", "abs(dq)", "sqrt(abs(dq))")
    smooth = ("s", "s*exp(-power(abs(dq/0.5), 2))", "dq", "1", "dq*abs(dq)", "1/(1 + dq**2)")
    found = {text: own_friction("own_kink", text).column.kinked for text in (*kinked, *smooth)}
    assert [text for text, kink in found.items() if kink] == [*kinked]
    assert own_friction("own_kink", lambda dq: max(dq, 0.0)).column.kinked
    with pytest.raises(ValueError, match="jumps at standstill"):
        own_friction("own_bad", "sign(dq)")
