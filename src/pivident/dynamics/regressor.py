"""Observation matrix Φ(q, dq, ddq), with tau = Φ θ, linear in the parameters; (P-3).

Inside, the matrix is *packed*: only the structurally non-zero entries are computed, one row per
entry, time last, sorted by joint. On the TX40 that is about a third of the dense matrix. The
dense form (samples, joints, parameters) is filled from it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.dynamics.elementary import TILE
from pivident.dynamics.entry_plan import EntryPlan, has_inner_signal, make_entry_plan
from pivident.dynamics.friction import friction_column
from pivident.dynamics.kernels import tree_of
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor_kernels import DENSE, PACKED, TORQUES, observe, tile_rows
from pivident.foundation.compiled import read_only
from pivident.foundation.errors import UnusableValue
from pivident.foundation.scratch import working_array
from pivident.foundation.text.display import Displayed
from pivident.foundation.threads import run_in_threads
from pivident.robot.description import Robot

BLOCK = 2048  # samples per block of a thread

_UNWEIGHTED = np.empty(0)

_own = threading.local()


@dataclass(frozen=True, eq=False)
class Regressor(Displayed):
    """The observation matrix of a robot for chosen parameters.

    Attributes:
        robot: the robot.
        parameters: the columns, in order.
        row: joint of each packed entry, ascending, shape (entries,).
        column: parameter of each packed entry, shape (entries,).
        offsets: entries of joint j are ``offsets[j]:offsets[j+1]``, shape (joints + 1,).
        inner_entries: entries that need more than one sample, friction with memory and friction
            that depends on load, ascending; most robots have none.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    row: np.ndarray  # joint of each packed entry, ascending, (entries,)
    column: np.ndarray  # parameter of each packed entry, (entries,)
    offsets: np.ndarray  # entries of joint j: offsets[j]:offsets[j+1], (joints + 1,)
    inner_entries: np.ndarray  # entries of friction with memory or load, ascending
    _plan: EntryPlan = field(repr=False)

    @classmethod
    def build(cls, robot: Robot, parameters: Sequence[Parameter], probed: bool = True) -> Regressor:
        """Find the non-zero entries: by the tree's structure, then by probing random states.

        A probe decides because geometry hides zeros that the tree does not show (a vertical
        first axis does not feel gravity). Friction acts on its own joint whatever its constants,
        even where a random speed does not show it.

        Args:
            robot: the robot.
            parameters: columns of the observation matrix, in their order.
            probed: whether random states are asked, which takes longer than a torque or two.

        Returns:
            The regressor, which knows where entries can be non-zero.

        Raises:
            UnusableValue: a mechanism with closed loops, see `dynamics.robot_regressor`.
        """
        if robot.constraints is not None:
            raise UnusableValue(
                f"{robot!r} has closed loops", advice="use regressor_of(robot, parameters)"
            )
        candidates = list(_possible_entries(robot, parameters))
        everything = cls._from_entries(robot, tuple(parameters), candidates)
        if not probed:
            return everything
        q, dq, ddq = np.random.default_rng(20180501).uniform(-2.0, 2.0, (3, robot.size, 64))
        inner = np.zeros((everything.inner_entries.size, 64))
        packed = everything.packed(q, dq, ddq, inner=inner)
        scale = max(1.0, float(np.abs(packed).max(initial=0.0)))
        alive = np.abs(packed).max(axis=1) > 1e-12 * scale
        alive |= np.array([parameters[c].friction is not None for c in everything.column], bool)
        if alive.all():
            return everything
        return cls._from_entries(
            robot,
            tuple(parameters),
            [
                (int(j), int(c))
                for j, c in zip(everything.row[alive], everything.column[alive], strict=True)
            ],
        )

    @classmethod
    def _from_entries(
        cls, robot: Robot, parameters: tuple[Parameter, ...], entries: list[tuple[int, int]]
    ) -> Regressor:
        entries = sorted(entries)
        row = np.array([j for j, _ in entries], dtype=np.int64)
        column = np.array([c for _, c in entries], dtype=np.int64)
        offsets = np.searchsorted(row, np.arange(robot.size + 1))
        plan = make_entry_plan(robot, parameters, entries)
        inner = [e for e, (_, c) in enumerate(entries) if has_inner_signal(parameters[c])]
        return cls(robot, parameters, row, column, offsets, np.array(inner, dtype=np.int64), plan)

    def in_geometry_of(self, robot: Robot) -> Regressor:
        """The same entries of a robot that differs in frames of joints and gravity alone."""
        return replace(self, robot=robot, _plan=self._plan._replace(tree=tree_of(robot)))

    def __reduce__(self) -> tuple:
        # plans hold addresses of functions, which another process has elsewhere
        return type(self).build, (self.robot, self.parameters)

    @property
    def entries(self) -> int:
        """Number of structurally non-zero entries."""
        return self.row.size

    def columns_of(self, joint: int) -> np.ndarray:
        """Parameters that act on a joint: indices into ``parameters``."""
        return self.column[self.offsets[joint] : self.offsets[joint + 1]]

    def packed(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
        inner: np.ndarray | None = None,
        place: np.ndarray | None = None,
    ) -> np.ndarray:
        """Non-zero entries of Φ, time **last**, of motion (joints, samples): (entries, samples).

        Args:
            q: joint positions [rad or m], shape (joints, samples); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            out: array (rows, samples) to write into; rows of no entry stay as they are.
            inner: columns of :meth:`inner`, shape (inner entries, samples); needed for a
                stretch of a longer record. None: these signals are the beginning of their
                record, and loads are zero.
            place: row of ``out`` for each entry, shape (entries,); None: one below the other.

        Returns:
            Entries, shape (entries, samples), or ``out``.

        Raises:
            ValueError: shapes that do not fit.
        """
        q, dq, ddq = (_in_order(x) for x in (q, dq, ddq))
        self._check_motion(q.T, dq.T, ddq.T)
        out, place = self._packed_out(out, place, q.shape[1])
        own = _in_order(self._inner_or_own(q, dq, ddq, inner))
        observe(self._plan, _tile(self._plan), PACKED, place, _UNWEIGHTED, q, dq, ddq, own, out)
        return out

    def matrix(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        out: np.ndarray | None = None,
        inner: np.ndarray | None = None,
    ) -> np.ndarray:
        """Dense Φ, tau = Φ θ, of motion (samples, joints): (samples, joints, parameters).

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            out: array (samples, joints, parameters) of an earlier call to write into. Its
                structural zeros are taken to be zero already and are not written again.
            inner: as for :meth:`packed`, shape (inner entries, samples).

        Returns:
            Φ, shape (samples, joints, parameters).

        Raises:
            ValueError: shapes that do not fit.
        """
        self._check_motion(q, dq, ddq)
        samples, out = q.shape[0], self._dense_out(out, q.shape[0])
        place = self.row * out.shape[2] + self.column
        flat = out.reshape(samples, out.shape[1] * out.shape[2])
        own = self._inner_or_own(q.T, dq.T, ddq.T, inner)

        def block(part: slice) -> None:
            x, dx, ddx = (_in_order(signal[part].T) for signal in (q, dq, ddq))
            inside = _in_order(own[:, part])
            tile = _tile(self._plan)
            observe(
                self._plan, tile, DENSE, place, _UNWEIGHTED, x, dx, ddx, inside, flat[part]
            )  # fmt: skip

        run_in_threads(block, _blocks(samples))
        return out

    def torque(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        theta: np.ndarray,
        inner: np.ndarray | None = None,
    ) -> np.ndarray:
        """Tau = Φ(q, dq, ddq) θ, shape (samples, joints) [N m or N].

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            theta: parameters, shape (parameters,).
            inner: as for :meth:`packed`, shape (inner entries, samples). None: made here, with
                the load of ``theta``.

        Raises:
            ValueError: shapes that do not fit.
        """
        self._check_motion(q, dq, ddq)
        theta = np.asarray(theta, dtype=float)
        own = self._inner_or_own(q.T, dq.T, ddq.T, inner, theta)
        return self._weighted_sum(theta[self.column], q, dq, ddq, own)

    def inner(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        theta: np.ndarray | None = None,
    ) -> np.ndarray:
        """Columns that need more than one sample, friction with memory or load, time **last**.

        They are made once for a whole record and handed to :meth:`packed`, :meth:`matrix` and
        :meth:`torque` with the blocks it is walked through in.

        Args:
            q: joint positions [rad or m] from the start of the record on, where friction with
                memory is relaxed, time **last**, shape (joints, samples); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            theta: parameters whose torques of inertia, gravity and springs are the load, shape
                (parameters,); None: the load is zero.

        Returns:
            Columns of ``inner_entries``, shape (inner entries, samples).
        """
        out = np.zeros((self.inner_entries.size, q.shape[1]))
        friction = [self.parameters[self.column[e]].friction for e in self.inner_entries]
        load: np.ndarray | None = None
        for k, (e, term) in enumerate(zip(self.inner_entries, friction, strict=True)):
            assert term is not None
            j = self.row[e]
            if term.has_memory:
                out[k] = friction_column(term, dq[j], q[j])
            elif theta is not None:
                load = self._load(q, dq, ddq, theta, out) if load is None else load
                out[k] = friction_column(term, dq[j], q[j], load[:, j])
        return out

    def levels(self, dq: np.ndarray) -> np.ndarray:
        """Inner signals of steady motion with a load of one: the sign of the speed.

        They stand for the columns with memory or load where states do not follow each other.

        Args:
            dq: joint speeds [rad/s or m/s], time last, shape (joints, samples).
        """
        return np.sign(dq[self.row[self.inner_entries]])

    @property
    def depends_on_load(self) -> bool:
        """Whether a column depends on the parameters, through the load of a joint."""
        return bool(self.load_parameters.any())

    @property
    def load_parameters(self) -> np.ndarray:
        """True for the parameters of friction that grows with the load, shape (parameters,)."""
        return np.array(
            [p.friction is not None and p.friction.depends_on_load for p in self.parameters], bool
        )

    def _load(self, q, dq, ddq, theta: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Torque of inertia, gravity and springs, shape (samples, joints)."""
        carried = np.array([p.carries_load for p in self.parameters], bool)
        weights = np.where(carried, theta, 0.0)[self.column]
        return self._weighted_sum(weights, q.T, dq.T, ddq.T, inner)

    def _weighted_sum(
        self, weights: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, inner: np.ndarray
    ) -> np.ndarray:
        """Sum of each joint's entries with given weights, shape (samples, joints)."""
        tau = working_array(q.shape)

        def block(part: slice) -> None:
            x, dx, ddx = (_in_order(signal[part].T) for signal in (q, dq, ddq))
            torque = np.empty(x.shape)
            inside = _in_order(inner[:, part])
            tile = _tile(self._plan)
            observe(
                self._plan, tile, TORQUES, self.offsets, weights, x, dx, ddx, inside, torque
            )  # fmt: skip
            tau[part] = torque.T

        run_in_threads(block, _blocks(len(q)))
        return tau

    def _inner_or_own(
        self,
        q: np.ndarray,
        dq: np.ndarray,
        ddq: np.ndarray,
        inner: np.ndarray | None,
        theta: np.ndarray | None = None,
    ) -> np.ndarray:
        """The inner signals given, or those of the stretch itself; signals are time last."""
        shape = (self.inner_entries.size, q.shape[1])
        if self.inner_entries.size == 0:
            return np.zeros(shape)
        if inner is None:
            return self.inner(q, dq, ddq, theta)
        if inner.shape != shape:
            raise UnusableValue(f"inner has shape {inner.shape}", advice=f"{shape} is needed")
        return inner

    def _packed_out(
        self, out: np.ndarray | None, place: np.ndarray | None, samples: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where ``packed`` writes: array and row of each entry, as given or new."""
        if place is None:
            place = np.arange(self.entries)
        shape = (int(place.max(initial=-1)) + 1, samples)
        if out is None:
            out = np.empty(shape)
        if len(out) < shape[0] or out.shape[1:] != shape[1:]:
            raise UnusableValue(
                f"out has shape {out.shape}", advice=f"{shape} or more rows are needed"
            )
        return out, place

    def _dense_out(self, out: np.ndarray | None, samples: int) -> np.ndarray:
        """Where ``matrix`` writes, as given or new."""
        shape = (samples, self.robot.size, len(self.parameters))
        if out is None:
            out = np.zeros(shape)
        if out.shape != shape or not out.flags.c_contiguous:
            raise UnusableValue(
                f"out has shape {out.shape}", advice=f"{shape} in C order is needed"
            )
        return out

    def _check_motion(self, *signals: np.ndarray) -> None:
        """Refuse other shapes than (samples, joints): the compiled loops do not check them."""
        shapes = [np.shape(x) for x in signals]
        if any(len(s) != 2 or s[1] != self.robot.size or s != shapes[0] for s in shapes):
            raise UnusableValue(
                f"q, dq, ddq have shapes {', '.join(map(str, shapes))}",
                advice=f"all must be (samples, {self.robot.size}), with one row for a single "
                "state: q[None]",
            )


def _tile(plan: EntryPlan) -> np.ndarray:
    """Working memory of the compiled loops, kept by each thread.

    Half a megabyte allocated at every call comes from the system page by page, which takes longer
    than the columns of a thousand samples.
    """
    rows = tile_rows(plan)
    kept: np.ndarray | None = getattr(_own, "tile", None)
    if kept is None or len(kept) < rows:
        kept = _own.tile = np.zeros((rows, TILE))
    return kept


def _blocks(samples: int) -> list[slice]:
    """Consecutive blocks of a record."""
    return [slice(start, min(start + BLOCK, samples)) for start in range(0, samples, BLOCK)]


def _in_order(signal: np.ndarray) -> np.ndarray:
    """A signal (rows, samples) as ``observe`` is compiled for: contiguous and read-only."""
    return read_only(np.ascontiguousarray(signal, dtype=float))


def _possible_entries(robot: Robot, parameters: Sequence[Parameter]) -> Iterator[tuple[int, int]]:
    """(joint, parameter) pairs that the tree allows to be non-zero."""
    for c, p in enumerate(parameters):
        if p.is_inertial:
            yield from ((j, c) for j in robot.ancestors(p.joint))
        elif p.coupling is not None:
            yield from ((p.coupling.joint, c), (p.coupling.motor, c))
        else:
            yield p.joint, c
