"""Programs: what is left out, what becomes a variable, and the same results in every language."""

import numpy as np
import pytest
import sympy

from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import OperationCount, call, cosine, sine
from pivident.models.symbolic.assignments import MAX_OPERATIONS, Input, Output, output_array
from pivident.models.symbolic.program import Program
from tests.models.symbolic.evaluation import evaluated

Q = Input("q", (symbol("q1"), symbol("q2")), "positions [rad]")
NAMES = ("zz1", "zz[left elbow]", "zz_left_elbow", "class", "sin", "größe", "q1*/", "λ")
THETA = Input("theta", tuple(symbol(name) for name in NAMES), "parameters")


def example():
    """A program with shared parts, odd names and constant elements."""
    q1, q2 = Q.symbols
    a, b, c, d, e, f, g, h = THETA.symbols
    shared = a * sine(q1) + b * cosine(q1 + q2)
    first = shared * shared - c * sine(q1) + d * call("atan", 3.0 * q2)
    second = -(shared + e * f) * g + h * call("sign", q1)
    return Program.build(
        "lambda",
        [Q],
        THETA,
        [
            Output("tau", output_array([first, second]), "torques [N m]"),
            Output("if", output_array([[shared, 0.0, 1.0], [q2, -shared, a]]), "a matrix"),
        ],
        title='Two "results" of """nothing""" \\ */',
        hints=[("shared", shared), ("S1", sine(q1)), ("unused", a * h), ("number", q1)],
        notes=["A note."],
    )


def inputs(count=11):
    rng = np.random.default_rng(3)
    return rng.uniform(-4.0, 4.0, (count, 2)), rng.uniform(-2.0, 2.0, len(NAMES))


def test_variables_are_what_is_shared_or_named():
    program = example()
    names = list(program.variables.values())
    assert "shared" in names and "S1" in names
    assert "unused" not in names and "number" not in names
    assert len(set(names)) == len(names)
    before = set(Q.symbols) | set(THETA.symbols)
    for expression in program.variables:  # each variable is made of what stands before it
        for operand in expression.operands:
            assert operand in before or operand not in program.variables
        before.add(expression)


def test_operations_on_parameters_alone_are_named():
    program = example()
    assert program.parameter_operation_count == OperationCount(1, 0, 0, 0)
    assert "Of these, on parameters alone: 1 multiplications" in "\n".join(program.header)


def test_long_expressions_are_cut():
    symbols = tuple(symbol(f"p{k}") for k in range(200))
    total = symbols[0]
    for s in symbols[1:]:
        total = total + s * s
    program = Program.build(
        "sum", [Input("p", symbols)], Input("theta", ()), [Output("y", output_array([total]))]
    )
    longest = max(text.count("+") + text.count("*") for text in program.to_python().splitlines())
    assert longest <= MAX_OPERATIONS + 2
    p = np.random.default_rng(0).uniform(size=(3, 200))
    expected = p[:, 0] + (p[:, 1:] ** 2).sum(1)
    np.testing.assert_allclose(program.function()(p)[:, 0], expected, rtol=1e-14)


def test_generated_python_gives_the_same_results():
    program = example()
    q, theta = inputs()
    tau, matrix = program.function()(q, theta)
    tau_again, matrix_again = evaluated(program, q, theta)
    assert tau.shape == (11, 2) and matrix.shape == (11, 2, 3)
    np.testing.assert_allclose(tau, tau_again, rtol=1e-14)
    np.testing.assert_allclose(matrix, matrix_again, rtol=1e-14)
    assert (matrix[:, 0, 1] == 0.0).all() and (matrix[:, 0, 2] == 1.0).all()


def test_generated_python_broadcasts():
    program = example()
    q, theta = inputs(12)
    one, _ = program.function()(q[4], theta)
    grid, _ = program.function()(q.reshape(3, 4, 2), theta)
    assert one.shape == (2,) and grid.shape == (3, 4, 2)
    np.testing.assert_array_equal(grid[1, 0], one)
    with pytest.raises(ValueError, match=r"q has shape \(12, 3\); its last axis must be 2"):
        program.function()(np.zeros((12, 3)), theta)


def test_sympy_gives_the_same_results():
    program = example()
    q, theta = inputs(1)
    pairs, outputs = program.to_sympy()
    given = dict(zip([s.name for s in (*Q.symbols, *THETA.symbols)], [*q[0], *theta], strict=True))
    values = {sympy.Symbol(name, real=True): value for name, value in given.items()}
    for variable, expression in pairs:
        values[variable] = expression.subs(values)
    tau, matrix = evaluated(program, q[0], theta)
    ours = [float(sympy.sympify(x).subs(values)) for x in outputs["tau"]]
    np.testing.assert_allclose(ours, tau, rtol=1e-12)
    flat = [float(sympy.sympify(x).subs(values)) for x in sympy.flatten(outputs["if"])]
    np.testing.assert_allclose(flat, matrix.ravel(), rtol=1e-12)


def test_text_for_sympy_makes_the_same_expressions():
    from pivident.models.symbolic.print_python import sympy_module

    program = example()
    namespace = {}
    exec(sympy_module([program]), namespace)
    pairs, outputs = namespace["lambda_"]()
    expected_pairs, expected_outputs = program.to_sympy()
    assert len(pairs) == len(expected_pairs)
    for (_, ours), (_, theirs) in zip(pairs, expected_pairs, strict=True):
        numbers = {s: 0.3 + 0.1 * len(s.name) for s in ours.free_symbols | theirs.free_symbols}
        assert float(ours.subs(numbers)) == pytest.approx(float(theirs.subs(numbers)), rel=1e-12)
    assert outputs["if"].shape == expected_outputs["if"].shape == (2, 3)


def test_latex_is_escaped_and_balanced():
    text = example().to_latex()
    assert text.count("{") - text.count(r"\{") == text.count("}") - text.count(r"\}")
    assert text.count(r"\left(") == text.count(r"\right)")
    assert r"\textbackslash{}" in text and "Elements of a matrix that are not listed" in text
    body = text.split(r"\begin{align*}")[1].split(r"\end{align*}")[0]
    left = [line.split("&=")[0].strip() for line in body.split(r"\\")]
    assert len(set(left)) == len(left)


def test_unknown_symbols_are_refused():
    with pytest.raises(ValueError, match="'g' depends on 'other', which is no input"):
        Program.build("g", [Q], THETA, [Output("y", output_array([symbol("other")]))])
