"""Friction columns: whole signals, single speeds and slopes agree."""

import numpy as np
import pytest

from pivident.dynamics.friction import friction_column, smoothed_sign
from pivident.dynamics.friction_kernels import friction_value_and_slope, smooth_sign_and_slope
from pivident.robot.friction import FrictionColumn
from pivident.robot.friction_term import SignFunction

SMOOTH = (SignFunction.ATAN, SignFunction.TANH)
NONLINEAR = (
    FrictionColumn.COULOMB,
    FrictionColumn.COULOMB_POSITIVE,
    FrictionColumn.COULOMB_NEGATIVE,
    FrictionColumn.STRIBECK,
    FrictionColumn.POWER,
    FrictionColumn.VISCOUS_POSITIVE,
    FrictionColumn.VISCOUS_NEGATIVE,
)
SHAPE = (40.0, 0.07, 1.6)  # γ, v_s, δ
SPEEDS = np.concatenate([np.linspace(-1.0, 1.0, 401), [-1e-6, 1e-6, 30.0, -30.0]])


@pytest.mark.parametrize("sign", SMOOTH)
@pytest.mark.parametrize("column", NONLINEAR)
def test_a_single_speed_gives_the_value_of_the_signal(column, sign):
    signal = friction_column(column, sign, SHAPE, SPEEDS)
    single = [friction_value_and_slope(int(column), int(sign), *SHAPE, v)[0] for v in SPEEDS]
    np.testing.assert_allclose(single, signal, rtol=1e-14, atol=1e-16)


@pytest.mark.parametrize("sign", SMOOTH)
@pytest.mark.parametrize("column", NONLINEAR)
def test_slopes_are_those_of_finite_differences(column, sign):
    step = 1e-6
    speeds = SPEEDS[abs(SPEEDS) > 2e-6]  # |v|^1.6 has no second derivative at rest
    above, below = (friction_column(column, sign, SHAPE, speeds + h) for h in (step, -step))
    slopes = [friction_value_and_slope(int(column), int(sign), *SHAPE, v)[1] for v in speeds]
    np.testing.assert_allclose(slopes, (above - below) / (2 * step), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("sign", SMOOTH)
def test_slopes_at_rest(sign):
    slope = {SignFunction.ATAN: 2 / np.pi * 40.0, SignFunction.TANH: 40.0}[sign]
    assert smooth_sign_and_slope(int(sign), 40.0, 0.0) == (0.0, pytest.approx(slope))
    at_rest = {
        column: friction_value_and_slope(int(column), int(sign), *SHAPE, 0.0)
        for column in NONLINEAR
    }
    assert at_rest[FrictionColumn.COULOMB] == (0.0, pytest.approx(slope))
    assert at_rest[FrictionColumn.COULOMB_POSITIVE] == (0.5, pytest.approx(slope / 2))
    assert at_rest[FrictionColumn.COULOMB_NEGATIVE] == (-0.5, pytest.approx(slope / 2))
    for column in (FrictionColumn.VISCOUS_POSITIVE, FrictionColumn.VISCOUS_NEGATIVE):
        assert at_rest[column] == (0.0, 0.5)
    assert at_rest[FrictionColumn.STRIBECK] == (0.0, pytest.approx(slope))


def test_linear_columns():
    np.testing.assert_array_equal(friction_column(FrictionColumn.VISCOUS, 0, SHAPE, SPEEDS), SPEEDS)
    assert (friction_column(FrictionColumn.OFFSET, 0, SHAPE, SPEEDS) == 1.0).all()


@pytest.mark.parametrize("sign", list(SignFunction))
def test_sign_functions_are_odd_and_bounded_by_one(sign):
    s = smoothed_sign(sign, 40.0, SPEEDS)
    np.testing.assert_array_equal(s, -smoothed_sign(sign, 40.0, -SPEEDS))
    assert abs(s).max() <= 1.0
    assert (np.sign(s) == np.sign(SPEEDS)).all()


def test_both_directions_together_are_symmetric_coulomb_friction():
    for sign in SignFunction:
        up, down, both = (
            friction_column(column, sign, SHAPE, SPEEDS)
            for column in (
                FrictionColumn.COULOMB_POSITIVE,
                FrictionColumn.COULOMB_NEGATIVE,
                FrictionColumn.COULOMB,
            )
        )
        np.testing.assert_allclose(up + down, both, atol=1e-16)
        assert (up >= 0).all() and (down <= 0).all()


def test_stribeck_friction_has_fallen_to_one_over_e_at_its_speed():
    value = friction_column(
        FrictionColumn.STRIBECK, SignFunction.SIGN, (1.0, 0.07, 1.6), np.array([0.07, -0.07])
    )
    np.testing.assert_allclose(value, [np.exp(-1), -np.exp(-1)])


def test_half_of_coulomb_friction_acts_at_one_over_gamma():
    # the creep that the smoothing of the paper allows: 50 % at 1/150 rad/s, 95 % at 0.085 rad/s
    s = smoothed_sign(SignFunction.ATAN, 150.0, np.array([1 / 150, np.tan(0.475 * np.pi) / 150]))
    np.testing.assert_allclose(s, [0.5, 0.95], rtol=1e-12)
