"""The public record of a Stäubli TX40 through the same forms: what of the pattern a real arm shows.

The record is not that of the paper: another motion, encoders as fine as they are, no reference. Its
truth is unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources

import numpy as np

from pivident.errors import DatasetUnavailable, PividentError
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.experiment.experiment import load_experiment
from pivident.paper.experiment import FORMS
from pivident.recording.datasets import dataset_files
from pivident.validation.residuals.autocorrelation import correlated_shares

#: Name of the record.
DATASET = "staubli_tx40"


@dataclass(frozen=True, eq=False)
class PublicRecord:
    """What the forms made of the record."""

    results: Mapping[str, Identification]  # by form
    failures: Mapping[str, str]  # message of the forms that gave no estimate

    def correlated(self, form: str) -> float:
        """Share of the autocorrelations of all joints beyond ±2/√n."""
        return float(np.mean(correlated_shares(self.results[form])))


def run_public_record(say: Callable[[str], None] = lambda line: None) -> PublicRecord | None:
    """Estimate with all forms on the public record.

    Args:
        say: progress.

    Returns:
        The results, or None where the record is not on this machine.
    """
    try:
        dataset_files(DATASET)
    except DatasetUnavailable:
        return None
    with resources.as_file(resources.files(__package__) / "public_record.toml") as path:
        experiment = load_experiment(path)
        problem = experiment.problem()
    results: dict[str, Identification] = {}
    failures: dict[str, str] = {}
    for name, method in experiment.methods().items():
        say(f"public record: {name}")
        try:
            results[FORMS[name]] = identify(problem, method)
        except PividentError as error:
            failures[FORMS[name]] = str(error)
    return PublicRecord(results, failures)
