"""The EMPS benchmark to the letter: open loop, chosen on the training record, scored once.

Estimate on DATA_EMPS.mat, simulate the drive input of DATA_EMPS_PULSES.mat in *open loop*, let the
first 20 samples of its position set the initial state, and score

    1000 · RMSE(qm[20:])  in mm

(Janot, Gautier, Brunot 2019, Nonlinear System Identification Benchmarks; the submission script of
github.com/GerbenBeintema/nonlinear_benchmarks).

The rule, of which no part reads the test record:

1. Objective. `oloe` with ``horizon = "record"``: the squares of the position errors of one free run
   over the record that is fitted.
2. Halves. Each law is fitted to the first half of the training record and simulated over the
   second, from the first 20 samples there, and the reverse. Its held-out error is the root mean
   square of both runs.
3. Laws. Those of `emps_laws.laws`, then the chosen one with one further term (`extensions`). A law
   is refused if a parameter of the whole training record is at the bound of its sign, if a
   constant is at the end of its range or not determined, or if half the step changes the
   simulated training record by more than 1 % of its error.
4. Choice. The fewest unknowns within one standard error of the smallest held-out error, the
   standard error being that of the sum of differences over the two halves; of equals the smaller
   error.
5. The chosen law is fitted to the whole training record with the objective of 1, and scored.

    PIVIDENT_DATA=FOLDER python -m benchmarks.emps_leaderboard [--score]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from benchmarks.emps_laws import Candidate, extensions, laws
from benchmarks.open_loop_model import GIVEN, OpenLoopModel, Stretch, rms
from scipy.optimize import minimize_scalar

from pivident.data.recording.public_records import EMPS, load_emps, load_emps_pulses
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import Cascade

#: The law of its controller.
CONTROLLER = Cascade([160.18], [243.45], averaged=True)

#: Samples of a period of the reference.
PERIOD = 6240

#: Time after which a constant speed has settled [s].
SETTLED = 0.15

#: Change of a simulation when its step is halved that is accepted, relative to its errors.
SAME = 0.01

#: Runs of an estimate, the fastest of which is its processor time: others use the machine, too.
RUNS = 3

#: Draws from the covariance that show what the uncertainty of an estimate does to a simulation.
DRAWS = 20

#: 95 % half width of the logarithm of a constant above which it counts as not determined: the
#: interval of a number as large as its own half width contains zero.
DETERMINED = 1.0


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate on the training record.

    Attributes:
        candidate: what was tried.
        squares: squared errors of the free run over each half, fitted to the other [mm²], (2,).
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


def tried(candidate: Candidate, record: Recording) -> Trial:
    """Fit each half and simulate the other; then what is against the law on the whole record."""
    middle, end = len(record.q) // 2, len(record.q)
    halves = [Stretch(0, middle), Stretch(middle, end)]
    squares = np.full(2, np.inf)
    try:
        for k, (fitted, held_out) in enumerate(zip(halves, halves[::-1], strict=True)):
            model = candidate.model_of(candidate.fitted(record.part(*fitted)))
            errors = model.errors(record, held_out)[GIVEN:]
            squares[k] = float(errors @ errors)
        reason = refusal(candidate, candidate.fitted(record), record)
    except PividentError as error:
        reason = f"cannot be fitted: {error}"
    return Trial(candidate, squares, end - 2 * GIVEN, reason)


def refusal(candidate: Candidate, found: Identification, record: Recording) -> str:
    """Why a law is not chosen whatever its errors; empty where nothing is against it."""
    assert found.simulation is not None
    ends = [name for name in found.simulation.at_bound if name in found.names]
    if ends:
        return "impossible sign: " + ", ".join(ends)
    if found.simulation.at_bound:
        return "at the end of its range: " + ", ".join(found.simulation.at_bound)
    if found.simulation.held:
        return "not determined: " + ", ".join(found.simulation.held)
    for own in found.simulation.loop_parameters:
        low, high = own.value - 1.96 * own.std, own.value + 1.96 * own.std
        wide = low < 0.0 if own.name == "delay" else high > np.exp(DETERMINED) * own.value
        if wide:
            return f"not determined: {own.name} {low:.3g} to {high:.3g}"
    whole, model = Stretch(0, len(record.q)), candidate.model_of(found)
    errors = model.errors(record, whole)
    change = rms(model.errors(record, whole, finer=2) - errors)
    if change > SAME * rms(errors):
        return f"half a step changes it by {change:.2g} mm"
    return ""


def simplest(trials: Sequence[Trial]) -> Trial:
    """The fewest unknowns within one standard error of the best; of equals the better one.

    The sum of squares exceeds that of the best one by Σ d over the halves, whose standard error is
    √2 times the standard deviation of d.
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


