import math

import numpy as np
import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    dahl,
    lugre,
    offset,
    power_viscous,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot
from tests.friction_columns import friction_columns

SPEED = np.linspace(-2.0, 2.0, 9)


def atan(speed, gamma):
    return 2 / np.pi * np.arctan(gamma * speed)


def test_the_columns_of_a_law_are_its_functions_of_the_speed():
    law = FrictionLaw((viscous(), coulomb(gamma=150), offset(), stribeck(0.5, 2, gamma=20)))
    columns = friction_columns(law, SPEED)
    np.testing.assert_allclose(columns[:, 0], SPEED)
    np.testing.assert_allclose(columns[:, 1], atan(SPEED, 150))
    np.testing.assert_allclose(columns[:, 2], 1.0)
    np.testing.assert_allclose(columns[:, 3], atan(SPEED, 20) * np.exp(-((SPEED / 0.5) ** 2)))


def test_equal_levels_in_both_directions_are_coulomb_friction():
    sides = friction_columns(FrictionLaw(asymmetric_coulomb("tanh", 30)), SPEED)
    np.testing.assert_allclose(sides.sum(1), np.tanh(30 * SPEED), atol=1e-15)


def test_the_hard_sign_is_simulated_with_a_finite_slope():
    law = FrictionLaw((coulomb("sign", gamma=150),))
    np.testing.assert_allclose(friction_columns(law, SPEED)[:, 0], np.sign(SPEED))
    np.testing.assert_allclose(friction_columns(law, SPEED, simulated=True)[:, 0], atan(SPEED, 150))


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


def test_terms_that_share_a_constant_agree_on_it():
    both = (stribeck(0.1), *lugre(1e-3, 0.2, 0.1))
    changed = FrictionLaw(both).with_shapes({"stribeck_speed": 0.3})
    assert [t.shape("stribeck_speed").value for t in changed.terms] == [0.3, 0.3, 0.3]
    with pytest.raises(ValueError, match=r"stribeck_speed is 0\.1 in one term and 0\.2 in another"):
        FrictionLaw((stribeck(0.1), *lugre(1e-3, 0.2, 0.2)))


def test_terms_of_a_polynomial_have_powers_of_their_own():
    law = FrictionLaw((power_viscous(2.0, "fva"), power_viscous(3.0, "fvb")))
    assert [(s.name, s.value) for s in law.shapes] == [("fva_exponent", 2), ("fvb_exponent", 3)]


def test_presliding_takes_the_place_of_coulomb_friction():
    with pytest.raises(ValueError, match="named twice: fc; 'dahl' and 'lugre' take the place"):
        FrictionLaw((coulomb(), dahl(1e-3)))
    with pytest.raises(ValueError, match="already contains fv; drop"):
        FrictionLaw((viscous(), *asymmetric_viscous()))


def test_an_unknown_constant_is_refused_with_the_nearest_one():
    with pytest.raises(ValueError, match="no constant 'striebeck_speed'; did you mean 'stribeck"):
        FrictionLaw((stribeck(0.1),)).with_shapes({"striebeck_speed": 0.3})


def test_single_joints_may_have_laws_of_their_own():
    robot = load_robot("planar_2r")
    name = robot.joint_names[1]
    changed = robot.with_friction({name: FrictionLaw((dahl(1e-3),))})
    assert str(changed.joints[1].friction) == "fc z(0.001)"
    assert changed.joints[0].friction == robot.joints[0].friction
    with pytest.raises(RobotDescriptionError, match="no joint 'elbo'"):
        robot.with_friction({"elbo": FrictionLaw()})
