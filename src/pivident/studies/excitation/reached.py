"""What a designed motion promised beside what its record gave, as numbers and in words.

A design predicts the standard error of every parameter. The record of the motion gives others if
its noise is not that of the prediction, if the model has errors, or if the robot moved otherwise.
What was known before the motion is left out of the prediction where the estimate does not use it.

Predicted beside reached standard errors, in words and as a table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.estimation.identification import Identification
from pivident.foundation.document.document import Accounted, Document, Part
from pivident.foundation.document.table import Column, Table
from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.plain_values import plain
from pivident.foundation.text.sentences import listed
from pivident.studies.excitation.design import Design
from pivident.studies.excitation.design_file import load_design
from pivident.studies.excitation.followed_motion import ANOTHER, FollowedMotion, followed_motion

#: Ratios of reached to predicted standard errors up to this, or down to its inverse, are called as
#: predicted.
AS_PREDICTED = 1.15
#: How many of the parameters that were predicted worst are named.
NAMED = 3
#: Width of a line, in characters.
WIDTH = 100
#: A motion of which this share was recorded is complete; the rest may be rest at its ends.
COMPLETE = 0.95
#: Other motion in a record is reported from this duration on [s].
MIN_OTHER = 0.5


@dataclass(frozen=True)
class ReachedError:
    """Predicted and reached standard error of one parameter.

    Attributes:
        name: of the parameter.
        unit: of its value.
        joint: the joint whose torque it belongs to.
        predicted: standard error that the design predicts, infinite where it determines nothing.
        reached: standard error of the estimate.
    """

    name: str
    unit: str
    joint: str
    predicted: float
    reached: float

    @property
    def ratio(self) -> float:
        """Reached over predicted; NaN where one of them is no positive number."""
        known = 0.0 < self.predicted < math.inf and 0.0 < self.reached < math.inf
        return self.reached / self.predicted if known else math.nan


@dataclass(frozen=True, eq=False)
class ReachedErrors(Accounted):
    """Standard errors that a design predicts, beside those of the estimate from its record.

    Attributes:
        file: file of the design.
        method: method of the estimate.
        noise: noise that the prediction rests on, one sentence.
        followed: the recordings that were compared with the designed motion.
        errors: one entry for each parameter that both have; empty where they are not compared.
        with_earlier: whether earlier records count, in the prediction and in the estimate.
        reason: why they are not compared, one sentence; empty where they are.
    """

    file: Path
    method: str
    noise: str = ""
    followed: tuple[FollowedMotion, ...] = ()
    errors: tuple[ReachedError, ...] = ()
    with_earlier: bool = False
    reason: str = ""

    @property
    def compared(self) -> tuple[ReachedError, ...]:
        """Parameters with both standard errors, those that were predicted worst first."""
        known = [e for e in self.errors if math.isfinite(e.ratio)]
        return tuple(sorted(known, key=lambda e: -e.ratio))

    @property
    def ratio(self) -> float:
        """Geometric mean of reached over predicted; NaN where nothing is compared."""
        return _geometric_mean([e.ratio for e in self.compared])

    @property
    def ratio_by_joint(self) -> dict[str, float]:
        """The same over the parameters of each joint, which its noise scales."""
        joints: dict[str, list[float]] = {}
        for error in self.errors:
            if math.isfinite(error.ratio):
                joints.setdefault(error.joint, []).append(error.ratio)
        return {joint: _geometric_mean(ratios) for joint, ratios in joints.items()}

    @property
    def heading(self) -> str:
        """What is compared, without a full stop."""
        return f"Standard errors predicted by {self.file.name} and reached by {self.method}"

    def table(self) -> Table:
        """One row for each parameter."""
        numbers = np.array([(e.predicted, e.reached, e.ratio) for e in self.errors]).reshape(-1, 3)
        columns = {
            "parameter": Column([e.name for e in self.errors]),
            "predicted": Column(numbers[:, 0], "σ predicted", digits=3),
            "reached": Column(numbers[:, 1], "σ reached", digits=3),
            "ratio": Column(numbers[:, 2], "reached/predicted", digits=3),
            "unit": Column([e.unit for e in self.errors]),
        }
        return Table("errors", columns, title=self.heading)

    def account(self) -> Document:
        """The standard errors side by side, and what they say."""
        tables = [self.table()] if self.errors else []
        text = " ".join([f"{self.heading}.", *sentences(self)])
        return Document(self.heading, [Part("Designed motion", [*tables, text])])

    def __str__(self) -> str:
        tables = [self.table().text()] if self.errors else []
        lines = [line for text in sentences(self) for line in wrap(text, WIDTH)]
        return escaped("\n".join([self.heading, *tables, *lines]))

    def to_values(self) -> dict[str, Any]:
        """Plain values for a file; numbers that are not finite are None."""
        return {
            "design": str(self.file),
            "method": self.method,
            "noise": self.noise,
            "reason": self.reason,
            "with_earlier": self.with_earlier,
            "ratio": plain(self.ratio),
            "ratio_by_joint": plain(self.ratio_by_joint),
            "recordings": [plain(f) | {"is_same": f.is_same} for f in self.followed],
            "parameters": [plain(e) | {"ratio": plain(e.ratio)} for e in self.errors],
        }


def reached_errors(
    files: Sequence[Path | None], recordings: Sequence[Recording], result: Identification
) -> tuple[ReachedErrors, ...]:
    """Predicted and reached standard errors of every design that recordings follow.

    Args:
        files: file of the design of each recording, None for one without.
        recordings: the recordings that the result was estimated from.
        result: the estimate.

    Returns:
        One entry for each design, which says why where it is not compared.

    Raises:
        DesignFileError: a file is no design, or it is damaged.
    """
    found = []
    for file in dict.fromkeys(f for f in files if f is not None):
        own = [r for f, r in zip(files, recordings, strict=True) if f == file]
        found.append(_of_design(load_design(file), file, own, len(recordings) - len(own), result))
    return tuple(found)


def _of_design(
    design: Design, file: Path, own: Sequence[Recording], others: int, result: Identification
) -> ReachedErrors:
    """One design beside the estimate."""
    made = ReachedErrors(file, result.method, design.noise)
    if reason := _foreign(design, result):
        return replace(made, reason=reason)
    made = replace(
        made,
        followed=tuple(followed_motion(in_order_of(design.robot, r), design.motion) for r in own),
    )
    different = [f.recording for f in made.followed if not f.is_same]
    if different:
        return replace(made, reason=other_motion(made.followed, different))
    runs = sum(len(f.starts) for f in made.followed)
    earlier = any(math.isfinite(p.before) for p in design.predicted)
    if others and not (earlier and runs == 1):
        return replace(
            made,
            reason=(
                f"The estimate uses {others} more {'recording' if others == 1 else 'recordings'}, "
                "which the prediction does not know of; identify the record of this motion alone "
                "to compare."
            ),
        )
    return replace(
        made, with_earlier=bool(others), errors=_errors(design, result, runs, bool(others))
    )


def _foreign(design: Design, result: Identification) -> str:
    """Why a design and a result do not belong together, empty where they do."""
    if design.robot.joint_names != result.robot.joint_names:
        return (
            f"The design is for another robot, with the joints {listed(design.robot.joint_names)}; "
            f"this one has {listed(result.robot.joint_names)}."
        )
    predicted = [p.name for p in design.predicted]
    if unknown := [
        name for name in predicted if name not in set(base_parameters(design.robot).names)
    ]:
        return (
            f"The design asks for {listed(unknown)}, from two runs of the motion; one record does "
            "not show them."
        )
    if foreign := [name for name in result.names if name not in set(predicted)]:
        return (
            "The design is for a robot with other parameters: it predicts nothing of "
            f"{listed(foreign)}."
        )
    return ""


def other_motion(followed: Sequence[FollowedMotion], different: Sequence[str]) -> str:
    """That a record holds another motion, with its numbers.

    Args:
        followed: the recordings beside the designed motion.
        different: names of those that hold another one.
    """
    worst = max((f for f in followed if not f.is_same), key=lambda f: float(np.median(f.share)))
    names = f"The recording {different[0]}" if len(different) == 1 else listed(list(different))
    verb = "holds" if len(different) == 1 else "hold"
    if np.median(worst.share) <= ANOTHER:
        return (
            f"{names} {verb} {100 * worst.covered:.0f} % of the designed motion; its standard "
            "errors are not compared."
        )
    return (
        f"{names} {verb} another motion than the design: where it fits best, the positions differ "
        f"by {100 * float(np.median(worst.share)):.0f} % of the rms of the motion (median of the "
        "joints); standard errors are not compared."
    )


def _errors(
    design: Design, result: Identification, runs: int, with_earlier: bool
) -> tuple[ReachedError, ...]:
    """Both standard errors of each parameter; of several runs each adds its information."""
    predicted = {p.name: p.std if with_earlier else p.alone for p in design.predicted}
    return tuple(
        ReachedError(
            name,
            parameter.unit,
            result.robot.tree.joint_names[parameter.joint],
            predicted[name] / math.sqrt(runs),
            float(reached),
        )
        for name, parameter, reached in zip(
            result.names, result.parameters, result.std, strict=True
        )
    )


def _geometric_mean(ratios: Sequence[float]) -> float:
    """NaN of nothing."""
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else math.nan


def sentences(found: ReachedErrors) -> list[str]:
    """What the comparison says: how well it was predicted, by joint, and what motion was run.

    Args:
        found: predicted and reached standard errors.
    """
    if found.reason:
        return [found.reason, *_deviations(found)]
    return [*_prediction(found), *_deviations(found)]


def _prediction(found: ReachedErrors) -> Iterator[str]:
    """How well standard errors were predicted."""
    compared = found.compared
    if compared:
        ratio, many = found.ratio, f"geometric mean of {len(compared)} parameters"
        words = f"{format_significant(ratio)} times the predicted ones, {many}"
        if ratio > AS_PREDICTED:
            yield f"The standard errors are larger than predicted: {words}."
        elif ratio < 1.0 / AS_PREDICTED:
            yield f"The standard errors are smaller than predicted: {words}."
        else:
            yield f"The standard errors are as predicted: {words}."
        if worst := [e for e in compared if e.ratio > AS_PREDICTED * max(1.0, ratio)][:NAMED]:
            named = ", ".join(f"{e.name} {format_significant(e.ratio)}" for e in worst)
            yield f"Furthest from their prediction: {named} times as large."
        by_joint = found.ratio_by_joint
        if len(by_joint) > 1:
            named = ", ".join(f"{j} {format_significant(r)}" for j, r in by_joint.items())
            yield f"By joint: {named}."
        if larger := [j for j, r in by_joint.items() if r > AS_PREDICTED]:
            yield (
                f"Noise or model error is larger than the design assumed on {listed(larger)}. "
                f"{found.noise}"
            )
        elif ratio < 1.0 / AS_PREDICTED:
            yield f"The noise is smaller than the design assumed. {found.noise}"
    else:
        yield "No parameter has both standard errors."
    new = [e.name for e in found.errors if math.isinf(e.predicted) and math.isfinite(e.reached)]
    if new:
        yield f"Estimated, although the design predicted nothing: {listed(new)}."
    if found.with_earlier:
        yield "The earlier recordings count on both sides."


def _deviations(found: ReachedErrors) -> Iterator[str]:
    """How the recorded motions differ from the designed one."""
    for followed in found.followed:
        if followed.is_same:
            yield from followed_sentences(followed)


def followed_sentences(followed: FollowedMotion) -> Iterator[str]:
    """How a recorded motion differs from the designed one, which it is.

    Args:
        followed: the recording beside the design.
    """
    yield _followed(followed)
    yield from _more_or_less(followed)


def _followed(followed: FollowedMotion) -> str:
    """That the robot ran the motion, and which joints deviate."""
    times = len(followed.starts)
    ran = "followed the design" + (f" {times} times" if times > 1 else "")
    largest = int(np.argmax(followed.share))
    if deviating := followed.deviating:
        return (
            f"{followed.recording} {ran}, but {listed(deviating)} deviate"
            f"{'s' if len(deviating) == 1 else ''}: {followed.joint_names[largest]} by "
            f"{100 * followed.share[largest]:.0f} % of the rms of its motion. What was predicted "
            "holds for the motion as designed."
        )
    return (
        f"{followed.recording} {ran}: positions differ by at most "
        f"{format_significant(100 * followed.share[largest], 2)} % of the rms of the motion "
        f"({followed.joint_names[largest]})."
    )


def _more_or_less(followed: FollowedMotion) -> Iterator[str]:
    """Parts of the motion that are missing, and motion that is not of the design."""
    if followed.covered < COMPLETE:
        yield (
            f"Only {100 * followed.covered:.0f} % of the motion was recorded, so that standard "
            "errors must be larger than predicted."
        )
    if followed.other > MIN_OTHER:
        yield (
            f"The record also holds {format_significant(followed.other)} s of other motion, which "
            "the prediction does not know of."
        )
