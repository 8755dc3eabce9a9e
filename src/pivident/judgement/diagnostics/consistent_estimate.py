"""A physically consistent estimate with its intervals, tables and sentences.

What it costs on held-out motion: each held-out block has an estimate from the other blocks. It is
made consistent by itself, and both estimates, free and consistent, predict the block. What the
parameters that were not estimated would do to the torque is taken from the sums of the whole
record.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification, torque_sums
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import Attempts, IdentificationError, in_words
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.sentences import capital
from pivident.judgement.validation.held_out.cross_validation import CrossValidation
from pivident.judgement.validation.held_out.out_of_sample import OutOfSample
from pivident.judgement.validation.held_out.prediction import Judge, PredictionError, pooled
from pivident.models.consistency.consistent_model import ConsistentModel
from pivident.models.consistency.link_quantities import LinkRow, ends_text, link_table
from pivident.models.consistency.metric import HALF_INTERVAL
from pivident.models.consistency.options import ConsistencyOptions, consistent_label
from pivident.models.consistency.profile_intervals import ProfileIntervals, not_found_sentence


@dataclass(frozen=True, eq=False)
class ConsistentPrediction:
    """Torque errors of free and consistent estimates on the same held-out stretches."""

    free: PredictionError  # of the free estimates
    consistent: PredictionError  # of the same estimates made consistent
    stretches: int  # number of stretches
    # stretches whose estimate could not be made consistent, with the reason
    failures: tuple[str, ...] = ()

    @property
    def cost(self) -> float:
        """Relative growth of the error below the motion's highest frequency, -1 to ∞."""
        return self.consistent.total_in_band / max(self.free.total_in_band, 1e-300) - 1.0

    def __str__(self) -> str:
        text = (
            f"torque error on {self.stretches} held-out stretches, below {self.free.band:g} Hz: "
            f"{self.free.total_in_band:.3g} % free, {self.consistent.total_in_band:.3g} % "
            f"consistent (relative change {100 * self.cost:+.2g} %)"
        )
        if self.failures:
            text += f"; {len(self.failures)} more could not be made consistent"
        return text


def consistent_prediction(
    validation: CrossValidation,
    recordings: Sequence[Recording],
    make_consistent: Callable[[Identification], ConsistentModel],
) -> ConsistentPrediction | None:
    """Errors of free and consistent estimates on the stretches of a cross-validation.

    Its estimates are reused. None if nothing was held out, or none could be made consistent.
    """
    if validation.training_only:
        return None
    whole = validation.identification
    sums = torque_sums(whole) if whole.recordings else whole.torque_sums
    judges: dict[str, Judge] = {}
    models: dict[int, ConsistentModel | str] = {}
    free: list[PredictionError] = []
    consistent: list[PredictionError] = []
    failures = []
    for stretch in validation.held_out:
        if stretch.identification is None or stretch.prediction is None:
            continue
        key = id(stretch.identification)
        if key not in models:
            models[key] = _made(replace(stretch.identification, torque_sums=sums), make_consistent)
        model = models[key]
        if isinstance(model, str):
            failures.append(f"{stretch.recording}, {stretch.start:.2f} s: {model}")
            continue
        if stretch.recording not in judges:
            recording = next(r for r in recordings if r.name == stretch.recording)
            judges[stretch.recording] = Judge(recording, stretch.prediction.band)
        judge = judges[stretch.recording]
        consistent += judge.score(model, [stretch.span(judge.recording)])
        free.append(stretch.prediction)
    if not free:
        return None
    return ConsistentPrediction(pooled(free), pooled(consistent), len(free), tuple(failures))


def _made(
    found: Identification, make_consistent: Callable[[Identification], ConsistentModel]
) -> ConsistentModel | str:
    """The consistent model, or the reason why there is none."""
    try:
        return make_consistent(found)
    except IdentificationError as error:
        return str(error)


#: Confidence of all intervals.
CONFIDENCE = 0.95

#: Parameters that moved by less are not listed [σ].
LISTED_MOVE = 0.05

#: Constraints with a smaller share of the distance are not listed.
LISTED_SHARE = 0.005


