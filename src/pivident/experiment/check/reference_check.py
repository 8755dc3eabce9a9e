"""The reference against the log: whether it is one, of the same joints, in the same unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.data.logs.log import Log
from pivident.experiment.check.remark import usable_rows
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import Reordered, Repair, Reversed, in_unit

#: What this check looks at, and the columns of the reference.
REFERENCE, COLUMNS = Topic("reference"), ("recording", "columns", "q_ref")

COPY = FindingKind(REFERENCE, "copy", COLUMNS)
CONSTANT = FindingKind(REFERENCE, "constant", COLUMNS)
OFFSET = FindingKind(REFERENCE, "offset", COLUMNS)
ORDER = FindingKind(REFERENCE, "order", COLUMNS)
UNIT = FindingKind(REFERENCE, "unit", ("recording", "units", "q_ref"))
SPEED = FindingKind(REFERENCE, "speed")
FAR = FindingKind(REFERENCE, "far", COLUMNS)

#: Distance between reference and position, relative to the motion, that is plausible.
CLOSE = 0.25

#: Share of the variance that another reading of the reference must explain.
ALIKE = 0.97

#: Travel below which a joint's reference is not judged [rad or m].
MOTION = 0.05


def check_reference(log: Log) -> list[Finding]:
    """Whether the reference is one: of the same joints, in the same unit, before the position."""
    if "q_ref" not in log.channels or "q" not in log.channels:
        return []
    q, q_ref = log.channels["q"], log.channels["q_ref"]
    if q.shape != q_ref.shape:
        return []
    rows = usable_rows(q, q_ref)
    if len(rows) < 50:
        return []
    return [*_reference(log, q[rows], q_ref[rows])]


def _reference(log: Log, q: np.ndarray, q_ref: np.ndarray) -> Iterator[Finding]:
    names = log.joint_names
    distance = np.std(q_ref - q, axis=0) / np.maximum(np.std(q, axis=0), 1e-12)
    copies = [names[j] for j in range(q.shape[1]) if np.array_equal(q[:, j], q_ref[:, j])]
    if copies:
        text = f"The reference of {', '.join(copies)} is the measured position itself."
        advice = (
            "Name the column of the setpoint; without one leave q_ref out and set "
            'reference = "reconstruct".'
        )
        yield COPY.finding("error", text, copies[0], advice)
        return
    for j, name in enumerate(names[: q.shape[1]]):
        if np.std(q_ref[:, j]) == 0 and np.std(q[:, j]) > 0:
            text = f"The reference of {name} never changes, but {name} moves."
            advice = "Name the column of this joint's setpoint."
            yield CONSTANT.finding("error", text, name, advice)
            return
    far = [j for j in range(q.shape[1]) if distance[j] > CLOSE and np.ptp(q[:, j]) > MOTION]
    if not far:
        moving = np.ptp(q, axis=0) > MOTION
        apart = moving * np.abs(np.mean(q_ref - q, axis=0)) / np.maximum(np.ptp(q, axis=0), MOTION)
        for j in np.flatnonzero(apart > 0.1).tolist():
            offset = Quantity(float(np.mean(q_ref - q, axis=0)[j]), log.position_unit(j))
            yield OFFSET.finding(
                "warning",
                f"The reference of {names[j]} lies {offset.value:.4g} {offset.unit} away from the "
                "position throughout.",
                names[j],
                "Their zeros differ; correct one of them in the log.",
                {"offset": offset},
            )
        return
    fit = np.abs(_correlations(q, q_ref))
    best = fit.argmax(axis=1)
    swapped = [j for j in far if best[j] != j and fit[j, best[j]] ** 2 > ALIKE]
    if swapped:
        pairs = ", ".join(f"{names[j]} follows the reference of {names[best[j]]}" for j in swapped)
        text = f"The columns of q and q_ref are in different orders: {pairs}."
        advice = "List both in the order of the robot's joints."
        order = tuple(int(best[j]) if j in swapped else j for j in range(q.shape[1]))
        repairs = [Repair((Reordered(channel="q_ref", order=order),))]
        yield ORDER.finding("error", text, names[swapped[0]], advice, repairs=repairs)
        return
    for j in far:
        signed = _correlations(q[:, [j]], q_ref[:, [j]])[0, 0]
        factor = signed * float(np.std(q_ref[:, j]) / np.std(q[:, j]))
        if signed**2 > ALIKE:
            cause, step = f"{factor:.4g} times the position", "Check the units of q and q_ref."
            repairs = list[Repair]()
            if signed < 0:
                step = "One of the two has the wrong sign; correct it in the log."
                repairs = [Repair((Reversed(channel="q_ref", joints=(names[j],)),))]
            elif 0.9 < factor * np.pi / 180 < 1.1:
                step = 'It seems to be in degrees: set units = {q_ref = "deg"}.'
                repairs = [in_unit("q_ref", "deg")]
            elif 0.9 < factor * 180 / np.pi < 1.1:
                step = 'The positions seem to be in degrees: set units = {q = "deg"}.'
                repairs = [in_unit("q", "deg")]
            text = f"The reference of {names[j]} is {cause}."
            evidence = {"factor": Quantity(factor)}
            yield UNIT.finding("error", text, names[j], step, evidence, repairs=repairs)
            continue
        speed_of_ref = abs(_correlations(q[:, [j]], np.gradient(q_ref[:, [j]], axis=0))[0, 0])
        speed_of_q = abs(_correlations(q_ref[:, [j]], np.gradient(q[:, [j]], axis=0))[0, 0])
        if max(speed_of_ref, speed_of_q) ** 2 > 0.9:
            which, other = ("q", "q_ref") if speed_of_ref > speed_of_q else ("q_ref", "q")
            text = f"{which} of {names[j]} is the derivative of {other}: it holds a speed."
            advice = f"Name the column of the position for {which}."
            place = (*COLUMNS[:-1], which)
            yield SPEED.finding("error", text, names[j], advice, place=place)
            continue
        yield FAR.finding(
            "warning",
            f"{names[j]} does not follow its reference: they differ by {100 * distance[j]:.3g} % "
            "of the motion.",
            names[j],
            "Another column, another joint, or a reference in another frame; IV and PIV simulate "
            "the loop along it.",
            {"distance": Quantity(100 * float(distance[j]), "%", digits=3)},
        )


def _correlations(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Correlation of every column of x with every column of y."""
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    size = np.outer(np.linalg.norm(x, axis=0), np.linalg.norm(y, axis=0))
    return (x.T @ y) / np.where(size > 0, size, 1.0)
