"""The machines of benchmarks/model_faults against pivident's inverse dynamics, fault by fault."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.model_faults.cases import users_robot
from benchmarks.model_faults.faults import FAULTS, is_possible
from benchmarks.model_faults.machines import draw
from benchmarks.model_faults.simulator import Plant
from benchmarks.unknown_arms.truth import true_base_parameters

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor

#: Step over which a mean acceleration is that of its begin [s].
H = 1e-7


def misfit(fault: str, arm: str, corrected: bool, record: int = 0) -> float:
    """Largest error of the inverse dynamics with the true parameters over the largest torque."""
    planted = FAULTS[fault](draw(arm, 3), np.random.default_rng(8))
    setup = planted.setup
    believed = setup
    if corrected and planted.corrected is not None:
        believed = replace(setup, believed=planted.corrected)
    robot = users_robot(believed)
    base = base_parameters(robot)
    truth = true_base_parameters(setup.made, robot)
    theta = np.array([truth[name] for name in base.names])
    regressor = Regressor.build(robot, base.parameters)
    rng = np.random.default_rng(9)
    errors, sizes = [], []
    for _ in range(5):
        n = setup.arm.size
        q = np.array(setup.arm.home) + 0.5 * np.array(setup.arm.reach) * rng.uniform(-1, 1, n)
        plant = Plant(setup, record, q)
        plant.v[:] = v = 0.3 * setup.arm.speeds * rng.uniform(-1, 1, n)
        tau = 0.1 * setup.arm.efforts * rng.uniform(-1, 1, n)
        plant.step(setup.drive * tau, H, 1.0)
        ddq = (plant.v - v) / H
        seen = setup.gear * np.array([q, v, ddq])
        seen[0] += setup.zero
        model = regressor.torque(*(x[None] for x in seen), theta)[0]
        errors.append(np.abs(model - tau))
        sizes.append(np.abs(tau))
    return float((np.max(errors, axis=0) / np.max(sizes, axis=0)).max())


@pytest.mark.parametrize("arm", ["scara", "cobot6", "link7", "telescope"])
def test_without_fault_the_users_model_is_right(arm):
    assert misfit("none", arm, corrected=False) < 1e-5


@pytest.mark.parametrize("arm", ["scara", "cobot6", "link7", "telescope"])
@pytest.mark.parametrize("fault", ["link-length", "axis-angle", "joint-offset"])
def test_a_corrected_description_is_right(fault, arm):
    if not is_possible(fault, arm):
        pytest.skip("this arm does not show it")
    right, wrong = (misfit(fault, arm, corrected) for corrected in (True, False))
    assert right < 1e-5 < 1e-4 < wrong


@pytest.mark.parametrize("fault", ["gear-ratio", "torque-gain", "stribeck", "tanh"])
def test_other_faults_change_the_torques(fault):
    assert misfit(fault, "cobot6", corrected=True) > 3e-3


def test_a_payload_is_in_the_second_record_only():
    assert misfit("payload", "cobot6", corrected=False) < 1e-5
    assert misfit("payload", "cobot6", corrected=False, record=1) > 1e-2