@dataclass(frozen=True, eq=False)
class ConsistentEstimate:
    """An estimate made consistent."""

    label: str  # name in tables, ``PC-IDIM-PIV``
    model: ConsistentModel  # the consistent parameters
    base: ProfileIntervals  # intervals of the estimated base parameters
    standard: ProfileIntervals  # intervals of all standard parameters
    links: tuple[LinkRow, ...]  # the links as bodies, with intervals
    options: ConsistencyOptions  # of the stage
    # torque errors on held-out motion, free and consistent; None without any
    prediction: ConsistentPrediction | None = None

    def headline(self) -> str:
        """The result in one line."""
        model = self.model
        text = (
            "the free estimate is consistent as it is"
            if model.was_consistent
            else f"{format_significant(model.distance)} σ from the free estimate, "
            f"{format_significant(model.least_distance)} σ at least"
        )
        return f"{self.label}: {text} ({1e3 * model.seconds:.0f} ms)"

    def sentences(self) -> list[str]:
        """The result, its cost in torque error, and notes."""
        lines = [self.model.headline()]
        if self.prediction is not None:
            lines += [
                f"{capital(str(self.prediction))}.",
                *(f"Not consistent: {failure}." for failure in self.prediction.failures),
            ]
        lines += [f"{note.rstrip('.')}." for note in self.model.notes]
        if missing := self.not_found():
            lines.append(not_found_sentence(missing))
        return lines

    def not_found(self) -> tuple[str, ...]:
        """Quantities whose interval has an end that the solver did not find."""
        names = [*self.base.not_found, *self.standard.not_found]
        names += [
            f"the {title} of {row.name}"
            for row in self.links
            for title, own in (
                ("mass", (row.mass,)),
                ("centre of mass", row.center_of_mass),
                ("principal moments", row.moments),
            )
            if any(math.isnan(end) for q in own for end in (q.low, q.high))
        ]
        return tuple(dict.fromkeys(names))

    def held_back(self) -> list[str]:
        """Active constraints, the most expensive first."""
        return [str(a) for a in self.model.active if a.share >= LISTED_SHARE]

    def link_table(self) -> Table:
        """The links with their intervals."""
        return link_table(self.model.links, self.links)

    def moved_table(self) -> Table:
        """Base parameters that moved, the farthest first; no row if the estimate was consistent."""
        model, free = self.model, self.model.free
        order = np.argsort(-np.abs(model.moved), kind="stable")
        rows = order[np.abs(model.moved[order]) >= LISTED_MOVE][
            : 0 if model.was_consistent else None
        ]
        intervals = [ends_text(self.base.low[k], self.base.high[k]) for k in rows]
        moved = model.moved[rows]
        columns = {
            "parameter": Column([model.names[k] for k in rows]),
            "free": Column(
                free.theta[rows],
                spread=HALF_INTERVAL * free.std[rows],
                spread_title=f"±{HALF_INTERVAL:g}σ",
            ),
            "consistent": Column(model.theta[rows], digits=4),
            "interval": Column(intervals, f"{CONFIDENCE:.0%} interval"),
            "moved_sigmas": Column(moved, "moved [σ]", cells=[f"{x:+.2f}" for x in moved]),
            "unit": Column([free.units[k] for k in rows]),
        }
        return Table("moved", columns, title="Parameters that moved")

    def __str__(self) -> str:
        parts = ["\n".join([self.label, *(f"  {line}" for line in self.sentences())])]
        parts.append(self.link_table().text())
        if moved := self.moved_table():
            parts.append(moved.text())
        if held_back := self.held_back():
            parts.append("\n".join(["Held back by", *(f"  {line}" for line in held_back)]))
        return "\n\n".join(parts)


@dataclass(frozen=True)
class NoConsistentEstimate:
    """An estimate that could not be made consistent."""

    label: str  # name in tables, ``PC-IDIM-PIV``
    reason: str  # why, with the next step

    def headline(self) -> str:
        """The reason in one line."""
        return f"{self.label}: {self.reason}"


def consistent_estimate(
    free: Identification,
    options: ConsistencyOptions,
    progress: Callable[[str], None] | None = None,
) -> ConsistentEstimate:
    """Make an estimate consistent, with intervals of parameters and links."""
    from pivident.models.consistency.link_intervals import link_rows

    say = progress or (lambda line: None)
    label = consistent_label(free.method)
    say(f"{label}: nearest consistent parameters")
    model = options.make_consistent(free)
    say(f"{label}: intervals of {len(model.parameters)} parameters and {len(model.links)} links")
    return ConsistentEstimate(
        label,
        model,
        model.intervals(CONFIDENCE, of="estimated"),
        model.intervals(CONFIDENCE, of="standard"),
        link_rows(model, CONFIDENCE),
        options,
    )


def consistent_estimates(
    free_estimates: Mapping[str, Identification],
    judged: OutOfSample | None,
    names: Sequence[str],
    options: ConsistencyOptions,
    recordings: Sequence[Recording],
    progress: Callable[[str], None] | None = None,
    attempts: Attempts | None = None,
) -> Mapping[str, ConsistentEstimate | NoConsistentEstimate]:
    """Make several estimates consistent, and evaluate them on held-out motion."""
    say, own = progress or (lambda line: None), Attempts()
    attempts = attempts or Attempts()
    made: dict[str, ConsistentEstimate | NoConsistentEstimate] = {}
    # A poor fit of one block is kept: without it the comparison would be too favourable.
    every = replace(options, accept_far=True)
    for name in names:
        label = consistent_label(free_estimates[name].method)
        found = own.of(label, consistent_estimate, free_estimates[name], options, say)
        if found is None:
            made[name] = NoConsistentEstimate(label, in_words(own.errors[-1]))
            continue
        if judged is not None and name in judged.results:
            say(f"{label}: held-out motion")
            prediction = attempts.of(
                f"{label} was not judged on held-out motion",
                consistent_prediction, judged.results[name], recordings, every.make_consistent,
            )  # fmt: skip
            found = replace(found, prediction=prediction)
        made[name] = found
    return made
