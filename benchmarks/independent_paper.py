"""Two implementations of IDIM-PIV as printed, and what its open choices change, on the twin.

    PYTHONPATH=. python benchmarks/independent_paper.py [--agreement] [--choices] [--smoothers]
        [--standstill] [--masks]

The second implementation (`tests/independent`) was written from the paper's text alone. Part one
gives both the same records and choices. Part two takes the text as literally as it goes, and then
one choice after the other in another way; no choice looks at the truth, which only says
afterwards how often intervals were right. Part three smooths ten records in two ways, part four
says what is left of friction then, and part five leaves out slow samples where encoders count
revolutions of the joint. The tables are part of the page of the paper. About twenty minutes of a
core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt
from tests.independent.arm import observed
from tests.independent.identification import (
    Estimate,
    bandpass,
    instrumental_variables,
    prefiltered,
)
from tests.independent.random_walk import derivatives
from tests.independent.reading import Reading
from tests.independent.twin import AS_PIVIDENT, Twin, bench_of, twin

from pivident.estimation.identify import identify
from pivident.foundation.errors import PividentError
from pivident.studies.paper.markdown import table
from pivident.studies.paper.published import published_table

PAGE = Path("src/pivident/studies/paper/templates/independent.md")
ENCODERS = ("motor", "joint", "log")
COMPARED = ("over IDIM-IV", "over IDIM-IV, axes weighted", "covered")
RESIDUALS = (
    "residual below 10 Hz, slow [N m]",
    "else [N m]",
    "slow, with the true velocity [N m]",
)
SLOW = 0.05  # share of an axis's largest speed below which it is called slow
PARTS = ("agreement", "choices", "smoothers", "standstill", "masks")
MASKS = (0.01, 0.02, 0.03, 0.05, 0.1)  # shares of the rated speed
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


def choices() -> Iterator[list[object]]:
    """What each choice makes of the first record of each reading of the encoders."""
    motor, *others = (twin(bench_of(encoder), 0) for encoder in ENCODERS)
    for label, reading in CHOICES:
        ends = [ended(prefiltered(made.record, reading, made.start)) for made in others]
        yield [label, *judged(motor, reading), *ends]


def smoothers(records: int) -> Iterator[list[object]]:
    """What smoother and band-pass make of the same records."""
    bench = bench_of("motor")
    for run in range(records):
        made = twin(bench, run)
        for name in ("irwsm", "bandpass"):
            yield [run, name, *judged(made, replace(SETTLED, smoother=name))]


def standstill(made: Twin) -> Iterator[list[object]]:
    """What noise of the velocities makes of dry friction: residuals of the truth below 10 Hz."""
    record, true = made.record, made.bench.noise_free
    low_pass, ends = butter(4, 10.0, fs=record.rate, output="sos"), slice(1250, -1250)
    for name in ("irwsm", "bandpass"):
        q, dq, ddq = (
            derivatives(record.q_m, record.rate, "own", "centred")
            if name == "irwsm"
            else bandpass(record)
        )
        low = [
            sosfiltfilt(low_pass, record.tau.T - np.einsum("jps,p->js", phi, made.truth))[:, ends]
            for phi in (observed(q, dq, ddq), observed(q, true.dq, ddq))
        ]
        for j in range(len(low[0])):
            slow = np.abs(true.dq[ends, j]) < SLOW * np.abs(true.dq[:, j]).max()
            noise = 1e3 * np.std((dq - true.dq)[ends, j])
            own = low[0][j, slow], low[0][j, ~slow], low[1][j, slow]
            yield [name, j + 1, f"{noise:.2g}", *(f"{np.std(x):.2g}" for x in own)]


def masks(records: int) -> Iterator[list[object]]:
    """Pivident's recommended form where the encoders count revolutions of the joint, by mask."""
    bench = bench_of("joint")
    for mask in MASKS:
        found = []
        for run in range(records):
            with suppress(PividentError):
                problem = replace(bench.problem(run), mask=mask)
                found.append(identify(problem, bench.scenario.methods["piv"]))
        scores = np.array([np.abs(one.theta - bench.expected) / one.std for one in found])
        error = np.median([np.abs(one.theta / bench.expected - 1) for one in found])
        share = f"{100 * np.mean(scores < 2):.1f} %"
        yield [f"{100 * mask:g} %", share, f"{100 * error:.2g} %", f"{len(found)} of {records}"]


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
    for name in PARTS:
        parser.add_argument(f"--{name}", action="store_true")
    options = parser.parse_args()
    whole = not any(getattr(options, name) for name in PARTS)
    text = PAGE.read_text("utf-8")
    if options.agreement or whole:
        head = ["encoder", "record", "pivident", "second", "largest difference [σ]"]
        rows = printed(agreement(options.records))
        text = with_table(text, "### The same choices", table(head, rows))
    if options.choices or whole:
        head = ["reading", "motor: ends", *COMPARED, "joint: ends", "log: ends"]
        text = with_table(text, "### Other choices", table(head, printed(choices())))
    if options.standstill or whole:
        head = ["smoother", "axis", "noise of the velocity [mrad/s]", *RESIDUALS]
        rows = printed(standstill(twin(bench_of("motor"), 0)))
        text = with_table(text, "### Standstill", table(head, rows))
    if options.masks or whole:
        head = ["slower than, of the rated speed", "covered", "median error", "estimates"]
        text = with_table(text, "### Slow samples", table(head, printed(masks(options.records))))
    if options.smoothers or whole:
        head = ["record", "smoother", "ends", *COMPARED]
        rows = printed(smoothers(options.records))
        text = with_table(text, "### The smoother", table(head, rows))
    table_1 = np.array(
        [row.relative_std["piv"] / row.relative_std["iv"] for row in published_table()]
    )
    print("Table 1:", over(table_1, np.ones_like(table_1)))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
