"""Inertias that no joint signal determines: issue 3284 of MuJoCo, built again.

A seven-axis arm whose bodies are far from the file (the last is 4.24 times as heavy, centres of
mass are more than 5 cm off), a record without noise, bounds that hold the truth, and damping and
frictionloss that start at 5 % of their ranges, as its maintainers advise there. They report a
residual of about 3e-11 with inertial parameters that are wrong by orders of magnitude, since joint
signals only determine combinations of them. The thread gives neither arm nor motion; both are ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.foundation.errors import RankDeficientRegressor
from pivident.robot.friction import FrictionLaw, coulomb, viscous

from .arm import SHORT_TIME, Bodies, Chain, reference
from .judge import GAMMA, Case, Judge
from .own import fitted, named, problem_of
from .peer import RESIDUALS, identified
from .record import Record, simulated

#: Length of the record [s], and reach of its motion [rad].
SECONDS, REACH = 3.0, np.array([1.2, 0.7, 1.2, 0.8, 1.2, 0.9, 1.2])

#: Distances d, r [m] and angles α [rad] of a seven-axis arm, in Khalil's notation.
GEOMETRY = np.array([
    [0.0, 0.333, 0.0], [0.0, 0.0, -np.pi / 2], [0.0, 0.316, np.pi / 2],
    [0.0825, 0.0, np.pi / 2], [-0.0825, 0.384, -np.pi / 2], [0.0, 0.0, np.pi / 2],
    [0.088, 0.0, np.pi / 2],
])  # fmt: skip


def seven_axes() -> Chain:
    """Its geometry and gains."""
    d, r, alpha = GEOMETRY.T
    kp = np.array([900.0, 900.0, 700.0, 700.0, 300.0, 250.0, 150.0])
    return Chain(
        tuple(f"joint{j}" for j in range(1, 8)), ("0 0 1",) * 7,
        np.column_stack([d, -r * np.sin(alpha), r * np.cos(alpha)]), alpha, kp, 0.07 * kp,
    )  # fmt: skip


def cad() -> Bodies:
    """The file: boxes whose centres of mass are on the axes."""
    mass = np.array([4.0, 4.0, 3.0, 2.7, 1.7, 1.6, 0.35])
    side = np.array([0.25, 0.25, 0.2, 0.2, 0.15, 0.15, 0.1])
    sphere = mass * side**2 / 6.0
    return Bodies(
        seven_axes(), mass, np.zeros((7, 3)) + np.array([0.0, 0.0, 0.01]),
        np.column_stack([sphere, sphere, sphere, *np.zeros((3, 7))]),
        np.array([0.6, 0.6, 0.5, 0.5, 0.25, 0.2, 0.15]),
        np.array([3.0, 3.0, 2.0, 2.0, 0.8, 0.6, 0.5]),
        np.array([2.0, 2.0, 1.5, 1.5, 0.7, 0.5, 0.4]),
    )  # fmt: skip


def real(seed: int = 3284) -> Bodies:
    """The arm: other masses, centres and inertias."""
    rng = np.random.default_rng(seed)
    file = cad()
    factor = np.append(rng.uniform(0.7, 1.5, 6), 4.24)
    away = rng.normal(size=(7, 3))
    away *= (rng.uniform(0.05, 0.09, 7) / np.linalg.norm(away, axis=1))[:, None]
    away[0] *= 0.5
    inertia = file.inertia * (factor * rng.uniform(0.8, 1.3, 7))[:, None]
    inertia[:, 3:] = 0.1 * inertia[:, :1] * rng.uniform(-1.0, 1.0, (7, 3))
    inertia[:, 1] *= rng.uniform(0.8, 1.2, 7)
    return replace(
        file, mass=factor * file.mass, centre=file.centre + away, inertia=inertia,
        armature=file.armature * rng.uniform(0.7, 1.4, 7),
        damping=file.damping * rng.uniform(0.7, 1.4, 7),
        friction=file.friction * rng.uniform(0.7, 1.4, 7),
    )  # fmt: skip


def unidentifiable(max_iterations: int = 45) -> None:
    """Print what both programs say."""
    law = FrictionLaw((viscous(), coulomb("tanh", GAMMA)))
    own = Case(real(), law, SHORT_TIME)
    true = simulated(own.bodies, reference(7, SECONDS, REACH), SHORT_TIME)
    judge = Judge.of(own, simulated(own.bodies, reference(8, SECONDS, REACH), SHORT_TIME))
    _ours(judge, true)
    _theirs(judge, true, max_iterations)


def _ours(judge: Judge, true: Record) -> None:
    """Base parameters before any data; then estimates, and a motion of two joints only."""
    bodies, law = judge.case.bodies, judge.case.law
    problem = problem_of(true, cad(), law)
    base = base_parameters(problem.robot)
    without = [base.standard[k].name for k in base.without_effect]
    print(
        f"pivident: {len(base.standard)} standard parameters, {len(base)} combinations act on the "
        f"joints; without effect: {', '.join(without)}; only within a combination: "
        f"{', '.join(base.standard[k].name for k in base.dropped)}"
    )
    fit = fitted(problem, named("ml"))
    off = fit.result.theta - judge.theta(bodies)
    print(
        f"pivident ml: processor {fit.processor:.1f} s, {len(fit.result.history)} passes, largest "
        f"error of a combination {np.abs(off).max():.2g} kg m², kg m, N m s/rad or N m; torque of "
        f"another motion {100.0 * judge.predicted(fit.result.theta):.2g} %"
    )
    few = np.where(np.arange(7) >= 5, REACH, 0.0)
    little = simulated(bodies, reference(7, SECONDS, few), SHORT_TIME)
    resting = problem_of(little, cad(), law)
    try:
        fitted(resting, named("ml", undetermined="refuse"))
        print("pivident ml, joints 6 and 7 alone move: nothing refused")
    except RankDeficientRegressor as error:
        print(f"pivident ml, joints 6 and 7 alone move, refuse: {error}")
    fit = fitted(resting, named("ml", undetermined="hold"))
    assert fit.result.simulation is not None
    held = fit.result.simulation.held
    print(f"pivident ml, the same, hold: holds {len(held)} of {len(base)}: {', '.join(held)}")


def _theirs(judge: Judge, true: Record, max_iterations: int) -> None:
    """Residual, inertias and intervals of the other program."""
    bodies, start = judge.case.bodies, cad()
    lifted = replace(start, damping=0.2 * start.damping, friction=0.2 * start.friction)
    fit = identified(
        true, lifted, RESIDUALS["positions, speeds, torques"], weighted=False, friction=True,
        friction_time=SHORT_TIME, max_iterations=max_iterations,
    )  # fmt: skip
    size = fit.scaled_singular_values
    ratio = fit.bodies.inertia[:, :3] / bodies.inertia[:, :3]
    ratio = np.maximum(ratio, 1.0 / ratio)
    off = judge.theta(fit.bodies) - judge.theta(bodies)
    print(
        f"mujoco.sysid: processor {fit.processor:.0f} s, {fit.simulations} rollouts, "
        f"{fit.passes} Jacobians, objective {fit.squares:.2g}, cond(JᵀJ) of the scaled "
        f"Jacobian {(size[0] / max(size[-1], 1e-300)) ** 2:.1g}"
    )
    mass = fit.bodies.mass / bodies.mass
    print(f"    masses over the true ones: {', '.join(f'{x:.2f}' for x in mass)}")
    print(f"    moments of inertia off by a factor of up to {ratio.max():.3g}")
    print(
        f"    intervals of its report: {int(np.isinf(fit.half).sum())} of {fit.half.size} "
        f"infinite; at a bound: {', '.join(fit.at_bound) or 'none'}"
    )
    print(
        f"    largest error of a combination {np.abs(off).max():.2g}; torque of another motion "
        f"{100.0 * judge.predicted(judge.theta(fit.bodies)):.2g} %"
    )
