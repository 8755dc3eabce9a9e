"""A leg whose description swings in its loop: where the search starts, and what it makes of it."""

from types import SimpleNamespace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.estimation.output_error.loop_unknowns import values_of
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD, Cascade
from pivident.loop.simulation.direction import ParametrisedLoop
from pivident.robot.mjcf import read_mjcf
from pivident.studies.simulators import search
from pivident.studies.simulators.fit_simulator import fit_simulator
from pivident.studies.simulators.joint_quantities import simulator_robot
from pivident.studies.simulators.search import equation_start
from tests.studies.simulators.leg import example

RATE, SECONDS, COUNT = 400.0, 3.0, 2.0 * np.pi / 2**14
LAW = PD(40.0, 1.0)
TRUTH = {
    "armature": np.array([0.018, 0.018, 0.017]),
    "damping": np.array([0.035, 0.10, 0.17]),
    "frictionloss": np.array([0.23, 0.30, 0.06]),
    "bias": np.array([0.024, -0.018, -0.043]),
    "delay": np.array([4.9e-3]),
}


def reference():
    """Chirps from 0.1 to 8 Hz, each joint with a phase and an amplitude of its own."""
    t = np.arange(round(SECONDS * RATE)) / RATE
    turns = 0.1 * t + 7.9 * t**2 / (2.0 * SECONDS)
    sweep = np.sin(2.0 * np.pi * turns[:, None] + np.array([5.8, 5.9, 5.5]))
    return np.array([0.0, 0.6, -1.2]) + np.minimum(t, 1.0)[:, None] * [0.26, 0.34, 0.21] * sweep


def log_of(robot, law):
    """Counted positions of the leg in its loop, at half the rate of the law."""
    machine, q_ref = simulator_robot(robot), reference()
    parameters = standard_parameters(machine)
    theta = nominal_values(machine, parameters)
    true = {"ia": TRUTH["armature"], "fv": TRUTH["damping"], "fc": TRUTH["frictionloss"]}
    for k, p in enumerate(parameters):
        if p.stem in true:
            theta[k] = true[p.stem][p.joint]
    bias, far = TRUTH["bias"], np.full(3, 1e4)
    signals = LoopSignals(
        RATE, q_ref, None, None, bias[None], np.ones(3), np.full(3, np.inf), far, far,
        drive_delay=float(TRUTH["delay"][0]),
    )  # fmt: skip
    loop = ParametrisedLoop(machine, parameters, theta, law, signals, (q_ref[0] - bias, 0.0 * bias))
    made = simulate(loop.model, law, signals, machine.joint_names, loop.begin)
    q = COUNT * np.round((made.q + bias) / COUNT)[::2]
    return Recording(
        "log", machine.joint_names, q, np.zeros_like(q), RATE / 2.0, q_ref[::2],
        control_rate=RATE, allow_constant=True, saturation="allow",
    )  # fmt: skip


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("leg") / "leg.xml"
    path.write_text(example().LEG, encoding="utf-8")
    return read_mjcf(path)


@pytest.mark.parametrize("law", [LAW, Cascade(40.0, 1.0)], ids=["pd", "cascade"])
def test_a_leg_that_swings_without_armature_is_found(robot, law):
    fit = fit_simulator(robot, Loop(law), log_of(robot, law))
    assert fit.converged
    for quantity, true in TRUTH.items():
        for found, value in zip(fit.of(quantity).values(), true, strict=True):
            assert abs(found.value - value) < 4 * found.std, found


def test_equations_of_motion_start_near_the_truth(robot, monkeypatch):
    starts = []

    def kept(stretches, unknowns):
        starts.append((unknowns, equation_start(stretches, unknowns)))
        return starts[-1][1]

    monkeypatch.setattr(search, "equation_start", kept)
    fit_simulator(robot, Loop(LAW), log_of(robot, LAW))
    found = dict(zip([u.name for u in starts[0][0]], starts[0][1].tolist(), strict=True))
    for k, joint in enumerate(robot.joint_names):
        for quantity, relative in (("armature", 0.05), ("damping", 0.3), ("frictionloss", 0.5)):
            ratio = found[f"{quantity}[{joint}]"] / TRUTH[quantity][k]
            assert abs(ratio - 1.0) < relative, (quantity, joint)
    assert abs(found["delay"] - TRUTH["delay"][0]) < 2e-4


def test_without_them_the_fit_says_that_it_did_not_settle(robot, monkeypatch):
    def description(stretches, unknowns):
        return values_of(stretches[0].loop, unknowns)

    monkeypatch.setattr(search, "equation_start", description)
    fit = fit_simulator(robot, Loop(LAW), log_of(robot, LAW))
    assert not fit.converged
    assert fit.rms.max() > 0.05


def test_errors_as_large_as_the_distance_from_the_reference_are_no_fit():
    t = np.linspace(0.0, 20.0, 500)
    q, q_ref = np.sin(t)[:, None], np.sin(t + 0.4)[:, None]
    loop = SimpleNamespace(signals=SimpleNamespace(q_ref=q_ref))
    stretch = SimpleNamespace(q=q, loop=loop, step=1, first=50, samples=500)

    def lost(share):
        errors = share * (q - q_ref).T[None]
        return search.is_lost(SimpleNamespace(stretches=(stretch,), errors=(errors,)))

    assert lost(0.8)
    assert not lost(0.3)
