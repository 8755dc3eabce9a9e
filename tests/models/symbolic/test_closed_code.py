"""Code of mechanisms with closed loops: C, SymPy and LaTeX say what the kernels compute."""

import ctypes

import numpy as np
import pytest
import sympy

from pivident.models import inverse_model, joint_motion, symbolic_models
from pivident.models.symbolic.print_c import c_header, c_source
from pivident.models.symbolic.print_python import python_module, sympy_module
from pivident.models.symbolic.program import latex_document
from tests.models.symbolic.mechanisms import (
    GALLERY,
    MADE,
    base_of,
    closed_states,
    mechanism,
    motion_of_all,
    observation,
)
from tests.models.symbolic.test_print_c import compiled, needs_compiler, pointer


def posture_of(library, closing):
    """A copy of the posture that the C file begins with."""
    size = len(closing.posture)
    return np.array((ctypes.c_double * size).in_dll(library, "closed_posture"))


def rows(function, signals, constants, shape):
    """Results of the function for many states; nothing is written behind the last row."""
    count = len(signals[0])
    out = np.full((count + 1, *shape), np.nan)
    given = [np.ascontiguousarray(x) for x in signals]
    function(ctypes.c_size_t(count), *(pointer(a) for a in [*given, *constants, out]))
    assert np.isnan(out[count]).all()
    return out[:count]


@needs_compiler
@pytest.mark.parametrize("name", [*GALLERY, "weld on the base", "geared five bar"])
def test_c_of_every_model(tmp_path, name):
    """Compiles without a warning; torques and Nᵀ Y of rows of states at random."""
    robot, base = mechanism(name), base_of(name)
    programs = symbolic_models(robot, None, base)
    library = compiled(tmp_path, programs)
    q, dq, ddq = closed_states(robot, 20, 1)
    theta = np.random.default_rng(2).uniform(-1.0, 1.0, len(base))
    phi = observation(robot, base.parameters, q, dq, ddq)
    closing = programs[0].closing
    start = [] if closing is None else [posture_of(library, closing)]
    tau = rows(library.inverse_model_samples, (q, dq, ddq), [theta, *start], (robot.size,))
    np.testing.assert_allclose(tau, phi @ theta, rtol=0, atol=1e-9 * np.abs(phi @ theta).max())
    found = rows(library.observation_matrix_samples, (q, dq, ddq), start, phi.shape[1:])
    np.testing.assert_allclose(found, phi, rtol=0, atol=1e-9 * np.abs(phi).max())
    standard = np.random.default_rng(3).uniform(-1.0, 1.0, (2, len(base.standard)))
    groups = rows(library.base_parameters_samples, (standard,), [], (len(base),))
    np.testing.assert_allclose(groups, [base.values(x) for x in standard], rtol=1e-12, atol=1e-12)


@needs_compiler
def test_c_follows_the_posture(tmp_path):
    """A function for one state moves its posture along, and leaves it where loops do not close."""
    robot = mechanism("orthoglide")
    program = joint_motion(robot)
    library = compiled(tmp_path, [program])
    q, dq, ddq = closed_states(robot, 6, 4)
    positions = motion_of_all(robot, q, dq, ddq)[0]
    order = [
        int(s.name[1:]) - 1 for s in (*program.inputs[0].symbols, *program.closing.unknown.symbols)
    ]
    posture = posture_of(library, program.closing)
    results = [np.empty(o.shape) for o in program.outputs]
    for k in range(6):
        state = [np.ascontiguousarray(x[k]) for x in (q, dq, ddq)]
        library.joint_motion(*(pointer(a) for a in [*state, posture, *results]))
        np.testing.assert_allclose(results[0], positions[k], rtol=0, atol=1e-12)
        np.testing.assert_allclose(posture, positions[k, order], rtol=0, atol=1e-12)
    before = posture.copy()
    too_far = np.array([2.0, 0.0, 0.0])
    library.joint_motion(*(pointer(a) for a in [too_far, dq[0], ddq[0], posture, *results]))
    assert np.isnan(results[0][order[3:]]).all()
    np.testing.assert_array_equal(posture, before)
    library.joint_motion(*(pointer(a) for a in [q[0].copy(), dq[0], ddq[0], posture, *results]))
    np.testing.assert_allclose(results[0], positions[0], rtol=0, atol=1e-12)


@needs_compiler
def test_two_delta_robots_go_into_one_program(tmp_path):
    """Names of the posture and of Newton's method get the prefix too."""
    programs = [joint_motion(mechanism("delta"))]
    text = c_source(programs, prefix="left_") + c_source(programs, prefix="right_")
    assert "left_closed_posture[12] =" in text and "right_closing_step(" in text
    header = c_header(programs, prefix="left_")
    assert "extern const double left_closed_posture[12];" in header and "static" not in header


@pytest.mark.parametrize("name", ["five_bar", "orthoglide"])
def test_sympy(name):
    """The text for SymPy, at one state; passive positions without closed form are symbols."""
    robot, base = mechanism(name), base_of(name)
    program = inverse_model(robot, base)
    namespace: dict = {}
    exec(sympy_module([program]), namespace)
    pairs, outputs = namespace["inverse_model"]()
    q, dq, ddq = closed_states(robot, 1, 5)
    theta = np.random.default_rng(6).uniform(-1.0, 1.0, len(base))
    values = {}
    for argument, numbers in zip(
        (*program.inputs, program.parameters), (q[0], dq[0], ddq[0], theta), strict=True
    ):
        values |= {
            sympy.Symbol(s.name, real=True): x
            for s, x in zip(argument.symbols, numbers, strict=True)
        }
    if program.closing is not None:
        assert "closing_step" in namespace
        for s in program.closing.unknown.symbols:
            position = motion_of_all(robot, q, dq, ddq)[0][0, int(s.name[1:]) - 1]
            values[sympy.Symbol(s.name, real=True)] = position
    for variable, expression in pairs:
        values[variable] = sympy.sympify(expression).xreplace(values).evalf()
    tau = [float(sympy.sympify(x).xreplace(values).evalf()) for x in outputs["tau"]]
    expected = observation(robot, base.parameters, q, dq, ddq)[0] @ theta
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["five_bar", "delta"])
def test_latex(name):
    programs = symbolic_models(mechanism(name), None, base_of(name))
    text = latex_document(programs)
    assert text.count("{") - text.count(r"\{") == text.count("}") - text.count(r"\}")
    assert text.count(r"\left(") == text.count(r"\right)")
    assert ("Step of Newton's method" in text) == (name == "delta")


def test_a_module_has_newtons_method_once():
    text = python_module(symbolic_models(mechanism("delta"), None, base_of("delta")))
    assert text.count("def close_loops(") == text.count("def closing_step(") == 1
    namespace: dict = {}
    exec(text, namespace)
    assert len(namespace["POSTURE"]) == 12
    q, dq, ddq = closed_states(mechanism("delta"), 3)
    passive = namespace["close_loops"](q.reshape(3, 1, 3))
    assert passive.shape == (3, 1, 9)
    positions = namespace["joint_motion"](q, dq, ddq)[0]
    np.testing.assert_array_equal(np.isin(passive[:, 0], positions), True)
    assert namespace["joint_motion"](q[:0], dq[:0], ddq[:0])[0].shape == (0, 12)


@pytest.mark.parametrize("name", MADE)
def test_same_text_each_time(name):
    first = inverse_model(mechanism(name), base_of(name)).to_c()
    assert inverse_model(mechanism(name), base_of(name)).to_c() == first
