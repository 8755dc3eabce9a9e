"""Real records: held-out torque error of all methods beside that of PIV, the same bands.

    PIVIDENT_DATA=FOLDER python -m benchmarks.methods_on_records [--records emps tx40 kr300]
        [--methods ls,piv,cloe] [--table FILE]

EMPS: fitted on one file, judged on the other (pulses), in closed loop with its known law. TX40:
five contiguous folds with the paper's 28 parameters and offsets; its reference was not logged, so
that only the open loop can be simulated. KR300, axes 1 to 3: five blocks of each motion, with the
law of the records' authors, which explains only part of the recorded torque, and with the law
identified from the record.

The torque error is that of the motion's band, ‖τ - Φθ‖/‖τ‖ of the held-out motion, by
`compare_out_of_sample`, or below 4 Hz on KR300, by `kuka_kr300_blocks`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from benchmarks.held_out_folds import tx40_problem
from benchmarks.kuka_kr300_blocks import EXAMPLE, held_out, loops, without_vague_inertias

from pivident.data.recording.public_records import load_emps, load_emps_pulses, load_kuka_kr300
from pivident.estimation.methods import METHODS
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.foundation.errors import PividentError
from pivident.judgement.validation.held_out.out_of_sample import OutOfSample, compare_out_of_sample
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.gallery import load_robot
from pivident.studies.many.study.scenario import league_methods

Errors = dict[str, float]

#: Methods that are compared unless others are named.
COMPARED = ("ls", "iv-full-rate", "piv", "cloe", "clie", "ml", "oloe")


def emps(names: Sequence[str]) -> Errors:
    """Unseen pulses."""
    loop = Loop(Cascade(kp=[160.18], kv=[243.45], averaged=True), 35.15065188248547, 10.0)
    problem = Problem(load_robot("emps"), (load_emps(),), loop)
    return _errors(compare_out_of_sample(problem, names, recording=load_emps_pulses()))


def tx40(names: Sequence[str]) -> Errors:
    """Five folds."""
    return _errors(compare_out_of_sample(tx40_problem(), names))


def _errors(found: OutOfSample) -> Errors:
    """Held-out torque errors in the motion's band, by method [%]; what failed is printed."""
    print(found)
    for name, why in found.failures.items():
        print(f"  {name}: {why[:110]}")
    return {name: own.prediction.total_in_band for name, own in found.results.items()}


def kr300(names: Sequence[str]) -> Errors:
    """Blocks of two motions, two laws, without the moments of inertia that LS hardly tells."""
    robot = load_robot(EXAMPLE / "kuka_kr300_axes_1_3.toml")
    runs = tuple(load_kuka_kr300(motion, robot=robot) for motion in ("A", "B"))
    known, fewer = loops(robot, runs), without_vague_inertias(robot, runs)
    found: Errors = {}
    for law in ("identified", "authors' PD"):
        own, loop = known[law]
        for name in names:
            method = PrefilteredIV(prefilter="direct") if name == "piv" else METHODS[name]
            started = perf_counter()
            try:
                errors = held_out(robot, own, loop, method, lambda *_: fewer)
            except PividentError as error:
                print(f"  {name:12} {law:12} {type(error).__name__}: {str(error)[:110]}")
                continue
            if law == "identified":
                found[name] = float(np.mean(errors))
            listed = "  ".join(f"{e:6.2f}" for e in errors)
            seconds = perf_counter() - started
            print(
                f"  {name:12} {law:12} {listed} %   mean {np.mean(errors):.2f} %, {seconds:.0f} s"
            )
    return found


RECORDS: Mapping = {"emps": emps, "tx40": tx40, "kr300": kr300}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", nargs="+", default=list(RECORDS), choices=list(RECORDS))
    parser.add_argument("--methods", default=",".join(COMPARED))
    parser.add_argument("--table", type=Path, help="CSV file for the errors")
    options = parser.parse_args()
    names = league_methods(options.methods.split(","))
    lines = ["record,method,error"]
    for record in options.records:
        print(f"\n{record}")
        for name, error in RECORDS[record](names).items():
            lines.append(f"{record.upper()},{name},{error:.2f}")
    if options.table is not None:
        options.table.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
