"""The generated functions of friction: up to date, and derivatives of one another."""

from pathlib import Path

import numpy as np
import pytest

from pivident.dynamics import friction_generated
from pivident.dynamics.friction import expression_value
from pivident.dynamics.friction_generated import position_derivatives, speed_derivatives
from pivident.dynamics.friction_kernels import BY_GAMMA, CURVATURE, SLOPE, VALUE
from pivident.foundation.compiled import kernel
from pivident.robot.friction_terms import TERM_KINDS, friction_columns

COLUMNS = [c for c in friction_columns().values() if c.expression and not c.of_load]
CONSTANTS = (0.6, 1.7)
GAMMA = 3.0


def test_module_is_what_the_declarations_give():
    pytest.importorskip("sympy")
    from pivident.dynamics.generate_friction import built_in_module

    assert Path(friction_generated.__file__).read_text("utf-8") == built_in_module()


@kernel
def _speed(column, sign, first, second, dq, out):
    found = speed_derivatives(
        column, sign[0], sign[1], sign[2], sign[3], sign[4], first, second, dq
    )
    for k in range(out.size):
        out[k] = found[k]


@kernel
def _position(column, first, second, q, out):
    found = position_derivatives(column, first, second, q)
    for k in range(out.size):
        out[k] = found[k]


def derivatives(column, x, gamma=GAMMA, constants=CONSTANTS):
    """All numbers of a column with s = tanh(γ dq)."""
    out, s = np.empty(9), np.tanh(gamma * x)
    e = 1.0 - s * s
    slopes = np.array([s, gamma * e, -2 * gamma**2 * s * e, x * e, e - 2.0 * gamma * x * s * e])
    if column.of_position:
        _position(int(column), *constants, x, out)
    else:
        _speed(int(column), slopes, *constants, x, out)
    return out


@pytest.mark.parametrize("column", COLUMNS, ids=lambda c: c.name)
@pytest.mark.parametrize("x", [-1.3, -0.2, 0.04, 0.7])
def test_each_is_the_difference_of_another(column, x):
    step = 1e-6
    here = derivatives(column, x)
    s = np.tanh(GAMMA * x)
    names = {"q": x, "dq": x, "s": s} | dict(zip(column.constants, CONSTANTS, strict=False))
    value = expression_value(column.expression, names)
    assert here[VALUE] == pytest.approx(value, rel=1e-14)

    def difference(of, **changed):
        ahead = derivatives(column, **{k: v + step for k, v in changed.items()})[of]
        behind = derivatives(column, **{k: v - step for k, v in changed.items()})[of]
        return pytest.approx((ahead - behind) / (2.0 * step), rel=1e-7, abs=1e-8)

    assert here[SLOPE] == difference(VALUE, x=x)
    assert here[CURVATURE] == difference(SLOPE, x=x)
    for by, of in ((BY_GAMMA, VALUE), (BY_GAMMA + 1, SLOPE)):
        ahead, behind = (derivatives(column, x, GAMMA + h)[of] for h in (step, -step))
        assert here[by] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-7, abs=1e-8)
        for k in range(2):
            near = [np.array(CONSTANTS) + h * (np.arange(2) == k) for h in (step, -step)]
            ahead, behind = (derivatives(column, x, GAMMA, tuple(c))[of] for c in near)
            expected = pytest.approx((ahead - behind) / (2.0 * step), rel=1e-7, abs=1e-8)
            assert here[by + 2 * (k + 1)] == expected


@pytest.mark.parametrize("column", COLUMNS, ids=lambda c: c.name)
def test_all_are_finite_at_rest(column):
    for exponent in (0.1, 0.5, 1.0, 1.5, 2.0, 5.0):
        assert np.isfinite(derivatives(column, 0.0, constants=(0.3, exponent))).all()
        if column.name == "power":
            assert np.isfinite(derivatives(column, 0.0, constants=(exponent, 0.0))).all()


@pytest.mark.parametrize("kind", TERM_KINDS.values(), ids=lambda kind: kind.name)
def test_every_key_of_a_term_is_declared(kind):
    needed, possible = kind.arguments
    signs = {"smoothing", "gamma"}
    assert {key.key for key in kind.keys} == (needed | possible) - signs
    assert all(key.meaning for key in kind.keys if key.key in needed)
    assert len({column.name for column in kind.columns}) == len(kind.columns)
