"""Descriptions without the loops on records of closed mechanisms: what the verdict names.

    python -m benchmarks.forced_trees [five_bar delta …] [--seeds 3] [--methods ls,iv,piv]
        [--seconds 12] [--noise 1] [--table FILE]

Records are made by MuJoCo with other bodies, rotors, friction and motions for every seed. A row has
the largest share of a joint's torque that the description cannot make whatever its parameters (rms,
over random postures), the error on motion that was not fitted, what is said of the model (``!`` for
a reservation) and the joints that are named. The description with the loops is the first of each.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import pivident as pv
from pivident.foundation.errors import PividentError
from pivident.judgement.model_errors.coupling_errors import COUPLED

from .misfit import misfit
from .models import FORCED, Forced
from .records import Record, problem_of, record_of


@dataclass(frozen=True)
class Row:
    """What came of one description and one method.

    Attributes:
        mechanism, forced, seed, method: what it was made from.
        misfit: largest share of a joint's torque that the description cannot make [%].
        error: on motion that was not fitted, in the motion's band [%].
        said: kinds of the statements about the model, with ``!`` or ``·``.
        joints: those of the statement on coupled ones.
        is_named: whether that is a reservation.
        reservations: their number.
    """

    mechanism: str
    forced: str
    seed: int
    method: str
    misfit: float
    error: float
    said: str
    joints: str
    is_named: bool
    reservations: int

    def __str__(self) -> str:
        return (
            f"{self.mechanism:25} {self.forced:28} {self.seed:2d} {self.method:4} "
            f"{self.misfit:7.3f} % {self.error:6.2f} %  {self.said}"
            f"{' (' * bool(self.joints)}{self.joints}{')' * bool(self.joints)}"
        )


def row_of(record: Record, forced: Forced | None, name: str, seed: int, method: str) -> Row:
    """Estimate, diagnose and read the verdict."""
    problem = problem_of(record, forced)
    result = pv.identify(problem, method)
    diagnostics = pv.diagnose(problem, {method: result})
    verdict = pv.verdict(diagnostics)
    model = [s for s in verdict.statements if s.topic == "model" and s.kind != "not checked"]
    marks = {"ok": "+", "note": "·", "warning": "!", "error": "×"}
    compared, causes = diagnostics.out_of_sample, diagnostics.model_errors
    named = () if causes is None else causes.named
    return Row(
        name,
        "the mechanism" if forced is None else forced.name,
        seed,
        method,
        0.0 if forced is None else 100.0 * float(misfit(record.machine, forced).max()),
        float("nan") if compared is None else compared.results[method].prediction.total_in_band,
        ", ".join(f"{marks[s.severity]} {s.kind}" for s in model),
        "; ".join(one.cause.subject for one in named if one.cause.kind == COUPLED),
        any(s.kind == COUPLED and s.severity == "warning" for s in model),
        sum(s.severity in ("warning", "error") for s in verdict.statements),
    )


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "mechanisms", nargs="*", default=list(dict.fromkeys(f.mechanism for f in FORCED))
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--methods", default="ls,iv,piv")
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--noise", type=float, default=1.0, help="over the standard one")
    parser.add_argument("--table", type=Path, help="CSV file for the rows")
    options = parser.parse_args()
    rows: list[Row] = []
    for name in options.mechanisms:
        choices = [None, *(f for f in FORCED if f.mechanism == name)]
        for seed in range(options.seeds):
            record = record_of(name, seed, options.seconds, options.noise)
            for forced in choices:
                for method in options.methods.split(","):
                    try:
                        rows.append(row_of(record, forced, name, seed, method))
                    except PividentError as error:
                        what = "the mechanism" if forced is None else forced.name
                        print(f"{name:25} {what:28} {seed:2d} {method:4} refused: {error}")
                        continue
                    print(rows[-1], flush=True)
    summary(rows)
    if options.table is not None:
        fields = list(Row.__dataclass_fields__)
        lines = [",".join(f'"{getattr(row, key)}"' for key in fields) for row in rows]
        options.table.write_text("\n".join([",".join(fields), *lines]) + "\n", encoding="utf-8")


def summary(rows: list[Row]) -> None:
    """How often joints are named as coupled, by description."""
    print()
    for key in dict.fromkeys((row.mechanism, row.forced) for row in rows):
        own = [row for row in rows if (row.mechanism, row.forced) == key]
        worst = max(row.misfit for row in own)
        errors = sorted(row.error for row in own)
        print(
            f"{key[0]:25} {key[1]:28} misfit up to {worst:.3g} %, error {errors[0]:.2f} to "
            f"{errors[-1]:.2f} %: coupled joints named {sum(row.is_named for row in own)} of "
            f"{len(own)}, no reservation at all {sum(not row.reservations for row in own)}"
        )


if __name__ == "__main__":
    main()
