"""Planar arm and records of it for the fits of simulations."""

from functools import cache

import numpy as np

import pivident as pv
from pivident.dynamics.forward import make_model
from pivident.estimation.output_error import fit as fit_module
from pivident.estimation.output_error.loop_unknowns import Unknown
from pivident.estimation.output_error.record_stretches import Stretch
from pivident.estimation.output_error.simulated_errors import SimulatedErrors
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from tests.planar_arm import LAW, nominal_parameters, planar_motion, planar_record

RATE = 1000.0
SAMPLES = 4000


@cache
def reference(samples: int = SAMPLES) -> np.ndarray:
    return planar_motion(np.random.default_rng(2), RATE, samples)


def truth(names) -> np.ndarray:
    base, theta = nominal_parameters()
    return theta[[base.names.index(name) for name in names]]


def problem(
    seed: int = 3,
    noise: float = 2e-6,
    law=LAW,
    drive_gain=(1.0, 1.0),
    samples: int = SAMPLES,
    **own,
) -> pv.Problem:
    """A record of the arm's true loop, and a problem that declares ``law`` and gains of one."""
    base, theta = nominal_parameters()
    rng = np.random.default_rng(seed)
    q, tau = planar_record(
        base, theta, reference(samples), RATE, rng, encoder_noise=noise, drive_gain=drive_gain
    )
    recording = pv.Recording.from_arrays(
        q, tau, RATE, joint_names=base.robot.joint_names, q_ref=reference(samples)
    )
    return pv.Problem(base.robot, (recording,), pv.Loop(law), **own)


def signals(samples: int = SAMPLES, **own) -> LoopSignals:
    return LoopSignals(
        RATE, reference(samples), None, None, None, np.ones(2), np.full(2, np.inf),
        np.full(2, 0.5), np.full(2, 50.0), **own,
    )  # fmt: skip


def loop(theta: np.ndarray | None = None, **own) -> ParametrisedLoop:
    base, nominal = nominal_parameters()
    values = nominal if theta is None else theta
    return ParametrisedLoop(base.robot, base.parameters, values, LAW, signals(**own))


def stretch(own: ParametrisedLoop, start_std=None, first: int = 0, noise: float = 0.0) -> Stretch:
    """What the loop with the true parameters gives, beside another loop."""
    base, theta = nominal_parameters()
    model = make_model(base.robot, base.parameters, theta)
    made = simulate(model, LAW, own.signals, base.robot.joint_names)
    rng = np.random.default_rng(0)
    q = made.q + noise * rng.standard_normal(made.q.shape)
    tau = made.tau + noise * rng.standard_normal(made.tau.shape)
    moving = np.ones(made.q.shape, bool)
    return Stretch("run", own, q, tau, 1, 0, moving, 0.0, start_std, first)


def unknowns(*names: str) -> list[Unknown]:
    base, _ = nominal_parameters()
    parameters = {p.name: p for p in base.parameters}
    chosen = names or tuple(parameters)
    return [Unknown(n, parameters[n].unit, Direction("parameter", n)) for n in chosen]


def all_columns(made: SimulatedErrors) -> np.ndarray:
    """J of one stretch at once, shape (channels, joints, columns, rows)."""
    channels, joints, _ = made.errors.shape
    return np.array(
        [
            [
                np.concatenate([block for _, block in made.columns.blocks(c, j)], axis=1)
                for j in range(joints)
            ]
            for c in range(channels)
        ]
    )


def counted_simulations(monkeypatch) -> list[int]:
    """Receives the number of tangents of each simulation that a fit makes from now on."""
    runs, whole = [], fit_module.simulated_errors

    def counted(stretches, unknowns, *others):
        runs.append(len(unknowns))
        return whole(stretches, unknowns, *others)

    monkeypatch.setattr(fit_module, "simulated_errors", counted)
    return runs
