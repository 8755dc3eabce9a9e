"""The EMPS benchmark to the letter: open loop, chosen on the training record, scored once.

Estimate on DATA_EMPS.mat, simulate the drive input of DATA_EMPS_PULSES.mat in *open loop*, let the
first 20 samples of its position set the initial state, and score

    1000 · RMSE(qm[20:])  in mm

(Janot, Gautier, Brunot 2019, Nonlinear System Identification Benchmarks; the submission script of
github.com/GerbenBeintema/nonlinear_benchmarks). The friction law is chosen on the training record
alone, by cross-validation over *motions*. Its reference goes from rest to rest at three speeds in
two directions, 32 moves of six kinds. All moves of one kind are left out, the law is fitted to the
others, and each move that was left out is simulated in open loop from its own first 20 samples.
Repeated periods would only show how well the machine repeats itself.

Chosen is the law with the fewest unknowns within one standard error of the smallest held-out
error, of those that are not refused. The test record is read after that.

    PIVIDENT_DATA=FOLDER python -m benchmarks.emps_leaderboard
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from time import process_time

import numpy as np
from benchmarks.emps_laws import Candidate, extensions, laws
from benchmarks.open_loop_fit import (
    GIVEN,
    OpenLoopFit,
    OpenLoopModel,
    Stretch,
    fit_open_loop,
    rms,
)
from scipy.optimize import minimize_scalar

from pivident.data.recording.public_records import load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.studies.friction_laws.law_scores import impossible_terms

#: Samples of a period of the reference.
PERIOD = 6240

#: Speed below which the reference turns or rests between two moves [m/s].
REST = 1e-3

#: Time after which a constant speed has settled [s].
SETTLED = 0.15

#: Change of a simulation when its step is halved that is accepted, relative to its errors.
SAME = 0.01

#: Runs of an estimate, the fastest of which is its processor time: others use the machine, too.
RUNS = 3

#: 95 % half width of the logarithm of a constant above which it counts as not determined: the
#: interval of a number as large as its own half width contains zero.
DETERMINED = 1.0


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate on the training record.

    Attributes:
        candidate: what was tried.
        squares: squared errors of the moves of each kind while it was left out [mm²], (kinds,).
        samples: that were counted.
        refused: why it is not chosen whatever its errors; empty where nothing is against it.
    """

    candidate: Candidate
    squares: np.ndarray
    samples: int
    refused: str = ""

    @property
    def held_out(self) -> float:
        """Root mean square of all errors [mm]."""
        return float(np.sqrt(self.squares.sum() / self.samples))


def moves_of(record: Recording) -> list[Stretch]:
    """From rest to rest of the reference; the first one has begun before the record."""
    speed = np.abs(np.diff(record.q_ref[:, 0])) * record.rate
    rests = [
        k for k in range(1, len(speed) - 1)
        if speed[k] <= speed[k - 1] and speed[k] < speed[k + 1] and speed[k] < REST
    ]  # fmt: skip
    return [Stretch(*ends) for ends in pairwise([0, *rests, len(record.q)])]


def kinds_of(record: Recording, moves: Sequence[Stretch]) -> list[list[int]]:
    """Indices of the moves of each kind: largest speed to a centimetre per second, direction."""
    speed = np.diff(record.q_ref[:, 0]) * record.rate
    kinds: dict[float, list[int]] = {}
    for k, own in enumerate(moves):
        here = speed[slice(*own)]
        fastest = round(float(here[np.abs(here).argmax()]), 2)
        kinds.setdefault(fastest, []).append(k)
    return [kinds[fastest] for fastest in sorted(kinds)]


def connected(moves: Sequence[Stretch]) -> list[Stretch]:
    """What follows one upon the other as a whole."""
    joined = [moves[0]]
    for own in moves[1:]:
        if own.start == joined[-1].stop:
            joined[-1] = Stretch(joined[-1].start, own.stop)
        else:
            joined.append(own)
    return joined


def fitted(
    candidate: Candidate,
    record: Recording,
    moves: Sequence[Stretch],
    kinds: Sequence[Sequence[int]] | None = None,
) -> OpenLoopFit:
    """Estimate from moves, each from its own initial state; the search starts at IDIM-LS.

    Args:
        candidate: what is fitted.
        record: the training record.
        moves: that are fitted.
        kinds: that the jackknife leaves out one after the other; None: single moves.
    """
    model = candidate.model(candidate.linear_start(record, connected(moves)))
    return fit_open_loop(model, record, moves, kinds)


def tried(candidate: Candidate, record: Recording) -> Trial:
    """Leave each kind of move out once, and simulate its moves with the estimate of the others."""
    moves = moves_of(record)
    kinds = kinds_of(record, moves)
    squares, samples = [], 0
    for own in kinds:
        rest = [move for k, move in enumerate(moves) if k not in own]
        model = fitted(candidate, record, rest).model
        errors = [model.errors(record, moves[k])[GIVEN:] for k in own]
        squares.append(sum(float(e @ e) for e in errors))
        samples += sum(map(len, errors))
    reason = refusal(candidate, fitted(candidate, record, moves, kinds), record)
    return Trial(candidate, np.array(squares), samples, reason)


