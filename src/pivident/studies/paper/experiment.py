"""One experiment of the paper, on its twin and on the public record of a real arm.

The scenario ``paper`` has three readings of "3600 points per revolution"; each is one condition.

The public record of a Stäubli TX40 through the same forms: what of the pattern a real arm shows.

The record is not that of the paper: another motion, encoders as fine as they are, no reference. Its
truth is unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib import resources

import numpy as np

from pivident.data.recording.datasets import dataset_files
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import DatasetUnavailable, PividentError
from pivident.foundation.text.display import Displayed
from pivident.judgement.validation.residuals.autocorrelation import correlated_shares
from pivident.linear.free_law import FreeLaw
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import Scenario, load_scenario
from pivident.studies.prediction.predict import predict
from pivident.studies.prediction.prediction import Prediction

#: Readings of the resolution of the encoders, and what each means.
READINGS = {
    "joint": "per revolution of the joint, and the control law reads them",
    "motor": "per revolution of the motor, and the control law reads them",
    "log": "per revolution of the joint, on the record only",
}
#: Forms of the estimate by the name of the method; with ``IDENTIFIED`` behind it, the control law
#: was identified from the record.
FORMS = {
    "ls": "IDIM-LS",
    "iv": "IDIM-IV",
    "piv-as-printed": "IDIM-PIV as printed",
    "piv": "IDIM-PIV as recommended",
    "didim": "DIDIM",
    "oloe": "OLOE",
}
IDENTIFIED = ", law identified"
#: Number of the record that validates: another motion than the first one.
VALIDATION = 1
#: Name of the record.
DATASET = "staubli_tx40"


@dataclass(frozen=True, eq=False)
class Reading(Displayed):
    """One experiment: its bench, and what every form of the estimate made of its first record.

    Attributes:
        name: key of ``READINGS``.
        bench: truth, loop, motions and noise.
        recording: what was estimated from.
        validation: another motion of the same loop.
        results: estimates by form.
        failures: message of the forms that gave no estimate.
        law: the identified control law, where one was asked for.
    """

    name: str
    bench: Bench
    recording: Recording
    validation: Recording
    results: Mapping[str, Identification]
    failures: Mapping[str, str]
    law: FreeLaw | None = None

    @cached_property
    def predictions(self) -> dict[str, Prediction]:
        """Torques of the validation by each form."""
        return {form: predict(found, self.validation) for form, found in self.results.items()}

    @cached_property
    def smoothed_as_printed(self) -> np.ndarray:
        """Half-power frequencies that the smoother of the paper finds, shape (joints,) [Hz]."""
        return estimate_kinematics(self.recording, METHODS["piv-as-printed"].signals).f50


def condition_numbers(bench: Bench) -> list[float]:
    """Condition number of the observation matrix along the reference of each motion.

    Columns are as they are, in SI units, at one row in each decimation of the band-pass.
    """
    numbers = []
    content = bench.scenario.content
    recipe = bench.scenario.methods["ls"].signals
    assert isinstance(recipe, Bandpass)
    step = int(np.prod(recipe.factor(content.record.rate)))
    for motion in range(len(content.trajectory.seeds)):
        q, dq, ddq = (x[::step] for x in bench.reference_of_record(motion))
        phi = bench.regressor.matrix(q, dq, ddq)
        numbers.append(float(np.linalg.cond(phi.reshape(-1, phi.shape[-1]))))
    return numbers


def condition(reading: str, way: str = "known") -> Scenario:
    """A condition of the scenario ``paper``: law known, simulated by the method, or identified."""
    (found,) = _loaded("paper").chosen_conditions([f"{reading}-{way}"])
    return found


_loaded = cache(load_scenario)  # which checks all conditions


def run_reading(
    reading: str,
    *,
    simulated: bool = True,
    identified: bool = True,
    say: Callable[[str], None] = lambda line: None,
) -> Reading:
    """Simulate one experiment and estimate with every form.

    Args:
        reading: key of ``READINGS``.
        simulated: whether DIDIM and OLOE are among the forms, which fit a simulation.
        identified: whether the forms with an identified control law are.
        say: progress.

    Returns:
        The experiment; forms that gave no estimate are in its failures.

    Raises:
        ExperimentError: there is no such reading.
    """
    scenario = condition(reading)
    bench = Bench(scenario)
    problem = bench.problem(0)
    results: dict[str, Identification] = {}
    failures: dict[str, str] = {}

    def attempt(form: str, method: Method, own=problem) -> None:
        say(f"{reading}: {form}")
        try:
            results[form] = identify(own, method)
        except PividentError as error:
            failures[form] = str(error)

    methods = dict(scenario.methods)
    if simulated:
        methods |= condition(reading, "simulated").methods
    for name, method in methods.items():
        attempt(FORMS[name], method)
    law = None
    if identified:
        say(f"{reading}: control law")
        law = bench.identified_law(problem.recordings[0])
        loop = replace(bench.loop, controller=law.law)
        for name in ("iv", "piv-as-printed", "piv"):
            attempt(FORMS[name] + IDENTIFIED, scenario.methods[name], replace(problem, loop=loop))
    return Reading(
        reading,
        bench,
        problem.recordings[0],
        bench.recording(VALIDATION),
        results,
        failures,
        law,
    )


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
