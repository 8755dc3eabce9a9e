"""Several methods on the same held-out motion: which estimate to take?

PIV has the right intervals where its noise model is right. On a real machine the residual is mostly
model error, and a prefilter made for noise can weigh the wrong samples and frequencies; then PIV
predicts worse than plain IV, and IV's estimate is the one to take. Blocks of one motion differ by
chance, too: a difference counts only if its interval does not contain zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.signs import negative_parameters
from pivident.errors import ExperimentError, IdentificationError
from pivident.estimation.identification import Identification
from pivident.estimation.methods import (
    METHODS,
    InstrumentalVariables,
    Method,
    PrefilteredIV,
)
from pivident.estimation.parameter_rows import CONTRADICTION
from pivident.estimation.problem import Problem
from pivident.recording.recording import Recording
from pivident.text.numbers import format_significant
from pivident.text.plain_table import plain_table
from pivident.validation.held_out.cross_validation import CrossValidation, judged_on
from pivident.validation.held_out.judged_motion import JudgedMotion
from pivident.validation.residuals.model_error import model_error_by_held_out_blocks

#: PIV may predict so much worse than IV before IV is the one to take.
TOLERATED = 1.02

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
        return f"{100 * (self.low - 1):+.1f} to {100 * (self.high - 1):+.1f} %"

    def __str__(self) -> str:
        text = f"{100 * (self.value - 1):+.1f} %"
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
        return "\n\n".join([self.table(), *self.sentences()])

    def table(self) -> str:
        """One line for each method."""
        rows = self.results.values()
        band = next(iter(rows)).prediction.band
        stretches = len(next(iter(rows)).held_out)
        columns: list[tuple[str, str, list[str]]] = [
            ("method", "<", [self._label(name) for name in self.results]),
            (f"error % < {band:g} Hz", ".", [f"{r.prediction.total_in_band:.2f}" for r in rows]),
            ("all", ".", [f"{r.prediction.total:.2f}" for r in rows]),
            (f"fitted < {band:g} Hz", ".", [f"{r.training.total_in_band:.2f}" for r in rows]),
            ("replay %", ".", ["–" if r.replay is None else f"{r.replay.total:.2f}" for r in rows]),
        ]
        for k in range(stretches if stretches > 1 else 0):
            cells = []
            for r in rows:
                error = r.held_out[k].prediction if k < len(r.held_out) else None
                cells.append("–" if error is None else f"{error.total_in_band:.2f}")
            columns.append((f"#{k + 1}", ".", cells))
        return plain_table(columns)

    def joint_table(self) -> str:
        """One line for each joint: the error of each method below the motion's highest frequency.

        Rms values are those of the recommended method, whose largest relative error is marked.
        """
        e = self.results[self.recommended].prediction
        worst = int(np.argmax(e.relative_in_band))
        columns: list[tuple[str, str, list[str]]] = [
            ("joint", "<", list(e.joint_names)),
            (f"torque rms < {e.band:g} Hz", ".", [format_significant(x) for x in e.torque_in_band]),
            ("error rms", ".", [format_significant(x) for x in e.rms_in_band]),
            ("unit", "<", list(e.units)),
        ]
        for name, judged in self.results.items():
            cells = [format_significant(x) for x in judged.prediction.relative_in_band]
            columns.append((f"{self._label(name)} %", ".", cells))
        marks = ["largest" if j == worst else "" for j in range(len(e.joint_names))]
        return plain_table([*columns, ("", "<", marks)])

    def joint_heading(self) -> str:
        """What the table by joint shows."""
        taken = self.results[self.recommended]
        return (
            f"Torque error of each joint on {taken.where}, below {taken.prediction.band:g} Hz "
            f"(rms: {self._label(self.recommended)}):"
        )

    def sentences(self) -> list[str]:
        """Which estimate to take and why, with the ratio of the errors."""
        return [*self._warning(), *self.ratio_lines(), *self._advice()]

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
        first = next(iter(self.results.values()))
        return [first.warning] if self.training_only else []

    def _advice(self) -> list[str]:
        lines = []
        taken = self._label(self.recommended)
        if self.piv_over_iv is not None:
            piv, iv = self._label(self.piv), self._label(self.iv)
            if self.piv_is_worse:
                lines.append(
                    f"{piv} predicts worse than {iv} by more than "
                    f"{100 * (TOLERATED - 1):.0f} %: take the estimate of {taken}. "
                    + " ".join(self.causes)
                )
            elif self.undecided:
                lines.append(
                    f"{piv} and {iv} show no difference within {self.piv_over_iv.range} (95 %, "
                    f"from the scatter of the held-out blocks): take the estimate of {taken}, "
                    "whose intervals are better founded."
                    + (f" {self.apart} More motion or more folds would decide." * bool(self.apart))
                )
            else:
                lines.append(
                    f"{piv} predicts as well as {iv} to within {100 * (TOLERATED - 1):.0f} % or "
                    f"better: take the estimate of {taken}, whose intervals are better founded."
                )
        elif self.best == self.recommended:
            lines.append(f"Smallest held-out torque error: {taken}.")
        else:
            lines.append(
                f"Take the estimate of {taken}: its regressors may share noise with the residual."
            )
        best = self.results[self.best]
        if self.best != self.recommended:
            lines.append(
                f"{self._label(self.best)} has the smallest error, "
                f"{best.prediction.total_in_band:.2f} %. A small prediction error does not show "
                "that parameters are free of bias."
            )
        lines += [f"{name} failed: {text}" for name, text in self.failures.items()]
        return lines


def compare_out_of_sample(
    problem: Problem,
    methods: Sequence[str] | Mapping[str, Method] = ("ls", "iv", "iv-full-rate", "piv"),
    *,
    folds: int = 5,
    gap: float | None = None,
    recording: Recording | Sequence[Recording] | None = None,
    identifications: Mapping[str, Identification] | None = None,
    progress: Callable[[str], None] | None = None,
) -> OutOfSample:
    """Cross-validate several methods on the same stretches and say which estimate to take.

    ``gap``: left out on either side of a block [s].
    """
    chosen = dict(methods) if isinstance(methods, Mapping) else {m: METHODS[m] for m in methods}
    if not chosen:
        raise ExperimentError("no method to compare; name at least one, such as 'piv'")
    say = progress or (lambda line: None)
    results: dict[str, CrossValidation] = {}
    failures: dict[str, str] = {}
    say("smoothing the held-out motion")
    motion = JudgedMotion.of(problem, recording)
    for name, method in chosen.items():
        known = (identifications or {}).get(name)
        try:
            results[name] = judged_on(
                motion, method, folds, gap, known, _prefixed(say, method.label)
            )
        except IdentificationError as error:
            failures[name] = str(error)
    if not results:
        raise IdentificationError(
            f"none of the methods could be judged; {next(iter(chosen))} fails with: "
            f"{next(iter(failures.values()))}"
        )
    return _judged(chosen, results, failures)


def _judged(
    methods: Mapping[str, Method],
    results: dict[str, CrossValidation],
    failures: dict[str, str],
) -> OutOfSample:
    """Best, recommended, and why."""
    error = {name: r.prediction.total_in_band for name, r in results.items()}
    best = min(error, key=error.__getitem__)

    def smallest(kind: type) -> str:
        names = [
            n
            for n in results
            if isinstance(methods[n], kind) and not getattr(methods[n], "as_printed", False)
        ]
        return min(names, key=error.__getitem__, default="")

    piv, iv = smallest(PrefilteredIV), smallest(InstrumentalVariables)
    if not (piv and iv):
        return OutOfSample(results, failures, best, piv or iv or best, piv, iv)
    ratio = error_ratio(results[piv], results[iv])
    worse = is_worse(ratio)
    causes = tuple(likely_causes(results[piv], results[iv])) if worse else ()
    apart = _contradictions(results[piv].identification, results[iv].identification)
    return OutOfSample(results, failures, best, iv if worse else piv, piv, iv, ratio, causes, apart)


def is_worse(ratio: Ratio) -> bool:
    """Whether an error is larger than another by more than is tolerated and than chance makes.

    Where one or two stretches give no interval, the difference itself has to do.
    """
    return ratio.value > TOLERATED and not ratio.could_be_chance


def error_ratio(a: CrossValidation, b: CrossValidation) -> Ratio:
    """Held-out error of a over that of b, in the motion's band, with an interval.

    The interval is Student's, from the logarithms of the stretches' ratios; blocks of one motion
    have their easy and hard parts in common, which the ratio takes out.
    """
    from scipy.stats import t as student

    logs = [
        np.log(x.prediction.total_in_band / y.prediction.total_in_band)
        for x, y in zip(a.held_out, b.held_out, strict=False)
        if x.prediction is not None and y.prediction is not None
    ]
    value = a.prediction.total_in_band / b.prediction.total_in_band
    if len(logs) < MIN_STRETCHES:
        return Ratio(value, np.nan, np.nan)
    reach = student.ppf(0.975, len(logs) - 1) * np.std(logs, ddof=1) / np.sqrt(len(logs))
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
    """The parameters in which two estimates differ most, by robust standard errors."""
    spread = np.hypot(a.robust_std, b.robust_std)
    distance = np.abs(a.theta - b.theta) / np.maximum(spread, 1e-300)
    most = [k for k in np.argsort(-distance)[:3] if distance[k] > CONTRADICTION]
    if not most:
        return ""
    listed = ", ".join(
        f"{a.names[k]} ({format_significant(a.theta[k])} against {format_significant(b.theta[k])} "
        f"{a.units[k]}, {distance[k]:.1f} σ)"
        for k in most
    )
    return f"The two differ most in {listed}."


def _prefixed(say: Callable[[str], None], label: str) -> Callable[[str], None]:
    """Progress lines that say whose they are."""
    return lambda line: say(line if line.startswith(label) else f"{label}: {line}")
