"""Generated C: compiles without a warning, gives the same results, one state or many."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import call, cosine, sine
from pivident.dynamics.regressor import Regressor
from pivident.models.symbolic.assignments import Input, Output, output_array
from pivident.models.symbolic.composite_bodies import mass_matrix
from pivident.models.symbolic.newton_euler import inverse_model, observation_matrix
from pivident.models.symbolic.print_c import TILE, c_header, c_source
from pivident.models.symbolic.program import Program
from pivident.models.symbolic.robot_models import symbolic_models
from pivident.robot.gallery import load_robot
from tests.dynamics.friction_laws import law
from tests.models.symbolic.evaluation import evaluated
from tests.models.symbolic.robots import states
from tests.models.symbolic.test_program import example, inputs

COMPILER = shutil.which("gcc") or shutil.which("cc")
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wshadow"]

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")


def compiled(folder, programs, flags=("-O1",)):
    """A library of the programs; the header is included before, so that both agree."""
    source = folder / "model.c"
    (folder / "model.h").write_text(c_header(programs), encoding="utf-8")
    source.write_text('#include "model.h"\n' + c_source(programs), encoding="utf-8")
    library = folder / "model.so"
    command = [COMPILER, *STRICT, *flags, "-shared", "-fPIC", source, "-o", library, "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


def pointer(array):
    assert array.flags.c_contiguous and array.dtype == np.float64
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def one_by_one(function, arguments, parameters, shape):
    """Results of the function for one state, for each row of the arguments."""
    out = np.full((len(arguments[0]), *shape), np.nan)
    for k in range(len(out)):
        rows = [np.ascontiguousarray(a[k]) for a in arguments]
        result = np.full(shape, np.nan)
        function(*(pointer(a) for a in [*rows, *parameters, result]))
        out[k] = result
    return out


def all_at_once(function, arguments, parameters, shape):
    """Results of the function for many states; nothing is written behind the last row."""
    count = len(arguments[0])
    out = np.full((count + 1, *shape), np.nan)
    rows = [np.ascontiguousarray(a) for a in arguments]
    function(ctypes.c_size_t(count), *(pointer(a) for a in [*rows, *parameters, out]))
    assert np.isnan(out[count]).all()
    return out[:count]


@needs_compiler
@pytest.mark.parametrize("count", [0, 1, TILE - 1, TILE, 2 * TILE + 3])
def test_models_of_the_tx40(tmp_path_factory, count):
    library, robot, base = tx40_library(tmp_path_factory)
    q, dq, ddq = states(robot, count, 11)
    theta = np.random.default_rng(2).uniform(-1.0, 1.0, len(base))
    regressor = Regressor.build(robot, base.parameters)
    tau = all_at_once(library.inverse_model_samples, (q, dq, ddq), [theta], (6,))
    expected = regressor.torque(q, dq, ddq, theta)
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-11)
    single = one_by_one(library.inverse_model, (q, dq, ddq), [theta], (6,))
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e-11)
    phi = all_at_once(library.observation_matrix_samples, (q, dq, ddq), [], (6, len(base)))
    np.testing.assert_allclose(phi, regressor.matrix(q, dq, ddq), rtol=0, atol=1e-11)
    mass = one_by_one(library.mass_matrix, (q,), [theta], (6, 6))
    again = all_at_once(library.mass_matrix_samples, (q,), [theta], (6, 6))
    np.testing.assert_allclose(mass, again, rtol=0, atol=1e-13)


_libraries = {}


def tx40_library(tmp_path_factory):
    """Compiled once for all counts."""
    if not _libraries:
        robot = load_robot("staubli_tx40")
        base = base_parameters(robot)
        programs = [inverse_model(robot, base), observation_matrix(robot, base)]
        programs.append(mass_matrix(robot, base))
        _libraries["tx40"] = compiled(tmp_path_factory.mktemp("c"), programs), robot, base
    return _libraries["tx40"]


@needs_compiler
def test_odd_names_and_constant_results(tmp_path):
    program = example()
    library = compiled(tmp_path, [program])
    q, theta = inputs(TILE + 2)
    expected, matrix = evaluated(program, q, theta)
    tau, out = np.zeros((len(q), 2)), np.full((len(q), 2, 3), np.nan)
    arrays = [np.ascontiguousarray(q), theta, tau, out]
    library.lambda__samples(ctypes.c_size_t(len(q)), *(pointer(a) for a in arrays))
    np.testing.assert_allclose(tau, expected, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(out, matrix, rtol=1e-13, atol=1e-13)


@needs_compiler
@pytest.mark.parametrize("name", ["polynomial", "harmonic drive", "counterbalance", "load", "dahl"])
def test_friction_laws(tmp_path, name):
    robot = load_robot("planar_2r").with_friction(law(name))
    program = inverse_model(robot, "standard")
    library = compiled(tmp_path, [program])
    q, dq, ddq = states(robot, 10, 4)
    rng = np.random.default_rng(4)
    theta = rng.uniform(0.1, 1.0, len(program.parameters))
    given = [q, dq, ddq]
    if len(program.inputs) > 3:
        given.append(rng.uniform(-1.0, 1.0, (10, len(program.inputs[3]))))
    (expected,) = evaluated(program, *given, theta)
    tau = all_at_once(library.inverse_model_samples, given, [theta], (2,))
    np.testing.assert_allclose(tau, expected, rtol=1e-12, atol=1e-12)


@needs_compiler
def test_elementary_functions_are_exact_to_rounding(tmp_path):
    x = symbol("x")
    results = output_array([sine(x), cosine(x), call("atan", x), call("sign", x)])
    program = Program.build(
        "functions", [Input("x", (x,))], Input("theta", ()), [Output("y", results)]
    )
    library = compiled(tmp_path, [program], ("-O3",))
    rng = np.random.default_rng(6)
    size = 10.0 ** rng.uniform(-8.0, 5.0, (20_000, 1))
    angles = np.concatenate(
        [size * rng.choice([-1.0, 1.0], size.shape), np.arange(-40, 41)[:, None] * np.pi / 4]
    )
    y = all_at_once(library.functions_samples, [angles], [], (4,))
    exact = np.column_stack([np.sin(angles), np.cos(angles), np.arctan(angles), np.sign(angles)])
    np.testing.assert_allclose(y, exact, rtol=0, atol=3e-16)


@needs_compiler
def test_arguments_without_effect_do_not_warn(tmp_path):
    """Nothing of the EMPS depends on its position; a horizontal slide feels no gravity."""
    robot = load_robot("emps")
    library = compiled(tmp_path, symbolic_models(robot))
    theta = np.arange(1.0, 5.0)
    q, dq, ddq = states(robot, TILE + 1)
    tau = all_at_once(library.inverse_model_samples, (q, dq, ddq), [theta], (1,))
    (expected,) = evaluated(inverse_model(robot), q, dq, ddq, theta)
    np.testing.assert_allclose(tau, expected, rtol=1e-13)
    gravity = all_at_once(library.gravity_vector_samples, (q,), [theta], (1,))
    assert (gravity == 0.0).all()


def test_comments_cannot_be_closed_by_a_name():
    text = c_source([example()])
    comment = text[text.index("Two ") :].splitlines()[0]
    assert "*/" not in comment and "* /" in comment


def test_one_state_only():
    text = c_source([example()], prefix="arm_", many=False)
    assert "void arm_lambda(" in text and "_samples" not in text
    assert "arm_lambda(" in c_header([example()], prefix="arm_", many=False)
