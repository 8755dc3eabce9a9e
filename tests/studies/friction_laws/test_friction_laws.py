"""Estimators with every friction law, on motions of the planar arm whose parameters are known."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.estimation.answer import answer
from pivident.estimation.identify import build_regression, identify
from pivident.estimation.iteration import MAX_PASSES
from pivident.estimation.least_squares import LeastSquares, settled_least_squares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass, RandomWalk
from pivident.judgement.validation.moment_sums import moment_sums
from pivident.judgement.validation.overidentification import overidentification_test
from pivident.loop.motion.motion import Kinematics, packed_stretch, with_inner
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import load_robot
from tests.dynamics.friction_laws import LAWS, law, smooth_motion
from tests.friction_columns import friction_columns

RATE = 500.0
FULL, THINNED = LeastSquares(signals=RandomWalk()), LeastSquares(signals=Bandpass(decimation=8))


def truth_of(problem: Problem) -> np.ndarray:
    """Nominal inertias and some friction, shape (parameters,)."""
    rng = np.random.default_rng(5)
    standard = problem.base.standard
    values = nominal_values(problem.robot, standard)
    for k, p in enumerate(standard):
        if p.friction is not None:
            values[k] = 0.08 if p.stem == "fl" else rng.uniform(1.0, 3.0)
    return problem.base.values(values)


def exact(name: str, duration: float = 12.0) -> tuple[Problem, Kinematics, np.ndarray]:
    """A problem, its motion without noise, and the true parameters.

    The torque is that of the rigid arm and, joint by joint, of the law's own formulas.
    """
    robot = load_robot("planar_2r").with_friction(law(name))
    q, dq, ddq = smooth_motion(RATE, duration, 2)
    empty = Recording("run", robot.joint_names, q, dq + ddq, RATE, torque_timing="sampled")
    problem = Problem(robot, (empty,))
    theta = truth_of(problem)
    bare = robot.with_friction(FrictionLaw())
    rigid = Regressor.build(bare, standard_parameters(bare))
    named = dict(zip(problem.base.standard, problem.base.standard_from_base(theta), strict=True))
    own = [value for p, value in named.items() if p.friction is None]
    tau = rigid.torque(q, dq, ddq, np.array(own))
    for j, joint in enumerate(robot.joints):
        friction = {p.stem: v for p, v in named.items() if p.friction is not None and p.joint == j}
        springs = [t for t in joint.friction.terms if t.carries_load]
        load = tau[:, j].copy()
        if springs:
            load += friction_columns(FrictionLaw(tuple(springs)), dq[:, j], q[:, j]) @ [
                friction[t.stem] for t in springs
            ]
        columns = friction_columns(joint.friction, dq[:, j], q[:, j], load)
        tau[:, j] += columns @ [friction[t.stem] for t in joint.friction.terms]
    recording = replace(empty, tau=tau)
    unknown = np.full(2, np.nan)
    motion = [np.ascontiguousarray(x.T) for x in (q, dq, ddq, tau)]
    return (
        replace(problem, recordings=(recording,)),
        Kinematics(recording, *motion, 0, len(q), unknown, unknown),
        theta,
    )


def silent(line: str) -> None:
    pass


@pytest.mark.parametrize("method", [FULL, THINNED], ids=["full rate", "decimated"])
@pytest.mark.parametrize("name", LAWS)
def test_least_squares_returns_the_parameters_of_every_law(name, method):
    problem, kinematics, theta = exact(name)
    found = answer(problem, method, *settled_least_squares(problem, method, [kinematics], silent))
    assert found.converged
    np.testing.assert_allclose(found.theta, theta, rtol=1e-8, atol=1e-8)
    model = found.predict(kinematics.q.T, kinematics.dq.T, kinematics.ddq.T)
    np.testing.assert_allclose(model, kinematics.tau.T, atol=1e-7)
    assert (found.iterations > 1) == problem.regressor.depends_on_load


def test_the_load_settles_in_a_few_passes_where_there_is_noise():
    problem, kinematics, theta = exact("load")
    noise = 0.5 * np.random.default_rng(1).standard_normal(kinematics.tau.shape)
    noisy = replace(kinematics, tau=kinematics.tau + noise)
    found = answer(problem, FULL, *settled_least_squares(problem, FULL, [noisy], silent))
    assert found.converged and found.iterations < MAX_PASSES / 3
    assert (np.abs(found.theta - theta) < 5.0 * found.formula_std).all()


def test_a_stretch_without_the_path_before_it_is_refused():
    problem, kinematics, _ = exact("dahl", 4.0)
    with pytest.raises(ValueError, match="does not contain the path before it"):
        packed_stretch(problem.regressor, kinematics, slice(500, 600))
    whole = with_inner(problem.regressor, kinematics)
    part = slice(500, 600)
    alone = problem.regressor.packed(whole.q[:, part], whole.dq[:, part], whole.ddq[:, part])
    stretch = packed_stretch(problem.regressor, whole, part)
    assert np.abs(stretch - alone).max() > 0.1


def test_a_usual_law_leaves_a_motion_as_it_is():
    problem, kinematics, _ = exact("stribeck", 4.0)
    assert with_inner(problem.regressor, kinematics) is kinematics


@pytest.mark.parametrize("name", ["dahl", "load"])
def test_built_regressions_know_path_and_load(name):
    problem, _, theta = exact(name, 6.0)
    names = dict(zip(problem.names, theta, strict=True))
    phi, tau = build_regression(replace(problem, initial=names))
    error = tau - phi @ theta
    assert np.sqrt(np.mean(error**2)) < 5e-3 * np.sqrt(np.mean(tau**2))


KP, KD = np.array([6000.0, 2500.0]), np.array([180.0, 60.0])


def simulated(name: str, noise_std: float) -> tuple[Problem, np.ndarray]:
    """A run of the planar arm with a law, encoder noise in the loop, and the true parameters."""
    robot = load_robot("planar_2r").with_friction(law(name))
    postures = np.random.default_rng(2).uniform(-1.5, 1.5, (30, 2))
    q_ref, _, _ = point_to_point(postures, 0.8 * robot.rated_speeds, 1000.0, 6000)
    blank = Recording("run", robot.joint_names, q_ref, q_ref + 1.0, 1000.0, q_ref)
    problem = Problem(robot, (blank,), Loop(PD(KP, KD)))
    theta = truth_of(problem)
    noise = noise_std * np.random.default_rng(4).standard_normal(q_ref.shape)
    signals = LoopSignals(
        rate=1000.0, q_ref=q_ref, dq_ref=None, inputs=None, noise=noise, drive_gain=np.ones(2),
        limit=np.full(2, np.inf), bound=np.full(2, 0.5), speed_bound=np.full(2, 50.0),
    )  # fmt: skip
    model = make_model(robot, problem.regressor.parameters, theta)
    made = simulate(model, PD(KP, KD), signals, robot.joint_names)
    recording = replace(blank, q=made.q + noise, tau=made.tau)
    return replace(problem, recordings=(recording,)), theta


@pytest.mark.parametrize("method", ["iv-full-rate", "piv", "didim"])
@pytest.mark.parametrize("name", ["dahl", "lugre", "coarse slip", "load and memory"])
def test_instruments_know_path_and_load(name, method):
    problem, theta = simulated(name, 2e-7)
    found = identify(problem, method)
    assert found.converged
    frictions = np.array([p.friction is not None for p in found.parameters])
    allowed = 0.02 * np.abs(theta) + 6.0 * found.std
    assert (np.abs(found.theta - theta) < allowed)[frictions].all()
    assert found.equations is not None
    for block in found.equations.blocks():
        for rows in block.joints:
            assert np.isfinite(rows.phi).all() and rows.phi.any(axis=1).all()


def test_decimated_instruments_know_path_and_load():
    problem, theta = simulated("load and memory", 2e-7)
    found = identify(problem, "iv")
    assert found.converged
    assert (np.abs(found.theta - theta) < 0.05 * np.abs(theta) + 0.05).all()


@pytest.mark.parametrize("extra", ["reference", "delayed"])
def test_tests_of_instruments_take_laws_with_memory_and_load(extra):
    problem, _ = simulated("load and memory", 1e-6)
    found = identify(problem, "piv")
    sums = moment_sums(found, extra)
    outcome = overidentification_test(sums, found.names)
    assert np.isfinite(outcome.statistic) and 0.0 <= outcome.p_value <= 1.0
