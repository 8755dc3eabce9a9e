"""Error of a simulation by its horizon: from a tenth of a second to the whole record.

An open loop is cut into runs of one length, each of which begins at the measured state; the error
of a horizon is the root mean square over all samples of all runs, and beside it the smallest and
the largest tenth of the runs. A closed loop has a law with a memory, whose state is known at the
beginning alone: it is simulated from there (`Replay`), and its error at a horizon is that of the
record up to then.

* EMPS, fitted on one record, simulated on the other one (of the same motion). The open loop begins
  at the state that the first 20 samples of a run give, which are not counted, as
  `emps_leaderboard` scores it; the law that it chose, fitted over the record and over moves, beside
  the published values. The closed loop has the known law.
* TX40, examples/staubli_tx40, fitted on the same motion. The log holds neither law nor reference.
  The recorded torques drive it, alone, or with a virtual law of 10 Hz that leads it back to the
  smoothed motion: how near depends on that law, how it goes on with the horizon does not.
* KR300, examples/kuka_kr300, fitted on the same two motions: closed loop of the identified law
  under the recorded reference.

    PIVIDENT_DATA=FOLDER python -m benchmarks.horizon_curve [--figure FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from benchmarks.emps_laws import TWO_SLOPES, Candidate, laws
from benchmarks.emps_leaderboard import CONTROLLER
from benchmarks.open_loop_model import GIVEN, OpenLoopModel, Stretch

from pivident.data.recording.public_records import EMPS, load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.output_error.record_stretches import open_stretches
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import SimulationDiverged
from pivident.judgement.validation.held_out.prediction import Judge
from pivident.judgement.validation.held_out.replay import Replay, motion_of
from pivident.loop.simulation.control_loop import Loop

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

#: Horizons but the last one, which is the record [s].
HORIZONS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)

#: Colour and line of the curves of a panel.
LINES = (("#0b6e99", "o-"), ("#c8553d", "s--"), ("#777777", "^:"), ("#222222", "D-"))

#: Shares of the runs between which the others lie.
TENTHS = (0.1, 0.9)

#: Simulated less measured positions of all runs of one horizon [mm or mrad], (samples, joints)
#: each; a run that diverges has none but infinite ones.
Runs = Sequence[np.ndarray]


class Point(NamedTuple):
    """Error at a horizon [mm or mrad]: of all runs, and of the least and largest tenth of them."""

    horizon: float
    error: float
    low: float
    high: float
    runs: int


@dataclass(frozen=True, eq=False)
class Curve:
    """Error of one simulation by horizon.

    Attributes:
        machine: which one, for the panel of the figure.
        title: which simulation of it.
        unit: of its errors.
        points: by horizon.
    """

    machine: str
    title: str
    unit: str
    points: list[Point]


def edges(samples: int, horizon: int) -> Iterator[Stretch]:
    """Runs of equal length that fill a record, none longer than the horizon."""
    count = -(-samples // horizon)
    ends = np.linspace(0, samples, count + 1).astype(int).tolist()
    return (Stretch(*own) for own in pairwise(ends))


def point(horizon: float, runs: Runs) -> Point:
    """Error of a horizon."""
    squares = [np.mean(own**2) for own in runs]
    whole = np.average(squares, weights=[own.size for own in runs])
    low, high = np.quantile(np.sqrt(squares), TENTHS, method="nearest")
    return Point(horizon, float(np.sqrt(whole)), float(low), float(high), len(runs))


def curve(
    machine: str, title: str, unit: str, seconds: float, runs: Callable[[float], Runs]
) -> Curve:
    """Points of all horizons up to the record's length."""
    horizons = [*(h for h in HORIZONS if h < 0.8 * seconds), seconds]
    made = Curve(machine, title, unit, [point(h, runs(h)) for h in horizons])
    print(f"{machine}, {title}")
    for own in made.points:
        print(
            f"  {own.horizon:6.2f} s: {own.error:9.4g} {unit} ({own.low:.3g} to {own.high:.3g}; "
            f"{own.runs} runs)", flush=True,
        )  # fmt: skip
    return made


def protocol_runs(model: OpenLoopModel, record: Recording, horizon: float) -> Runs:
    """Errors of an open loop whose runs begin at the state that 20 samples give [mm]."""
    runs = edges(record.samples, round(horizon * record.rate))
    return [model.errors(record, own)[GIVEN:, None] for own in runs]


