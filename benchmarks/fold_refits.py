"""Held-out errors of estimates from sums, beside those of identifications made again.

    PIVIDENT_DATA=FOLDER python benchmarks/fold_refits.py [--folds 5]

`cross_validate` solves the sums of the record without a block. Here each fold is identified again,
from recordings that end where the block begins: smoothing, noise models, weights and instruments of
their own. They lose what smoother and filters drop at the new ends, and remainders of less than 250
samples. Torque error below the band of the motion, over all blocks [%]: TX40, EMPS, KR300 with the
law that was identified, TIAGo.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import held_out_folds
import kuka_kr300_blocks as kuka
import tiago

from pivident import load_experiment
from pivident.data.recording.datasets import ENVIRONMENT
from pivident.data.recording.public_records import load_kuka_kr300
from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.folds import (
    GAP_PERIODS,
    Fold,
    JudgedMotion,
    contiguous_folds,
)
from pivident.judgement.validation.held_out.prediction import motion_band, pooled
from pivident.robot.gallery import load_robot

NAMES = ("ls", "iv", "iv-full-rate", "piv")

EMPS = Path(__file__).resolve().parents[1] / "examples" / "emps" / "experiment.toml"

#: Shorter remainders are not identified [samples].
SHORTEST = 300


def kr300() -> Problem:
    """Both motions between start and stop, without vague moments of inertia."""
    robot = load_robot(kuka.EXAMPLE / "kuka_kr300_axes_1_3.toml")
    runs = tuple(load_kuka_kr300(motion, robot=robot) for motion in ("A", "B"))
    recordings, loop = kuka.loops(robot, runs)["identified"]
    moving = tuple(run.slice(kuka.START, kuka.STOP) for run in recordings)
    return Problem(robot, moving, loop, kuka.without_vague_inertias(robot, runs))


def problems() -> Iterator[tuple[str, Problem]]:
    """Each record with its name."""
    yield "TX40", held_out_folds.tx40_problem()
    yield "EMPS", load_experiment(EMPS).problem()
    yield "KR300", kr300()
    with tempfile.TemporaryDirectory() as folder:
        tiago.run(Path(os.environ[ENVIRONMENT]) / "tiago", Path(folder))
        yield "TIAGo", load_experiment(next(Path(folder).rglob("*.toml"))).problem()


def refitted(
    problem: Problem, method: Method, motion: JudgedMotion, folds: Sequence[Fold]
) -> float:
    """Error of identifications that are made again without each fold [%]."""
    used = identify(problem, method).instruments
    if not isinstance(method, LeastSquares) and used and used.kind not in ("loop", "repetition"):
        method = replace(method, instruments=used.kind)
    errors = []
    for fold in folds:
        parts = tuple(_rest(problem, motion, fold))
        found = identify(replace(problem, recordings=parts), method)
        for piece in fold.held_out:
            errors += motion.fitted[piece.recording].score(found, [piece.span])
    return pooled(errors).total_in_band


def _rest(problem: Problem, motion: JudgedMotion, fold: Fold) -> Iterator[Recording]:
    """What is left of the recordings without a fold and its gaps."""
    for k, recording in enumerate(problem.recordings):
        start, stop = motion.moving[k]
        ends = [(start, stop)]
        for piece in fold.left_out:
            if piece.recording == k:
                ends = [(start, piece.start), (piece.stop, stop)]
        for a, b in ends:
            if b - a >= SHORTEST:
                yield recording.part(a, b)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folds", type=int, default=5)
    options = parser.parse_args()
    print(f"{'record':6s} {'method':13s} {'sums %':>7s} {'again %':>7s} {'s':>6s} {'s again':>7s}")
    for name, problem in problems():
        motion = JudgedMotion.of(problem)
        gap = GAP_PERIODS / motion_band(problem.recordings[0])
        folds = contiguous_folds(problem.recordings, motion.moving, options.folds, gap)
        for key in NAMES:
            method, started = METHODS[key], time.process_time()
            ours = cross_validate(problem, method, folds=options.folds).prediction.total_in_band
            between = time.process_time()
            again = refitted(problem, method, motion, folds)
            took = between - started, time.process_time() - between
            print(f"{name:6s} {key:13s} {ours:7.3f} {again:7.3f} {took[0]:6.2f} {took[1]:7.2f}")


if __name__ == "__main__":
    main()
