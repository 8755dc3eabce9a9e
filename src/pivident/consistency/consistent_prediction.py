"""Cost of physical consistency on held-out motion.

Each held-out block has an estimate from the other blocks. It is made consistent by itself, and
both estimates, free and consistent, predict the block. What the parameters that were not estimated
would do to the torque is taken from the sums of the whole record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.identification import Identification
from pivident.estimation.torque_sums import torque_sums
from pivident.recording.recording import Recording
from pivident.validation.held_out.cross_validation import CrossValidation, HeldOut
from pivident.validation.held_out.prediction import Judge, PredictionError, pooled

if TYPE_CHECKING:
    from pivident.consistency.consistent_model import ConsistentModel


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
        consistent += judge.score(model, [_span(stretch, judge.recording)])
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


def _span(stretch: HeldOut, recording: Recording) -> slice:
    """Samples of a stretch in its recording."""
    start, stop = (
        int(np.rint((time - recording.start_time) * recording.rate))
        for time in (stretch.start, stretch.stop)
    )
    return slice(start, stop)
