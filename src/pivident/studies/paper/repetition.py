"""The experiment repeated: what the rows of the study ``paper`` say about each form.

Motions take turns, so runs of one motion belong together; intervals go by the means of motions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from pivident.foundation.distributions import student
from pivident.foundation.text.display import Displayed
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.run import Store
from pivident.studies.many.study.summary import (
    Interval,
    clustered_interval,
    geometric_mean,
    record_means,
    wilson_interval,
)
from pivident.studies.paper.experiment import FORMS, IDENTIFIED, READINGS, condition

#: Ways of the scenario, and what stands behind the name of the form.
WAYS = {"known": "", "simulated": "", "identified": IDENTIFIED}


@dataclass(frozen=True, eq=False)
class Runs(Displayed):
    """All runs of one form: arrays over the runs that gave an estimate.

    Attributes:
        names: parameters.
        truth: their true values, shape (parameters,).
        runs: numbers of the runs, shape (runs,).
        motions: which motion each moved along, shape (runs,).
        theta: estimates, shape (runs, parameters).
        std: reported standard errors, likewise.
        converged: whether the iteration converged, shape (runs,).
        iterations: how many there were, shape (runs,).
        correlated: share of autocorrelations beyond ±2/√n, shape (runs, joints).
        orders: of the noise models, shape (runs, joints).
        failed: number of runs without an estimate.
        message: of the first of them.
    """

    names: tuple[str, ...]
    truth: np.ndarray
    runs: np.ndarray
    motions: np.ndarray
    theta: np.ndarray
    std: np.ndarray
    converged: np.ndarray
    iterations: np.ndarray
    correlated: np.ndarray
    orders: np.ndarray
    failed: int
    message: str

    @property
    def count(self) -> int:
        """Number of runs, those without an estimate among them."""
        return len(self.theta) + self.failed

    @cached_property
    def covered(self) -> np.ndarray:
        """Whether the truth lies within two standard errors, (runs, parameters)."""
        return np.abs(self.theta - self.truth) < 2.0 * self.std

    @property
    def coverage(self) -> float:
        """Share of the parameters of all runs that are covered."""
        return float(self.covered.mean()) if self.covered.size else math.nan

    @property
    def coverage_interval(self) -> Interval:
        """95 % interval of the coverage, motions as clusters."""
        return clustered_interval(self.covered.mean(axis=1), self.motions)

    @property
    def median_error(self) -> float:
        """Median of |θ̂/θ - 1| over runs and parameters."""
        return float(np.median(np.abs(self.theta / self.truth - 1.0))) if self.count else math.nan

    @property
    def converged_share(self) -> float:
        """Share of all runs whose iteration converged."""
        return float(self.converged.sum()) / self.count if self.count else math.nan

    @property
    def converged_interval(self) -> Interval:
        """95 % interval of that share."""
        return wilson_interval(self.converged_share, self.count)

    @property
    def relative_std(self) -> np.ndarray:
        """Median over the runs of σ/|θ̂|, shape (parameters,)."""
        return np.median(self.std / np.abs(self.theta), axis=0)

    def relative_bias(self, name: str) -> tuple[float, float]:
        """Mean of θ̂/θ - 1 of a parameter, and half its 95 % interval.

        Args:
            name: of the parameter.
        """
        k = self.names.index(name)
        means = record_means(self.theta[:, k] / self.truth[k] - 1.0, self.motions)
        return float(means.mean()), half_interval(means)


@dataclass(frozen=True, eq=False)
class Repetition(Displayed):
    """All forms of all readings.

    Attributes:
        readings: runs by reading and form: ``readings[reading][form]``.
    """

    readings: Mapping[str, Mapping[str, Runs]]

    @property
    def runs(self) -> int:
        """Largest number of runs of a form."""
        return max(own.count for forms in self.readings.values() for own in forms.values())

    @property
    def motions(self) -> int:
        """Largest number of motions of a form."""
        everyone = [own for forms in self.readings.values() for own in forms.values()]
        return max(np.unique(own.motions).size for own in everyone)


def read_repetition(folder: Path) -> Repetition:
    """The repetition from the folder of the study ``paper``.

    Args:
        folder: results folder of the study; conditions that are not there are left out.

    Returns:
        What is there.

    Raises:
        StudyFolderError: a shard cannot be read.
    """
    readings: dict[str, dict[str, Runs]] = {}
    for reading in READINGS:
        forms: dict[str, Runs] = {}
        for way, behind in WAYS.items():
            place = folder / f"{reading}-{way}"
            if place.is_dir():
                forms |= _forms(place, reading, way, behind)
        if forms:
            readings[reading] = forms
    return Repetition(readings)


def ratio_of_deviations(new: Runs, old: Runs) -> tuple[np.ndarray, float]:
    """Relative standard errors of one form over those of another, and their geometric mean.

    Medians over the runs that both have, shape (parameters,).
    """
    both = np.intersect1d(new.runs, old.runs)
    mine, theirs = np.isin(new.runs, both), np.isin(old.runs, both)
    ratios = np.median(new.std[mine] / np.abs(new.theta[mine]), axis=0) / np.median(
        old.std[theirs] / np.abs(old.theta[theirs]), axis=0
    )
    return ratios, geometric_mean(ratios)


def half_interval(means: np.ndarray) -> float:
    """Half the 95 % interval of a mean by Student's t; NaN of fewer than two."""
    if means.size < 2:
        return math.nan
    spread = float(means.std(ddof=1)) / math.sqrt(means.size)
    return float(student.ppf(0.975, means.size - 1)) * spread


def _forms(folder: Path, reading: str, way: str, behind: str) -> dict[str, Runs]:
    """Runs of one condition by the name of the form."""
    scenario = condition(reading, way)
    bench = Bench(scenario)
    rows = Store(folder).rows()
    turns = len(scenario.content.trajectory.seeds)
    forms = {}
    for method in scenario.methods:
        own = rows.filter(rows["method"] == method)
        good, bad = own.filter(own["error"].is_null()), own.filter(own["error"].is_not_null())

        def stacked(key: str, width: int, good=good) -> np.ndarray:
            return np.array(good[key].to_list(), dtype=float).reshape(-1, width)

        if not own.is_empty():
            size, joints = len(bench.estimated), scenario.robot.size
            forms[FORMS[method] + behind] = Runs(
                names=bench.estimated,
                truth=bench.expected,
                runs=good["run"].to_numpy(),
                motions=good["record"].to_numpy() % turns,
                theta=stacked("theta", size),
                std=stacked("std", size),
                converged=good["converged"].to_numpy().astype(bool),
                iterations=good["iterations"].to_numpy(),
                correlated=stacked("correlated", joints),
                orders=stacked("noise_order", joints),
                failed=len(bad),
                message="" if bad.is_empty() else bad["message"][0],
            )
    return forms
