"""Sums of products of regressors, instruments and torque: all that the tests on instruments need.

With Y = [Φ Z X τ], the weighted and prefiltered columns of the observation matrix, of the
instruments, of further instruments X and the torque, they are YᵀY over all rows and
[Φ Z X]ᵀ[Φ Z τ] over each window of time (raised cosines, see ``estimation.sandwich``). Their size
is that of the parameters, not of the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.windows import Share, Windows, windows_of
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.identification import Identification
from pivident.estimation.restrictions import Freedom
from pivident.estimation.solved_equations import Equations
from pivident.foundation.errors import IdentificationError
from pivident.loop.motion.motion import Motion, central_differences, with_inner

ExtraInstruments = Literal["reference", "delayed", "other"]


@dataclass(eq=False)
class MomentSums:
    """Sums over all joints and records, columns in the order Φ, Z, X, τ."""

    size: int  # number of parameters b
    extra: int  # number of further instruments, 0 or b
    gram: np.ndarray  # YᵀY, shape (2b + extra + 1, 2b + extra + 1)
    windows: np.ndarray  # [Φ Z X]ᵀ[Φ Z τ] of each window, shape (windows, 2b + extra, 2b + 1)
    shares: np.ndarray  # share of the record in each window, summing to one, shape (windows,)
    rows: int = 0  # number of rows in use
    extra_kind: str = ""  # what the further instruments are; empty: there are none

    @classmethod
    def empty(cls, size: int, extra: int, windows: Sequence[Windows]) -> MomentSums:
        """No rows yet."""
        width = 2 * size + extra
        count, total = sum(w.count for w in windows), sum(w.samples for w in windows)
        shares = np.zeros(count)
        for own in windows:
            gaps = np.diff(np.linspace(0, own.samples, own.count)) / total
            shares[own.first : own.first + own.count - 1] += gaps / 2
            shares[own.first + 1 : own.first + own.count] += gaps / 2
        gram, parts = np.zeros((width + 1, width + 1)), np.zeros((count, width, 2 * size + 1))
        return cls(size, extra, gram, parts, shares)

    def add(
        self,
        columns: np.ndarray,
        phi: np.ndarray,
        z: np.ndarray,
        extra: np.ndarray | None,
        tau: np.ndarray,
        rows: int,
        shares: Sequence[Share],
        extra_columns: np.ndarray | None = None,
    ) -> None:
        """Add rows of one joint, time last.

        ``columns``: parameters that act on the joint, shape (k,); ``phi``: its columns, shape
        (k, samples); ``extra``: further instruments, likewise, or None; ``extra_columns``: places
        of the further instruments; None: those of the others.
        """
        lines = [columns, self.size + columns]
        stack = [phi, z]
        if extra is not None:
            lines.append(2 * self.size + (columns if extra_columns is None else extra_columns))
            stack.append(extra)
        left = np.concatenate(lines)
        right = np.append(np.concatenate([columns, self.size + columns]), 2 * self.size)
        rights = np.vstack([phi, z, tau])
        moments = np.vstack(stack)
        every = np.vstack([moments, tau])
        places = np.append(left, len(self.gram) - 1)
        self.gram[np.ix_(places, places)] += every @ every.T
        first = shares[0].window
        parts = np.zeros((shares[-1].window + 2 - first, left.size, right.size))
        for share in shares:
            part, response = moments[:, share.part], rights[:, share.part].T
            rising = (part * share.rising) @ response
            parts[share.window + 1 - first] += rising
            parts[share.window - first] += part @ response - rising
        self.windows[first : first + len(parts), left[:, None], right] += parts
        self.rows += rows

    def block(self, left: str, right: str) -> np.ndarray:
        """Part of the Gram matrix, such as ``("z", "phi")`` for ZᵀΦ."""
        return self.gram[self._place(left), self._place(right)]

    def window(self, left: str, right: str) -> np.ndarray:
        """The same in each window, windows first; ``right`` is ``phi``, ``z`` or ``tau``."""
        place = self._place(right) if right != "tau" else slice(2 * self.size, None)
        return self.windows[:, self._place(left), place]

    def scaled(self) -> tuple[MomentSums, np.ndarray]:
        """The same with columns of unit length, and the lengths, shape (columns,).

        Parameters differ by orders of magnitude, and so do their columns. An instrument is
        given a length of its own, which changes no estimate.
        """
        length = np.sqrt(np.diag(self.gram))
        length = np.where(length > 0, length, 1.0)
        length[-1] = 1.0
        right = np.r_[length[: 2 * self.size], 1.0]
        scaled = replace(
            self,
            gram=self.gram / np.outer(length, length),
            windows=self.windows / length[:-1, None] / right,
        )
        return scaled, length

    def along(self, freedom: Freedom) -> MomentSums:
        """The same of Φ N, Z N, X N and τ - Φ θ₀: as far as the parameters are free."""
        if np.array_equal(freedom.basis, np.eye(self.size)) and not freedom.offset.any():
            return self
        left = np.kron(np.eye(2 + bool(self.extra)), freedom.basis.T)
        every = np.zeros((len(left) + 1, len(self.gram)))
        every[:-1, :-1], every[-1, -1] = left, 1.0
        every[-1, : self.size] = -freedom.offset
        size, chosen = freedom.free.size, np.r_[: 2 * self.size, len(self.gram) - 1]
        right = every[np.r_[: 2 * size, len(left)]][:, chosen]
        return replace(
            self,
            size=size,
            extra=size if self.extra else 0,
            gram=every @ self.gram @ every.T,
            windows=left @ self.windows @ right.T,
        )

    def _place(self, name: str) -> slice:
        b = self.size
        return {
            "phi": slice(0, b),
            "z": slice(b, 2 * b),
            "extra": slice(2 * b, 2 * b + self.extra),
            "tau": slice(2 * b + self.extra, None),
        }[name]


def moment_sums(
    identification: Identification, extra: ExtraInstruments | None = None
) -> MomentSums:
    """Sums of the equations that an identification solved last, in one pass over its records."""
    equations = kept_equations(identification)
    if not equations.has_instruments:
        raise IdentificationError(
            f"{identification.method} has no instruments to be tested",
            advice="identify with 'iv', 'iv-full-rate' or 'piv'",
        )
    if extra == "other":
        more: Any = _other_kind(identification)
    else:
        more = None if extra is None else further_instruments(equations, extra)
    windows = windows_of(equations.lengths)
    sums = MomentSums.empty(equations.size, 0 if extra is None else equations.size, windows)
    used = identification.instruments
    sums.extra_kind = used.further_kind if extra == "other" and used else extra or ""
    for block in equations.blocks(more):
        shares = list(windows[block.record].shares(block.span))
        for r in block.joints:
            sums.add(r.columns, r.phi, r.z, r.extra, r.tau, int(r.used.sum()), shares)
    return sums.along(identification.restrictions.freedom)


def kept_equations(identification: Identification) -> Equations:
    """Equations of a result."""
    if identification.equations is None:
        raise IdentificationError(
            f"the equations of this {identification.method} result were not kept",
            advice="take the result as identify() returns it",
        )
    return identification.equations


def further_instruments(
    equations: Equations, extra: ExtraInstruments
) -> list[Motion] | list[np.ndarray]:
    """Motions, or columns of decimated records, that further instruments are made of."""
    motions: list = []
    for record in equations.records:
        recording = record.kinematics.recording
        if extra == "delayed":
            motions.append(_delayed(record))
        elif record.full_rate and recording.q_ref is not None:
            motions.append(_on_reference(equations.regressor, record))
        else:
            why = "no q_ref" if recording.q_ref is None else "decimated equations"
            raise IdentificationError(
                f"recording {recording.name!r} has {why}, so Φ(q_ref) cannot be an instrument",
                advice="use extra='delayed'",
            )
    return motions


def _other_kind(identification: Identification) -> list[Motion]:
    """Motions of the next best kind of instruments that the record allows."""
    used, equations = identification.instruments, kept_equations(identification)
    if used is None or not used.further:
        raise IdentificationError(
            "the record allows no other kind of instruments", advice="use 'delayed'"
        )
    theta = identification.theta
    return [with_inner(equations.regressor, motion, theta) for motion in used.further]


@dataclass(frozen=True, eq=False)
class Signals:
    """Positions, speeds and accelerations of another motion, time last."""

    q: np.ndarray  # positions [rad or m], shape (joints, samples)
    dq: np.ndarray  # speeds [rad/s or m/s]
    ddq: np.ndarray  # accelerations [rad/s² or m/s²]
    inner: np.ndarray | None = None  # columns with memory or load, shape (inner entries, samples)

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples."""
        return self.q[:, span], self.dq[:, span], self.ddq[:, span]


