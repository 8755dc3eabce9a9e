"""Repairs of a log's reading that let unseen motion be predicted better.

One joint's torque of the other sign or of another gain, two columns exchanged, a joint that counts
the other way, a zero a quarter turn off, degrees among radians, gravity along another axis, another
clock: each is tried on `reading_rows`, and compared with the log as it is read, stretch by stretch.
With d_k the change of the score of stretch k, a repair counts where

    mean(d) + t(1 - α/m) std(d)/√K < log(1 - LEAST_GAIN).

Each kind of fault has the same share of α, and each of its members the same share of that: m is the
number of kinds times that of the members. The best repair is applied and the search goes on, so
that two faults are found one after the other. At the end come the ratios of gains that nobody has
verified, all at once, as far as the joints share parameters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from pivident.foundation.distributions import student
from pivident.foundation.errors import PividentError
from pivident.foundation.golden_section import lowest
from pivident.foundation.text.repair import (
    Change,
    Edit,
    Multiplied,
    Reordered,
    Repair,
    Retimed,
    Reversed,
    Shifted,
)
from pivident.judgement.audit.gain_ratios import gain_ratios, joint_sums
from pivident.judgement.diagnostics.reading_rows import (
    ReadingRows,
    Sums,
    fitted_scores,
    mean_error,
    scores,
)
from pivident.robot.description import Robot

#: Level of all tests of a round together.
LEVEL = 0.05

#: Share by which a repair lowers the error at least.
LEAST_GAIN = 0.02

#: Faults that are looked for, one after the other.
ROUNDS = 3

#: Gains of a joint's torque that are tried, and within which the best one is no fault.
GAINS, NO_GAIN = (0.5, 0.7, 1.4, 2.0), 1.2

#: Range of gains, and of clocks, that is searched.
GAIN_RANGE, CLOCK_RANGE = 20.0, 2.5

#: Clocks that are tried; the best one is no fault within the same bounds as a gain.
CLOCKS = (0.5, 2.0)

#: Positions of a joint span at least this in its unit, and at most this many turns [rad].
LEAST_SPAN, FARTHEST = 0.05, 20.0

#: Of one of so many rows a repair may not make the fit worse by more than this.
FEW, ROUGHLY = 4, 0.05

#: Growth of the score within which another repair explains as much.
ALIKE = 0.02


@dataclass(frozen=True, eq=False)
class Candidate:
    """A repair that lowers the error clearly.

    Attributes:
        repair: what is changed.
        alike: other repairs that do as well.
    """

    repair: Repair
    alike: tuple[Repair, ...] = ()


def search(rows: ReadingRows, unverified: Collection[str] = ()) -> tuple[Candidate, ...]:
    """Repairs that lower the error clearly, one after the other, each upon those before.

    The repairs are in the order in which they were found; none where the log is best as it is read.
    ``unverified``: joints whose gains nobody has given.
    """
    found: list[Candidate] = []
    for _ in range(ROUNDS):
        best = _best(rows)
        if best is None:
            break
        found.append(best)
        rows = rows.after(best.repair)
    ratios = _ratios(rows, unverified)
    if ratios is not None and clearly_lower(rows.after(ratios).scores() - rows.scores(), 1):
        found.append(Candidate(ratios))
    return tuple(found)


def _ratios(rows: ReadingRows, unverified: Collection[str]) -> Repair | None:
    """Factors of the torques with which the joints share their parameters best."""
    names, (gram, right, square) = rows.robot.joint_names, rows.sums
    free, sums = np.isin(names, list(unverified)), []
    for j, name in enumerate(names):
        k, count = rows.regressor.columns_of(j), int(rows.moving[:, j].sum())
        grams, total = gram[:, j, k[:, None], k], float(square[:, j].sum())
        sums.append(joint_sums(name, k, grams, right[:, j, k], total, count))
    if not free.any() or not all(own.rows > own.columns.size for own in sums):
        return None
    found = gain_ratios(sums, np.ones(len(names)), np.where(free, np.nan, 1.0))
    chosen = np.flatnonzero(found.connected & free)
    factors = tuple((names[j], float(f"{found.gains[j]:.4g}")) for j in chosen)
    return _one(Multiplied(channel="tau", factors=factors)) if factors else None


def _best(rows: ReadingRows) -> Candidate | None:
    """The repair that lowers the error most, and those that do as well."""
    given = rows.scores()
    tried = list(_tried(rows, float(given.mean()) + np.log1p(-LEAST_GAIN)))
    members = Counter(_kind(repair) for repair, _ in tried)
    kept = [
        (repair, other - given)
        for repair, other in tried
        if other is not None and clearly_lower(other - given, len(members) * members[_kind(repair)])
    ]
    if not kept:
        return None
    best = min(kept, key=lambda pair: float(pair[1].mean()))
    alike = [
        repair
        for repair, change in kept
        if repair is not best[0] and not clearly_lower(best[1] - change, 1, ALIKE)
    ]
    return Candidate(best[0], tuple(alike))


def _kind(repair: Repair) -> tuple[str, str]:
    """What kind of fault a repair undoes."""
    edit = repair.edits[0]
    return type(edit).__name__, getattr(edit, "channel", "")


def raises_the_error(rows: ReadingRows, repair: Repair) -> tuple[float, float] | None:
    """Mean errors without and with a repair that clearly raises them [%]; None where it may not."""
    try:
        given, other = rows.scores(), rows.after(repair).scores()
    except (PividentError, np.linalg.LinAlgError):  # the rows do not show it
        return None
    return (mean_error(given), mean_error(other)) if clearly_lower(given - other, 1) else None


def clearly_lower(change: np.ndarray, tried: int, least: float = LEAST_GAIN) -> bool:
    """Whether scores, shape (stretches,), fall by more than a share, of so many comparisons."""
    n = len(change)
    if n < 3:
        return False
    reach = float(student.isf(LEVEL / tried, n - 1)) * float(np.std(change, ddof=1)) / np.sqrt(n)
    return float(change.mean()) + reach < np.log1p(-least)


def _tried(rows: ReadingRows, reach: float) -> Iterator[tuple[Repair, np.ndarray | None]]:
    """Repairs with the scores that they make; None where not even the fit is below ``reach``."""
    few = rows.roughly(FEW)
    hopeless = _fit(few.sums) + ROUGHLY
    for repair, sums in _repairs(rows):
        try:
            fits = _fit(sums(few)) < hopeless and _fit(sums(rows)) < reach
            yield repair, scores(sums(rows)) if fits else None
        except (PividentError, np.linalg.LinAlgError):
            continue


def _fit(sums: Sums) -> float:
    """Mean score of the fit to all stretches."""
    return float(fitted_scores(sums).mean())


def _repairs(rows: ReadingRows) -> Iterator[tuple[Repair, Callable[[ReadingRows], Sums]]]:
    """Repairs with what makes their sums of some rows."""
    whole = rows.roughly(1)
    for j, name in enumerate(rows.robot.joint_names):
        for gain in (-1.0, _gain(rows, whole, j)):
            if gain is not None:
                yield _torque(name, gain), partial(ReadingRows.with_gain, joint=j, factor=gain)
    for repair in _of_motion(rows, whole):
        yield repair, partial(_after, repair=repair)


def _after(rows: ReadingRows, repair: Repair) -> Sums:
    """Sums of the rows with a repair."""
    return rows.after(repair).sums


def _torque(name: str, factor: float) -> Repair:
    """So many times one joint's torque."""
    if factor == -1.0:
        return Repair((Reversed(channel="tau", joints=(name,)),))
    return Repair((Multiplied(channel="tau", factors=((name, float(f"{factor:.4g}")),)),))


