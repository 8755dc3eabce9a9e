"""The inverse model of each joint on a log: columns and torque through one and the same low-pass.

Every joint gets an equation of its own, tau_j = Φ_j θ_j, with all parameters that act on it. That
wastes what the joints share, but a fault in one channel stays in that channel. Both sides are
low-passed at `BANDWIDTH` without phase, so that the torque may be moved in time by fractions of a
sample and still be compared with the same columns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from pivident.data.logs.bad_samples import TOLERATED
from pivident.data.logs.log import Log
from pivident.data.logs.timestamps import resample_smooth
from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.errors import RecordingError
from pivident.judgement.audit.blocked_fit import BLOCKS, orthonormal
from pivident.judgement.audit.timing import Timing
from pivident.robot.description import Robot
from pivident.signals.alignment import torque_shift
from pivident.signals.bandpass import bandpass, butterworth
from pivident.signals.cubic_spline import CubicSpline, cubic_spline

#: Band in which model and torque are compared [Hz]; flexible joints begin above it.
BANDWIDTH = 20.0

#: Rows per second and hertz of bandwidth: enough for splines between the rows.
OVERSAMPLING = 8

#: Samples that are looked at, in the middle of the motion; more would only take longer.
MAX_SAMPLES = 60_000

#: Share of the rated speed below which a joint's rows do not count: static friction has no law.
LOW_SPEED = 0.01

#: Band of the positions before they are differentiated, in bandwidths. Narrower, it rounds the
#: reversals of dry friction, which then look like a delay of milliseconds.
WIDER = 10.0

#: Time in periods of the band over which the low-pass mixes rest and motion.
MIXED = 1.0


#: Readings of a log are first tried on one of so many rows with rough columns (`roughly`), which
#: follow the band closely still, and on all rows unless an error is beyond its bound there by more
#: than this factor.
APART, BEYOND = 4, 1.25


class ByJoint(Sequence[np.ndarray]):
    """An array for each joint, made when it is first asked for: many models need but one."""

    def __init__(self, joints: int, make: Callable[[int], np.ndarray]) -> None:
        self._made: list[np.ndarray | None] = [None] * joints
        self._make: Callable[[int], np.ndarray] | None = make

    def __len__(self) -> int:
        return len(self._made)

    def __getitem__(self, joint: Any) -> Any:  # an index, or a slice of them
        if isinstance(joint, slice):
            return [self[j] for j in range(len(self))[joint]]
        if self._made[joint] is None and self._make is not None:
            self._made[joint] = self._make(range(len(self))[joint])
            if all(made is not None for made in self._made):
                self._make = None  # and what it was made from
        return self._made[joint]


class DescribedTorque:
    """Torques of the description on the rows, made when they are first asked for.

    ``make``: gives those of gravity and of all other inertial parameters, low-passed.
    """

    def __init__(self, make: Callable[[], tuple[np.ndarray, np.ndarray]]) -> None:
        self._make = make

    @cached_property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Of gravity, and of all other inertial parameters, each of shape (rows, joints)."""
        return self._make()


