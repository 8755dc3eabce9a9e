"""Two implementations of IDIM-PIV as printed, and what its open choices change, on the twin.

    PYTHONPATH=. python benchmarks/independent_paper.py [--agreement] [--choices] [--smoothers]

The second implementation (`tests/independent`) was written from the paper's text alone. Part one
gives both the same records and choices. Part two takes the text as literally as it goes, and then
one choice after the other in another way; no choice looks at the truth, which only says
afterwards how often intervals were right. Part three smooths ten records in two ways. The tables
are part of the page of the paper. About a quarter of an hour of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.independent.identification import Estimate, instrumental_variables, prefiltered
from tests.independent.reading import Reading
from tests.independent.twin import AS_PIVIDENT, Twin, bench_of, twin

from pivident.studies.paper.markdown import table
from pivident.studies.paper.published import published_table

PAGE = Path("src/pivident/studies/paper/templates/independent.md")
ENCODERS = ("motor", "joint", "log")
COMPARED = ("over IDIM-IV", "over IDIM-IV, axes weighted", "covered")
SETTLED = Reading(margins=(0.25, 0.25), weak_integral=True, noise_fits=2)

#: One choice after the other, by what the page calls it.
CHOICES: tuple[tuple[str, Reading], ...] = (
    ("the text as literally as it goes", Reading()),
    ("integral left out of C⁻¹", Reading(weak_integral=True)),
    ("… and λ⁻¹ᐟ² in L", Reading(weak_integral=True, exponent=0.5)),
    ("… and two noise models, then kept", Reading(weak_integral=True, noise_fits=2)),
    ("… and 0.25 s at the ends left out", SETTLED),
    ("… … with λ⁻¹ᐟ² in L", replace(SETTLED, exponent=0.5)),
    ("… … slow samples left out", replace(SETTLED, slowest=0.05)),
    ("… … … of noise models, too", replace(SETTLED, slowest=0.05, noise_moving=True)),
    ("… … accelerations on the sample", replace(SETTLED, slopes="centred")),
    ("… … second pass as smooth as the first", replace(SETTLED, second_pass="same")),
    ("… … band-pass in place of irwsm", replace(SETTLED, smoother="bandpass")),
    ("… … AR model of the torque (4.4)", replace(SETTLED, noise_of="torque")),
    ("… … AR orders up to 1000", replace(SETTLED, fit="burg", max_order=1000)),
    ("… … AR orders up to 32", replace(SETTLED, max_order=32)),
    ("… … one noise model for all axes", replace(SETTLED, joint_noise=False)),
    ("… … C⁻¹ bounded by a tenth of C(∞)", replace(SETTLED, ridge=0.1)),
    ("… … F_p and decimation to 100 Hz first", replace(SETTLED, decimation=50)),
    ("… … half the way back where it runs away", replace(SETTLED, halvings=8)),
)


def agreement(records: int) -> Iterator[list[object]]:
    """How both implementations end on each record, and how far their estimates are apart."""
    for encoder in ENCODERS:
        bench = bench_of(encoder)
        for run in range(records):
            made = twin(bench, run)
            first, second = made.by_pivident(), prefiltered(made.record, AS_PIVIDENT, made.start)
            apart = "–"
            if first.converged and second.converged:
                apart = f"{np.max(np.abs(first.theta - second.theta) / second.errors):.3f}"
            yield [encoder, run, ended(first), ended(second), apart]


def ended(found: Estimate) -> str:
    """In how many iterations, or why not."""
    if found.converged:
        return f"{found.iterations} iterations"
    return "no convergence" if found.end.startswith("no convergence") else "cannot be simulated"


def choices(encoder: str, made: Twin) -> Iterator[list[object]]:
    """What each choice makes of one record."""
    for label, reading in CHOICES:
        yield [encoder, label, *judged(made, reading)]


def smoothers(records: int) -> Iterator[list[object]]:
    """What smoother and band-pass make of the same records."""
    bench = bench_of("motor")
    for run in range(records):
        made = twin(bench, run)
        for name in ("irwsm", "bandpass"):
            yield ["motor", run, name, *judged(made, replace(SETTLED, smoother=name))]


def judged(made: Twin, reading: Reading) -> list[str]:
    """How a reading ends on a record, its standard errors over those of IDIM-IV, and coverage."""
    found = prefiltered(made.record, reading, made.start)
    cells = []
    if found.end.startswith("The simulated"):
        return [ended(found), "–", "–", "–"]
    for weights in (False, True):
        plain = Reading(margins=reading.margins, axis_weights=weights)
        other = instrumental_variables(made.record, plain, made.start)
        cells.append(over(relative(found), relative(other)))
    covered = np.abs(found.theta - made.truth) < 2 * found.errors
    return [ended(found), *cells, f"{100 * covered.mean():.0f} %"]


def relative(found: Estimate) -> np.ndarray:
    """Relative standard errors."""
    return found.errors / np.abs(found.theta)


def over(new: np.ndarray, old: np.ndarray) -> str:
    """Geometric mean of the ratios of two methods' standard errors, and how many fall."""
    ratios = new / old
    return f"{np.exp(np.mean(np.log(ratios))):.2g}, {np.sum(ratios < 1)} of {len(ratios)} fall"


def printed(rows: Iterator[list[object]]) -> list[list[object]]:
    """Rows, said while they are made."""
    made = []
    for row in rows:
        print(*row, sep=" | ", flush=True)
        made.append(row)
    return made


def with_table(text: str, heading: str, part: str) -> str:
    """The page with the table below a heading replaced."""
    lines = text.split("\n")
    first = next(k for k in range(lines.index(heading), len(lines)) if lines[k].startswith("|"))
    last = next(k for k in range(first, len(lines)) if not lines[k].startswith("|"))
    return "\n".join([*lines[:first], part, *lines[last:]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=10)
    parser.add_argument("--agreement", action="store_true")
    parser.add_argument("--choices", action="store_true")
    parser.add_argument("--smoothers", action="store_true")
    options = parser.parse_args()
    whole = not (options.agreement or options.choices or options.smoothers)
    text = PAGE.read_text("utf-8")
    if options.agreement or whole:
        head = ["encoder", "record", "pivident", "second", "largest difference [σ]"]
        rows = printed(agreement(options.records))
        text = with_table(text, "### The same choices", table(head, rows))
    if options.choices or whole:
        head = [
            "encoder",
            "reading",
            "ends",
            "over IDIM-IV",
            "over IDIM-IV, axes weighted",
            "covered",
        ]
        rows = [row for e in ENCODERS for row in printed(choices(e, twin(bench_of(e), 0)))]
        text = with_table(text, "### Other choices", table(head, rows))
    if options.smoothers or whole:
        head = ["encoder", "record", "smoother", "ends", *COMPARED]
        rows = printed(smoothers(options.records))
        text = with_table(text, "### The smoother", table(head, rows))
    table_1 = np.array(
        [row.relative_std["piv"] / row.relative_std["iv"] for row in published_table()]
    )
    print("Table 1:", over(table_1, np.ones_like(table_1)))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
