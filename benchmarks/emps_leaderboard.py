"""The EMPS benchmark to the letter: open loop, chosen on the training record, scored once.

Estimate on DATA_EMPS.mat, simulate the drive input of DATA_EMPS_PULSES.mat in *open loop*, let the
first 20 samples of its position set the initial state, and score

    1000 · RMSE(qm[20:])  in mm

(Janot, Gautier, Brunot, Nonlinear System Identification Benchmarks 2019; the submission script of
github.com/GerbenBeintema/nonlinear_benchmarks). Friction law, length of the stretches that are
fitted and further terms are chosen on the training record alone: its reference has four periods,
each is left out once and simulated in open loop with the estimate of the others. The test record
is read after that. Searches start from IDIM-LS of the same law, whose time is counted.

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
    fit_open_loop,
    rms,
)
from scipy.optimize import minimize_scalar

from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
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

#: Time after which a constant speed has settled [s].
SETTLED = 0.15

#: Stribeck speeds that are tried [m/s].
SPEEDS = (0.005, 0.01, 0.02)

#: Periods, of the four, in which a further term has to be better.
MOST_PERIODS = 3

#: Most simulations with tangents: of a law whose tangents are differences, of others.
FEW, MANY = 8, 30

#: The authors' least-squares values (kg, N s/m, N, N), and starts of what is beside them.
PUBLISHED = {"m1": 95.1089, "fv1": 203.5034, "fc1": 20.3935, "off1": -3.1648}
START = PUBLISHED | {
    "presliding_distance": 5e-6, "stribeck_excess": 0.1,
}  # fmt: skip


@dataclass(frozen=True)
class Candidate:
    """A friction law with its drive.

    Attributes:
        title: for the tables.
        terms: of the law.
        constants: of the law or the drive that are sought beside the parameters.
        fixed: values that are not sought.
        slow: whether its tangents are differences; its search starts from ``reference_law``.
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


def reference_law() -> Candidate:
    """The law that the length of the stretches is chosen with."""
    return Candidate("slopes and levels by direction", BY_DIRECTION)


