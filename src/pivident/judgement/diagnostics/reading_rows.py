"""Rows of a problem on which other readings of its log are compared in milliseconds.

A log may be read in many ways: with a torque of the other sign, with two columns exchanged, with a
zero elsewhere, with gravity along another axis. For each of them least squares

    min_θ Σ_j w_j ‖τ_j - Φ_j(q, dq, ddq) θ‖²

is solved from the sums of stretches of time, each stretch predicted from all others. Positions and
torques are low-passed alike, and rows near a standstill or a reversal are left out, where neither
friction nor a low-pass of it is known. The score of a stretch is the mean logarithm of the joints'
relative errors: no unit and no gain of a joint changes it by itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.problem import Problem
from pivident.foundation.common_work import once
from pivident.foundation.errors import PividentError
from pivident.foundation.text.repair import Change, Edit, Repair, Retimed
from pivident.judgement.audit.blocked_fit import BLOCKS
from pivident.judgement.audit.inverse_model import BANDWIDTH, InverseModel
from pivident.judgement.audit.recording_audit import recording_model
from pivident.judgement.diagnostics.repaired_problem import channels_after, zeros_of
from pivident.robot.description import Robot

#: Channels that the observation matrix is made of.
MOTION = ("q", "dq", "ddq")

#: Rows of a joint below which those near a reversal are kept.
FEW_ROWS = 200

#: Rows per hertz of the band, which are enough to solve for parameters.
DENSITY = 3.0

#: Relative size of what keeps normal equations solvable.
RIDGE = 1e-12

#: Relative errors below this are alike: of an exact log nothing is left to compare.
LEAST = 1e-6

#: Share of a joint's mean square below which its torque in a stretch says nothing.
STILL = 1e-3

#: Φᵀ Φ, Φᵀ τ and τᵀ τ of each stretch and joint.
Sums = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class ReadingRows:
    """Rows of all recordings.

    Attributes:
        robot: the robot.
        parameters: names of those that are estimated.
        channels: ``q dq ddq tau``, low-passed, each of shape (rows, joints).
        moving: rows that count, shape (rows, joints).
        block: number of the stretch of time of each row, shape (rows,).
        regressor: of the parameters that are estimated, for the robot.
        zeros: what was added to the logged positions, shape (joints,) [rad or m].
        known: packed entries of the observation matrix, where rows with the same motion have made
            them.
        like: rows with the same motion, which share the sums of joints with the same torque.
    """

    robot: Robot
    parameters: tuple[str, ...]
    channels: Mapping[str, np.ndarray]
    moving: np.ndarray
    block: np.ndarray
    regressor: Regressor
    zeros: np.ndarray
    known: np.ndarray | None = None
    like: ReadingRows | None = None

    @classmethod
    def of(cls, problem: Problem) -> ReadingRows | None:
        """Rows of a problem whose torques were measured.

        None for mechanisms with closed loops or measured bases, and where recordings are too short.
        """
        robot = problem.robot
        measured = all(r.torque_source == "measured" for r in problem.recordings)
        if robot.constraints is not None or robot.base_joints or not measured:
            return None
        try:
            return once(("reading rows", problem), lambda: cls._of(problem))
        except (PividentError, np.linalg.LinAlgError):
            return None

    @classmethod
    def _of(cls, problem: Problem) -> ReadingRows:
        models = [recording_model(problem.robot, r) for r in problem.recordings]
        some = [slice(None, None, _stride(model)) for model in models]
        pairs = list(zip(models, some, strict=True))
        channels = {c: np.vstack([getattr(m, c)[own] for m, own in pairs]) for c in MOTION}
        names = tuple(problem.base.names[k] for k in problem.selection)
        return cls(
            problem.robot,
            names,
            channels | {"tau": np.vstack([m.tau()[own] for m, own in pairs])},
            np.vstack([_counting(m)[own] for m, own in pairs]),
            np.concatenate([m.block[own] + k * BLOCKS for k, (m, own) in enumerate(pairs)]),
            _regressor(problem.robot, names),
            zeros_of(problem.recordings[0]),
        )

    def roughly(self, step: int) -> ReadingRows:
        """One of so many rows, all in one stretch."""
        return replace(
            self,
            channels={name: values[::step] for name, values in self.channels.items()},
            moving=self.moving[::step],
            block=np.zeros(len(self.block[::step]), int),
            known=self.entries[:, ::step],
            like=None,
        )

    def after(self, repair: Repair) -> ReadingRows:
        """The same rows with a repair.

        Raises:
            ExperimentError: they do not show what it changes.
        """
        rows = self
        for edit in repair.edits:
            rows = rows._after(edit)
        return rows

    def _after(self, edit: Change) -> ReadingRows:
        match edit:
            case Retimed(factor=f):
                slower = {"dq": self.channels["dq"] / f, "ddq": self.channels["ddq"] / f**2}
                return replace(self, channels={**self.channels, **slower}, known=None, like=None)
            case Edit(place=("robot", "gravity"), value=gravity):
                # the same directions are asked for again on more rows
                key = "robot under gravity", self.robot, tuple(gravity)
                robot = once(key, partial(self.robot.with_gravity, np.array(gravity, float)))
                regressor = _regressor(robot, self.parameters)
                return replace(self, robot=robot, regressor=regressor, known=None, like=None)
        names = self.robot.joint_names
        moving = np.abs(channels_after(edit, {"tau": 1.0 * self.moving}, names)["tau"]) > 0.0
        changed = channels_after(edit, self.channels, names, self.zeros)
        same = all(changed[c] is self.channels[c] for c in MOTION)
        known, like = (self.entries, self) if same else (None, None)
        return replace(self, channels=changed, moving=moving, known=known, like=like)

    def scores(self) -> np.ndarray:
        """Mean logarithm of the joints' relative errors in each stretch, from all others."""
        return scores(self.sums)

    def with_gain(self, joint: int, factor: float) -> Sums:
        """Sums with so many times one joint's torque, which may be negative."""
        gram, right, square = (x.copy() for x in self.sums)
        gram[:, joint] /= factor**2
        right[:, joint] /= factor
        return gram, right, square

    def without(self, names: Collection[str]) -> np.ndarray:
        """The same without some parameters."""
        kept = [k for k, name in enumerate(self.parameters) if name not in names]
        gram, right, square = self.sums
        return scores((gram[:, :, kept][..., kept], right[:, :, kept], square))

    @cached_property
    def entries(self) -> np.ndarray:
        """Packed entries of Φ of all rows, shape (entries, rows)."""
        if self.known is not None:
            return self.known
        return self.regressor.packed(*(self.channels[c].T for c in MOTION))

    @cached_property
    def sums(self) -> Sums:
        """Sums of each stretch and joint, torques in units of their own rms."""
        ends = np.flatnonzero(np.diff(self.block, prepend=-1, append=-1))
        stretches = [slice(start, stop) for start, stop in pairwise(ends)]
        shape, size = (len(stretches), self.robot.size), len(self.regressor.parameters)
        gram, right, square = (
            np.zeros((*shape, size, size)),
            np.zeros((*shape, size)),
            np.zeros(shape),
        )
        if self.like is not None:
            gram, right, square = (x.copy() for x in self.like.sums)
        for j in range(self.robot.size):
            if self.like is not None and self._has_torque_of(self.like, j):
                continue
            columns, rows = self.regressor.columns_of(j), self._rows_of(j)
            for k, part in enumerate(stretches):
                products = rows[:, part] @ rows[:, part].T
                gram[k, j, columns[:, None], columns] = products[:-1, :-1]
                right[k, j, columns], square[k, j] = products[:-1, -1], products[-1, -1]
        return gram, right, square

    def _has_torque_of(self, other: ReadingRows, joint: int) -> bool:
        """Whether a joint has the same torque on the same rows."""
        pairs = (self.channels["tau"], other.channels["tau"]), (self.moving, other.moving)
        return all(np.array_equal(own[:, joint], their[:, joint]) for own, their in pairs)

    def _rows_of(self, joint: int) -> np.ndarray:
        """Φ of a joint's own columns, and τ in units of its rms, shape (columns + 1, rows)."""
        tau, moving = self.channels["tau"][:, joint], self.moving[:, joint]
        size = np.sqrt(np.mean(np.where(moving, tau, 0.0) ** 2))
        scale = moving / (size if size > 0.0 else np.inf)
        own = slice(*self.regressor.offsets[joint : joint + 2])
        return np.vstack([self.entries[own], tau]) * scale


