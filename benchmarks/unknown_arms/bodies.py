"""Consistent bodies of unknown arms: masses, moves and torque errors.

    python -m benchmarks.unknown_arms.bodies FOLDER/ARM [...] [--method piv]

Reads the results that `python -m benchmarks.unknown_arms --out FOLDER` has stored. Each estimate is
made consistent with the bodies of the user's URDF, whose masses are off by 10 to 30 %, and without
any. Columns: largest and smallest mass over that of the user's URDF, total mass over the true one,
largest distance of a mass from the truth (factor), growth of distances, largest move of a parameter
that the data determine to a tenth, torque errors of the free and the consistent model on the
held-out motion (true signals).
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import pivident as pv
from pivident.models.consistency.consistent_model import ConsistentModel, make_consistent
from pivident.robot.description import Robot

from .judge import _true_signals
from .truth import Machine, machine

#: Relative standard error up to which the data determine a parameter.
DETERMINED = 0.1


def without_bodies(robot: Robot) -> Robot:
    """The same arm from a file without inertials."""
    links = tuple(replace(link, inertia=np.zeros(10)) for link in robot.links)
    return replace(robot, links=links)


def held_out_errors(folder: Path, made: Machine, model: ConsistentModel) -> tuple[float, float]:
    """Torque errors of the free and of the consistent model on a motion nobody fitted [%]."""
    q, dq, ddq, tau, fast = _true_signals(folder, made, model.free, "held_out")
    size = np.linalg.norm(tau[fast])
    free, consistent = (
        float(100.0 * np.linalg.norm((m.predict(q, dq, ddq) - tau)[fast]) / size)
        for m in (model.free, model)
    )
    return free, consistent


def row(folder: Path, made: Machine, free, described: Robot) -> tuple[str, np.ndarray]:
    """One estimate made consistent, as a line and as numbers."""
    model = make_consistent(free, accept_far=True)
    mass = np.array([body.mass for body in model.links])
    own = np.array([link.inertia[9] for link in described.links])
    names = [joint.name for joint in made.arm.joints]
    true = np.array([made.bodies[names.index(n)].mass for n in described.joint_names])
    determined = free.std <= DETERMINED * np.abs(free.theta)
    # nearly the nearest point: almost nothing is left to the prior
    nearest = make_consistent(free, accept_far=True, room=1e-4)
    moved = np.abs(model.moved - nearest.moved)
    errors = held_out_errors(folder, made, model)
    figures = np.array(
        [
            (mass / own).max(),
            (mass / own).min(),
            mass.sum() / true.sum(),
            np.exp(np.abs(np.log(mass / true)).max()),
            model.least_distance,
            model.distance,
            moved[determined].max(initial=0.0),
            *errors,
        ]
    )
    text = "{:7.2f} {:6.3f} {:7.2f} {:8.1f} {:7.2f} {:7.2f} {:7.2f} {:8.3f} {:8.3f}"
    return text.format(*figures), figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+", help="of an arm, with seed-… in it")
    parser.add_argument("--method", default="piv")
    options = parser.parse_args()
    found: dict[str, list[np.ndarray]] = {"described": [], "bare": []}
    print(
        "record             largest  least   total  factor   least  chosen   moved     free  cons."
    )
    for arm in options.folders:
        for folder in sorted(arm.glob("seed-*")):
            stored = folder / "experiment-results" / options.method / "identification.json"
            if not stored.exists():
                continue
            truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
            made = machine(arm.name, truth["seed"], False)
            free = pv.load_identification(stored)
            for kind in found:
                robot = free.robot if kind == "described" else without_bodies(free.robot)
                text, figures = row(folder, made, replace(free, robot=robot), free.robot)
                found[kind].append(figures)
                print(f"{arm.name} {folder.name} {kind:9s} {text}", flush=True)
    for kind, rows in found.items():
        print(f"{kind}: median {np.round(np.median(rows, axis=0), 3)}")
        print(f"{kind}: largest {np.round(np.max(rows, axis=0), 3)}")


if __name__ == "__main__":
    main()