def equation_error(candidate: Candidate, record: Recording, method: str) -> Identification:
    """LS, IV or PIV of a law, with the controller's instruments: no simulation error."""
    robot = candidate.model().robot
    loop = Loop(CONTROLLER, drive_gain=float(EMPS["units"]["tau"]["gain"]), limit=10.0)
    return identify(Problem(robot, (record,), loop), method)


def expected_error(candidate: Candidate, found: Identification, record: Recording) -> float:
    """Error of the simulated position that the uncertainty of the estimate explains [mm].

    The root mean square of q(p) - q(p̂) over draws of p from the covariance of the parameters. The
    measured position sets the initial state and cancels otherwise.
    """
    whole, model = Stretch(0, len(record.q)), candidate.model_of(found)
    own, rng = model.errors(record, whole)[GIVEN:], np.random.default_rng(0)
    squares = []
    for theta in rng.multivariate_normal(found.theta, found.covariance, DRAWS):
        names = ["m1" if name == "m1r" else name for name in found.names]
        values = model.values | dict(zip(names, theta.tolist(), strict=True))
        moved = replace(model, values=values).errors(record, whole)[GIVEN:]
        squares.append(np.mean((moved - own) ** 2))
    return float(np.sqrt(np.mean(squares)))


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
    each = " ".join(f"{np.sqrt(e / (trial.samples / 2)):7.2f}" for e in trial.squares)
    title = f"{trial.candidate.title:36} {len(trial.candidate.names):2}"
    print(f"{title} {trial.held_out:7.3f}   {each}   {trial.refused}", flush=True)
    return trial


def main(score: bool) -> None:
    """Choose on the training record; then, if asked, open the test record and score."""
    train = load_emps()
    print("speed [m/s]: force in each period of the training record [N]")
    for speed, forces in constant_speed_forces(train).items():
        print(f"{speed:7.3f}: {' '.join(f'{force:7.2f}' for force in forces)}")
    print(f"{'law':36} unknowns, held-out error, of each half [mm], refused because")
    chosen, trials = choose(train, laws())
    print(f"\nchosen: {chosen.candidate.title}\n", flush=True)
    records = [train, load_emps_pulses()] if score else [train]
    print(f"{'score [mm]':40} {'held out':>8} {'train':>6} {'test':>6} {'CPU [s]':>8}")
    published = laws()[0].model()
    print(f"{'  published values (least squares)':49} {_scores(published, records)}")
    for trial in trials:
        if not np.isfinite(trial.squares).all():
            continue
        times = []
        for _ in range(RUNS):
            begin = process_time()
            found = trial.candidate.fitted(train)
            times.append(process_time() - begin)
        model = trial.candidate.model_of(found)
        title = f"{'→' if trial is chosen else ' '} {trial.candidate.title}"
        scores = _scores(model, records)
        print(f"{title:40} {trial.held_out:8.3f} {scores} {min(times):8.2f}")
        for name, value, std in zip(found.names, found.theta, found.std, strict=True):
            print(f"      {name:22} {value:12.6g} ± {1.96 * std:.3g}", flush=True)
        assert found.simulation is not None
        for own in found.simulation.loop_parameters:
            print(f"      {own.name:22} {own.value:12.6g} ± {1.96 * own.std:.3g}", flush=True)
        if trial is not chosen:
            continue
        for record in records:
            expected = expected_error(trial.candidate, found, record)
            print(f"      (uncertainty of the estimate on {record.name}: {expected:.2f} mm)")
        if score and "off1" in model.values:
            change, after = offset_afterwards(model, records[-1])
            print(f"      (with the offset that fits the test, {change:+.3f} N: {after:.2f} mm)")
    moves = chosen.candidate.model_of(chosen.candidate.fitted(train, "moves"))
    print(f"{'  the chosen law over moves':49} {_scores(moves, records)}")
    for candidate in (laws()[0], chosen.candidate):
        for method in ("ls", "iv", "piv"):
            model = candidate.model_of(equation_error(candidate, train, method))
            print(f"{f'  {method} of {candidate.title}':49} {_scores(model, records)}")


def _scores(model: OpenLoopModel, records: Sequence[Recording]) -> str:
    """Scores on the training record and, where it is opened, on the test record."""
    return " ".join(f"{model.score(own, Stretch(0, len(own.q))):6.2f}" for own in records)


if __name__ == "__main__":
    main(score="--score" in sys.argv)