def _regressor(robot: Robot, names: tuple[str, ...]) -> Regressor:
    """Φ of parameters by name; of all where another direction of gravity has others."""
    base = base_parameters(robot)
    places = {name: k for k, name in enumerate(base.names)}
    named = [base.parameters[places[name]] for name in names if name in places]
    return regressor_of(robot, named if len(named) == len(names) else base.parameters)


def scores(sums: Sums) -> np.ndarray:
    """Mean logarithm of the joints' relative errors in each stretch, shape (stretches,)."""
    gram, right, _ = sums
    weights = _weights(sums)
    a, b = sum(w * gram[:, j] for j, w in enumerate(weights)), weights @ right
    return _scores(_solved(a.sum(axis=0) - a, b.sum(axis=0) - b), sums)


def fitted_scores(sums: Sums) -> np.ndarray:
    """The same of the fit to all stretches, a tenth of the work: `scores` are larger."""
    gram, right, _ = (x.sum(axis=0) for x in sums)
    weights = _weights(sums)
    return _scores(_solved(np.tensordot(weights, gram, 1), weights @ right), sums)


def _weights(sums: Sums) -> np.ndarray:
    """Of the joints: the inverse of each one's relative mean square error, shape (joints,)."""
    gram, right, square = (x.sum(axis=0) for x in sums)
    left = _left(_solved(gram.sum(axis=0), right.sum(axis=0)), gram, right, square)
    return np.asarray(square / np.maximum(left, LEAST**2 * square + 1e-300))