@dataclass(frozen=True, eq=False)
class InverseModel:
    """Rows of the inverse model of every joint."""

    robot: Robot
    base: BaseParameters  # its base parameters
    rate: float  # sampling rate of the log [Hz]
    first: int  # sample of the log with which the part that is looked at begins
    at: np.ndarray  # position of each row, in samples from there
    columns: Sequence[np.ndarray]  # of each joint, shape (rows, own parameters)
    own: tuple[np.ndarray, ...]  # indices of these parameters in ``base``, for each joint
    moving: np.ndarray  # which rows of which joint count, shape (rows, joints)
    q: np.ndarray  # low-passed positions [rad or m], shape (rows, joints), as ``dq`` and ``ddq``
    dq: np.ndarray  # speeds
    ddq: np.ndarray  # accelerations
    described: DescribedTorque  # after the description
    shift: float  # samples by which the torque belongs later than its sample says, as declared
    block: np.ndarray  # number of the stretch of time that a row belongs to
    torque: CubicSpline  # low-passed torque as a function of the position in samples
    samples: int  # number of samples looked at
    signals: FilteredLog  # what the rows are made from

    @property
    def gravity(self) -> np.ndarray:
        """Torque of gravity after the description, low-passed, shape (rows, joints)."""
        return self.described.parts[0]

    @property
    def inertial(self) -> np.ndarray:
        """Torque of all other inertial parameters after it, likewise."""
        return self.described.parts[1]

    def tau(self, delay: float = 0.0) -> np.ndarray:
        """Torque on the rows if it was logged that much later than the positions."""
        return self.torque(self.at - self.shift + delay * self.rate)

    def reordered(self, torque_of: Sequence[int]) -> InverseModel:
        """The same rows with the torques in another order."""
        torque = replace(self.torque, c=np.ascontiguousarray(self.torque.c[:, :, list(torque_of)]))
        return replace(self, torque=torque)

    def delayed(self, delay: float) -> InverseModel:
        """The same rows with a delay of the torque [s] made good."""
        return replace(self, shift=self.shift - delay * self.rate)

    def away_from_rest(self) -> InverseModel:
        """The same without the rows beside a standstill, which share its static friction.

        Friction holds a joint that stands with any torque up to its own, and the low-pass mixes
        that into the motion before and behind. A reversal is no standstill.
        """
        near = [_near_standstill(~rows, self._mixed) for rows in self.moving.T]
        return replace(self, moving=self.moving & ~np.column_stack(near))

    def away_from_reversals(self) -> InverseModel:
        """The same without all rows that the low-pass mixes with rest or a reversal of the joint.

        Between them dry friction is constant, and its law does not matter.
        """
        near = [_near(~rows, self._mixed) for rows in self.moving.T]
        return replace(self, moving=self.moving & ~np.column_stack(near))

    def below(self, share: float) -> InverseModel:
        """The same through a low-pass at a share of the band, columns and torque alike."""
        band = share * min(BANDWIDTH, 0.1 * self.rate)
        rows = self.rate / float(self.at[1] - self.at[0])
        columns = tuple(butterworth(c, rows, band) for c in self.columns)
        x = self.torque.x
        torque = cubic_spline(x, butterworth(self.torque(x), self.rate, band))
        return replace(self, columns=columns, torque=torque)

    def roughly(
        self,
        scale: float | np.ndarray = 1.0,
        shift: float | np.ndarray = 0.0,
        robot: Robot | None = None,
        apart: int = APART,
    ) -> InverseModel:
        """Rows with columns of the low-passed motion as they are, cheap to try a reading with.

        Torques of the description are not made for them: ``described`` stays that of all rows.

        Args:
            scale: so many times the positions, for all joints or each.
            shift: what is added to these [rad or m], likewise.
            robot: another description; None: the same.
            apart: one of so many rows.
        """
        robot = robot or self.robot
        base, rows = base_parameters(robot), slice(None, None, apart)
        motion = scale * self.q[rows] + shift, scale * self.dq[rows], scale * self.ddq[rows]
        q, dq, ddq = (np.ascontiguousarray(x.T) for x in motion)
        regressor = regressor_of(robot, base.parameters)
        theta = base.values(nominal_values(robot, base.standard))
        packed = regressor.packed(q, dq, ddq, inner=regressor.inner(q, dq, ddq, theta))
        offsets = regressor.offsets
        return replace(
            self,
            robot=robot,
            base=base,
            at=self.at[rows],
            columns=tuple(packed[i:j].T for i, j in pairwise(offsets)),
            own=tuple(regressor.columns_of(j) for j in range(robot.size)),
            moving=self.moving[rows],
            q=q.T,
            dq=dq.T,
            ddq=ddq.T,
            block=self.block[rows],
        )

    @property
    def _mixed(self) -> int:
        """Rows over which the low-pass mixes what lies beside one another."""
        period = float(self.at[1] - self.at[0]) / self.rate
        return int(np.ceil(MIXED / (min(BANDWIDTH, 0.1 * self.rate) * period)))

    @cached_property
    def bases(self) -> Sequence[np.ndarray]:
        """Orthonormal basis of each joint's columns on its counting rows."""
        columns, moving = self.columns, self.moving  # not the model, which would never be freed
        return ByJoint(self.robot.size, lambda j: orthonormal(columns[j][moving[:, j]])[0])

    @cached_property
    def relative_errors(self) -> np.ndarray:
        """Share of each joint's torque that its own columns do not explain, shape (joints,)."""
        tau = self.tau()
        return np.array([self.relative_error(j, tau[:, j]) for j in range(self.robot.size)])

    def relative_error(self, joint: int, tau: np.ndarray) -> Any:
        """‖τ - Φ_j θ̂‖ / ‖τ‖ of a torque on one joint's columns, shape (rows,), or of several.

        NaN where it is zero; of several, shape (rows, torques), one for each.
        """
        basis, tau = self.bases[joint], tau[self.moving[:, joint]]
        left = np.linalg.norm(tau - basis @ (basis.T @ tau), axis=0)
        with np.errstate(invalid="ignore"):
            return left / np.linalg.norm(tau, axis=0)

    def usable(self, joint: int) -> bool:
        """Whether a joint moves long enough for its equation to say anything."""
        rows = int(self.moving[:, joint].sum())
        return rows > 1.5 * self.bases[joint].shape[1] + BLOCKS and rows > 50


