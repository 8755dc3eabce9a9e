"""Model building, observation matrix and closed-loop simulation of the TX40, beside Pinocchio.

Run with ``pytest benchmarks/bench_dynamics.py --benchmark-enable``.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

RATE = 5000.0
SAMPLES = 34_500
ESSENTIAL = (
    "zz1 fv1 fc1 xx2 xz2 zz2 mx2 fv2 fc2 xx3 zz3 my3 ia3 fv3 fc3 mx4 ia4 fv4 fc4 my5 ia5 fv5 fc5 "
    "ia6 fv6 fc6 fvm6 fcm6"
).split()
KP = np.array([12047.5, 12015.0, 4556.8, 1359.0, 2840.3, 2354.1])
KD = np.array([89.37, 131.92, 28.23, 4.943, 8.857, 1.282])


@pytest.fixture(scope="module")
def robot():
    """The TX40 with 60 base parameters: friction with offsets, coupling without inertia."""
    gallery = load_robot("staubli_tx40")
    return replace(gallery, couplings=tuple(replace(c, inertia=False) for c in gallery.couplings))


@pytest.fixture(scope="module")
def motion(robot):
    """Moves between ten random postures: q, dq, ddq, each (samples, 6)."""
    postures = np.random.default_rng(0).uniform(-1.5, 1.5, (10, 6))
    return point_to_point(postures, 0.6 * robot.rated_speeds, RATE, SAMPLES)


@pytest.fixture(scope="module")
def theta(robot):
    """Nominal values of all standard parameters."""
    return nominal_values(robot, standard_parameters(robot))


@pytest.fixture(scope="module")
def model_of_pinocchio(robot):
    """The same tree and the same links."""
    model = pin.Model()
    for joint, link in zip(robot.joints, robot.links, strict=True):
        placement = pin.SE3(joint.rotation, joint.translation)
        index = model.addJoint(joint.parent + 1, pin.JointModelRZ(), placement, joint.name)
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = link.inertia
        dynamic = np.array([m, mx, my, mz, xx, xy, yy, xz, yz, zz])
        model.appendBodyToJoint(
            index, pin.Inertia.FromDynamicParameters(dynamic), pin.SE3.Identity()
        )
    model.armature[:] = robot.rotor_inertia
    return model


@pytest.mark.benchmark(group="model of a six-axis arm from its description")
def test_base_parameters_from_the_description(benchmark):
    benchmark(lambda: base_parameters(load_robot("staubli_tx40")))


@pytest.mark.benchmark(group="observation matrix, 34,500 samples")
def test_dense_matrix_of_60_base_columns(benchmark, robot, motion):
    regressor = Regressor.build(robot, base_parameters(robot).parameters)
    assert len(regressor.parameters) == 60
    buffer = regressor.matrix(*motion)
    benchmark(regressor.matrix, *motion, out=buffer)


@pytest.mark.benchmark(group="observation matrix, 34,500 samples")
def test_packed_entries_of_the_essential_set(benchmark, robot, motion):
    base = base_parameters(robot)
    wanted = sorted(base.index(n) for n in (*ESSENTIAL, *(f"off{j}" for j in range(1, 7))))
    regressor = Regressor.build(robot, [base.parameters[k] for k in wanted])
    last = [np.ascontiguousarray(x.T) for x in motion]
    buffer = regressor.packed(*last)
    benchmark(regressor.packed, *last, out=buffer)


@pytest.mark.benchmark(group="observation matrix, 34,500 samples")
def test_torques_without_the_matrix(benchmark, robot, motion, theta):
    regressor = Regressor.build(robot, standard_parameters(robot))
    benchmark(regressor.torque, *motion, theta)


@pytest.mark.benchmark(group="observation matrix, 34,500 samples")
def test_pinocchio_regressor_in_a_python_loop(benchmark, model_of_pinocchio, motion):
    data = model_of_pinocchio.createData()
    out = np.empty((SAMPLES, 6, 60))

    def loop():
        for k, (q, dq, ddq) in enumerate(zip(*motion, strict=True)):
            out[k] = pin.computeJointTorqueRegressor(model_of_pinocchio, data, q, dq, ddq)

    benchmark(loop)


@pytest.mark.benchmark(group="closed-loop simulation, 34,500 samples")
def test_simulation(benchmark, robot, motion, theta):
    model = make_model(robot, standard_parameters(robot), theta)
    signals = LoopSignals(
        RATE, motion[0], motion[1], None, None, np.ones(6), np.full(6, np.inf),
        np.full(6, 1.0), np.full(6, 100.0),
    )  # fmt: skip
    benchmark(simulate, model, PD(KP, KD), signals, robot.joint_names)


@pytest.mark.benchmark(group="closed-loop simulation, 34,500 samples")
def test_pinocchio_aba_in_a_python_loop(benchmark, model_of_pinocchio, robot, motion, theta):
    """Runge–Kutta 4 with one substep, which is not accurate on the wrist."""
    value = dict(zip((p.name for p in standard_parameters(robot)), theta, strict=True))
    viscous, dry = (np.array([value[f"{s}{j}"] for j in range(1, 7)]) for s in ("fv", "fc"))
    data, h = model_of_pinocchio.createData(), 1.0 / RATE

    def acceleration(q, dq, tau):
        friction = viscous * dq + dry * (2.0 / np.pi) * np.arctan(150.0 * dq)
        return pin.aba(model_of_pinocchio, data, q, dq, tau - friction).copy()

    def loop():
        q, dq, last = motion[0][0].copy(), np.zeros(6), motion[0][0]
        for q_ref, dq_ref in zip(motion[0], motion[1], strict=True):
            tau = KP * (q_ref - q) + KD * (dq_ref - (q - last) / h)
            last = q
            a1 = acceleration(q, dq, tau)
            v2 = dq + 0.5 * h * a1
            a2 = acceleration(q + 0.5 * h * dq, v2, tau)
            v3 = dq + 0.5 * h * a2
            a3 = acceleration(q + 0.5 * h * v2, v3, tau)
            v4 = dq + h * a3
            a4 = acceleration(q + h * v3, v4, tau)
            q = q + h / 6.0 * (dq + 2.0 * (v2 + v3) + v4)
            dq = dq + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        return q

    assert np.abs(loop() - motion[0][-1]).max() < 0.1
    benchmark.pedantic(loop, rounds=3)
