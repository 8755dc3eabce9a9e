"""How precise any unbiased estimate from counted positions can be, and how precise ours are.

    PYTHONPATH=. python benchmarks/bound_of_counts.py [--records 10]

Reading *joint* of the paper's twin: the control law reads positions y = Δ round((q + e)/Δ) with
Δ = 2π/3600 rad and white noise e of σ = 2 µrad. The recorded torque is the law's, a known function
of the counts before, so that given those the arm is one that known torques drive from an unknown
start, and

    p(y_1 … y_N | θ) = Π_k P(y_k | q_k(θ)),    q_k(θ) by the recorded torques alone.

The sensitivities ∂q_k/∂θ are hence those of the arm in open loop, along the motion that the closed
loop has made, and the Fisher information is

    I = Σ_k i(q_k) (∂q_k/∂θ)(∂q_k/∂θ)ᵀ,    i(q) = Σ_y (∂P(y | q)/∂q)² / P(y | q),

with the initial state, which nobody is told, among the unknowns and then eliminated. Where an
interval is wide, i is all in the samples at its ends: its mean over an interval is about 1.81/(σΔ).
An estimator that takes rounding for white noise of variance Δ²/12 has 12/Δ² in its place, and one
that begins anew from time to time has more initial states to find.

The estimators run on the same records. The table is part of the page of the paper.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
from benchmarks.independent_paper import PAGE, bench_of, with_table
from scipy.special import ndtr

from pivident.dynamics.parameters import Parameter
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.output_error.loop_unknowns import start_directions
from pivident.estimation.output_error.record_stretches import OpenLoop
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.closed_loop import LoopSignals, Trajectory
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.loop.simulation.tangents import tangent_blocks
from pivident.robot.description import Robot
from pivident.studies.many.study.bench import Bench
from pivident.studies.paper.markdown import table

HEADING = "### What counts allow"
#: Parameters of one kind, by the beginnings of their names.
GROUPS = {
    "inertias": ("xx", "xz", "zz"),
    "first moments": ("mx", "my"),
    "rotor inertias": ("ia",),
    "viscous friction": ("fv",),
    "dry friction": ("fc",),
}
#: Median of |x| of a standard normal x.
MEDIAN_OF_NORMAL = 0.6745
#: Probability below which a count adds nothing.
LEAST_SHARE = 1e-20
#: How long `oloe` lets these open loops run, on the mean, before they begin anew [s].
SHORT_RUN = 1.0
BOUNDS = ("bound", "with Δ²/12", "in runs of 1 s")
#: What is run, beside what the recommended form leaves out: method, and mask, None for its own.
FORMS = {
    "IDIM-PIV": ("piv", None),
    "IDIM-PIV, mask 5 %": ("piv", 0.05),
    "DIDIM": ("didim", None),
    "OLOE": ("oloe", None),
}


def information_of_counts(q: np.ndarray, count: float, sigma: float) -> np.ndarray:
    """i(q): information on a position from its count [1/rad²], like ``q``."""
    steps = np.arange(-2, 3)[:, *(None,) * q.ndim]  # a count further away hardly adds to the sum
    edges = ((np.round(q / count) + steps) * count + 0.5 * count - q) / sigma
    density = np.exp(-0.5 * edges**2) / np.sqrt(2 * np.pi)
    # of the nearer tail, so that no share is the difference of two ones
    share = np.where(edges[1:] < 0, np.diff(ndtr(edges), axis=0), -np.diff(ndtr(-edges), axis=0))
    slope = np.diff(density, axis=0)
    return np.sum(slope**2 / np.where(share > LEAST_SHARE, share, np.inf), axis=0) / sigma**2


def made_motion(bench: Bench, run: int) -> Trajectory:
    """The true motion of a record, of the loop that reads its counts."""
    reference = bench.reference_of_record(run)
    noise = bench.noise.in_loop((run, bench.scenario.content.seed), reference[0].shape)
    return bench.simulated(bench.heads, bench.true_values, reference, noise, rounded=True)


def bounds(bench: Bench, run: int) -> list[np.ndarray]:
    """Least standard errors by counts, by white noise Δ²/12, and by that in short runs."""
    true, n = made_motion(bench, run), bench.scenario.robot.size
    count, sigma = bench.loop.counts(n)[0], float(np.ravel(bench.noise.encoder)[0])
    told = information_of_counts(true.q, count, sigma)
    white = np.full_like(told, 12 / count**2)

    whole = len(true.q) / true.rate

    def by(information: np.ndarray, seconds: float) -> np.ndarray:
        edges = [*range(0, len(true.q), round(seconds * true.rate)), len(true.q)]
        runs = [slice(*ends) for ends in pairwise(edges)]
        arms = [driven(bench.scenario.robot, bench.heads, bench.true_values, true, r) for r in runs]
        return least_errors([triangle(a, information[r]) for a, r in zip(arms, runs, strict=True)])

    return [by(told, whole), by(white, whole), by(white, SHORT_RUN)]


def driven(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    motion: Trajectory,
    run: slice = slice(None),
) -> ParametrisedLoop:
    """The arm that the torques of a motion drive in open loop, over a run of its samples."""
    n, endless = robot.size, np.full(robot.size, np.inf)
    signals = LoopSignals(
        rate=motion.rate,
        q_ref=motion.q[run],
        dq_ref=None,
        inputs=motion.tau[run],
        noise=None,
        drive_gain=np.ones(n),
        limit=endless,
        bound=endless,
        speed_bound=endless,
    )
    start = motion.q[run][0], motion.dq[run][0]
    return ParametrisedLoop(robot, parameters, theta, OpenLoop(), signals, start)


def triangle(arm: ParametrisedLoop, information: np.ndarray) -> np.ndarray:
    """R with RᵀR the information on the parameters of an arm whose start is unknown.

    ``information``: that on each position, shape (samples, joints) [1/rad² or 1/m²].
    """
    starts = start_directions(arm.robot.size)
    directions = [*starts, *(Direction("parameter", p.name) for p in arm.parameters)]
    factor = np.zeros((1, len(directions)))
    for block in tangent_blocks(arm, directions):
        rows = np.sqrt(information[block.samples, :, None]) * block.q
        factor = np.linalg.qr(np.vstack([factor, rows.reshape(-1, len(directions))]), mode="r")
    return factor[len(starts) :, len(starts) :]  # what is left when the start has been fitted


def least_errors(triangles: Sequence[np.ndarray]) -> np.ndarray:
    """Square roots of the diagonal of (Σ RᵀR)⁻¹, of parameters of any size."""
    factor = np.linalg.qr(np.vstack(triangles), mode="r")
    size = np.linalg.norm(factor, axis=0)
    return np.linalg.norm(np.linalg.inv(factor / size), axis=1) / size


def estimates(bench: Bench, form: str, records: int) -> list[Identification]:
    """What a form makes of the records on which it gives an estimate."""
    name, mask = FORMS[form]
    method = bench.scenario.methods.get(name, METHODS[name])
    found = []
    for run in range(records):
        problem = bench.problem(run)
        with suppress(PividentError):
            found.append(identify(problem if mask is None else replace(problem, mask=mask), method))
    return found


def rows(bench: Bench, records: int) -> list[list[str]]:
    """Least and actual errors by group, relative [%]; then coverage and estimates."""
    columns = [
        np.median(x, axis=0) for x in np.swapaxes([bounds(bench, r) for r in range(records)], 0, 1)
    ]
    shares, counts = ["–"] * len(BOUNDS), ["–"] * len(BOUNDS)
    for form in FORMS:
        found = estimates(bench, form, records)
        errors = np.abs([one.theta - bench.expected for one in found])
        columns.append(np.median(errors, axis=0) / MEDIAN_OF_NORMAL)
        covered = errors < 2 * np.array([one.std for one in found])
        shares.append(f"{100 * covered.mean():.1f} %")
        counts.append(f"{len(found)} of {records}")
    relative = 100 * np.array(columns) / np.abs(bench.expected)
    made = []
    for group, stems in {**GROUPS, "all": ("",)}.items():
        own = [name.startswith(stems) for name in bench.estimated]
        made.append([group, *(f"{x:.2g} %" for x in np.median(relative[:, own], axis=1))])
    return [*made, ["covered", *shares], ["estimates", *counts]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=10)
    made = rows(bench_of("joint"), parser.parse_args().records)
    part = table(["", *BOUNDS, *FORMS], made)
    print(part)
    PAGE.write_text(with_table(PAGE.read_text("utf-8"), HEADING, part), encoding="utf-8")


if __name__ == "__main__":
    main()
