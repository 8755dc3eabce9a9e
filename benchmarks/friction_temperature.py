"""Friction that falls as gears warm up: is its change found, and are the intervals right?

    python benchmarks/friction_temperature.py [--records 20] [--seconds 24]

An arm of three joints simulated by Pinocchio (`tests.judgement.model_errors.warming_arm`): friction
of two joints falls by 30 % over the record, that of the third stays although its temperature rises,
too. For each method: share of the 95 % intervals that hold the true change per kelvin, and the true
friction at the mean temperature of the record and at its first one; beside it the same of records
without any change. Held-out torque error without a change, with one that nobody corrects, and
corrected. How much the held-out error owes to a change that was estimated with the held-out block,
too. How often smaller changes are found.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.judgement.model_errors import warming_arm as arm

from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.common_work import shared_work
from pivident.judgement.model_errors.corrections import (
    Corrections,
    corrections,
    with_corrections,
)
from pivident.judgement.validation.held_out.cross_validation import cross_validate

#: Methods, and whether the control law makes their instruments.
METHODS = (("ls", False), ("piv", False), ("piv", True))
#: Fall of friction over the record, and smaller ones that may not be found.
FALL, SMALLER = 0.3, (0.02, 0.05, 0.1)
#: Parts of a record that are left out in turn.
PARTS = 5
#: Records of which is asked what the parts that are left out have to do with the change.
LEAKS = 5


def changes_held(made: Corrections, fall: float) -> list[bool]:
    """Whether the interval of each change that was found holds the true one."""
    viscous, coulomb = arm.changes(fall)
    held = []
    for cause in made.causes:
        j = arm.NAMES.index(cause.subject)
        size, std = made.of(cause)
        held += (np.abs(size - [viscous[j], coulomb[j]]) < 1.96 * std).tolist()
    return held


def friction_held(found: Identification, truth: Mapping[str, float]) -> list[bool]:
    """Whether the interval of each friction parameter holds the true one."""
    place = [found.names.index(name) for name in truth]
    error = np.abs(found.theta[place] - np.array(list(truth.values())))
    return (error < 1.96 * found.std[place]).tolist()


def held_out(problem: Problem, method: str) -> float:
    """Held-out torque error below 20 Hz [%]."""
    return float(cross_validate(problem, method, folds=PARTS).prediction.total_in_band)


def leak(problem: Problem, method: str) -> float:
    """Held-out error with the change from all parts, over that from the parts that are fitted."""
    whole = problem.recordings[0]
    mean = float(arm.temperatures(whole.samples).mean())
    ends = np.linspace(0, whole.samples, PARTS + 1).astype(int)
    parts = tuple(replace(whole.part(a, b), name=str(a)) for a, b in pairwise(ends))
    every = corrections(replace(problem, recordings=parts, reference_temperature=mean), method)
    squares = np.zeros(2)
    for unseen in parts:
        others = tuple(part for part in parts if part is not unseen)
        rest = replace(problem, recordings=others, reference_temperature=mean)
        for n, made in enumerate((every, corrections(rest, method))):
            fitted = replace(rest, recordings=made.on(others))
            (cold,) = made.on([unseen])
            score = cross_validate(fitted, method, recording=cold).prediction
            squares[n] += score.total_in_band**2
    return float(np.sqrt(squares[0] / squares[1]))


def share(held: Sequence[bool]) -> str:
    """How many of how many, in per cent."""
    return f"{100 * np.mean(held):.0f} % of {len(held)}" if held else "none"


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=24.0)
    given = parser.parse_args()
    samples = int(given.seconds * arm.RATE)
    held: dict[str, list[bool]] = defaultdict(list)
    errors: dict[str, list[float]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for seed in range(given.records):
            for method, looped in METHODS:
                with shared_work():
                    one_record(folder, seed, samples, method, looped, held, errors)
            print(f"record {seed + 1} of {given.records}", file=sys.stderr)
    for text, flags in sorted(held.items()):
        print(f"{text}: {share(flags)}")
    for text, values in sorted(errors.items()):
        print(f"{text}: median {np.median(values):.4g}, largest {np.max(values):.4g}")


def one_record(
    folder: Path,
    seed: int,
    samples: int,
    method: str,
    looped: bool,
    held: dict[str, list[bool]],
    errors: dict[str, list[float]],
) -> None:
    """Add what one record says of one method."""
    steady = arm.problem(folder, arm.recording(seed, 0.0, samples), looped=looped)
    own, title = identify(steady, method), method + ", control law known" * looped
    held[f"{title}: friction without a change held"] += friction_held(own, arm.truth(0.0, samples))
    held[f"{title}: found where there is none"].append(bool(corrections(steady, method).causes))
    errors[f"{title}: held-out error without a change [%]"].append(held_out(steady, method))
    record = arm.recording(seed, FALL, samples)
    for words, reference in (("mean", None), ("first", arm.START)):
        problem = arm.problem(folder, record, looped=looped, reference_temperature=reference)
        made = corrections(problem, method)
        found = with_corrections(identify(made.problem, method), made)
        truth = arm.truth(FALL, samples, reference)
        held[f"{title}: friction at the {words} temperature held"] += friction_held(found, truth)
        if reference is None:
            held[f"{title}: change per kelvin held"] += changes_held(made, FALL)
            names = [cause.subject for cause in made.causes]
            held[f"{title}: both joints found, and no other"].append(sorted(names) == ["j1", "j2"])
            errors[f"{title}: held-out error, not corrected [%]"].append(held_out(problem, method))
            errors[f"{title}: held-out error, corrected [%]"].append(held_out(made.problem, method))
            if seed < LEAKS and not looped:
                errors[f"{title}: held-out error by a change from all parts over its own"].append(
                    leak(problem, method)
                )
    for fall in SMALLER if not looped else ():
        weak = arm.problem(folder, arm.recording(seed, fall, samples))
        names = [cause.subject for cause in corrections(weak, method).causes]
        held[f"{title}: joints found that fall by {100 * fall:.0f} %"] += [
            joint in names for joint in ("j1", "j2")
        ]


if __name__ == "__main__":
    main()
