"""Identify a simulated TX40, where the truth is known.

Simulates one record of the closed loop, writes it to record.npz as a user's log would come, and
reads it back through experiment.toml. Least squares, the decimated IV and both full-rate methods
are then judged by what a real record never tells: their error, and how many of the true values
lie within two reported standard deviations.

    python identify_simulated_tx40.py [--folder FOLDER] [--seed SEED]
"""

import argparse
from pathlib import Path

import numpy as np

from pivident import Identification, identify, load_experiment, write_report
from pivident.experiment.simulated_tx40 import tx40_fine

HERE = Path(__file__).parent


def write_record(path: Path, seed: int) -> dict[str, float]:
    """Simulate a record, write it to a file, and return the true parameters."""
    problem, truth = tx40_fine(seed)
    recording = problem.recordings[0]
    np.savez(path, q=recording.q, tau=recording.tau, q_ref=recording.q_ref, dq_ref=recording.dq_ref)
    return truth


def judgement(result: Identification, truth: dict[str, float]) -> tuple[float, float]:
    """Median relative error [%], and share of the truth within ±2σ [%]."""
    true = np.array([truth[p.name] for p in result.parameters])
    error = result.theta - true
    median = 100 * np.median(np.abs(error / true))
    coverage = 100 * np.mean(np.abs(error) <= 2 * result.std)
    return float(median), float(coverage)


def main(folder: Path = HERE, seed: int = 0) -> dict[str, Identification]:
    """Run the example.

    Args:
        folder: where experiment.toml is, and where record.npz and report.html are written.
        seed: of the simulated noise.

    Returns:
        Results by the method's short name.
    """
    truth = write_record(folder / "record.npz", seed)
    experiment = load_experiment(folder / "experiment.toml")
    problem = experiment.problem()
    results = {}
    print(f"{'method':22s} {'iterations':>10s} {'median error':>13s} {'within 2σ':>10s}")
    for name, method in experiment.methods().items():
        result = results[name] = identify(problem, method)
        median, coverage = judgement(result, truth)
        print(f"{result.method:22s} {result.iterations:10d} {median:11.3f} % {coverage:8.0f} %")
    report = folder / "report.html"
    write_report(list(results.values()), report, truth=truth, title=experiment.title)
    print(f"report: {report}")
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=HERE)
    parser.add_argument("--seed", type=int, default=0)
    main(**vars(parser.parse_args()))
