import math

import numpy as np
import pytest

from pivident.robot import FrictionLaw
from pivident.robot.friction import (
    asymmetric_coulomb,
    coulomb,
    offset,
    stribeck,
    viscous,
)

SPEED = np.linspace(-2.0, 2.0, 9)


def atan(speed, gamma):
    return 2 / np.pi * np.arctan(gamma * speed)


def test_the_columns_of_a_law_are_its_functions_of_the_speed():
    law = FrictionLaw((viscous(), coulomb(gamma=150), offset(), stribeck(0.5, 2, gamma=20)))
    columns = law.columns(SPEED)
    np.testing.assert_allclose(columns[:, 0], SPEED)
    np.testing.assert_allclose(columns[:, 1], atan(SPEED, 150))
    np.testing.assert_allclose(columns[:, 2], 1.0)
    np.testing.assert_allclose(columns[:, 3], atan(SPEED, 20) * np.exp(-((SPEED / 0.5) ** 2)))


def test_equal_levels_in_both_directions_are_coulomb_friction():
    sides = FrictionLaw(asymmetric_coulomb("tanh", 30)).columns(SPEED)
    np.testing.assert_allclose(sides.sum(1), np.tanh(30 * SPEED), atol=1e-15)


def test_the_hard_sign_is_simulated_with_a_finite_slope():
    law = FrictionLaw((coulomb("sign", gamma=150),))
    np.testing.assert_allclose(law.columns(SPEED)[:, 0], np.sign(SPEED))
    np.testing.assert_allclose(law.columns(SPEED, simulated=True)[:, 0], atan(SPEED, 150))


@pytest.mark.parametrize("gamma", [0.0, -1.0, math.nan, math.inf])
def test_a_slope_that_is_not_positive_is_refused(gamma):
    with pytest.raises(ValueError, match="gamma of 'fc' must be positive"):
        coulomb(gamma=gamma)


def test_a_stribeck_speed_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="stribeck_speed must be positive, not 0"):
        stribeck(0.0)


@pytest.mark.parametrize(
    ("law", "text", "slopes"),
    [
        ((viscous(), coulomb(gamma=150), offset()), "fv dq + fc (2/π) atan(γ dq) + off", (150,)),
        ((coulomb("sign", gamma=150),), "fc sign(dq)", ()),
        (
            asymmetric_coulomb("tanh", 30),
            "fcp (1 + tanh(γ dq))/2 - fcn (1 - tanh(γ dq))/2",
            (30,),
        ),
        (
            (coulomb(gamma=150), stribeck(0.05, gamma=20)),
            "fc (2/π) atan(γ dq) + fs (2/π) atan(γ dq) exp(-|dq/0.05|^2)",
            (150, 20),
        ),
        ((), "none", ()),
    ],
)
def test_a_law_is_shown_as_a_formula(law, text, slopes):
    assert str(FrictionLaw(tuple(law))) == text
    assert FrictionLaw(tuple(law)).slopes == slopes


def test_a_term_is_named_once():
    with pytest.raises(ValueError, match="named twice: fv"):
        FrictionLaw((viscous(), viscous()))


def test_asymmetric_levels_leave_no_room_for_coulomb_or_offset():
    for term in (coulomb(), offset()):
        with pytest.raises(ValueError, match="already contains fc and off"):
            FrictionLaw((*asymmetric_coulomb(), term))
