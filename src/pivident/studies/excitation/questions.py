"""Questions that a motion answers: about the robot, about a load, about its drive gains.

The motion is run once, or several times with other bodies. With A_j = Σ_t (L_j Φ_j)ᵀ (L_j Φ_j) of
joint j, which all runs share, the information on the unknowns z of a question is

    I = Σ_runs Σ_j M_jᵀ A_j M_j,      Φ_j M_j = how the rows of joint j change with z

- the robot: one run, z = θ and M_j = 1;
- a load with the ten parameters φ at the last link, of which K φ reaches the base parameters: a run
  without it and one with it, z = (θ, φ_b), M_j = (1, 0) and (1, K_b), with independent columns K_b
  of K and φ_b regrouped so that K_b φ_b = K φ;
- drive gains, each wrong by a share δ_j: the same two runs with a load that is known,
  z = (θ, δ), M_j = (1, -θ e_jᵀ) and (1, -(θ + K φ) e_jᵀ).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, independent_columns
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.sentences import listed
from pivident.robot.description import INERTIAL

#: Share of the longest column below which one is rounding.
NO_EFFECT = 1e-9


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked of the records of a motion.

    Attributes:
        names: of the unknowns, shape (unknowns,).
        units: of their values.
        values: their present values, NaN where none is known, shape (unknowns,).
        asked: indices of the unknowns that count.
        runs: M of each run and joint, each (parameters, unknowns); None: the unknowns are the
            parameters, and the motion is run once.
        about: ``robot``, ``load`` or ``gains``.
        words: what is asked, a few words.
        loads: base parameters that the body of each run adds, each (base,).
        notes: what cannot be asked, complete sentences.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    asked: np.ndarray
    runs: tuple[tuple[np.ndarray, ...], ...] | None = None
    about: Literal["robot", "load", "gains"] = "robot"
    words: str = "parameters of the robot"
    loads: tuple[np.ndarray, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.names)

    def sizes(self, significant: np.ndarray) -> np.ndarray:
        """Size of each unknown that matters: its value, or that of a noticeable torque if larger.

        Args:
            significant: sizes of base parameters whose torque is noticeable, shape (base,).
        """
        base = len(significant)
        if self.runs is not None:
            spread = np.max([np.abs(m[:, base:]) for run in self.runs for m in run], axis=0)
            with np.errstate(divide="ignore"):
                further = (significant[:, None] / spread).min(axis=0)
            significant = np.concatenate([significant, further])
        return np.fmax(np.abs(self.values), significant)

    def information(self, by_joint: list[np.ndarray]) -> np.ndarray:
        """Information on the unknowns, shape (unknowns, unknowns).

        Args:
            by_joint: A_j of each joint, shape (parameters, parameters).
        """
        if self.runs is None:
            return np.sum(by_joint, axis=0)
        return sum(m.T @ a @ m for run in self.runs for m, a in zip(run, by_joint, strict=True))

    def slope_of(self, joint: int, slope: np.ndarray) -> np.ndarray:
        """∂J/∂A_j from ∂J/∂I, shape (parameters, parameters)."""
        if self.runs is None:
            return slope
        return np.sum([run[joint] @ slope @ run[joint].T for run in self.runs], axis=0)


def robot_question(
    base: BaseParameters, values: np.ndarray, asked: np.ndarray | None = None
) -> Question:
    """The base parameters of the robot, or some of them.

    Args:
        base: the base parameters.
        values: their present values, NaN where none is known, shape (base,).
        asked: indices of those that count; None: all.
    """
    chosen = np.arange(len(base)) if asked is None else asked
    return Question(base.names, tuple(p.unit for p in base.parameters), values, chosen)


def load_question(base: BaseParameters, values: np.ndarray, load: np.ndarray) -> Question:
    """A load at the last link, from one run without it and one with it.

    Args:
        base: the base parameters.
        values: their present values, shape (base,).
        load: expected ``xx xy xz yy yz zz mx my mz m`` of the load in the last link's frame, for
            the sizes that matter, shape (10,).

    Raises:
        ExperimentError: no torque depends on a load.
    """
    n, p = base.robot.size, len(base)
    spread = load_columns(base)
    kept, regrouping = _regrouped(spread)
    if not kept:
        raise ExperimentError(
            f"no torque of {base.robot.name!r} depends on a load at its last link, so that no "
            "motion identifies one"
        ).about("about")
    stems = [INERTIAL[k] for k in kept]
    grouped = np.count_nonzero(regrouping, axis=1) > 1
    names = [f"load {s}{'r' if r else ''}" for s, r in zip(stems, grouped, strict=True)]
    without = np.hstack([np.eye(p), np.zeros((p, len(kept)))])
    loaded = np.hstack([np.eye(p), spread[:, kept]])
    units = {"m": "kg", "mx": "kg m", "my": "kg m", "mz": "kg m"}
    return Question(
        (*base.names, *names),
        (*(q.unit for q in base.parameters), *(units.get(s, "kg m²") for s in stems)),
        np.concatenate([values, regrouping @ load]),
        np.arange(p, p + len(kept)),
        ((without,) * n, (loaded,) * n),
        "load",
        "a load, from a run without it and a run with it",
        (np.zeros(p), spread @ load),
        tuple(_without_effect(kept, regrouping)),
    )


def _regrouped(columns: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Independent columns K_b of K, and R with K φ = K_b R φ, shape (kept, parameters)."""
    length = np.linalg.norm(columns, axis=0)
    active = length > NO_EFFECT * length.max()
    scaled = columns / np.where(active, length, 1.0)
    kept, _ = independent_columns(scaled, np.flatnonzero(active).tolist())
    regrouping = np.linalg.pinv(columns[:, kept]) @ columns
    return kept, np.where(np.abs(regrouping) < NO_EFFECT, 0.0, regrouping)