def refusal(candidate: Candidate, found: OpenLoopFit, record: Recording) -> str:
    """Why a law is not chosen whatever its errors; empty where nothing is against it.

    A parameter has a sign that no friction has; a constant is not determined; the simulated record
    depends on the step of the simulation.
    """
    values = found.model.values
    theta = [values[f"{term.stem}1"] for term in candidate.terms]
    impossible = impossible_terms(found.model.robot.joints[0].friction, theta)
    if impossible:
        return "impossible sign: " + ", ".join(sorted(impossible))
    for name in candidate.constants:
        low, high = found.low[name], found.high[name]
        wide = low < 0.0 if name == "delay" else np.log(high / values[name]) > DETERMINED
        if wide or (name == "delay" and values[name] == 0.0):
            return f"not determined: {name} {low:.3g} to {high:.3g}"
    whole = Stretch(0, len(record.q))
    errors = found.model.errors(record, whole)
    change = rms(found.model.errors(record, whole, finer=2) - errors)
    if change > SAME * rms(errors):
        return f"half a step changes it by {change:.2g} mm"
    return ""


def simplest(trials: Sequence[Trial]) -> Trial:
    """The fewest unknowns within one standard error of the best; of equals the better one.

    The sum of squares exceeds that of the best one by Σ d over the kinds of moves, whose standard
    error is √K times the standard deviation of d.
    """
    allowed = [trial for trial in trials if not trial.refused]
    best = min(allowed, key=lambda trial: trial.held_out)

    def is_close(trial: Trial) -> bool:
        d = trial.squares - best.squares
        return bool(d.sum() <= np.sqrt(len(d)) * d.std(ddof=1))

    close = [trial for trial in allowed if is_close(trial)]
    return min(close, key=lambda trial: (len(trial.candidate.names), trial.held_out))


def choose(
    record: Recording, candidates: Sequence[Candidate], further: bool = True
) -> tuple[Trial, list[Trial]]:
    """The law, then at most one further term, on the training record alone.

    Result: what was chosen, and everything that was tried.
    """
    trials = [_shown(tried(own, record)) for own in candidates]
    chosen = simplest(trials)
    if further:
        added = [_shown(tried(own, record)) for own in extensions(chosen.candidate)]
        trials += added
        chosen = simplest([chosen, *added])
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
    for start in range(0, len(speed) - PERIOD // 2, PERIOD):
        rows = np.arange(start, min(start + PERIOD, len(speed)))
        rows = rows[steady[rows]]
        for value in np.unique(np.round(speed[rows], 3)):
            force = record.tau[rows[np.round(speed[rows], 3) == value], 0].mean()
            forces.setdefault(float(value), []).append(float(force))
    return forces


def offset_afterwards(model: OpenLoopModel, test: Recording) -> tuple[float, float]:
    """Change of a law's offset that fits the test record [N], and its score [mm].

    A diagnosis after the score, which it does not change: how much of the score is offset.
    """
    values, whole = model.values, Stretch(0, len(test.q))

    def score(change: float) -> float:
        moved = values | {"off1": values["off1"] + change}
        return replace(model, values=moved).score(test, whole)

    found = minimize_scalar(score, bounds=(-1.0, 1.0), method="bounded", options={"xatol": 1e-3})
    return float(found.x), float(found.fun)


def _shown(trial: Trial) -> Trial:
    each = " ".join(f"{e:8.1f}" for e in trial.squares)
    title = f"{trial.candidate.title:36} {len(trial.candidate.names):2}"
    print(f"{title} {trial.held_out:7.3f}   {each}   {trial.refused}", flush=True)
    return trial


def main() -> None:
    """Choose on the training record; then open the test record and score."""
    train = load_emps()
    moves = moves_of(train)
    kinds = kinds_of(train, moves)
    print("speed [m/s]: force in each period of the training record [N]")
    for speed, forces in constant_speed_forces(train).items():
        print(f"{speed:7.3f}: {' '.join(f'{force:7.2f}' for force in forces)}")
    print(f"{'law':36} unknowns, held-out error [mm], squares of each kind [mm²], refused because")
    chosen, trials = choose(train, laws())
    print(f"\nchosen: {chosen.candidate.title}\n", flush=True)
    test, whole = load_emps_pulses(), Stretch(0, len(train.q))
    print(f"{'score [mm]':40} {'held out':>8} {'train':>6} {'test':>6} {'CPU [s]':>8}")
    published = laws()[0].model()
    scores = published.score(train, whole), published.score(test, whole)
    print(f"{'  published values (least squares)':49} {scores[0]:6.2f} {scores[1]:6.2f}")
    for trial in trials:
        times = []
        for _ in range(RUNS):
            begin = process_time()
            found = fitted(trial.candidate, train, moves, kinds)
            times.append(process_time() - begin)
        scores = found.model.score(train, whole), found.model.score(test, whole)
        title = f"{'→' if trial is chosen else ' '} {trial.candidate.title}"
        print(
            f"{title:40} {trial.held_out:8.3f} {scores[0]:6.2f} {scores[1]:6.2f} "
            f"{min(times):8.2f}   {found.simulations} passes"
        )
        for name in found.model.names:
            ends = f"{found.low[name]:.5g} to {found.high[name]:.5g}"
            print(f"      {name:22} {found.model.values[name]:12.6g}   95 %: {ends}", flush=True)
        if trial is not chosen:
            continue
        for name, record in (("training", train), ("test", test)):
            expected = found.expected_error(record, whole)
            print(f"      (uncertainty of the estimate on the {name} record: {expected:.2f} mm)")
        if "off1" in found.model.names:
            change, score = offset_afterwards(found.model, test)
            print(f"      (with the offset that fits the test, {change:+.3f} N: {score:.2f} mm)")


if __name__ == "__main__":
    main()
