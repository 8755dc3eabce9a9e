"""Are friction laws found again, with intervals that are true?

    python benchmarks/friction_law_recovery.py [--runs 50] [--methods ls,piv] [--processes 2]

One axis in a PD loop is simulated finely (Runge–Kutta 4 with laws of its own, independent of the
program's) with each friction law, encoder noise in the loop and torque noise on the record. Each
record is identified with the law it was made with, the constants of shape starting far from the
truth. Printed: the share of 2σ intervals that hold the truth, for parameters and for constants of
shape, asked 90 to 99 %; the mean error of each unknown in standard deviations; the time of a run.

Then the choice among laws: it begins with viscous and Coulomb friction and does not know what the
record was made with. Printed: how often the law that was there is chosen, how often viscous and
Coulomb friction alone is rejected, and how often wrong laws are (those without a term that is
there); asked: 90.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.studies.friction_laws.friction_axis import Axis, Noise
from tests.studies.friction_laws.friction_cases import CASES

from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import PividentError
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.robot.friction_term import Candidate
from pivident.studies.friction_laws.law_candidates import Reach, adding, change_of, key_of
from pivident.studies.friction_laws.law_choice import choose_laws
from pivident.studies.friction_laws.shapes import identify_shapes

NOISE = Noise(encoder=2e-7, torque=0.3)
METHOD: dict[str, Method] = dict(METHODS)
METHOD["ls"] = LeastSquares(signals=RandomWalk())


def standardised(name: str, method: str, seed: int) -> dict[str, float]:
    """(estimate - truth)/σ of every unknown of one record, constants of shape in their u."""
    case = CASES[name]
    problem = Axis(case.truth, noise=NOISE).problem(case.law, seed)
    try:
        if not case.shapes:
            found = identify(problem, METHOD[method])
            return {
                p: (found.value(p) - true) / float(found.robust_std[_index(found, p)])
                for p, true in case.parameters.items()
            }
        names = {"axis": list(case.shapes)}
        shaped = identify_shapes(problem, METHOD[method], names, profiles=False)
    except PividentError as error:
        return {f"failed: {str(error)[:80]}": np.inf}
    found = shaped.identification
    errors = {
        p: (found.value(p) - true) / float(found.std[_index(found, p)])
        for p, true in case.parameters.items()
    }
    for own in shaped.shapes:
        c = own.constant
        spread = own.std / c.slope(c.value)
        errors[c.name] = (c.coordinate(c.value) - c.coordinate(case.shapes[c.name])) / spread
    return errors


def chosen(name: str, seed: int) -> tuple[bool, bool, list[bool], str]:
    """Whether the true law is chosen, the plain one rejected, the wrong ones rejected; its name."""
    case = CASES[name]
    base = FrictionLaw((viscous(), coulomb(), *(() if name.startswith("asym") else (offset(),))))
    elements = Candidate(
        "Maxwell slip", lambda *_: case.law.terms[1:-1], instead_of=("coulomb", "stribeck")
    )
    more = {
        "ripple": {"ripple": adding(case.law.terms[3:])},
        "counterbalance": {"counterbalance": adding(case.law.terms[3:])},
        "Maxwell slip": {"Maxwell slip": change_of(elements, Reach(1.0, 1.0))},
    }
    problem = Axis(case.truth, noise=NOISE).problem(base, seed)
    choice = choose_laws(problem, more={"axis": more.get(name, {})}).joint("axis")
    true = key_of(problem.robot.with_friction(case.law).joints[0].friction)
    wrong = [s for s in choice.scores if not _contains(s.law, case.law)]
    plain = choice.base in wrong and choice.rejected(choice.base)
    rejected = [choice.rejected(s) for s in wrong]
    return key_of(choice.chosen.law) == true, plain, rejected, choice.chosen.name


#: Functions that can be what another one is: a power of one, a slope for each direction …
SAME = {
    "viscous": {"power", "viscous_positive"},
    "coulomb": {"coulomb_positive"},
}


def _contains(law: FrictionLaw, true: FrictionLaw) -> bool:
    """Whether a law has, at least, the terms that are there."""
    names = {t.column.name for t in law.terms}
    return all(names & ({t.column.name} | SAME.get(t.column.name, set())) for t in true.terms)


def _index(found, name: str) -> int:
    return next(k for k, n in enumerate(found.names) if n in (name, f"{name}r"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--choice-runs", type=int, default=50)
    parser.add_argument("--methods", default="ls,piv")
    parser.add_argument("--laws", default=",".join(CASES))
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    if options.runs:
        print(f"2σ coverage over {options.runs} records [%]; asked: 90 to 99")
    with ProcessPoolExecutor(options.processes) as pool:
        for name in options.laws.split(","):
            for method in options.methods.split(",") if options.runs else ():
                start = time.perf_counter()
                jobs = [
                    pool.submit(standardised, name, method, seed) for seed in range(options.runs)
                ]
                _report(name, method, [job.result() for job in jobs], start, options)
        if options.choice_runs:
            print(f"choice among laws on {options.choice_runs} records [%]")
        for name in options.laws.split(",") if options.choice_runs else ():
            seeds = range(options.choice_runs)
            _report_choice(name, list(pool.map(chosen, [name] * len(seeds), seeds)))


def _report_choice(name: str, runs: list[tuple[bool, bool, list[bool], str]]) -> None:
    """One line for a law: what was chosen where it was there."""
    right = 100.0 * np.mean([r[0] for r in runs])
    plain = "    –" if name == "Coulomb" else f"{100.0 * np.mean([r[1] for r in runs]):5.1f}"
    wrong = 100.0 * np.mean([x for r in runs for x in r[2]])
    others = Counter(r[3] for r in runs if not r[0])
    text = ", ".join(f"{what} {count}" for what, count in others.most_common())
    print(
        f"{name:20s} chosen {right:5.1f}  plain law rejected {plain}  wrong laws rejected "
        f"{wrong:5.1f}  {text}",
        flush=True,
    )


def _report(name: str, method: str, runs: list[dict[str, float]], start: float, options) -> None:
    """One line for a law and a method, and one for its unknowns."""
    seconds = (time.perf_counter() - start) * options.processes / options.runs
    unknowns = list(dict.fromkeys(key for run in runs for key in run))
    z = np.array([[run.get(key, np.nan) for key in unknowns] for run in runs])
    inside = np.abs(z) < 2.0
    known = ~np.isnan(z)
    shapes = np.array([key in CASES[name].shapes for key in unknowns])
    line = f"{name:20s} {method:4s} parameters {_share(inside, known, ~shapes)}"
    if shapes.any():
        line += f"  constants of shape {_share(inside, known, shapes)}"
    print(f"{line}  {seconds:.2f} s/record", flush=True)
    each = [
        f"{key} {100 * i[k].mean():.0f} ({v[k].mean():+.1f}σ)"
        for key, i, v, k in zip(unknowns, inside.T, z.T, known.T, strict=True)
    ]
    print(f"    {', '.join(each)}", flush=True)


def _share(inside: np.ndarray, known: np.ndarray, which: np.ndarray) -> str:
    return f"{100.0 * inside[:, which][known[:, which]].mean():5.1f}"


if __name__ == "__main__":
    main()
