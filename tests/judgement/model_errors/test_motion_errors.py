"""A robot changed by a little keeps the entries of its regressor; only its geometry is new."""

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.regressor import Regressor
from pivident.judgement.model_errors import motion_errors


@pytest.mark.parametrize("name", ["planar_2r", "staubli_tx40"])
@pytest.mark.parametrize("way", ["moved", "turned", "tilted"])
def test_entries_in_another_geometry_are_those_of_the_robot_built_anew(name, way):
    robot = pv.load_robot(name)
    parameters = pv.base_parameters(robot).parameters
    regressor = Regressor.build(robot, parameters)
    rng = np.random.default_rng(0)
    motion = rng.uniform(-2.0, 2.0, (3, 40, robot.size))
    theta = rng.normal(size=len(parameters))
    differs = False
    for j in range(robot.size):
        change = {
            "moved": motion_errors._moved(j, 0),
            "turned": motion_errors._turned(j, 1),
            "tilted": motion_errors._tilted(0),
        }[way]
        own = motion_errors._regressor_after(change, 1e-3, regressor)
        anew = Regressor.build(change(robot, 1e-3), parameters, probed=False)
        assert np.array_equal(own.torque(*motion, theta), anew.torque(*motion, theta))
        differs |= not np.array_equal(own.torque(*motion, theta), regressor.torque(*motion, theta))
    assert differs
