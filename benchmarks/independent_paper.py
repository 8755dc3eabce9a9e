"""Two implementations of IDIM-PIV as printed, and what its open choices change, on the twin.

    PYTHONPATH=. python benchmarks/independent_paper.py [--agreement] [--choices] [--smoothers]
        [--standstill] [--masks] [--figure]

The second implementation (`tests/independent`) was written from the paper's text alone. Part one
gives both the same records and choices. Part two takes the text as literally as it goes, and then
one choice after the other in another way; no choice looks at the truth, which only says
afterwards how often intervals were right. Part three smooths ten records in two ways, part four
says what is left of friction then and draws it, and part five leaves out slow samples where
encoders count revolutions of the joint. The tables are part of the page of the paper. About twenty
minutes of a core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, freqz, sosfiltfilt, welch
from tests.independent.arm import observed
from tests.independent.identification import (
    Estimate,
    Prefiltered,
    instrumental_variables,
    prefiltered,
)
from tests.independent.reading import Reading
from tests.independent.twin import AS_PIVIDENT, Twin, bench_of, twin

from pivident.estimation.identify import identify
from pivident.foundation.errors import PividentError
from pivident.studies.figures.paper_style import line_style, new_figure, paper_style
from pivident.studies.paper.markdown import table
from pivident.studies.paper.published import published_table

PAGE = Path("src/pivident/studies/paper/templates/independent.md")
FIGURE = PAGE.with_name("standstill.png")
ENCODERS = ("motor", "joint", "log")
COMPARED = ("over IDIM-IV", "over IDIM-IV, axes weighted", "covered")
RESIDUALS = (
    "residual below 10 Hz, slow [N m]",
    "else [N m]",
    "slow, with the true velocity [N m]",
)
SLOW = 0.05  # share of an axis's largest speed below which it is called slow
PARTS = ("agreement", "choices", "smoothers", "standstill", "masks", "figure")
STRETCH = 880  # samples of the stretches that spectra are averaged over
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
    ("… … auxiliary model from the measured start", replace(SETTLED, begins="measured")),
    ("… … its accelerations at the instants", replace(SETTLED, accelerations="instant")),
    ("… … negative friction simulated as none", replace(SETTLED, dissipative=True)),
    ("… … … and half the way back", replace(SETTLED, dissipative=True, halvings=8)),
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


SMOOTHERS = {name: replace(SETTLED, smoother=name) for name in ("irwsm", "bandpass")}


def slow_samples(made: Twin) -> np.ndarray:
    """Whether an axis is slow by its true speed, shape (samples, joints)."""
    speed = np.abs(made.bench.noise_free.dq)
    return speed < SLOW * speed.max(axis=0)


def standstill(made: Twin) -> Iterator[list[object]]:
    """What noise of the velocities makes of dry friction: residuals of the truth below 10 Hz."""
    record, true, slow = made.record, made.bench.noise_free, slow_samples(made)
    low_pass, ends = butter(4, 10.0, fs=record.rate, output="sos"), slice(1250, -1250)
    for name, reading in SMOOTHERS.items():
        method = Prefiltered(record, replace(reading, slopes="centred"))
        q, dq, ddq = method.measured
        low = [
            sosfiltfilt(low_pass, method.tau - np.einsum("jps,p->js", phi, made.truth))[:, ends]
            for phi in (method.phi, observed(q, true.dq, ddq))
        ]
        for j in range(len(low[0])):
            still = slow[ends, j]
            noise = 1e3 * np.std((dq - true.dq)[ends, j])
            own = low[0][j, still], low[0][j, ~still], low[1][j, still]
            yield [name, j + 1, f"{noise:.2g}", *(f"{np.std(x):.2g}" for x in own)]


def drawn(made: Twin, j: int = 0) -> None:
    """Residuals of the true parameters on one axis in time, and their spectra.

    Left: the speed, and below it the residual with either smoother. Right, a panel for each
    smoother: spectra of the slow samples and of the others, and that of the noise model.
    """
    rate, ends = made.record.rate, slice(1250, -1250)
    true, slow = made.bench.noise_free.dq[ends, j], slow_samples(made)[ends, j]
    t, low_pass = 0.25 + np.arange(len(slow)) / rate, butter(4, 10.0, fs=rate, output="sos")
    with paper_style():
        figure, (speed, first, residual, second) = new_figure(2, 2, columns=2, row_height=2.2)
        speed.plot(t, true, **line_style(0))
        speed.set(ylabel=f"speed of axis {j + 1} [rad/s]")
        residual.set(xlabel="time [s]", ylabel="residual below 10 Hz [N m]")
        second.set(xlabel="frequency [Hz]")
        for name, axes, colour in (("irwsm", first, 3), ("bandpass", second, 1)):
            method = Prefiltered(made.record, SMOOTHERS[name])
            error = method.tau[j] - np.einsum("ps,p->s", method.phi[j], made.truth)
            low = sosfiltfilt(low_pass, error)[ends]
            residual.plot(t[::20], low[::20], label=name, **line_style(colour))
            for label, chosen, style in (("slow", slow, 3), ("not slow", ~slow, 1)):
                axes.loglog(*spectrum(error[ends], chosen, rate), label=label, **line_style(style))
            method.identify_noise(made.truth, np.ones((len(method.tau), 1)))
            f = np.geomspace(rate / STRETCH, rate / 2, 400)
            law = freqz(*method.inverse(j)[::-1], worN=f, fs=rate)[1]
            white = freqz(method.noise[j].a, worN=f, fs=rate)[1]
            level = 2 * method.noise[j].variance / rate * np.abs(law / white) ** 2
            axes.loglog(f, level, label="noise model, for all samples", **line_style(0))
            axes.set(title=name, ylabel="residual [(N m)²/Hz]", ylim=(1e-7, 1))
            axes.legend(loc="lower right")
        for axes in (speed, residual):
            axes.fill_between(t, 0, 1, slow, transform=axes.get_xaxis_transform(), color="#e6e6e6")
        residual.legend()
        figure.savefig(FIGURE, dpi=150)


def spectrum(x: np.ndarray, chosen: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and mean power spectral density of the stretches of chosen samples."""
    edges = np.flatnonzero(np.diff(np.r_[False, chosen, False])).reshape(-1, 2)
    long = [x[a:b] for a, b in edges if b - a >= STRETCH]
    found = [welch(own, rate, nperseg=STRETCH, detrend=False) for own in long]
    density = np.average([d for _, d in found], axis=0, weights=[len(own) for own in long])
    return found[0][0][1:], density[1:]


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
    asked = {name for name in PARTS if getattr(options, name)} or set(PARTS)
    records, tables = options.records, {}
    if "agreement" in asked:
        head = ["encoder", "record", "pivident", "second", "largest difference [σ]"]
        tables["### The same choices"] = table(head, printed(agreement(records)))
    if "choices" in asked:
        head = ["reading", "motor: ends", *COMPARED, "joint: ends", "log: ends"]
        tables["### Other choices"] = table(head, printed(choices()))
    if "standstill" in asked:
        head = ["smoother", "axis", "noise of the velocity [mrad/s]", *RESIDUALS]
        rows = printed(standstill(twin(bench_of("motor"), 0)))
        tables["### Standstill"] = table(head, rows)
    if "figure" in asked:
        drawn(twin(bench_of("motor"), 0))
    if "masks" in asked:
        head = ["slower than, of the rated speed", "covered", "median error", "estimates"]
        tables["### Slow samples"] = table(head, printed(masks(records)))
    if "smoothers" in asked:
        head = ["record", "smoother", "ends", *COMPARED]
        tables["### The smoother"] = table(head, printed(smoothers(records)))
    text = PAGE.read_text("utf-8")
    for heading, part in tables.items():
        text = with_table(text, heading, part)
    PAGE.write_text(text, encoding="utf-8")
    table_1 = np.array(
        [row.relative_std["piv"] / row.relative_std["iv"] for row in published_table()]
    )
    print("Table 1:", over(table_1, np.ones_like(table_1)))


if __name__ == "__main__":
    main()
