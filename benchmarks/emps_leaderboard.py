"""The EMPS benchmark to the letter: open loop, chosen on the training record, scored once.

Estimate on DATA_EMPS.mat, simulate the drive input of DATA_EMPS_PULSES.mat in *open loop*, let the
first 20 samples of its position set the initial state, and score

    1000 · RMSE(qm[20:])  in mm

(Janot, Gautier, Brunot, Nonlinear System Identification Benchmarks 2019; the submission script of
github.com/GerbenBeintema/nonlinear_benchmarks). Friction law, length of the stretches that are
fitted and further terms are chosen on the training record alone: its reference has four periods,
each is left out once and simulated in open loop with the estimate of the others. The test record
is read after that.

    PIVIDENT_DATA=FOLDER python -m benchmarks.emps_leaderboard
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from time import perf_counter, process_time

import numpy as np
from benchmarks.open_loop_fit import (
    OpenLoopFit,
    OpenLoopModel,
    Stretch,
    fit_in_two_steps,
    fit_open_loop,
    rms,
)

from pivident.recording.public_records import EMPS, load_emps, load_emps_pulses
from pivident.recording.recording import Recording
from pivident.robot.friction import (
    FrictionLaw,
    FrictionTerm,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    dahl,
    lugre,
    offset,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot

#: Samples of a period of the reference.
PERIOD = 6240

#: Stretches per period that are fitted, each from its own first samples; 0: the record as a whole.
LENGTHS = (0, 1, 2, 4)

#: Slope of the sign [s/m]: at 99 % of the Coulomb level a carriage at rest creeps 0.06 mm/s.
STEEP = 1e6

#: Slope of the sign in the examples [s/m].
GENTLE = 2000.0

#: Lead of the screw, and a wave as long as the motion [m].
LEAD, STROKE = 2.5e-3, 0.25

#: Periods, of the four, in which a further term has to be better.
MOST_PERIODS = 3

#: Simulations of a law whose tangents are central differences, once its start is an estimate.
FEW = 6

#: The authors' least-squares values (kg, N s/m, N, N), and starts of what is beside them.
PUBLISHED = {"m1": 95.1089, "fv1": 203.5034, "fc1": 20.3935, "off1": -3.1648}
START = PUBLISHED | {
    "fvp1": 203.5, "fvn1": 203.5, "fcp1": 17.23, "fcn1": 23.56, "fs1": 2.0,
    "stribeck_speed": 0.015, "stribeck_excess": 0.1, "presliding_distance": 5e-6,
}  # fmt: skip


@dataclass(frozen=True)
class Candidate:
    """A friction law with its drive.

    Attributes:
        title: for the tables.
        terms: of the law.
        constants: of the law or the drive that are sought beside the parameters.
        fixed: values that are not sought.
        slow: whether its tangents are central differences.
    """

    title: str
    terms: tuple[FrictionTerm, ...]
    constants: tuple[str, ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    slow: bool = False

    def model(self, start: dict[str, float] | None = None) -> OpenLoopModel:
        """Where its search starts: at the published values, or at those of a simpler law."""
        robot = load_robot("emps").with_friction(FrictionLaw(self.terms))
        names = ("m1", *(f"{term.stem}1" for term in self.terms), *self.constants)
        values = START | (start or {}) | dict(self.fixed)
        if "delay" in self.constants:
            values.setdefault("delay", 0.0)
        values |= {name: 0.0 for name in names if name not in values}
        return OpenLoopModel(robot, float(EMPS["units"]["tau"]["gain"]), values, names)


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate on the training record.

    Attributes:
        candidate: what was tried.
        length: stretches per period, see ``LENGTHS``.
        periods: error of each period that was left out [mm].
    """

    candidate: Candidate
    length: int
    periods: np.ndarray

    @property
    def held_out(self) -> float:
        """Root mean square over the periods [mm]."""
        return rms(self.periods)


SIGN = coulomb(gamma=STEEP)
BY_DIRECTION = (*asymmetric_viscous(), *asymmetric_coulomb(gamma=STEEP))
EXCESS = stribeck(START["stribeck_speed"], gamma=STEEP)


def laws() -> list[Candidate]:
    """Friction laws of the speed, simplest first."""
    return [
        Candidate("viscous, Coulomb, offset", (viscous(), SIGN, offset())),
        Candidate("slopes and levels by direction", BY_DIRECTION),
        Candidate("slopes and levels by direction, Stribeck", (*BY_DIRECTION, EXCESS),
                  ("stribeck_speed",)),
    ]  # fmt: skip


def extensions(chosen: Candidate) -> list[Candidate]:
    """What may be added to a law, one at a time."""

    def more(title: str, *terms: FrictionTerm) -> Candidate:
        return replace(chosen, title=f"+ {title}", terms=(*chosen.terms, *terms), slow=True)

    bare = (*asymmetric_viscous(), offset())
    gentle = tuple(replace(t, gamma=GENTLE) if t.has_sign else t for t in chosen.terms)
    return [
        replace(chosen, title="+ delay of the drive", constants=(*chosen.constants, "delay")),
        replace(chosen, title="+ lag of the drive, 0.3 ms", fixed=(("lag", 3e-4),)),
        replace(chosen, title="+ lag of the drive, 1 ms", fixed=(("lag", 1e-3),)),
        replace(chosen, title="slope of the sign 2000 s/m", terms=gentle),
        more("ripple of the screw, 2.5 mm", *ripple(2.0 * np.pi / LEAD, "a")),
        more("wave of the position, 250 mm", *ripple(2.0 * np.pi / STROKE, "b")),
        more("spring", spring()),
        Candidate("Dahl in place of Coulomb", (*bare, dahl(START["presliding_distance"])),
                  ("presliding_distance",), slow=True),
        Candidate("LuGre in place of Coulomb and Stribeck",
                  (*bare, *lugre(START["presliding_distance"], START["stribeck_excess"],
                                 START["stribeck_speed"], damped=False)),
                  ("presliding_distance", "stribeck_excess"), slow=True),
    ]  # fmt: skip