def _delayed(record: EquationRecord) -> Signals | np.ndarray:
    """Instruments one row later: their motion, or their columns where they are held."""
    motion = record.motion
    if motion is None:
        assert record.z is not None
        return _one_later(record.z)
    inner = None if motion.inner is None else _one_later(motion.inner)
    return Signals(_one_later(motion.q), _one_later(motion.dq), _one_later(motion.ddq), inner)


def _on_reference(regressor: Regressor, record: EquationRecord) -> Signals:
    """The reference's motion; loads, which need the parameters, are those of the instruments."""
    recording = record.kinematics.recording
    assert recording.q_ref is not None
    dq, ddq = central_differences(recording.q_ref, recording.rate)
    q_ref, dq, ddq = (np.ascontiguousarray(x.T) for x in (recording.q_ref, dq, ddq))
    inner = regressor.inner(q_ref, dq, ddq)
    own = None if record.motion is None else record.motion.inner
    if own is not None:
        of_load = regressor.load_parameters[regressor.column[regressor.inner_entries]]
        inner[of_load] = own[of_load]
    return Signals(q_ref, dq, ddq, inner)


def _one_later(x: np.ndarray) -> np.ndarray:
    """Rows delayed by one sample, the first one twice."""
    return np.concatenate([x[:, :1], x[:, :-1]], axis=1)
