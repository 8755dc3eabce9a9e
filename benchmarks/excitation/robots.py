"""Designed motions of several robots in cells with obstacles, checked again by other means.

    python -m benchmarks.excitation.robots staubli_tx40 planar_2r ur10e panda.urdf iiwa.urdf \
        --frozen panda_finger_joint1=0.02 panda_finger_joint2=0.02

A design of 20 s each, in a cell with a table, a post and a floor, in 20 s of search. Printed:
cond(W) of the best random motion and of the design, W the raw observation matrix of all base
parameters in SI units, then without the friction parameters; its square, the ratio of the
eigenvalues of WᵀW; the largest standard error over the size that matters; limits broken on a grid
ten times finer than that of the design, recomputed from the written file (see `fine_check`).

    … --rigid                 the parameters of the links alone, without friction and rotors
    … --random 200            200 random cells: designs, refusals, and limits broken
    … --random-search         plain random search of the same time beside each design
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from benchmarks.excitation.cells import Arm, arms, random_cell, table_and_post
from benchmarks.excitation.fine_check import FineResult, check

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.experiment.excite_keys import ExciteEntry
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import plain_table
from pivident.studies import Design, DesignRequest, design_motion, write_design
from pivident.studies.excitation.checked_motion import FINER, FineCheck, with_more_room
from pivident.studies.excitation.criteria import standard_errors
from pivident.studies.excitation.design_task import SAMPLES, DesignTask
from pivident.studies.excitation.knowledge import knowledge
from pivident.studies.excitation.limits import PLANNED_SHARE, ROOM
from pivident.studies.excitation.motions import ExcitingMotion
from pivident.studies.excitation.questions import robot_question
from pivident.studies.excitation.request import limits_of
from pivident.studies.excitation.search import random_coefficients

MOTIONS = ("fourier", "splines", "postures")


def conditions(design: Design) -> tuple[float, float, int]:
    """cond(W) with and without friction, and the number of the latter's columns."""
    base = base_parameters(design.robot)
    regressor = Regressor.build(design.robot, base.parameters)
    q, dq, ddq = design.motion.sampled(200.0)
    matrix = regressor.matrix(q, dq, ddq, inner=regressor.levels(dq.T))
    matrix = np.asarray(matrix).reshape(-1, len(base))
    rigid = np.array([p.is_inertial and p.stem != "ia" for p in base.parameters])
    return np.linalg.cond(matrix), np.linalg.cond(matrix[:, rigid]), int(rigid.sum())


def checked(design: Design, entry: ExciteEntry, arm: Arm, shapes: bool = True) -> FineResult:
    """The motion as it was written, on a grid ten times finer than that of the design."""
    rate = 10 * FINER * SAMPLES / design.motion.family.time_scale
    with tempfile.TemporaryDirectory() as folder:
        write_design(design, folder, rate)
        return check(
            arm.robot,
            Path(folder) / "motion.csv",
            limits_of(arm.robot, entry),
            arm.clearances(entry),
            shapes=shapes,
        )


def worst(task: DesignTask, motion: ExcitingMotion) -> float:
    """Largest standard error over the size that matters."""
    return float((standard_errors(task.predicted(motion)[0]) / task.criterion.sizes).max())


def task_of(arm: Arm, entry: ExciteEntry, request: DesignRequest) -> DesignTask:
    limits = limits_of(arm.robot, entry)
    known = knowledge(arm.robot, limits)
    question = robot_question(known.base, known.values)
    return DesignTask(arm.robot, request, limits, known, question, arm.clearances(entry))


def designed(arm: Arm, entry: ExciteEntry, request: DesignRequest) -> Design:
    limits, clearances = limits_of(arm.robot, entry), arm.clearances(entry)
    return design_motion(arm.robot, request, limits=limits, clearances=clearances)


def print_designs(found: list[Arm], seconds: float, criteria: list[str]) -> int:
    """First part: one design of 20 s for each robot and criterion."""
    rows, broken = [], 0
    for arm in found:
        entry = table_and_post(arm)
        for criterion in criteria:
            request = DesignRequest(seconds=seconds, criterion=criterion)
            start = time.perf_counter()
            design = designed(arm, entry, request)
            took = time.perf_counter() - start
            result = checked(design, entry, arm)
            broken += len(result.violations)
            whole, rigid, columns = conditions(design)
            task = task_of(arm, entry, request)
            rows.append(
                [
                    arm.robot.name,
                    criterion,
                    f"{took:.0f}",
                    f"{design.condition[0]:.0f}",
                    f"{whole:.0f}",
                    f"{len(design.predicted)}",
                    f"{rigid:.1f}",
                    f"{columns}",
                    f"{rigid**2:.4g}",
                    f"{100 * worst(task, design.motion):.2f}",
                    f"{len(result.violations)} of {result.samples}",
                    f"{result.torque:.1e}",
                    f"{1e3 * result.room[0]:.0f}/{1e3 * result.room[1]:.0f}",
                ]
            )
            print(f"{arm.robot.name} {criterion}", *result.violations, sep="\n  ", flush=True)
    titles = (
        "robot", "crit.", "s", "cond start", "cond(W)", "par.", "rigid", "par.", "eig WᵀW",
        "worst σ %", "broken", "Pinocchio N m", "mm capsules",
    )  # fmt: skip
    print(table(titles, rows))
    return broken


