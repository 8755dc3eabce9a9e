"""A closed loop in MuJoCo with the exported model, beside our own simulator."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.forward import make_model
from pivident.experiment import simulated_tx40 as scenarios
from pivident.foundation.errors import ExportError, SimulationDiverged
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PID, Cascade
from pivident.models.export.mjcf import to_mjcf
from pivident.models.export.urdf import to_urdf
from pivident.models.runnable_model import runnable_model
from pivident.robot.gallery import load_robot

from mujoco_loop import simulate_in_mujoco  # isort: skip

SAMPLES = 1500


@pytest.fixture(scope="module")
def loop():
    """The TX40 on the fastest part of its reference, model, law, signals, start, our positions."""
    model = runnable_model(load_robot("staubli_tx40"))
    problem, _ = scenarios.tx40_fine(samples=SAMPLES)
    recording, n = problem.recordings[0], 6
    signals = LoopSignals(
        recording.rate, recording.q_ref, recording.dq_ref, None, None,
        np.ones(n), np.full(n, np.inf), np.full(n, 0.5), np.full(n, 50.0),
    )  # fmt: skip
    return model, problem.loop.controller, signals


def ours(model, controller, signals):
    arranged = make_model(model.robot, model.parameters, model.values)
    return simulate(arranged, controller, signals, model.robot.joint_names).q


def test_with_the_models_friction_the_positions_are_ours(loop):
    model = loop[0]
    expected = ours(*loop)
    assert np.ptp(expected, axis=0).max() > 0.3
    q = simulate_in_mujoco(to_mjcf(model), *loop, steps=4, integrator="rk4", friction="model")
    np.testing.assert_allclose(q, expected, atol=1e-7)
    off = simulate_in_mujoco(to_mjcf(model), *loop, friction="model") - expected
    assert np.abs(off).max() < 1e-4


def test_with_mujocos_own_friction_they_are_near(loop):
    model, _, signals = loop
    expected = ours(*loop)
    off = simulate_in_mujoco(to_mjcf(model), *loop) - expected
    error = expected - signals.q_ref
    assert 1e-6 < np.sqrt(np.mean(off**2)) < 0.2 * np.sqrt(np.mean(error**2))


@pytest.mark.parametrize(
    "controller",
    [
        PID([3000.0, 2000.0], [120.0, 60.0], [4000.0, 2000.0], 0.002),
        Cascade([20.0, 20.0], [120.0, 60.0], [5.0, 5.0], averaged=True),
    ],
)
def test_filters_and_integrators_of_the_law_run_as_in_our_simulator(controller):
    model = runnable_model(load_robot("planar_2r"))
    smooth = [
        0.0 if p.stem == "fc" else v for p, v in zip(model.parameters, model.values, strict=True)
    ]
    model = replace(model, values=np.array(smooth))
    t = np.arange(1000) / 1000.0
    q_ref = np.column_stack([0.3 + 0.5 * np.sin(4 * t), 0.2 - 0.4 * np.sin(6 * t)])
    signals = LoopSignals(
        1000.0, q_ref, None, 2.0 * np.ones_like(q_ref), 1e-5 * np.cos(40 * q_ref),
        np.array([1.0, 0.5]), np.array([60.0, 60.0]), np.full(2, 1.0), np.full(2, 50.0),
    )  # fmt: skip
    q = simulate_in_mujoco(to_mjcf(model), model, controller, signals, steps=4, integrator="rk4")
    np.testing.assert_allclose(q, ours(model, controller, signals), atol=1e-6)


def test_a_loop_that_leaves_its_reference_names_the_joint(loop):
    model, _, signals = loop
    with pytest.raises(SimulationDiverged, match=r"'joint_6' is 0\.50"):
        simulate_in_mujoco(to_mjcf(model), model, PID(np.zeros(6), np.zeros(6)), signals)


def test_only_mjcf_has_motors(loop):
    model, controller, signals = loop
    with pytest.raises(ExportError, match="needs an MJCF file"):
        simulate_in_mujoco(to_urdf(model), model, controller, signals)
