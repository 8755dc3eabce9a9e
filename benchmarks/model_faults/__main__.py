"""What an estimate by PIV and its verdict make of planted faults.

    python -m benchmarks.model_faults coverage none --records 6
    python -m benchmarks.model_faults coverage gear-ratio torque-late --arms scara --records 3
    python -m benchmarks.model_faults naming --records 7

Columns of coverage: largest error over standard error, share of the parameters within two standard
errors, seconds of the estimate, what the verdict says, and the kinds of its warnings.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import pivident as pv
from pivident.foundation.errors import PividentError

from .cases import Case, make_case
from .faults import FAULTS, is_possible
from .machines import LOOPS
from .naming import naming


def errors_of(case: Case, found: pv.Identification) -> np.ndarray:
    """Errors of an estimate over its standard errors, one for each parameter."""
    truth = np.array([case.truth[name] for name in found.names])
    return (found.theta - truth) / found.std


def row(case: Case) -> np.ndarray:
    """Print what comes of a case; its errors over their standard errors, infinite without any."""
    begin = time.perf_counter()
    try:
        piv = pv.identify(case.problem, "piv")
    except PividentError as error:
        print(f"{case.arm:7s} {case.fault:18s} {case.seed:3d} {error}", flush=True)
        return np.array([np.inf])
    took = time.perf_counter() - begin
    errors = errors_of(case, piv)
    said = pv.verdict(piv)
    kinds = [
        f"{f.severity} {f.kind}" for f in said.statements if f.severity in ("warning", "error")
    ]
    worst = int(np.argmax(np.abs(errors)))
    print(
        f"{case.arm:7s} {case.fault:18s} {case.seed:3d} {case.size:8.3g} {case.unit:8s} "
        f"{errors[worst]:8.1f} ({piv.names[worst]}) {100 * np.mean(np.abs(errors) <= 2):5.0f} % "
        f"{took:5.1f} s  {said.headline} [{', '.join(kinds)}]",
        flush=True,
    )
    return errors


def coverage(faults: list[str], arms: list[str], records: int, first: int) -> None:
    """Print a row for each case, and the share within two standard errors of each fault."""
    for fault in faults:
        for arm in arms:
            if not is_possible(fault, arm):
                continue
            errors = [row(make_case(arm, fault, seed)) for seed in range(first, first + records)]
            together = np.abs(np.concatenate(errors))
            print(
                f"{arm} {fault}: {100 * np.mean(together <= 2):.1f} % within two standard errors, "
                f"largest error {np.median([np.abs(e).max() for e in errors]):.1f} (median)"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["coverage", "naming"])
    parser.add_argument("faults", nargs="*", help=f"of {', '.join(FAULTS)}; none: all of them")
    parser.add_argument("--arms", nargs="*", default=list(LOOPS))
    parser.add_argument("--records", type=int, default=6, help="seeds for each fault and arm")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    options = parser.parse_args()
    work = {"coverage": coverage, "naming": naming}[options.what]
    work(options.faults or list(FAULTS), options.arms, options.records, options.first)


if __name__ == "__main__":
    main()
