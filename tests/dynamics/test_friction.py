"""Friction columns: whole signals, single speeds and slopes agree."""

import numpy as np
import pytest

from pivident.dynamics.friction import friction_column, smoothed_sign
from pivident.dynamics.friction_kernels import friction_value_and_slope, smooth_sign_and_slope
from pivident.robot.friction_column import FrictionColumn, Shape, SignFunction, Smoothing
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms.coulomb import COULOMB, COULOMB_NEGATIVE, COULOMB_POSITIVE
from pivident.robot.friction_terms.offset import OFFSET
from pivident.robot.friction_terms.stribeck import STRIBECK
from pivident.robot.friction_terms.viscous import POWER, VISCOUS, VISCOUS_NEGATIVE, VISCOUS_POSITIVE

SIGNS = ("sign", "atan", "tanh")
SMOOTH = ("atan", "tanh")
NONLINEAR = (
    COULOMB,
    COULOMB_POSITIVE,
    COULOMB_NEGATIVE,
    STRIBECK,
    POWER,
    VISCOUS_POSITIVE,
    VISCOUS_NEGATIVE,
)
SHAPE = (40.0, 0.07, 1.6)  # γ, v_s, δ
SPEEDS = np.concatenate([np.linspace(-1.0, 1.0, 401), [-1e-6, 1e-6, 30.0, -30.0]])


def term(
    column: FrictionColumn, smoothing: Smoothing, shape: tuple[float, ...] = SHAPE
) -> FrictionTerm:
    shapes = (
        Shape(n, v, "1", 0.0, 10.0) for n, v in zip(column.constants, shape[1:], strict=False)
    )
    return FrictionTerm("f", column, smoothing, shape[0], tuple(shapes))


def value_and_slope(column: FrictionColumn, smoothing: Smoothing, speed: float):
    code, sign, shape = term(column, smoothing).encoded()
    return friction_value_and_slope(code, sign, *shape[:3], speed)


@pytest.mark.parametrize("sign", SMOOTH)
@pytest.mark.parametrize("column", NONLINEAR)
def test_a_single_speed_gives_the_value_of_the_signal(column, sign):
    signal = friction_column(term(column, sign), SPEEDS)
    single = [value_and_slope(column, sign, v)[0] for v in SPEEDS]
    np.testing.assert_allclose(single, signal, rtol=1e-14, atol=1e-16)


@pytest.mark.parametrize("sign", SMOOTH)
@pytest.mark.parametrize("column", NONLINEAR)
def test_slopes_are_those_of_finite_differences(column, sign):
    step = 1e-6
    speeds = SPEEDS[abs(SPEEDS) > 2e-6]  # |v|^1.6 has no second derivative at rest
    above, below = (friction_column(term(column, sign), speeds + h) for h in (step, -step))
    slopes = [value_and_slope(column, sign, v)[1] for v in speeds]
    np.testing.assert_allclose(slopes, (above - below) / (2 * step), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("sign", SMOOTH)
def test_slopes_at_rest(sign):
    slope = {"atan": 2 / np.pi * 40.0, "tanh": 40.0}[sign]
    assert smooth_sign_and_slope(int(SignFunction[sign.upper()]), 40.0, 0.0) == (
        0.0,
        pytest.approx(slope),
    )
    at_rest = {column: value_and_slope(column, sign, 0.0) for column in NONLINEAR}
    assert at_rest[COULOMB] == (0.0, pytest.approx(slope))
    assert at_rest[COULOMB_POSITIVE] == (0.5, pytest.approx(slope / 2))
    assert at_rest[COULOMB_NEGATIVE] == (-0.5, pytest.approx(slope / 2))
    for column in (VISCOUS_POSITIVE, VISCOUS_NEGATIVE):
        assert at_rest[column] == (0.0, 0.5)
    assert at_rest[STRIBECK] == (0.0, pytest.approx(slope))


def test_linear_columns():
    np.testing.assert_array_equal(friction_column(term(VISCOUS, "sign"), SPEEDS), SPEEDS)
    assert (friction_column(term(OFFSET, "sign"), SPEEDS) == 1.0).all()


@pytest.mark.parametrize("sign", [SignFunction[name.upper()] for name in SIGNS])
def test_sign_functions_are_odd_and_bounded_by_one(sign):
    s = smoothed_sign(sign, 40.0, SPEEDS)
    np.testing.assert_array_equal(s, -smoothed_sign(sign, 40.0, -SPEEDS))
    assert abs(s).max() <= 1.0
    assert (np.sign(s) == np.sign(SPEEDS)).all()


def test_both_directions_together_are_symmetric_coulomb_friction():
    for sign in SIGNS:
        up, down, both = (
            friction_column(term(column, sign), SPEEDS)
            for column in (
                COULOMB_POSITIVE,
                COULOMB_NEGATIVE,
                COULOMB,
            )
        )
        np.testing.assert_allclose(up + down, both, atol=1e-16)
        assert (up >= 0).all() and (down <= 0).all()


def test_stribeck_friction_has_fallen_to_one_over_e_at_its_speed():
    value = friction_column(term(STRIBECK, "sign", (1.0, 0.07, 1.6)), np.array([0.07, -0.07]))
    np.testing.assert_allclose(value, [np.exp(-1), -np.exp(-1)])


def test_half_of_coulomb_friction_acts_at_one_over_gamma():
    # the creep that the smoothing of the paper allows: 50 % at 1/150 rad/s, 95 % at 0.085 rad/s
    s = smoothed_sign(SignFunction.ATAN, 150.0, np.array([1 / 150, np.tan(0.475 * np.pi) / 150]))
    np.testing.assert_allclose(s, [0.5, 0.95], rtol=1e-12)
