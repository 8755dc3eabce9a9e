"""A lift changes no torque, and gives every link a mass."""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.models.runnable_model import standard_from_base
from pivident.robot.gallery import load_robot


@pytest.mark.parametrize("name", ["planar_2r", "staubli_tx40", "mitsubishi_rv2sq", "emps"])
def test_same_torques_and_a_mass_on_every_link(name):
    robot = load_robot(name)
    base = base_parameters(robot)
    rng = np.random.default_rng(3)
    values = base.values(nominal_values(robot, base.standard)) + 0.05 * rng.normal(size=len(base))
    standard = standard_from_base(base, values)
    assert np.abs(base.values(standard) - values).max() <= 1e-12 * max(1.0, np.abs(values).max())
    q, dq, ddq = rng.normal(size=(3, 50, robot.size))
    torque = Regressor.build(robot, base.parameters).torque(q, dq, ddq, values)
    lifted = Regressor.build(robot, base.standard).torque(q, dq, ddq, standard)
    assert lifted == pytest.approx(torque, abs=1e-10 * np.abs(torque).max())
    masses = [v for p, v in zip(base.standard, standard, strict=True) if p.stem == "m"]
    if name != "emps":  # the mass of a slide is a base parameter itself
        assert min(masses) > 0.0


def test_true_standard_parameters_stay_where_they_are():
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    nominal = nominal_values(robot, base.standard)
    assert standard_from_base(base, base.values(nominal)) == pytest.approx(nominal, abs=1e-9)