def periods_of(record: Recording) -> list[Stretch]:
    """Periods of the reference; the last one is shorter."""
    samples = len(record.q)
    return [Stretch(k, min(k + PERIOD, samples)) for k in range(0, samples - PERIOD // 2, PERIOD)]


def stretches_of(periods: Sequence[Stretch], length: int) -> list[Stretch]:
    """What is fitted of some periods: parts of each, or what is connected as a whole."""
    if length:
        return [
            Stretch(a, b)
            for own in periods
            for a, b in pairwise(np.linspace(own.start, own.stop, length + 1).astype(int).tolist())
        ]
    joined = [periods[0]]
    for own in periods[1:]:
        if own.start == joined[-1].stop:
            joined[-1] = Stretch(joined[-1].start, own.stop)
        else:
            joined.append(own)
    return joined


def fitted(
    candidate: Candidate,
    train: Recording,
    periods: Sequence[Stretch],
    length: int,
    start: dict[str, float] | None = None,
) -> OpenLoopFit:
    """Estimate from some periods of the training record."""
    stretches, model = stretches_of(periods, length), candidate.model(start)
    if candidate.slow:
        return fit_open_loop(model, train, stretches, FEW)
    if length:
        return fit_in_two_steps(model, train, stretches)
    return fit_open_loop(model, train, stretches, windows=periods)


def tried(
    candidate: Candidate, train: Recording, length: int, start: dict[str, float] | None = None
) -> Trial:
    """Leave each period out once, and simulate it with the estimate of the others."""
    periods = periods_of(train)
    errors = []
    for own in periods:
        rest = [other for other in periods if other is not own]
        errors.append(fitted(candidate, train, rest, length, start).model.score(train, own))
    return Trial(candidate, length, np.array(errors))


def estimate_of(trial: Trial, train: Recording) -> dict[str, float]:
    """Values from the whole training record, with the levels of a law without directions."""
    found = fitted(trial.candidate, train, periods_of(train), trial.length).model.values
    forwards, backwards = found["fcp1"], found["fcn1"]
    levels = {"fc1": 0.5 * (forwards + backwards), "off1": 0.5 * (forwards - backwards)}
    return found | levels


def better(trial: Trial, than: Trial) -> bool:
    """Whether a further term is better, overall and in most periods."""
    wins = int((trial.periods < than.periods).sum())
    return trial.held_out < than.held_out and wins >= MOST_PERIODS


def choose(
    train: Recording,
    candidates: Sequence[Candidate],
    lengths: Sequence[int] = LENGTHS,
    further: bool = True,
) -> tuple[Trial, list[Trial]]:
    """Law, length of the stretches and further terms, on the training record alone.

    Result: what was chosen, and everything that was tried.
    """
    trials = [_shown(tried(own, train, length)) for own in candidates for length in lengths]
    chosen = min(trials, key=lambda trial: trial.held_out)
    if further:
        start = estimate_of(chosen, train)
        added = [
            _shown(tried(own, train, chosen.length, start if own.slow else None))
            for own in extensions(chosen.candidate)
        ]
        trials += added
        gained = [trial for trial in added if better(trial, chosen)]
        chosen = min([chosen, *gained], key=lambda trial: trial.held_out)
    return chosen, trials


def _shown(trial: Trial) -> Trial:
    parts = f"{trial.length} per period" if trial.length else "whole"
    each = " ".join(f"{e:5.2f}" for e in trial.periods)
    print(f"{trial.candidate.title:44} {parts:12} {trial.held_out:6.2f}   {each}", flush=True)
    return trial


def main() -> None:
    """Choose on the training record; then open the test record and score."""
    train = load_emps()
    print(f"{'held-out error [mm]':44} {'stretches':12} {'all':>6}   each period", flush=True)
    chosen, trials = choose(train, laws())
    print(f"\nchosen: {chosen.candidate.title}, {chosen.length} stretches per period\n", flush=True)
    simple = min(trials[: len(laws()) * len(LENGTHS)], key=lambda trial: trial.held_out)
    start = estimate_of(simple, train)
    test, whole = load_emps_pulses(), Stretch(0, len(train.q))
    print(
        f"{'score [mm]':48} {'held out':>8} {'train':>6} {'test':>6} {'time [s]':>9} {'CPU [s]':>8}"
    )
    published = laws()[0].model()
    scores = published.score(train, whole), published.score(test, whole)
    print(f"{'  published values (least squares)':57} {scores[0]:6.2f} {scores[1]:6.2f}")
    for trial in trials:
        begin, processor = perf_counter(), process_time()
        found = fitted(
            trial.candidate, train, periods_of(train), trial.length,
            start if trial.candidate.slow else None,
        )  # fmt: skip
        times = perf_counter() - begin, process_time() - processor
        scores = found.model.score(train, whole), found.model.score(test, whole)
        parts = f"{trial.length} per period" if trial.length else "whole"
        title = f"{'→' if trial is chosen else ' '} {trial.candidate.title}, {parts}"
        print(
            f"{title:48} {trial.held_out:8.2f} {scores[0]:6.2f} {scores[1]:6.2f} "
            f"{times[0]:9.2f} {times[1]:8.2f}"
        )
        for name in found.model.names:
            ends = f"{found.low[name]:.5g} to {found.high[name]:.5g}"
            print(f"      {name:22} {found.model.values[name]:12.6g}   95 %: {ends}", flush=True)


if __name__ == "__main__":
    main()
