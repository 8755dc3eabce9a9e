"""Real records: IV and PIV with every kind of instruments that a record allows.

    PIVIDENT_DATA=FOLDER python benchmarks/instrument_kinds.py [RECORD …]

TIAGo, TX40 and KR300 (axes 1 to 3 of both motions) in five contiguous blocks, EMPS judged on its
unseen pulses. Two further splits ask for more than the motion that is fitted can give: KR300 fitted
on A and judged on B, and the reverse; TIAGo's last 30 %. For each method and kind: torque
error on the held-out motion below the band of the motion, over the best of all (a quotient of 1.03
is 3 % worse), iterations, smallest first-stage F, smallest share of an acceleration that the
instruments follow, and the test of Durbin, Wu and Hausman. ``ls`` stands beside them, and ``loop``
where the law is known or can be identified.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from kuka_kr300_blocks import CUTOFF, START, STOP, loops as kr300_loops, without_vague_inertias

from pivident import load_experiment
from pivident.data.recording.datasets import ENVIRONMENT, fetch
from pivident.data.recording.public_records import (
    load_emps,
    load_emps_pulses,
    load_kuka_kr300,
    load_staubli_tx40,
)
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.experiment.init.draft import draft_experiment
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.foundation.errors import PividentError
from pivident.foundation.text.numbers import plain_table
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.prediction import Judge
from pivident.judgement.validation.instrument_tests import instrument_tests
from pivident.loop.instruments.kinds import KINDS
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.gallery import load_robot

KR300 = Path(__file__).resolve().parents[1] / "examples" / "kuka_kr300"

#: Estimators that are compared with every kind.
ESTIMATORS = ("iv-full-rate", "piv")


@dataclass(frozen=True, eq=False)
class Case:
    """One record and the motion it is judged on.

    Attributes:
        name: of the record.
        problem: what is fitted; its loop makes the instruments of kind ``loop``.
        unseen: what is judged; None: five contiguous blocks.
        band: highest frequency that is judged [Hz]; None: that of the motion.
    """

    name: str
    problem: Problem
    unseen: Recording | None = None
    band: float | None = None


def cases() -> dict[str, Callable[[], Iterator[Case]]]:
    """All records by the name that selects them."""
    return {"tx40": tx40, "emps": emps, "kr300": kr300, "tiago": tiago}


def tx40() -> Iterator[Case]:
    """The paper's 28 parameters and six offsets; neither law nor reference are known."""
    robot, record = load_robot("staubli_tx40"), load_staubli_tx40().slice(0.05, 7.5)
    chosen = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    yield Case("TX40, five blocks", Problem(robot, (record,), parameters=chosen))


def emps() -> Iterator[Case]:
    """The prismatic axis, whose law is known."""
    loop = Loop(Cascade(kp=[160.18], kv=[243.45], averaged=True), 35.15065188248547, 10.0)
    problem = Problem(load_robot("emps"), (load_emps(),), loop)
    yield Case("EMPS, unseen pulses", problem, load_emps_pulses())


def kr300() -> Iterator[Case]:
    """Axes 1 to 3 while they move, one motion fitted and the other judged below 4 Hz."""
    robot = load_robot(KR300 / "kuka_kr300_axes_1_3.toml")
    runs = tuple(load_kuka_kr300(run, robot=robot) for run in ("A", "B"))
    chosen = without_vague_inertias(robot, runs)
    moving, loop = kr300_loops(robot, runs)["identified"]
    both = tuple(motion.slice(START, STOP) for motion in moving)
    yield Case("KR300, five blocks", Problem(robot, both, loop, parameters=chosen))
    speeds = tuple(
        replace(run, q_link=None, dq=behind.slice(START, STOP).dq)
        for run, behind in zip(both, map(_with_link_speeds, runs), strict=True)
    )
    case = Problem(robot, speeds, parameters=chosen)
    yield Case("KR300, five blocks, second sensor: speeds behind the gears", case)
    for fitted, judged in ((0, 1), (1, 0)):
        own = both[fitted]
        case = Problem(robot, (own,), loop, parameters=chosen)
        name = f"KR300, fitted on {'AB'[fitted]}, judged on {'AB'[judged]}"
        yield Case(name, case, runs[judged].slice(START, STOP), CUTOFF)


