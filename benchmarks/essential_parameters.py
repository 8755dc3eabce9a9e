"""Essential parameters of the TX40: on the public record, and on simulated ones with known truth.

    PIVIDENT_DATA=FOLDER python benchmarks/essential_parameters.py [--runs 10] [--level 0.01]

Public record: which of the 61 base parameters remain with each method, beside the laboratory's 28
essential ones and the 28 of Brunot et al. (2018). Simulated records (scenario *fine*): truth are 28
parameters, the search starts from all 61; how many of the 33 others stay, how many of the 28 go.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

from pivident.data.recording.public_records import load_staubli_tx40
from pivident.estimation.instrumental_variables import InstrumentalVariables
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL, tx40_fine
from pivident.judgement.validation.essential_parameters import (
    EssentialParameters,
    essential_parameters,
)
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.robot.gallery import load_robot

PAPER = set(TX40_ESSENTIAL)
LABORATORY = (PAPER - {"fc6"}) | {"iam6"}


def real_record(level: float) -> dict[str, EssentialParameters]:
    """The search on the public record, by each method."""
    robot, record = load_robot("staubli_tx40"), load_staubli_tx40()
    moving = record.slice(0.05, 7.5)
    loop = Loop(virtual_pd(robot, moving.q.mean(axis=0)), reference="smoothed")
    problem = Problem(robot, (moving,), loop)
    sharp = robot.with_friction(FrictionLaw((viscous(), coulomb("sign"), offset())))
    band = Bandpass(cutoff=100.0, median=3, decimation=(10, 10), edge=20)
    return {
        "laboratory's LS": essential_parameters(
            Problem(sharp, (record,)), LeastSquares(signals=band), level=level
        ),
        "iv": essential_parameters(problem, InstrumentalVariables(signals=band), level=level),
        "iv-full-rate": essential_parameters(problem, METHODS["iv-full-rate"], level=level),
        "piv": essential_parameters(problem, METHODS["piv"], level=level),
    }


def simulated(runs: int, level: float, method: str = "piv") -> tuple[int, int]:
    """Of the parameters that are zero, how many stayed; of the others, how many went."""
    stayed = went = 0
    for seed in range(runs):
        problem, _ = tx40_fine(seed)
        result = essential_parameters(replace(problem, parameters=None), method, level=level)
        names = heads(result)
        stayed += len(names - PAPER)
        went += len(PAPER - names)
    return stayed, went


def heads(result: EssentialParameters) -> set[str]:
    """Names of the essential parameters without the trailing r."""
    return {p.name for p in result.identification.parameters}


def listed(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--level", type=float, default=0.01)
    options = parser.parse_args()
    for name, result in real_record(options.level).items():
        print(f"{name}\n{result.summary()}")
        for label, published in (("laboratory's", LABORATORY), ("paper's", PAPER)):
            more, fewer = heads(result) - published, published - heads(result)
            print(f"  beside the {label} 28: more {listed(more)}; fewer {listed(fewer)}")
        for step in result.steps:
            if step.name.removesuffix("r") in PAPER | LABORATORY:
                print(
                    f"  {step.name} went: {step.value:.4g} ± {2 * step.std:.2g} {step.unit} (2σ), "
                    f"p = {step.p_value:.3f}"
                )
    started = time.perf_counter()
    stayed, went = simulated(options.runs, options.level)
    seconds = (time.perf_counter() - started) / options.runs
    print(
        f"fine, {options.runs} records: {stayed} of {33 * options.runs} zero parameters stayed "
        f"({100 * stayed / 33 / options.runs:.1f} %), {went} of {28 * options.runs} others went; "
        f"{seconds:.1f} s each"
    )


if __name__ == "__main__":
    main()
