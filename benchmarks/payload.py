"""A load of 1 kg on the flange of a TX40 by Monte Carlo: errors, deviations and coverage.

    python benchmarks/payload.py [--runs 50] [--first 0] [--methods ls piv differences]

The scenario is that of `tests.load_scenario`: 7 s at 2 kHz without and 7 s with the
load, all 61 base parameters unknown, encoder noise in the loop, 0.05 N m of noise on the torque.
Friction may change with the load. For the ten parameters of the load, its centre of mass and its
inertia about it: bias, empirical and predicted standard deviation, and how often the interval of
±2σ covers the truth (95.4 % if it is right; of 50 runs between 90 and 99 % for a group).

``differences`` identifies both records by PIV, each for itself, and fits the load to the difference
of their base parameters by generalised least squares; that needs a loaded record which tells all
of them.

    --short N      the loaded record has N samples only
    --wrist SHARE  reach of the wrist relative to the usual motion
    --mass-known   the mass is known from a scale to 1 g
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np
from tests.load_scenario import LOAD, LoadedArm, tx40_with_load

from pivident.estimation.identify import identify
from pivident.robot.description import INERTIAL
from pivident.studies.payload.arm_and_load import KnownParts, load_columns
from pivident.studies.payload.identify_payload import identify_payload
from pivident.studies.payload.load_estimate import LoadEstimate

UNITS = ["kg m²"] * 6 + ["kg m"] * 3 + ["kg"]


@dataclass(frozen=True, eq=False)
class Quantity:
    """One number of every run.

    Attributes:
        name: its name with unit.
        group: what its coverage is counted with.
        truth: the true value.
    """

    name: str
    group: str
    truth: float


def quantities() -> list[Quantity]:
    ten = [
        Quantity(f"{n} [{u}]", "ten parameters", v)
        for n, u, v in zip(INERTIAL, UNITS, LOAD.known(), strict=True)
    ]
    assert LOAD.center_of_mass is not None and LOAD.inertia is not None
    centre = [
        Quantity(f"c{axis} [m]", "centre of mass", v)
        for axis, v in zip("xyz", LOAD.center_of_mass, strict=True)
    ]
    inertia = [
        Quantity(f"J{n} about c [kg m²]", "inertia about it", v)
        for n, v in zip(INERTIAL[:6], LOAD.inertia, strict=True)
    ]
    return ten + centre + inertia


def numbers(load: LoadEstimate) -> tuple[np.ndarray, np.ndarray]:
    """Values and deviations in the order of `quantities`."""
    values = np.concatenate([load.values, load.center_of_mass, load.inertia])
    return values, np.concatenate([load.std, load.center_of_mass_std, load.inertia_std])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--methods", nargs="+", default=["ls", "iv-full-rate", "piv"])
    parser.add_argument("--short", type=int)
    parser.add_argument("--wrist", type=float, default=1.0)
    parser.add_argument("--mass-known", action="store_true")
    options = parser.parse_args()
    known = KnownParts(mass=LOAD.mass, mass_std=1e-3) if options.mass_known else None
    listed = quantities()
    truth = np.array([q.truth for q in listed])
    made: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {m: [] for m in options.methods}
    possible = dict.fromkeys(options.methods, 0)
    for seed in range(options.first, options.first + options.runs):
        arm = tx40_with_load(seed, reach_of_wrist=options.wrist)
        loaded = arm.loaded if options.short is None else shortened(arm.loaded, options.short)
        for method in options.methods:
            if method == "differences":
                load = by_differences(arm)
            else:
                load = identify_payload(arm.problem, [loaded], method, known=known).load
            made[method].append(numbers(load))
            possible[method] += load.is_possible
    for method, runs in made.items():
        values, std = (np.array([run[k] for run in runs]) for k in range(2))
        report(method, listed, values - truth, std)
        print(f"possible as a real body: {possible[method]} of {options.runs}")


def by_differences(arm: LoadedArm) -> LoadEstimate:
    """θ_loaded - θ_empty = B π + F ΔF, weighted by the sum of both covariances."""
    first = identify(arm.problem, "piv")
    second = identify(replace(arm.problem, recordings=(arm.loaded,)), "piv")
    columns = load_columns(arm.problem.base, 5)[list(arm.problem.selection)]
    friction = np.eye(len(first.theta))[:, [not p.carries_load for p in first.parameters]]
    design = np.hstack([columns, friction])
    weight = np.linalg.inv(first.formula_covariance + second.formula_covariance)
    scale = np.sqrt(np.diag(design.T @ weight @ design))
    gain = np.linalg.solve(design.T @ weight @ design / np.outer(scale, scale), (design / scale).T)
    gain = (gain @ weight) / scale[:, None]
    spread = gain @ (first.robust_covariance + second.robust_covariance) @ gain.T
    values = gain @ (second.theta - first.theta)
    return LoadEstimate(values[:10], spread[:10, :10], np.zeros((10, 0)), "link_6")


def shortened(recording, samples: int):
    """The first samples of a recording."""
    signals = {
        name: getattr(recording, name)[:samples]
        for name in ("q", "tau", "q_ref", "dq_ref", "ddq_ref")
    }
    return replace(recording, **signals)


def report(method: str, listed: list[Quantity], error: np.ndarray, std: np.ndarray) -> None:
    """Table of one method, and coverage of its groups."""
    inside = np.abs(error) < 2.0 * std
    print(f"\n== {method}, {len(error)} runs ==")
    print(f"{'quantity':24}{'bias':>11}{'empirical σ':>13}{'predicted σ':>13}{'covered %':>11}")
    for k, quantity in enumerate(listed):
        print(
            f"{quantity.name:24}{error[:, k].mean():11.2g}{error[:, k].std(ddof=1):13.2g}"
            f"{np.sqrt(np.mean(std[:, k] ** 2)):13.2g}{100 * inside[:, k].mean():11.0f}"
        )
    for group in dict.fromkeys(q.group for q in listed):
        own = [k for k, q in enumerate(listed) if q.group == group]
        print(f"covered, {group}: {100 * inside[:, own].mean():.1f} %")
    print(f"covered, mass: {100 * inside[:, 9].mean():.1f} %")


if __name__ == "__main__":
    main()