#: q, dq and ddq, each of shape (samples, joints).
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class FilteredLog:
    """Channels of a log on a uniform grid, filtered: the same for any unit of the positions."""

    rate: float  # sampling rate of the log [Hz]
    band: float  # of the low-pass [Hz]
    margin: int  # samples at both ends that the low-pass distorts
    first: int  # sample of the log with which the part that is looked at begins
    motion: Motion  # in a wider band
    low: Motion  # the same low-passed
    invented: np.ndarray  # True for samples that the log does not have, shape (samples,)
    torque: CubicSpline  # low-passed torque as a function of the position in samples

    @classmethod
    def of(cls, log: Log, timing: Timing) -> FilteredLog:
        """Filter positions and torques once."""
        assert log.robot is not None and timing.rate, "the caller has asked for both"
        q, tau, invented, first = uniform(log, timing, log.robot.size)
        rate = timing.rate
        band = min(BANDWIDTH, 0.1 * rate)
        margin = int(np.ceil(1.5 * rate / band))
        if len(q) < 8 * margin:
            raise RecordingError(
                f"{len(q)} samples are too few to compare torque and motion",
                advice=f"{8 * margin} are needed",
            )
        passed = bandpass(q, rate, min(WIDER * band, 0.4 * rate))
        q, dq, ddq = (butterworth(x, rate, band) for x in (passed.q, passed.dq, passed.ddq))
        torque = cubic_spline(np.arange(len(tau)), butterworth(tau, rate, band))
        motion = passed.q, passed.dq, passed.ddq
        return cls(rate, band, margin, first, motion, (q, dq, ddq), invented, torque)


def build_inverse_model(log: Log, timing: Timing) -> InverseModel:
    """Prepare rows of the inverse model from a log."""
    return inverse_model_of(log, FilteredLog.of(log, timing))


def inverse_model_of(
    log: Log,
    signals: FilteredLog,
    scale: float | np.ndarray = 1.0,
    shift: float | np.ndarray = 0.0,
) -> InverseModel:
    """Rows of the inverse model of a log read in another way.

    Args:
        log: the log.
        signals: its filtered channels.
        scale: so many times the logged positions, for all joints or each.
        shift: what is added to these [rad or m], likewise.
    """
    robot, rate, band, margin = log.robot, signals.rate, signals.band, signals.margin
    assert robot is not None
    base = base_parameters(robot)
    regressor = regressor_of(robot, base.parameters)
    samples = len(signals.motion[0])
    stride = max(1, int(rate / (OVERSAMPLING * band)))
    at = np.arange(margin, samples - margin, stride)
    q, dq, ddq = (scale * x[at] for x in signals.low)
    q = q + shift

    description = base.values(nominal_values(robot, base.standard))
    motion = signals.motion[0] * scale + shift, signals.motion[1] * scale, signals.motion[2] * scale
    turned = motion[0].T, motion[1].T, motion[2].T
    packed = regressor.packed(*turned, inner=regressor.inner(*turned, description))

    def columns_of(j: int) -> np.ndarray:
        chosen = slice(regressor.offsets[j], regressor.offsets[j + 1])
        return butterworth(packed[chosen].T, rate, band)[at]

    def described() -> tuple[np.ndarray, np.ndarray]:
        gravity, inertial = _described(base, regressor, motion)
        return butterworth(gravity, rate, band)[at], butterworth(inertial, rate, band)[at]

    rated = robot.rated_speeds
    fastest = np.abs(dq).max(axis=0)
    limit = LOW_SPEED * np.where(np.isfinite(rated), np.minimum(rated, 2 * fastest), fastest)
    control = log.control_rate or rate
    held = log.torque_timing or "held"
    late = torque_shift(rate, held, control_rate=control, delay=log.delay)  # type: ignore[arg-type]
    moving = _moving(robot, dq, limit)
    return InverseModel(
        robot,
        base,
        rate,
        signals.first,
        at.astype(float),
        ByJoint(robot.size, columns_of),
        tuple(regressor.columns_of(j) for j in range(robot.size)),
        moving & (fastest > 0) & ~_near(signals.invented, margin)[at, None],
        q,
        dq,
        ddq,
        DescribedTorque(described),
        late,
        _stretches(moving),
        signals.torque,
        samples,
        signals,
    )