def _gain(rows: ReadingRows, whole: ReadingRows, joint: int) -> float | None:
    """Factor of a joint's torque that fits best, where that is not about one.

    ``whole``: the rows as one stretch.
    """
    return _best_factor(rows, whole, partial(ReadingRows.with_gain, joint=joint), GAINS, GAIN_RANGE)


def _clock(rows: ReadingRows, whole: ReadingRows) -> float | None:
    """Factor of the times that fits best, likewise; a round one where that does as well."""

    def sums(own: ReadingRows, factor: float) -> Sums:
        return _after(own, _one(Retimed(factor=factor)))

    best = _best_factor(rows, whole, sums, CLOCKS, CLOCK_RANGE)
    if best is None:
        return None
    nearest = min(CLOCKS, key=lambda factor: abs(np.log(factor / best)))
    gained = scores(sums(rows, best)) - scores(sums(rows, nearest))
    return best if clearly_lower(gained, 1, 0.0) else nearest


def _best_factor(
    rows: ReadingRows,
    whole: ReadingRows,
    sums: Callable[..., Sums],
    tried: Sequence[float],
    reach: float,
) -> float | None:
    """Factor that fits best, where one of some is better than one; None if it is near.

    ``sums``: of some rows with a factor. Of all as one stretch they are made in no time.
    """
    for own in (whole, rows):
        found = {x: _fit(sums(own, factor=x)) for x in (1.0, *tried)}
        best = min(found, key=lambda x: found[x])
        if best == 1.0:
            return None
    points = sorted({1.0 / reach, *found, reach})
    beside = points[points.index(best) - 1], points[points.index(best) + 1]
    low, high = np.log(beside)
    factor = np.exp(lowest(lambda x: _fit(sums(rows, factor=np.exp(x))), low, high, 1e-3))
    at_an_end = abs(np.log(factor)) > 0.99 * np.log(reach)  # where no best one is
    return None if at_an_end or 1.0 / NO_GAIN < factor < NO_GAIN else float(factor)


