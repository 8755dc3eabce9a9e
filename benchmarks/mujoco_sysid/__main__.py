"""The same records in MuJoCo's toolbox `mujoco.sysid` and in pivident.

    pip install "mujoco[sysid]"
    python -m benchmarks.mujoco_sysid residuals      # which residual suits the other program best
    python -m benchmarks.mujoco_sysid compare --case viscous --draws 5
    python -m benchmarks.mujoco_sysid compare --case dry --draws 5
    python -m benchmarks.mujoco_sysid unidentifiable

Both start from the same wrong file. Draws of the noise after the first start the other program at
the truth, which spares it the search and, with residuals weighted by the true noise, does not
change where it ends.
"""

from __future__ import annotations

import argparse

import numpy as np

from .arm import DEFAULT_TIME, SHORT_TIME, reference, wrong
from .judge import Case, Judge, case
from .own import OwnFit, fitted, named, problem_of
from .peer import RESIDUALS, PeerFit, identified
from .record import measured, simulated
from .unidentifiable import unidentifiable

CASES = {"viscous": None, "dry": SHORT_TIME, "soft": DEFAULT_TIME}

#: Seeds of the motion that is fitted and of the one that is predicted, and its length [s].
FITTED, PREDICTED, SECONDS = 1, 2, 10.0

#: The residual that suits the other program best, see ``residuals``.
BEST = "positions, speeds, torques"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("residuals", "compare", "unidentifiable"))
    parser.add_argument("--case", choices=CASES, default="viscous")
    parser.add_argument("--draws", type=int, default=5)
    options = parser.parse_args()
    if options.what == "unidentifiable":
        unidentifiable()
        return
    own = case(CASES[options.case])
    judge = Judge.of(own, simulated(own.bodies, reference(PREDICTED, SECONDS), own.friction_time))
    (residuals if options.what == "residuals" else compare)(own, judge, options.draws)


def residuals(own: Case, judge: Judge, draws: int) -> None:
    """Errors of the other program by its residual, root mean squares over draws of the noise."""
    true = simulated(own.bodies, reference(FITTED, SECONDS), own.friction_time)
    for weighted in (True, False):
        for name in RESIDUALS:
            rows = []
            for draw in range(draws):
                fit = _peer(own, measured(true, draw), name, weighted, at_truth=True)
                rows.append(judge.theta(fit.bodies))
            weights = "true noise" if weighted else "signal size, its default"
            _line(f"{name}; weights: {weights}", judge, np.array(rows))


def compare(own: Case, judge: Judge, draws: int) -> None:
    """Time, errors, coverage and prediction of both programs."""
    true = simulated(own.bodies, reference(FITTED, SECONDS), own.friction_time)
    logs = [measured(true, draw) for draw in range(draws)]
    for name in ("cloe", "ml"):
        method = named(name)
        fitted(problem_of(logs[0], wrong(own.bodies), own.law), method)  # compiled
        fits = [fitted(problem_of(log, wrong(own.bodies), own.law), method) for log in logs]
        _own_lines(name, judge, fits)
    fits = [_peer(own, log, BEST, True, at_truth=draw > 0) for draw, log in enumerate(logs)]
    _peer_lines(judge, fits)


def _peer(own: Case, log, residual: str, weighted: bool, at_truth: bool) -> PeerFit:
    """One fit of the other program."""
    start = own.bodies if at_truth else wrong(own.bodies)
    return identified(
        log, start, RESIDUALS[residual], weighted=weighted, friction=own.has_friction,
        friction_time=own.friction_time,
    )  # fmt: skip


def _own_lines(name: str, judge: Judge, fits: list[OwnFit]) -> None:
    """What pivident makes of all draws."""
    first = fits[0]
    passes = [len(fit.result.history) for fit in fits]
    print(
        f"pivident {name}: processor {np.median([f.processor for f in fits]):.2f} s, wall "
        f"{np.median([f.wall for f in fits]):.2f} s, {max(passes)} passes (each one simulation "
        f"with the tangents of {len(first.result.names)} parameters)"
    )
    theta = np.array([fit.result.theta for fit in fits])
    half = np.array([1.96 * np.sqrt(np.diag(fit.result.covariance)) for fit in fits])
    _line(f"pivident {name}", judge, theta, half)
    for warning in first.result.warnings:
        print(f"    {warning}")


def _peer_lines(judge: Judge, fits: list[PeerFit]) -> None:
    """What the other program makes of them."""
    first, truth = fits[0], judge.case.bodies
    print(
        f"mujoco.sysid: processor {first.processor:.1f} s, wall {first.wall:.1f} s, "
        f"{first.simulations} rollouts in {first.passes} Jacobians (first draw, wrong start); "
        f"{np.median([f.processor for f in fits[1:]] or [np.nan]):.1f} s from the truth"
    )
    theta = np.array([judge.theta(fit.bodies) for fit in fits])
    half = np.array([fit.half_of(judge.theta) for fit in fits])
    _line("mujoco.sysid (base parameters: delta method)", judge, theta, half)
    true = np.concatenate([truth.armature, truth.damping, truth.friction])
    named_last = [n for n in first.names if "inertia" not in n]
    values = np.array([fit.values[-len(named_last) :] for fit in fits])
    halves = np.array([fit.half[-len(named_last) :] for fit in fits])
    inside = np.abs(values - true[: len(named_last)]) <= halves
    finite = np.isfinite(halves)
    print(
        f"    its report's intervals: {np.isinf([f.half for f in fits]).mean():.0%} infinite; of "
        f"armature, damping, frictionloss {(~finite).mean():.0%} infinite, "
        f"{inside[finite].mean():.0%} of the finite ones hold the truth"
    )
    always = [n for n, own in zip(named_last, finite.T, strict=True) if not own.all()]
    print(f"    infinite in some draw: {', '.join(always) or 'none'}")


def _line(name: str, judge: Judge, theta: np.ndarray, half: np.ndarray | None = None) -> None:
    """Errors, root mean squares over draws; ``theta``: shape (draws, base)."""
    truth = judge.theta(judge.case.bodies)
    off = theta - truth
    parts = []
    for group, chosen in judge.groups().items():
        error = np.sqrt(np.mean(off[:, chosen] ** 2))
        if group == "inertial":
            parts.append(f"{group} {1e3 * error:.3g}e-3 kg m² or kg m")
        else:
            share = 100.0 * np.sqrt(np.mean((off[:, chosen] / truth[chosen]) ** 2))
            parts.append(f"{group} {share:.3g} %")
    predicted = 100.0 * np.sqrt(np.mean([judge.predicted(own) ** 2 for own in theta]))
    parts.append(f"torque of another motion {predicted:.3g} %")
    if half is not None:
        inside = np.abs(off) <= half
        parts.append(f"coverage {inside.mean():.1%} of {inside.size}")
        parts.append(f"median half width {1e3 * np.median(half):.3g}e-3")
    print(f"{name}: {'; '.join(parts)}", flush=True)


if __name__ == "__main__":
    main()
