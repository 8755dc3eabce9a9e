"""Drive gains of a TX40 in amperes by Monte Carlo: estimators, intervals, ratios.

    python benchmarks/drive_gains.py [--runs 52] [--noise white coloured] [--first 300]

The scenario is that of `tests.payload_scenario`: 7 s at 2 kHz without and 7 s with
2 kg on the flange, all 61 base parameters unknown, encoder noise in the loop, 10 mA of noise on the
currents. ``coloured`` noise has the same deviation and an AR(1) pole at 0.95 (16 Hz). For each
estimator: bias, empirical and predicted standard deviation of each gain relative to the truth [%],
coverage of the ±2σ intervals [%], and the largest error of any gain in any run [%].
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from tests.payload_scenario import AmpereRecords, tx40_in_amperes

from pivident.estimation.drives.drive_gains import identify_drive_gains
from pivident.estimation.drives.known_payload import Payload

NOISE = {"white": {}, "coloured": {"correlation": 0.95}}


def estimates(made: AmpereRecords) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Gains over the truth and their deviations, by estimator."""
    found = identify_drive_gains(made.problem, made.payload, [made.loaded])
    answers = {"IV": (found.kappa, found.std), **found.literature}
    squares = identify_drive_gains(replace(made.problem, loop=None), made.payload, [made.loaded])
    answers["LS of commands"] = (squares.kappa, squares.std)
    mass = identify_drive_gains(made.problem, Payload(made.payload.mass), [made.loaded])
    answers["IV, only the mass known"] = (mass.kappa, mass.std)
    alone = identify_drive_gains(made.problem)
    pairs = [alone.ratio(m, 1) for m in range(len(made.gains))]
    true = made.gains / made.gains[1]
    relative = {name: (g / made.gains, s / made.gains) for name, (g, s) in answers.items()}
    values = np.array([v for v, _ in pairs]) / true
    return relative | {
        "ratios to joint 2, no payload": (values, np.array([s for _, s in pairs]) / true)
    }


def table(name: str, values: np.ndarray, std: np.ndarray) -> None:
    """Bias, deviations, coverage and the largest error of one estimator."""
    error = values - 1.0
    judged = std.max(axis=0) > 0  # the reference of a ratio is 1 without doubt
    inside = np.abs(error) < 2.0 * std
    lines = {
        "bias": error.mean(axis=0),
        "empirical σ": error.std(axis=0, ddof=1),
        "predicted σ": np.sqrt(np.mean(std**2, axis=0)),
        "covered": inside.mean(axis=0),
    }
    print(
        f"\n{name}: coverage {100 * inside[:, judged].mean():.1f} %, largest error "
        f"{100 * np.abs(error).max():.2f} %"
    )
    for label, row in lines.items():
        print(f"  {label:12}" + "".join(f"{100 * v:9.3f}" for v in row))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=52)
    parser.add_argument("--first", type=int, default=300)
    parser.add_argument("--noise", nargs="+", choices=NOISE, default=list(NOISE))
    options = parser.parse_args()
    for noise in options.noise:
        runs = [
            estimates(tx40_in_amperes(seed, **NOISE[noise]))
            for seed in range(options.first, options.first + options.runs)
        ]
        print(f"\n== {noise} noise of the currents, {options.runs} runs [%] ==")
        for name in runs[0]:
            values, std = (np.array([run[name][k] for run in runs]) for k in range(2))
            table(name, values, std)


if __name__ == "__main__":
    main()