def _of_motion(rows: ReadingRows, whole: ReadingRows) -> Iterator[Repair]:
    """Repairs that change the observation matrix, or which torque belongs to which row of it."""
    robot, names = rows.robot, rows.robot.joint_names
    clock = _clock(rows, whole)
    if clock is not None:
        yield _one(Retimed(factor=float(f"{clock:.4g}")))
    if robot.size > 1:
        for name in names:
            yield _one(Reversed(channel="q", joints=(name,)))
            yield _one(Reversed(channel="", joints=(name,)))
    for j, k in combinations(range(robot.size), 2):
        order = list(range(robot.size))
        order[j], order[k] = k, j
        yield _one(Reordered(channel="tau", order=tuple(order)))
        if robot.joints[j].kind == robot.joints[k].kind:
            yield _one(Reordered(channel="", order=tuple(order)))
    for gravity in directions(robot):
        yield _one(Edit(("robot", "gravity"), list(gravity)))
    for j, name in enumerate(names):
        if robot.joints[j].kind == "revolute":
            for quarters in (1, -1, 2):
                offset = float(f"{quarters * np.pi / 2:.6f}")
                yield _one(Shifted(offsets=((name, offset),)))
            logged, zero = rows.channels["q"][:, j] - rows.zeros[j], rows.zeros[j]
            for factor in (np.pi / 180.0, 180.0 / np.pi):
                if _turns(factor * logged + zero):
                    yield _one(Multiplied(channel="q", factors=((name, factor),)))


def _one(edit: Change) -> Repair:
    return Repair((edit,))


def _turns(q: np.ndarray) -> bool:
    """Whether positions in radians, shape (rows,), may be those of a joint."""
    return float(np.ptp(q)) > LEAST_SPAN and float(np.abs(q).max()) < FARTHEST


def directions(robot: Robot) -> Iterator[tuple[float, ...]]:
    """The other axes of the base along which gravity may point, and none, shape (3,) [m/s²].

    Some drives log torques from which gravity is taken out.
    """
    size = float(np.linalg.norm(robot.gravity))
    if size:
        yield (0.0, 0.0, 0.0)
    for axis in range(3):
        for sign in (1.0, -1.0):
            gravity = sign * size * np.eye(3)[axis]
            if size and not np.allclose(gravity, robot.gravity, atol=0.1 * size):
                yield tuple(float(f"{x:.6g}") + 0.0 for x in gravity)


def joined(candidates: Sequence[Candidate]) -> Repair:
    """Several repairs as one, in their order."""
    return Repair(tuple(edit for one in candidates for edit in one.repair.edits))
