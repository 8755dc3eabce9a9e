"""Real records: held-out torque error of fitted simulations beside that of PIV, the same bands.

    PIVIDENT_DATA=FOLDER python -m benchmarks.output_error_records [--records emps tx40 kr300]

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
from collections.abc import Mapping
from time import perf_counter

import numpy as np
from benchmarks.held_out_folds import tx40_problem
from benchmarks.kuka_kr300_blocks import EXAMPLE, held_out, loops, without_vague_inertias

from pivident.errors import PividentError
from pivident.estimation.methods import METHODS, PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.recording.public_records import load_emps, load_emps_pulses, load_kuka_kr300
from pivident.robot.gallery import load_robot
from pivident.simulation.control_loop import Loop
from pivident.simulation.controllers import Cascade
from pivident.validation.held_out.out_of_sample import compare_out_of_sample

CLOSED = ("cloe", "clie", "ml")


def emps() -> None:
    """Unseen pulses."""
    loop = Loop(Cascade(kp=[160.18], kv=[243.45], averaged=True), 35.15065188248547, 10.0)
    problem = Problem(load_robot("emps"), (load_emps(),), loop)
    names = ("ls", "iv-full-rate", "piv", *CLOSED, "oloe")
    print(compare_out_of_sample(problem, names, recording=load_emps_pulses()))


def tx40() -> None:
    """Five folds."""
    print(compare_out_of_sample(tx40_problem(), ("ls", "iv-full-rate", "piv", "oloe")))


def kr300() -> None:
    """Blocks of two motions, two laws, without the moments of inertia that LS hardly tells."""
    robot = load_robot(EXAMPLE / "kuka_kr300_axes_1_3.toml")
    runs = tuple(load_kuka_kr300(motion, robot=robot) for motion in ("A", "B"))
    known, fewer = loops(robot, runs), without_vague_inertias(robot, runs)
    for law in ("identified", "authors' PD"):
        own, loop = known[law]
        for name in ("ls", "piv", *CLOSED, "oloe"):
            method = PrefilteredIV(prefilter="direct") if name == "piv" else METHODS[name]
            started = perf_counter()
            try:
                errors = held_out(robot, own, loop, method, lambda *_: fewer)
            except PividentError as error:
                print(f"  {name:5} {law:12} {type(error).__name__}: {str(error)[:110]}")
                continue
            listed = "  ".join(f"{e:6.2f}" for e in errors)
            seconds = perf_counter() - started
            print(f"  {name:5} {law:12} {listed} %   mean {np.mean(errors):.2f} %, {seconds:.0f} s")


RECORDS: Mapping = {"emps": emps, "tx40": tx40, "kr300": kr300}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", nargs="+", default=list(RECORDS), choices=list(RECORDS))
    for name in parser.parse_args().records:
        print(f"\n{name}")
        RECORDS[name]()


if __name__ == "__main__":
    main()