def torque_driven_runs(problem: Problem, found: Identification, horizon: float) -> Runs:
    """Errors of the open loop from smoothed states [mm or mrad]; infinite where it diverges."""
    motions = [Judge(recording).kinematics for recording in problem.recordings]
    runs = []
    for own in open_stretches(problem, found.parameters, found.theta, motions, horizon):
        try:
            q = motion_of(own.loop).q[:: own.step][: own.samples]
            runs.append(1e3 * (q - own.q[: len(q)]))
        except SimulationDiverged:
            runs.append(np.full_like(own.q, np.inf))
    return runs


def replays(problem: Problem, found: Identification) -> Runs:
    """Errors of the closed loop over each recording [mm or mrad]."""
    runs = []
    for recording in problem.recordings:
        motion = Replay(problem, Judge(recording)).simulate(found)
        runs.append(1e3 * (motion.q.T - recording.q))
    return runs


def beginnings(runs: Runs, rate: float) -> Callable[[float], Runs]:
    """By horizon, the runs up to then."""
    return lambda horizon: [own[: round(horizon * rate)] for own in runs]


def emps() -> Iterator[Curve]:
    """The carriage on the record that was not fitted."""
    train, test = load_emps(), load_emps_pulses()
    law, seconds = Candidate("two slopes, Coulomb, offset", TWO_SLOPES), test.samples / test.rate
    models = {
        f"open loop, {how}": law.model_of(law.fitted(train, horizon))
        for how, horizon in (("fitted over the record", "record"), ("fitted over moves", "moves"))
    } | {"open loop, published values": laws()[0].model()}
    for title, model in models.items():
        yield curve("EMPS", title, "mm", seconds, partial(protocol_runs, model, test))
    loop = Loop(CONTROLLER, drive_gain=float(EMPS["units"]["tau"]["gain"]), limit=10.0)
    problem = Problem(law.model().robot, (train,), loop)
    found = identify(problem, "piv")
    unseen = Problem(law.model().robot, (test,), loop)
    runs = beginnings(replays(unseen, found), test.rate)
    yield curve("EMPS", "closed loop, PIV", "mm", seconds, runs)


def tx40() -> Iterator[Curve]:
    """The arm on the motion that it was fitted on, its recorded torques alone and led back."""
    experiment = load_experiment(EXAMPLES / "staubli_tx40" / "experiment.toml")
    problem, method = experiment.problem(), experiment.methods()["piv"]
    found, (recording,) = identify(problem, method), problem.recordings
    seconds = recording.samples / recording.rate
    driven = partial(torque_driven_runs, problem, found)
    yield curve("TX40", "recorded torques", "mrad", seconds, driven)
    led = replace(recording, inputs={"recorded_torque": recording.tau})
    runs = replays(replace(problem, recordings=(led,)), found)
    yield curve(
        "TX40", "the same, led back", "mrad", seconds, beginnings(runs, recording.rate)
    )  # fmt: skip


def kr300() -> Iterator[Curve]:
    """Axes 1 to 3 on the two motions that they were fitted on."""
    experiment = load_experiment(EXAMPLES / "kuka_kr300" / "experiment.toml")
    problem = experiment.problem()
    runs = replays(problem, identify(problem, experiment.methods()["piv"]))
    rate = problem.recordings[0].rate
    yield curve("KR300", "closed loop", "mrad", len(runs[0]) / rate, beginnings(runs, rate))


def drawn(curves: Sequence[Curve], file: Path) -> None:
    """The figure: a panel for each unit."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.9), layout="constrained")
    FigureCanvasAgg(figure)
    units = list(dict.fromkeys(own.unit for own in curves))
    for axes, unit in zip(figure.subplots(1, len(units), squeeze=False)[0], units, strict=True):
        shown = [own for own in curves if own.unit == unit]
        for own, (colour, line) in zip(shown, LINES, strict=False):
            horizons, errors, low, high, _ = zip(*own.points, strict=True)
            name = own.title if unit == "mm" else f"{own.machine}, {own.title}"
            axes.loglog(horizons, errors, line, color=colour, markersize=4, label=name)
            axes.fill_between(horizons, low, high, color=colour, alpha=0.12, linewidth=0)
        axes.set_xlabel("horizon [s]")
        axes.set_ylabel(f"simulated less measured position, rms [{unit}]")
        axes.set_title("EMPS, record not fitted" if unit == "mm" else "arms, record fitted")
        axes.grid(True, color="#e6e6e6", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(file, dpi=110)


def main(figure: Path | None) -> None:
    """Print all curves, and draw them."""
    curves = [own for machine in (emps, tx40, kr300) for own in machine()]
    if figure is not None:
        drawn(curves, figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Error of a simulation by its horizon.")
    parser.add_argument("--figure", type=Path, help="file to draw the curves to")
    main(**vars(parser.parse_args()))