def _with_link_speeds(run: Recording) -> Recording:
    """A run with the speeds of its encoders behind the gears [rad/s]."""
    (key,) = (key for key in "AB" if run.name.endswith(key))
    with np.load(fetch("kuka_kr300", key)[key]) as file:
        speeds = np.deg2rad(file["rec__act_vel_se_deg_per_s"][: run.joints].T)
    return replace(run, dq=np.ascontiguousarray(speeds))


def tiago() -> Iterator[Case]:
    """The experiment that `pivident init` writes, in five blocks and without the last 30 %."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(os.environ[ENVIRONMENT]) / "tiago"
        logs = [data / f"tiago_{name}.csv.gz" for name in ("position", "velocity", "effort")]
        out = Path(folder) / "experiment.toml"
        draft = draft_experiment(logs, str(data / "tiago_48_hey5.urdf.gz"), out=out)
        out.write_text(draft.text, encoding="utf-8")
        problem = load_experiment(out).problem()
    yield Case("TIAGo, five blocks", problem)
    (record,) = problem.recordings
    cut = int(0.7 * record.samples)
    problem = replace(problem, recordings=(record.part(0, cut),))
    yield Case("TIAGo, last 30 %", problem, record.part(cut, record.samples))


def methods(problem: Problem) -> Iterator[tuple[str, Method]]:
    """Least squares, and every estimator with every kind of instruments."""
    yield "ls", METHODS["ls"]
    yield "ls at full rate", LeastSquares(signals=RandomWalk())
    for name in ESTIMATORS:
        for kind in KINDS:
            if kind != "loop" or problem.loop is not None:
                yield f"{name}, {kind}", replace(METHODS[name], instruments=kind)


def judged(case: Case, method: Method) -> tuple[float, Identification] | str:
    """Error on the held-out motion [%] and the estimate, or why there are none."""
    try:
        if case.band is None or case.unseen is None:
            own = cross_validate(case.problem, method, folds=5, recording=case.unseen)
            return own.prediction.total_in_band, own.identification
        found = identify(case.problem, method)
        (error,) = Judge(case.unseen, case.band).score(found, [slice(0, case.unseen.samples)])
        return error.total_in_band, found
    except PividentError as error:
        return " ".join(str(error).split())[:90]


def report(case: Case) -> str:
    """One line for each method."""
    found = {name: judged(case, method) for name, method in methods(case.problem)}
    good = {name: own for name, own in found.items() if not isinstance(own, str)}
    best = min(error for error, _ in good.values())
    rows = [_row(name, *own, best) for name, own in good.items()]
    titles = ("method", "error %", "/ best", "iterations", "F", "follows %", "p (DWH)", "shift σ")
    table = plain_table(
        [(title, "<" if k == 0 else ".", [r[k] for r in rows]) for k, title in enumerate(titles)]
    )
    missing = [f"  {name}: {own}" for name, own in found.items() if isinstance(own, str)]
    return "\n".join([case.name, table, *missing])


def _row(name: str, error: float, result: Identification, best: float) -> list[str]:
    cells = [name, f"{error:.3f}", f"{error / best:.3f}", str(result.iterations)]
    if result.instruments is None:
        return [*cells, "", "", "", ""]
    tests = instrument_tests(result)
    follows = min(result.instruments.agreement, default=float("nan"))
    return [
        *cells,
        f"{tests.relevance.statistic:.3g}",
        f"{100 * follows:.1f}" if result.instruments.agreement else "",
        f"{tests.exogeneity.p_value:.2g}",
        f"{tests.exogeneity.practical_size:.2g}",
    ]


def main() -> None:
    chosen = sys.argv[1:] or list(cases())
    for name in chosen:
        for case in cases()[name]():
            print(f"{report(case)}\n", flush=True)


if __name__ == "__main__":
    main()