def print_random(found: list[Arm], count: int, seed: int) -> int:
    """Second part: random cells."""
    refusals: Counter[str] = Counter()
    broken, made, samples = 0, 0, 0
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        arm = found[number % len(found)]
        entry = random_cell(arm, rng)
        request = DesignRequest(
            duration=float(rng.uniform(5.0, 30.0)),
            motion=MOTIONS[int(rng.integers(3))],  # type: ignore[arg-type]
            seconds=float(rng.uniform(1.0, 2.0)),
            seed=number,
        )
        where = f"cell {number} ({arm.robot.name}, {request.motion}, {request.duration:.0f} s)"
        try:
            design = designed(arm, entry, request)
        except ExperimentError as error:
            refusals[str(error)] += 1
            print(f"{where}: refused: {error}", flush=True)
            continue
        result = checked(design, entry, arm, shapes=False)
        made, samples = made + 1, samples + result.samples
        broken += len(result.violations)
        for violation in result.violations:
            print(f"{where}: {violation}", flush=True)
    print(
        f"{count} random cells: {made} designs, {sum(refusals.values())} refusals, {broken} limits "
        f"broken on {samples} samples"
    )
    return broken


def random_search(arm: Arm, entry: ExciteEntry, request: DesignRequest) -> tuple[float, float]:
    """Criterion in its own words and cond(W) of the best of many random motions."""
    task = task_of(arm, entry, request)
    family = task.family(request.duration)
    allowed = task.constraints(family)
    narrower = with_more_room(allowed, PLANNED_SHARE, ROOM)
    objective, fine = task.objective(narrower), FineCheck.of(allowed)
    rng, best, least = np.random.default_rng(request.seed), None, np.inf
    end = time.perf_counter() + request.seconds
    while time.perf_counter() < end:
        drawn = random_coefficients(narrower, rng, None)
        if drawn is not None and (value := objective.value(drawn)) < least:
            best, least = drawn, value
    kept = None if best is None else fine.repaired(best)
    if kept is None:
        return np.nan, np.nan
    motion = ExcitingMotion(family, kept)
    criterion = task.criterion
    rate = 2.0 * SAMPLES / family.time_scale
    bare = task.information(rate, bare=True).of(motion.sampled(rate))
    values = np.linalg.eigvalsh(bare)
    reached = criterion.reached(task.predicted(motion)[0] if criterion.weighted else bare)
    return reached, float(np.sqrt(values[-1] / values[0]))


def print_random_search(found: list[Arm], seconds: float) -> None:
    """Third part: random search of the same time, with both cores' time in one."""
    rows = []
    for arm in found:
        entry = table_and_post(arm)
        for criterion in ("a", "d", "worst", "cond"):
            request = DesignRequest(seconds=seconds, criterion=criterion)
            design = designed(arm, entry, request)
            longer = DesignRequest(seconds=2.0 * seconds, criterion=criterion)
            reached, condition = random_search(arm, entry, longer)
            rows.append(
                [
                    arm.robot.name,
                    criterion,
                    f"{reached:.4g}",
                    f"{design.cost[1]:.4g}",
                    f"{reached / design.cost[1]:.2f}",
                    f"{condition:.0f}",
                    f"{design.condition[1]:.0f}",
                ]
            )
            print(*rows[-1], flush=True)
    titles = ("robot", "crit.", "random", "design", "ratio", "cond random", "cond design")
    print(table(titles, rows))


def table(titles, rows) -> str:
    columns = [
        (title, "<" if k < 2 else ">", [row[k] for row in rows]) for k, title in enumerate(titles)
    ]
    return plain_table(columns)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", nargs="+", help="names of the gallery, ur10e, paths of URDFs")
    parser.add_argument("--frozen", nargs="*", default=[], metavar="JOINT=POSITION")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each search")
    parser.add_argument("--criteria", nargs="*", default=["a", "cond"])
    parser.add_argument("--rigid", action="store_true")
    parser.add_argument("--random", type=int, default=0, metavar="CELLS")
    parser.add_argument("--random-search", action="store_true")
    parser.add_argument("--seed", type=int, default=0, help="of the random cells")
    options = parser.parse_args()
    frozen = {name: float(value) for name, value in (f.split("=") for f in options.frozen)}
    broken = 0
    with tempfile.TemporaryDirectory() as folder:
        found = arms(options.robots, frozen, Path(folder), options.rigid)
        if options.random:
            broken = print_random(found, options.random, options.seed)
        elif options.random_search:
            print_random_search(found, options.seconds)
        else:
            broken = print_designs(found, options.seconds, options.criteria)
    raise SystemExit(broken > 0)


if __name__ == "__main__":
    main()
