"""Real records: errors on motion that was not fitted, LS, IV, full-rate IV and PIV.

    PIVIDENT_DATA=FOLDER python benchmarks/held_out_folds.py

TX40 (reference not logged: smoothed measurement and a virtual PD law): five contiguous folds, each
predicted from the other four, with the paper's 28 parameters and six offsets.

EMPS: fitted on one file, judged on the other (pulses of 5.07 V as known input), by prediction and
by closed-loop simulation; once more with a noise model from the repeated periods. Then how much of
the residual is model error.
"""

from __future__ import annotations

from pivident.data.recording.public_records import load_emps, load_emps_pulses, load_staubli_tx40
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method, Repetition
from pivident.estimation.methods import METHODS
from pivident.estimation.prefiltered_iv import PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.judgement.validation.held_out.out_of_sample import OutOfSample, compare_out_of_sample
from pivident.judgement.validation.residuals.model_error import model_error
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.gallery import load_robot


def tx40_problem() -> Problem:
    """The TX40's motion, with a virtual law on the smoothed measurement."""
    robot, record = load_robot("staubli_tx40"), load_staubli_tx40().slice(0.05, 7.5)
    loop = Loop(virtual_pd(robot, record.q.mean(axis=0)), reference="smoothed")
    chosen = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    return Problem(robot, (record,), loop, chosen)


def tx40() -> tuple[Problem, OutOfSample]:
    """Five folds of the TX40's motion."""
    problem = tx40_problem()
    return problem, compare_out_of_sample(problem)


def emps() -> tuple[Problem, OutOfSample]:
    """The unseen pulses of EMPS."""
    controller = Cascade(kp=[160.18], kv=[243.45], averaged=True)
    loop = Loop(controller, 35.15065188248547, 10.0)
    problem = Problem(load_robot("emps"), (load_emps(),), loop)
    band = Bandpass(cutoff=100.0, decimation=10)
    methods: dict[str, Method] = {
        "ls": LeastSquares(signals=band),
        "iv": InstrumentalVariables(signals=band),
        "iv-full-rate": METHODS["iv-full-rate"],
        "piv": METHODS["piv"],
        "piv-repetition": PrefilteredIV(noise=Repetition()),
        "piv-as-printed": METHODS["piv-as-printed"],
    }
    return problem, compare_out_of_sample(problem, methods, recording=load_emps_pulses())


def main() -> None:
    for name, (problem, compared) in {"TX40": tx40(), "EMPS, unseen pulses": emps()}.items():
        print(f"{name}\n{compared}\n")
        for key in ("piv", "piv-repetition"):
            result = compared.results.get(key)
            if result is None:
                continue
            found = result.identification
            pairs = zip(found.names, found.theta, strict=True)
            values = "  ".join(f"{n} {v:.5g}" for n, v in pairs)
            if len(found.names) < 10:
                print(f"{key}: {values}, {found.iterations} iterations")
            print(f"{result.joint_table()}\n{model_error(problem, found, result)}\n")


if __name__ == "__main__":
    main()