def _without_effect(kept: list[int], regrouping: np.ndarray) -> Iterator[str]:
    """Which of the load's parameters have no effect, and which regroup with others."""
    without = [stem for stem, column in zip(INERTIAL, regrouping.T, strict=True) if not any(column)]
    if without:
        yield (
            f"No torque of this robot depends on {listed(without)} of the load, whatever the "
            "motion: they are left out."
        )
    sums = [
        f"{INERTIAL[k]}r = {INERTIAL[k]}"
        + "".join(f" {row[i]:+.4g} {INERTIAL[i]}" for i in np.flatnonzero(row) if i != k)
        for k, row in zip(kept, regrouping, strict=True)
        if np.count_nonzero(row) > 1
    ]
    if sums:
        yield f"Torques depend on these sums of the load's parameters only: {'; '.join(sums)}."


def gain_question(base: BaseParameters, values: np.ndarray, load: np.ndarray) -> Question:
    """Drive gains, from one run without a known load and one with it.

    Args:
        base: the base parameters.
        values: their present values, shape (base,).
        load: ``xx xy xz yy yz zz mx my mz m`` of the known load in the last link's frame, shape
            (10,).
    """
    n, p = base.robot.size, len(base)
    loaded = values + load_columns(base) @ load

    def run(theta: np.ndarray) -> tuple[np.ndarray, ...]:
        made = []
        for j in range(n):
            error = np.zeros((p, n))
            error[:, j] = -theta
            made.append(np.hstack([np.eye(p), error]))
        return tuple(made)

    return Question(
        (*base.names, *(f"gain of {name}" for name in base.robot.joint_names)),
        (*(q.unit for q in base.parameters), *("1",) * n),
        np.concatenate([values, np.ones(n)]),
        np.arange(p, p + n),
        (run(values), run(loaded)),
        "gains",
        "drive gains, from a run without the known load and a run with it",
        (np.zeros(p), loaded - values),
    )


def load_columns(base: BaseParameters) -> np.ndarray:
    """K: what the ten parameters of a body at the last link add to the base parameters.

    Args:
        base: the base parameters.

    Returns:
        Shape (base, 10).
    """
    last = base.robot.size - 1
    columns = np.zeros((len(base), len(INERTIAL)))
    for i, p in enumerate(base.standard):
        if p.joint == last and p.is_inertial:
            unit = np.zeros(len(base.standard))
            unit[i] = 1.0
            columns[:, INERTIAL.index(p.stem)] = base.values(unit)
    return columns
