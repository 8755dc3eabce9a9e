"""Several methods on the same held-out motion: which estimate to take?

PIV has the right intervals where its noise model is right. On a real machine the residual is mostly
model error, and a prefilter made for noise can weigh the wrong samples and frequencies; then PIV
predicts worse than plain IV, and IV's estimate is the one to take. Blocks of one motion differ by
chance, too: a difference counts only if its interval does not contain zero.

An estimate from a fitted simulation (CLOE, CLIE, ML, OLOE) rests on law, reference and drives as
well as on the model: where one of them is wrong, so is the simulated motion. It is taken only where
its held-out torque error is no larger than that of the estimate that would be taken without it,
and where its own simulation error shows neither model error nor a wrong gain
or delay.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.signs import negative_parameters
from pivident.estimation.identification import Identification
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.parameter_rows import CONTRADICTION
from pivident.estimation.problem import Problem
from pivident.foundation.distributions import student
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import Attempts, ExperimentError, IdentificationError, in_words
from pivident.foundation.text.numbers import format_significant
from pivident.judgement.validation.held_out.cross_validation import (
    CrossValidation,
    judged_on,
    percent_column,
)
from pivident.judgement.validation.held_out.folds import JudgedMotion
from pivident.judgement.validation.residuals.model_error import model_error_by_held_out_blocks

#: PIV may predict so much worse than IV before IV is the one to take.
TOLERATED = 1.02

#: What a fitted simulation may not have against it to be taken: topics and kinds of findings.
AGAINST_SIMULATION = (
    ("simulation", "model error"),
    ("law", "wrong gain"),
    ("law", "wrong delay"),
)

#: Why a fitted simulation is not taken where nothing but its error is against it.
LARGER = "its error is larger"

#: Fewest stretches from which an interval of a ratio is made.
MIN_STRETCHES = 3


@dataclass(frozen=True)
class Ratio:
    """Prediction error of one method over that of another, on the same stretches."""

    value: float  # over all stretches
    low: float  # lower end of its 95 % interval, from the stretches; NaN with fewer than three
    high: float  # upper end

    @property
    def could_be_chance(self) -> bool:
        """Whether the interval of the difference contains zero; unknown without one."""
        return self.low <= 1.0 <= self.high

    @property
    def range(self) -> str:
        """The interval of the difference in words."""
        return f"{100 * (self.low - 1):+z.1f} to {100 * (self.high - 1):+z.1f} %"

    def __str__(self) -> str:
        text = f"{100 * (self.value - 1):+z.1f} %"
        if np.isnan(self.low):
            return f"{text} (one or two stretches, no interval)"
        return f"{text} (95 %: {self.range})"


@dataclass(frozen=True, eq=False)
class OutOfSample:
    """Methods compared on motion that none was fitted to."""

    results: dict[str, CrossValidation]  # cross-validation of each method by its short name
    failures: dict[str, str]  # error of the methods that failed, likewise
    best: str  # name of the one with the smallest held-out torque error in the motion's band
    recommended: str  # name of the one whose estimate to take
    piv: str = ""  # name of the prefiltered method, empty without one
    iv: str = ""  # name of the best plain instrumental variable method, empty without one
    piv_over_iv: Ratio | None = None  # their errors' ratio, None without both
    causes: tuple[str, ...] = ()  # why PIV is likely to be worse, where it is, each with its number
    #: Parameters in which PIV and IV contradict each other, a sentence; empty where they do not.
    apart: str = ""
    simulated: str = ""  # name of the best fitted simulation, empty without one
    rival: str = ""  # name of the one to take among the others, empty without any
    simulated_over_rival: Ratio | None = None  # their errors' ratio, None without both
    against_simulated: str = ""  # why it is not the one to take, empty where it is
    fewer: str = ""  # why the motion is cut into another number of blocks than was asked for

    @property
    def piv_is_worse(self) -> bool:
        """Whether PIV predicts worse than IV by more than 2 %, and more than blocks scatter."""
        return self.piv_over_iv is not None and is_worse(self.piv_over_iv)

    @property
    def undecided(self) -> bool:
        """Whether PIV predicts worse by more than 2 %, but by less than the blocks scatter."""
        ratio = self.piv_over_iv
        return ratio is not None and ratio.value > TOLERATED and ratio.could_be_chance

    @property
    def motion(self) -> str:
        """The motion that was judged on, in words."""
        return next(iter(self.results.values())).motion

    @property
    def training_only(self) -> bool:
        """Whether nothing was held out."""
        return any(r.training_only for r in self.results.values())

    def _label(self, name: str) -> str:
        """Name of a method, with its short name where two are called alike."""
        label = self.results[name].method
        alike = [r for r in self.results.values() if r.method == label]
        return f"{label} [{name}]" if len(alike) > 1 else label

    def __str__(self) -> str:
        positions = self.position_table()
        heading = f"{self.position_heading()}\n"
        shown = [] if positions is None else [heading + positions.text()]
        return "\n\n".join([self.table().text(), *shown, *self.sentences()])

    def table(self) -> Table:
        """One row for each method."""
        rows = self.results.values()
        band = next(iter(rows)).prediction.band
        stretches = len(next(iter(rows)).held_out)
        replays = [nan if r.replay is None else r.replay.total for r in rows]
        columns = {
            "method": Column([self._label(name) for name in self.results]),
            "error_in_band_percent": percent_column(
                [r.prediction.total_in_band for r in rows], f"error % < {band:g} Hz"
            ),
            "error_percent": percent_column([r.prediction.total for r in rows], "all"),
            "fitted_percent": percent_column(
                [r.training.total_in_band for r in rows], f"fitted < {band:g} Hz"
            ),
            "replay_percent": percent_column(replays, "replay %"),
        }
        for k in range(stretches if stretches > 1 else 0):
            errors = [r.held_out[k].prediction if k < len(r.held_out) else None for r in rows]
            values = [nan if error is None else error.total_in_band for error in errors]
            columns[f"part_{k + 1}_percent"] = percent_column(values, f"#{k + 1}")
        return Table("methods", columns)

    def joint_table(self) -> Table:
        """One row for each joint: the error of each method below the motion's highest frequency.

        Rms values are those of the recommended method, whose largest relative error is marked.
        """
        e = self.results[self.recommended].prediction
        worst = int(np.argmax(e.relative_in_band))
        columns = {
            "joint": Column(e.joint_names),
            "torque_rms": Column(e.torque_in_band, f"torque rms < {e.band:g} Hz", digits=3),
            "error_rms": Column(e.rms_in_band, "error rms", digits=3),
            "unit": Column(e.units),
        }
        for name, judged in self.results.items():
            errors = judged.prediction.relative_in_band
            columns[f"{name}_percent"] = Column(errors, f"{self._label(name)} %", digits=3)
        marks = ["largest" if j == worst else "" for j in range(len(e.joint_names))]
        return Table("joints", columns | {"mark": Column(marks, " ")})

    def position_table(self) -> Table | None:
        """One row for each joint: rms error of the simulated positions; None where none are."""
        judged = {n: r.simulation for n, r in self.results.items() if r.simulation is not None}
        if not judged:
            return None
        first = next(iter(judged.values()))
        # without a held base, which stands still
        shown = np.flatnonzero(np.any([error.position for error in judged.values()], axis=0))
        columns = {"joint": Column([first.joint_names[j] for j in shown])}
        for name, error in judged.items():
            title = f"{self._label(name)}{', open loop' if error.loop == 'open' else ''}"
            columns[name] = Column(error.position[shown], title, digits=3)
        columns["unit"] = Column([first.units[j] for j in shown])
        return Table("positions", columns, title="Errors of the simulated positions")

    def position_heading(self) -> str:
        """What the table of positions shows."""
        where = self.results[self.recommended].where
        return f"Rms error of the simulated positions on {where}, by the estimate of each method:"

    def joint_heading(self) -> str:
        """What the table by joint shows."""
        taken = self.results[self.recommended]
        return (
            f"Torque error of each joint on {taken.where}, below {taken.prediction.band:g} Hz "
            f"(rms: {self._label(self.recommended)}):"
        )

    def sentences(self) -> list[str]:
        """Which estimate to take and why, with the ratio of the errors."""
        fewer = [self.fewer] if self.fewer else []
        return [*self._warning(), *fewer, *self.ratio_lines(), *self._advice()]

    def advice(self) -> list[str]:
        """The same without the ratio."""
        return [*self._warning(), *self._advice()]

    def ratio_lines(self) -> list[str]:
        """Error of PIV over that of IV, where both are there."""
        if self.piv_over_iv is None:
            return []
        piv, iv = self._label(self.piv), self._label(self.iv)
        return [f"Held-out torque error of {piv} over that of {iv}: {self.piv_over_iv}."]

    def _warning(self) -> list[str]:
        return [next(iter(self.results.values())).warning] if self.training_only else []

    def _advice(self) -> list[str]:
        return [
            *self._between_instruments(),
            *self._about_simulation(),
            *self._about_best(),
            *(f"{name} failed: {text}" for name, text in self.failures.items()),
        ]

    def _between_instruments(self) -> list[str]:
        """PIV or IV, where both are there."""
        if self.piv_over_iv is None:
            return []
        piv, iv, taken = (self._label(name) for name in (self.piv, self.iv, self.rival))
        take = "take the estimate of" if self.rival == self.recommended else "of the two prefer"
        if self.piv_is_worse:
            return [
                f"{piv} predicts worse than {iv} by more than "
                f"{100 * (TOLERATED - 1):.0f} %: {take} {taken}. " + " ".join(self.causes)
            ]
        if self.undecided:
            return [
                f"{piv} and {iv} show no difference within {self.piv_over_iv.range} (95 %, "
                f"from the scatter of the held-out blocks): {take} {taken}, "
                "whose intervals are better founded."
                + (f" {self.apart} More motion or more folds would decide." * bool(self.apart))
            ]
        return [
            f"{piv} predicts as well as {iv} to within {100 * (TOLERATED - 1):.0f} % or "
            f"better: {take} {taken}, whose intervals are better founded."
        ]

    def _about_simulation(self) -> list[str]:
        """Whether a fitted simulation is the one to take, where there is one beside others."""
        ratio = self.simulated_over_rival
        if ratio is None:
            return []
        own, rival = self._label(self.simulated), self._label(self.rival)
        text = f"The held-out torque error of {own} differs from that of {rival} by {ratio}"
        if self.against_simulated == LARGER:
            return [f"{text}: {own} is not the one to take."]
        if self.against_simulated:
            return [
                f"{text}, but {self.against_simulated}: {own}, which rests on law, reference and "
                "drives as well as on the model, is not the one to take."
            ]
        return [
            f"{text}, and its simulated motion shows neither model error nor a wrong gain or "
            f"delay: take the estimate of {own}."
        ]

    def _about_best(self) -> list[str]:
        """The smallest error, and why it need not decide."""
        taken, best = self._label(self.recommended), self.results[self.best]
        said = self.piv_over_iv is not None or self.recommended == self.simulated
        if self.best == self.recommended:
            return [] if said else [f"Smallest held-out torque error: {taken}."]
        lines = [] if said else [self._in_spite_of_error(taken)]
        least, own = (
            f"{judged.prediction.total_in_band:.2f}"
            for judged in (best, self.results[self.recommended])
        )
        if least == own:
            return lines
        return [
            *lines,
            f"{self._label(self.best)} has the smallest error, {least} % against {own} %. A small "
            "prediction error does not show that parameters are free of bias.",
        ]

    def _in_spite_of_error(self, taken: str) -> str:
        """Why an estimate is taken whose error is not the smallest."""
        if self.best == self.simulated and not (self.piv or self.iv):
            return f"Take the estimate of {taken}."
        return f"Take the estimate of {taken}: its regressors may share noise with the residual."


def compare_out_of_sample(
    problem: Problem,
    methods: Sequence[str] | Mapping[str, Method] = ("ls", "iv", "iv-full-rate", "piv"),
    *,
    folds: int = 5,
    gap: float | None = None,
    recording: Recording | Sequence[Recording] | None = None,
    identifications: Mapping[str, Identification] | None = None,
    progress: Callable[[str], None] | None = None,
    attempts: Attempts | None = None,
    motion: JudgedMotion | None = None,
) -> OutOfSample:
    """Cross-validate several methods on the same stretches and say which estimate to take.

    ``gap``: left out on either side of a block [s]; ``attempts``: what judges each method;
    ``motion``: the smoothed recordings, where they are there already.
    """
    chosen = dict(methods) if isinstance(methods, Mapping) else {m: METHODS[m] for m in methods}
    if not chosen:
        raise ExperimentError("no method to compare", advice="name at least one, such as 'piv'")
    say = progress or (lambda line: None)
    results: dict[str, CrossValidation] = {}
    attempts, failures = attempts or Attempts(), dict[str, str]()
    say("smoothing the held-out motion")
    motion = motion or JudgedMotion.of(problem, recording)
    division = motion.division(0 if motion.unseen else folds, gap)
    if division.reason and not division.count:
        raise IdentificationError.of_part("", division.reason)
    count = folds if motion.unseen else division.count
    for name, method in chosen.items():
        known = (identifications or {}).get(name)
        judged = attempts.of(
            f"{method.label} was not judged on held-out motion",
            judged_on, motion, method, count, gap, known, prefixed(say, method.label),
        )  # fmt: skip
        if judged is None:
            failures[name] = in_words(attempts.errors[-1])
        else:
            results[name] = judged
    if not results:
        raise IdentificationError(
            "none of the methods could be judged",
            advice=f"{next(iter(chosen))} fails with: {next(iter(failures.values()))}",
        )
    return replace(_judged(chosen, results, failures), fewer=division.line)


def _judged(
    methods: Mapping[str, Method],
    results: dict[str, CrossValidation],
    failures: dict[str, str],
) -> OutOfSample:
    """Best, recommended, and why."""
    error = {name: r.prediction.total_in_band for name, r in results.items()}
    best = min(error, key=error.__getitem__)

    def smallest(whitens: bool) -> str:
        names = [n for n in results if methods[n].whitens is whitens]
        return min(names, key=error.__getitem__, default="")

    piv, iv = smallest(True), smallest(False)
    found = OutOfSample(results, failures, best, piv or iv or best, piv, iv)
    if piv and iv:
        ratio = error_ratio(results[piv], results[iv])
        worse = is_worse(ratio)
        found = replace(
            found,
            recommended=iv if worse else piv,
            piv_over_iv=ratio,
            causes=tuple(likely_causes(results[piv], results[iv])) if worse else (),
            apart=_contradictions(results[piv].identification, results[iv].identification),
        )
    others = [n for n in results if not methods[n].fits_simulation]
    simulated = min(
        (n for n in results if n not in others),
        key=lambda n: (bool(_against(results[n].identification)), error[n]),
        default="",
    )
    rival = found.recommended if piv or iv else min(others, key=error.__getitem__, default="")
    found = replace(found, rival=rival)
    if simulated and rival:
        return _with_simulation(found, simulated)
    return replace(found, recommended=simulated) if simulated else found


def _with_simulation(found: OutOfSample, name: str) -> OutOfSample:
    """Whether the best fitted simulation is the one to take in place of its rival."""
    judged, rival = found.results[name], found.results[found.rival]
    ratio = error_ratio(judged, rival)
    larger = ratio.value > 1.0 if found.piv or found.iv else is_worse(ratio)
    why = _against(judged.identification) or LARGER * larger
    return replace(
        found,
        recommended=found.rival if why else name,
        simulated=name,
        simulated_over_rival=ratio,
        against_simulated=why,
    )


def _against(own: Identification) -> str:
    """What a fitted simulation has against it by itself; empty for nothing."""
    if not own.converged:
        return "it has not converged"
    if own.simulation is not None and not own.simulation.noise_orders:
        return "without noise models its errors are not tested for model error"
    shown = {(w.topic, w.kind): w.kind for w in own.warnings}
    kinds = [shown[key] for key in AGAINST_SIMULATION if key in shown]
    kinds = [f"a {kind}" if kind.startswith("wrong") else kind for kind in kinds]
    return f"it shows {' and '.join(kinds)}" if kinds else ""


def is_worse(ratio: Ratio) -> bool:
    """Whether an error is larger than another by more than is tolerated and than chance makes.

    Where one or two stretches give no interval, the difference itself has to do.
    """
    return ratio.value > TOLERATED and not ratio.could_be_chance


def error_ratio(
    a: CrossValidation, b: CrossValidation, level: float = 0.05, error: str = "total_in_band"
) -> Ratio:
    """Held-out error of a over that of b, in the motion's band, with an interval.

    ``level``: chance of a ratio outside of it; smaller where it is one of many comparisons;
    ``error``: which error of a `PredictionError`.

    The interval is Student's, from the logarithms of the stretches' ratios; blocks of one motion
    have their easy and hard parts in common, which the ratio takes out.
    """
    logs = [
        np.log(getattr(x.prediction, error) / getattr(y.prediction, error))
        for x, y in zip(a.held_out, b.held_out, strict=False)
        if x.prediction is not None and y.prediction is not None
    ]
    value = getattr(a.prediction, error) / getattr(b.prediction, error)
    if len(logs) < MIN_STRETCHES:
        return Ratio(value, np.nan, np.nan)
    reach = student.isf(0.5 * level, len(logs) - 1) * np.std(logs, ddof=1) / np.sqrt(len(logs))
    return Ratio(value, float(value * np.exp(-reach)), float(value * np.exp(reach)))


def likely_causes(piv: CrossValidation, iv: CrossValidation) -> list[str]:
    """Why the prefilter may be at fault, the most likely cause first."""
    found, causes = piv.identification, []
    if not found.converged:
        causes.append(f"It has not converged in {found.iterations} iterations.")
    split = model_error_by_held_out_blocks(iv)
    if split.mostly_model_error:
        causes.append(
            f"Likely cause: at most {100 * split.noise_share:.0f} % of the error variance in the "
            "motion's band is noise, the rest is model error; a prefilter that treats it as noise "
            "gives weight to the samples and frequencies where the model is wrong."
        )
    if found.options.get("mask") in (None, 0, 0.0):
        causes.append("No low-speed mask was used, and static friction laws are wrong there.")
    bound = [j.name for j in found.joints if j.ar_at_bound]
    if bound:
        causes.append(
            f"The order of the noise model is at its bound for {', '.join(bound)}; raise p_max."
        )
    negative = negative_parameters(found.parameters, found.names, found.theta, found.std)
    if negative:
        values = ", ".join(map(str, negative))
        causes.append(f"It has negative friction or rotor inertia: {values} (2σ).")
    if apart := _contradictions(found, iv.identification):
        causes.append(apart)
    return causes


def _contradictions(a: Identification, b: Identification) -> str:
    """The parameters in which two estimates differ most, in their standard errors."""
    distance = np.abs(a.theta - b.theta) / np.maximum(np.hypot(a.free_std, b.free_std), 1e-300)
    most = [k for k in np.argsort(-distance)[:3] if distance[k] > CONTRADICTION]
    if not most:
        return ""
    listed = ", ".join(
        f"{a.names[k]} ({format_significant(a.theta[k])} against {format_significant(b.theta[k])} "
        f"{a.units[k]}, {distance[k]:.1f} σ)"
        for k in most
    )
    return f"The two differ most in {listed}."


def prefixed(say: Callable[[str], None], label: str) -> Callable[[str], None]:
    """Progress lines that say whose they are.

    Args:
        say: called with one line at each stage.
        label: whose.
    """
    return lambda line: say(line if line.startswith(label) else f"{label}: {line}")