def laws() -> list[Candidate]:
    """Other friction laws of the speed, simplest first."""
    simple = (viscous(), SIGN, offset())
    return [
        Candidate("viscous, Coulomb, offset", simple),
        Candidate("the same, Stribeck 10 mm/s", (*simple, stribeck(0.01, gamma=STEEP))),
        *(
            Candidate(
                f"by direction, Stribeck {1e3 * speed:g} mm/s",
                (*BY_DIRECTION, stribeck(speed, gamma=STEEP)),
            )
            for speed in SPEEDS
        ),
    ]


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
        Candidate("Dahl in place of Coulomb", (*bare, dahl(5e-6)), ("presliding_distance",),
                  slow=True),
        Candidate("LuGre in place of Coulomb", (*bare, *lugre(5e-6, 0.1, 0.01, damped=False)),
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


def least_squares_start(
    candidate: Candidate, train: Recording, periods: Sequence[Stretch]
) -> dict[str, float]:
    """IDIM-LS of the same law on the same periods: where the search starts."""
    parts = tuple(train.part(*own) for own in stretches_of(periods, 0))
    found = identify(Problem(candidate.model().robot, parts), "ls").params
    return {"m1" if name == "m1r" else name: float(value) for name, value in found.items()}


def fitted(
    candidate: Candidate, train: Recording, periods: Sequence[Stretch], length: int
) -> OpenLoopFit:
    """Estimate from some periods of the training record."""
    if candidate.slow:
        start = estimate_of(reference_law(), train, periods, length)
    else:
        start = least_squares_start(candidate, train, periods)
    most = FEW if candidate.slow else MANY
    windows = None if length else periods
    model = candidate.model(start)
    return fit_open_loop(model, train, stretches_of(periods, length), most, windows)


def estimate_of(
    candidate: Candidate, train: Recording, periods: Sequence[Stretch], length: int
) -> dict[str, float]:
    """Values of a law by direction, with the levels of laws without directions."""
    found = fitted(candidate, train, periods, length).model.values
    forwards, backwards = found["fcp1"], found["fcn1"]
    return found | {"fc1": 0.5 * (forwards + backwards), "off1": 0.5 * (forwards - backwards)}


def tried(candidate: Candidate, train: Recording, length: int) -> Trial:
    """Leave each period out once, and simulate it with the estimate of the others."""
    periods = periods_of(train)
    errors = []
    for own in periods:
        rest = [other for other in periods if other is not own]
        errors.append(fitted(candidate, train, rest, length).model.score(train, own))
    return Trial(candidate, length, np.array(errors))


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
    """Length of the stretches, then the law, then further terms, on the training record alone.

    Result: what was chosen, and everything that was tried.
    """
    trials = [_shown(tried(reference_law(), train, length)) for length in lengths]
    chosen = min(trials, key=lambda trial: trial.held_out)
    trials += [_shown(tried(own, train, chosen.length)) for own in candidates]
    chosen = min(trials, key=lambda trial: trial.held_out)
    if further:
        further_terms = extensions(chosen.candidate)
        added = [_shown(tried(own, train, chosen.length)) for own in further_terms]
        trials += added
        gained = [trial for trial in added if better(trial, chosen)]
        chosen = min([chosen, *gained], key=lambda trial: trial.held_out)
    return chosen, trials


def constant_speed_forces(record: Recording) -> dict[float, list[float]]:
    """Mean force [N] in each period at each constant speed of the reference [m/s].

    Constant: the reference has not changed its speed for ``SETTLED``; the force is friction then.
    """
    speed = np.diff(record.q_ref[:, 0], prepend=record.q_ref[0, 0]) * record.rate
    last_change = np.maximum.accumulate(
        np.where(np.abs(np.diff(speed, prepend=0.0)) > 1e-6, np.arange(len(speed)), 0)
    )
    steady = np.arange(len(speed)) - last_change > SETTLED * record.rate
    forces: dict[float, list[float]] = {}
    for own in periods_of(record):
        rows = np.arange(*own)[steady[slice(*own)]]
        for value in np.unique(np.round(speed[rows], 3)):
            force = record.tau[rows[np.round(speed[rows], 3) == value], 0].mean()
            forces.setdefault(float(value), []).append(float(force))
    return forces


def offset_afterwards(model: OpenLoopModel, test: Recording) -> tuple[float, float]:
    """Change of a by-direction law's offset that fits the test record [N], and its score [mm].

    A diagnosis after the score, which it does not change: how much of the score is offset.
    """
    values, whole = model.values, Stretch(0, len(test.q))

    def score(change: float) -> float:
        levels = {"fcp1": values["fcp1"] + change, "fcn1": values["fcn1"] - change}
        return replace(model, values=values | levels).score(test, whole)

    found = minimize_scalar(score, bounds=(-1.0, 1.0), method="bounded", options={"xatol": 1e-3})
    return float(found.x), float(found.fun)


def _shown(trial: Trial) -> Trial:
    parts = f"{trial.length} per period" if trial.length else "whole"
    each = " ".join(f"{e:5.2f}" for e in trial.periods)
    print(f"{trial.candidate.title:44} {parts:12} {trial.held_out:6.2f}   {each}", flush=True)
    return trial


def main() -> None:
    """Choose on the training record; then open the test record and score."""
    train = load_emps()
    print("speed [m/s]: force in each period of the training record [N]")
    for speed, forces in constant_speed_forces(train).items():
        print(f"{speed:7.3f}: {' '.join(f'{force:7.2f}' for force in forces)}")
    print(f"{'held-out error [mm]':44} {'stretches':12} {'all':>6}   each period", flush=True)
    chosen, trials = choose(train, laws())
    print(f"\nchosen: {chosen.candidate.title}, {chosen.length} stretches per period\n", flush=True)
    test, whole = load_emps_pulses(), Stretch(0, len(train.q))
    print(
        f"{'score [mm]':48} {'held out':>8} {'train':>6} {'test':>6} {'time [s]':>9} {'CPU [s]':>8}"
    )
    published = laws()[0].model()
    scores = published.score(train, whole), published.score(test, whole)
    print(f"{'  published values (least squares)':57} {scores[0]:6.2f} {scores[1]:6.2f}")
    for trial in trials:
        begin, processor = perf_counter(), process_time()
        found = fitted(trial.candidate, train, periods_of(train), trial.length)
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
        if {"fcp1", "fcn1"} <= set(found.model.names):
            change, score = offset_afterwards(found.model, test)
            print(
                f"      (with the offset that fits the test record, {change:+.3f} N: {score:.2f})"
            )


if __name__ == "__main__":
    main()