def _scores(theta: np.ndarray, sums: Sums) -> np.ndarray:
    """Of parameters, of each stretch or of all."""
    gram, right, square = sums
    moves = square > STILL * square.sum(axis=0) / len(gram)
    missed = _left(theta, gram, right, square) / np.where(moves, square, 1.0)
    found = np.where(moves, 0.5 * np.log(np.maximum(missed, LEAST**2)), 0.0)
    return np.asarray(found.sum(axis=1) / np.maximum(moves.sum(axis=1), 1))


def mean_error(scores: np.ndarray) -> float:
    """Geometric mean of the joints' errors on all stretches, each predicted from all others [%]."""
    return 100.0 * float(np.exp(scores.mean()))


def _solved(gram: np.ndarray, right: np.ndarray) -> np.ndarray:
    """θ of normal equations, shape (…, parameters); leading axes are kept."""
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", gram), 1e-300))
    scaled = gram / (size[..., :, None] * size[..., None, :]) + RIDGE * np.eye(gram.shape[-1])
    return np.asarray(np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size)


def _left(theta: np.ndarray, gram: np.ndarray, right: np.ndarray, square: np.ndarray) -> np.ndarray:
    """‖τ_j - Φ_j θ‖² of each joint, shape (…, joints); leading axes are kept."""
    turned = theta[..., None, :]
    explained = np.sum(turned * ((gram @ turned[..., None])[..., 0] - 2.0 * right), axis=-1)
    return np.asarray(np.maximum(square + explained, 0.0))


def _stride(model: InverseModel) -> int:
    """Every so many rows of a model are used."""
    rows = model.rate / float(model.at[1] - model.at[0])
    return max(1, int(rows / (DENSITY * min(BANDWIDTH, 0.1 * model.rate))))


def _counting(model: InverseModel) -> np.ndarray:
    """Rows away from standstill and reversals, or all that move where these are few."""
    away = model.away_from_reversals().moving
    return np.where(away.sum(axis=0) > FEW_ROWS, away, model.moving)