def _moving(robot: Robot, dq: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Rows on which a joint moves, and every motor coupled with it as well."""
    fast = np.abs(dq) > limit
    for c in robot.couplings:
        together = np.abs(dq[:, c.motor] + c.ratio * dq[:, c.joint]) > limit[c.motor]
        fast[:, c.motor] &= together
        fast[:, c.joint] &= together
    return fast


def _stretches(moving: np.ndarray) -> np.ndarray:
    """Numbers of stretches of time in which the arm moves equally long; moving (rows, joints)."""
    before = np.cumsum(moving.any(axis=1))
    return np.minimum(before * BLOCKS // (before[-1] + 1), BLOCKS - 1)


def _near_standstill(still: np.ndarray, reach: int) -> np.ndarray:
    """Rows within ``reach`` of standstills that last twice as long; still (rows,)."""
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    near = np.zeros(len(still), bool)
    for start, stop in edges.reshape(-1, 2):
        if stop - start > 2 * reach:
            near[max(0, start - reach) : stop + reach] = True
    return near


def _near(invented: np.ndarray, margin: int) -> np.ndarray:
    """Samples that the low-pass mixes with invented ones."""
    if not invented.any():
        return invented
    around = np.cumsum(np.r_[np.zeros(margin + 1), invented, np.zeros(margin)])
    return around[2 * margin + 1 :] > around[: -2 * margin - 1]


def uniform(
    log: Log, timing: Timing, joints: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Positions and torques on a uniform grid, holes filled; returns (samples, joints)."""
    q, tau = log.channels["q"], log.channels["tau"]
    if q.shape[1] != joints or tau.shape != q.shape:
        raise RecordingError(
            f"the log has {q.shape[1]} positions and {tau.shape[1]} torques, the robot {joints} "
            "joints"
        )
    missing = ~(np.isfinite(q).all(axis=1) & np.isfinite(tau).all(axis=1))
    clock = log.clock
    if clock is not None and not timing.regular:
        missing |= ~np.isfinite(clock)
    if missing.mean() > TOLERATED:
        raise RecordingError(f"{100 * missing.mean():.3g} % of the samples are missing")
    rate = timing.rate or 1.0
    index = np.flatnonzero(~missing)
    t = index / rate
    if clock is not None and not timing.regular:
        order = np.flatnonzero(np.diff(np.maximum.accumulate(clock[index]), prepend=-np.inf) > 0)
        t, index = clock[index][order], index[order]
        if len(t) < 0.5 * len(q):
            raise RecordingError("the clock stands still or runs backward in half of the log")
    invented = np.zeros(len(q), dtype=bool)
    if missing.any() or not timing.regular:
        if (t[-1] - t[0]) * rate > 2 * len(q):
            raise RecordingError("the gaps in the log are longer than its samples")
        grid = np.arange(t[0], t[-1], 1.0 / rate)
        near = np.searchsorted(t, grid).clip(1, len(t) - 1)
        invented = t[near] - t[near - 1] > 2.5 / rate
        q, tau = (resample_smooth(t, x[index], grid) for x in (q, tau))
    first = 0
    if len(q) > MAX_SAMPLES:
        speed = np.abs(np.diff(q, axis=0, prepend=q[:1])).max(axis=1)
        busy = np.cumsum(speed)
        first = int(np.argmax(busy[MAX_SAMPLES - 1 :] - np.r_[0.0, busy[:-MAX_SAMPLES]]))
        part = slice(first, first + MAX_SAMPLES)
        q, tau, invented = q[part], tau[part], invented[part]
    return q, tau, invented, first


def _described(
    base: BaseParameters, regressor: Regressor, motion: Motion
) -> tuple[np.ndarray, np.ndarray]:
    """Torques of gravity, and of everything else but friction, after the robot's description."""
    nominal = nominal_values(base.robot, base.standard)
    for k, p in enumerate(base.standard):
        if not p.carries_load:
            nominal[k] = 0.0
    theta = base.values(nominal)
    at_rest = np.zeros_like(motion[0])
    gravity = regressor.torque(motion[0], at_rest, at_rest, theta)
    return gravity, regressor.torque(*motion, theta) - gravity
