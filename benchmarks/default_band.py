"""Which band does least squares want of a slow log, and does its own choice find it?

    PIVIDENT_DATA=FOLDER python benchmarks/default_band.py [RECORD ...]

Records: EMPS, TX40 and KR300 by their examples, TIAGo, a UR10 (r04) and a Panda at 30 Hz (r11) by
the drafts of `pivident init`. Each is thinned to about 100 and 50 Hz as a logger would, every k-th
sample, from several first samples: what two neighbours of one log differ by is chance. Least
squares is fitted with a band of an eighth of the rate (*thinned*), with the whole rate (*whole*),
and by its default, which chooses between them (*default*). Its torques are compared with those of
the record at its own rate, below 20 Hz or an eighth of that rate: on five blocks held out in turn,
and on the next motion: the other one, or the last and the first 28 % of a single one.

Printed: geometric means of the held-out errors over all first samples [%], and how far the default
is from the better of the other two.
"""

from __future__ import annotations

import dataclasses
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident import load_experiment
from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.init.draft import draft_experiment
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.judgement.validation.held_out.prediction import Judge, pooled

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

#: Records of examples, and those that are drafted: their logs and their description.
EXAMPLE = {"emps": "emps", "tx40": "staubli_tx40", "kr300": "kuka_kr300"}
DRAFTED = {
    "tiago": ("tiago/tiago_*.csv.gz", "tiago/tiago_48_hey5.urdf.gz"),
    "r04": ("public/r04_ur10_bag/ur10_exciting*.db3", "public/r04_ur10_bag/ur10.urdf"),
    "r11": ("public/r11_panda_30hz_bag/*.db3", "public/r11_panda_30hz_bag/panda.urdf"),
}

#: About which rates logs are thinned to [Hz], and from how many first samples.
RATES, PHASES = (100.0, 50.0), 5

#: Share of a single motion that is fitted, and that is judged at its other end.
FITTED, JUDGED = 0.7, 0.28

KINDS = ("thinned", "whole", "default")


def problem_of(name: str, folder: Path) -> Problem:
    """The problem of a record, as its example or its draft has it."""
    if name in EXAMPLE:
        return load_experiment(EXAMPLES / EXAMPLE[name] / "experiment.toml").problem()
    data, out = Path(os.environ["PIVIDENT_DATA"]), folder / f"{name}.toml"
    logs, robot = DRAFTED[name]
    draft = draft_experiment(sorted(data.glob(logs)), str(data / robot), out=out)
    out.write_text(draft.text, encoding="utf-8")
    return load_experiment(out).problem()


def thinned(problem: Problem, step: int, first: int) -> Problem:
    """Every so many samples, without a loop, whose control instants are gone."""
    runs = []
    for run in problem.recordings:
        fields = {f.name: getattr(run, f.name) for f in dataclasses.fields(Recording) if f.init}
        for name, value in fields.items():
            if isinstance(value, np.ndarray) and value.shape[:1] == (run.samples,):
                fields[name] = value[first::step]
        start = run.start_time + first / run.rate
        fields |= {"rate": run.rate / step, "start_time": start}
        runs.append(Recording(**(fields | dict.fromkeys(("q_ref", "dq_ref", "control_rate")))))
    return replace(problem, recordings=tuple(runs), loop=None)


def methods(rate: float) -> dict[str, LeastSquares]:
    """Least squares with each band."""
    recipes = Bandpass(bandwidth=min(20.0, rate / 8)), Bandpass(decimation=1), Bandpass()
    return {kind: LeastSquares(signals=own) for kind, own in zip(KINDS, recipes, strict=True)}


def on_blocks(problem: Problem, judges: list[Judge], method: LeastSquares) -> Iterator[float]:
    """Error on five blocks held out in turn [%]."""
    names, errors = [r.name for r in problem.recordings], []
    for block in cross_validate(problem, method, folds=5).held_out:
        judge = judges[names.index(block.recording)]
        if block.identification is not None:
            errors += judge.score(block.identification, [block.span(judge.recording)])
    yield pooled(errors).total_in_band


def on_next_motion(problem: Problem, judges: list[Judge], method: LeastSquares) -> Iterator[float]:
    """Error on each motion by the estimate from the other, or on either end of a single one [%]."""
    runs = problem.recordings
    if len(runs) > 1:
        for own, judge in zip(runs, judges[::-1], strict=True):
            found = identify(replace(problem, recordings=(own,)), method)
            yield judge.score(found, [slice(0, judge.recording.samples)])[0].total_in_band
        return
    (run,), (judge,), samples = runs, judges, judges[0].recording.samples
    for begin, span in (
        (0.0, slice(round((1.0 - JUDGED) * samples), samples)),
        (1.0 - FITTED, slice(0, round(JUDGED * samples))),
    ):
        start = run.start_time + begin * run.duration
        own = run.slice(start, start + FITTED * run.duration)
        found = identify(replace(problem, recordings=(own,)), method)
        yield judge.score(found, [span])[0].total_in_band


def main() -> None:
    """One line for each record, rate and kind of held-out motion."""
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1:] or (*EXAMPLE, *DRAFTED):
            problem = problem_of(name, Path(folder))
            judges, rate = [Judge(r) for r in problem.recordings], problem.recordings[0].rate
            for step in dict.fromkeys((1, *(max(round(rate / wanted), 1) for wanted in RATES))):
                firsts = np.unique(np.linspace(0, step - 1, min(step, PHASES)).astype(int))
                logs = [thinned(problem, step, first) if step > 1 else problem for first in firsts]
                for judged in (on_blocks, on_next_motion):
                    means = {}
                    for kind, method in methods(rate / step).items():
                        errors = [e for log in logs for e in judged(log, judges, method)]
                        means[kind] = float(np.exp(np.mean(np.log(errors))))
                    listed = "  ".join(f"{kind} {means[kind]:6.2f}" for kind in KINDS)
                    behind = means["default"] / min(means["thinned"], means["whole"]) - 1.0
                    head = (
                        f"{name:6s}{rate / step:7.1f} Hz, {judged.__name__.replace('_', ' '):14s}"
                    )
                    print(f"{head} {listed}  {100 * behind:+.1f} %", flush=True)


if __name__ == "__main__":
    main()
