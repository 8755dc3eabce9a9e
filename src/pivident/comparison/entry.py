"""One result in a comparison: its parameters with their intervals, and what it came from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from pivident.comparison.groups import Groups, base_of, groups_of
from pivident.consistency.significance import HALF_INTERVAL
from pivident.errors import PividentError
from pivident.estimation.identification import Identification
from pivident.robot.description import Robot


class ComparisonError(PividentError, ValueError):
    """Results that cannot be compared: fewer than two, none in a folder, names that do not fit."""


Kind = Literal["identification", "consistent", "model"]


@dataclass(frozen=True)
class Source:
    """The file that a result was read from."""

    path: str  # as it was given
    sha256: str  # of its bytes
    modified: str  # when it was last written, in ISO 8601, UTC


@dataclass(frozen=True, eq=False)
class Entry:
    """One result.

    Intervals are ±2σ with the robust σ, which allows for residuals that are correlated and of
    changing variance; with IDIM-PIV it is the method's own. Those of consistent parameters are
    profile intervals, drawn from 95 % to 2σ.
    """

    label: str  # name in the comparison, unique
    kind: Kind  # ``identification``, ``consistent`` or ``model``
    method: str
    robot: Robot
    names: tuple[str, ...]  # estimated base parameters
    value: np.ndarray  # estimates, shape (parameters,)
    low: np.ndarray  # lower ends of their intervals, likewise, NaN where there is none
    high: np.ndarray  # upper ends, likewise
    #: of the estimates, shape (parameters, parameters); None where only intervals are known
    covariance: np.ndarray | None
    relative_error: float  # ‖τ - Φθ‖/‖τ‖ on the fitted record, NaN where it is not known
    version: str
    #: SHA-256 of every input file by its name
    inputs: Mapping[str, str] = field(default_factory=dict)
    source: Source | None = None  # the file, None for a result in memory
    identification: Identification | None = None  # the estimate itself; None for models
    notes: tuple[str, ...] = ()  # sentences about this result

    @cached_property
    def groups(self) -> Groups:
        """All base parameters of the robot, those that were left out included."""
        return groups_of(base_of(self.robot, self.names))

    @cached_property
    def place(self) -> Mapping[str, int]:
        """Index of each estimated parameter by its name."""
        return {name: k for k, name in enumerate(self.names)}

    @cached_property
    def all_values(self) -> np.ndarray:
        """All base parameters, zero for those that were left out, shape (base,)."""
        place = self.place
        return np.array([self.value[place[n]] if n in place else 0.0 for n in self.groups.names])

    @property
    def left_out(self) -> tuple[str, ...]:
        """Base parameters of the robot that were not estimated, which the torque takes for zero."""
        return tuple(name for name in self.groups.names if name not in self.place)

    @property
    def condition(self) -> float:
        """Condition number of the column-scaled observation matrix, NaN where it is not known."""
        return math.nan if self.identification is None else self.identification.condition

    @property
    def samples(self) -> int | None:
        """Rows in use, all joints together; None where it is not known."""
        if self.identification is None:
            return None
        return sum(fit.rows for fit in self.identification.joints)

    @property
    def converged(self) -> bool | None:
        """Whether the iteration converged; None where it is not known."""
        return None if self.identification is None else self.identification.converged


def entry_of(identification: Identification, label: str, source: Source | None = None) -> Entry:
    """An identification as an entry."""
    covariance, notes = identification.robust_covariance, []
    if not np.isfinite(covariance).all():
        covariance = identification.covariance
        notes.append(
            f"{label} has no robust standard errors; the method's own are taken, which are too "
            "small where the residual is correlated."
        )
    if not identification.converged:
        notes.append(f"{label} has not converged; its values and intervals are provisional.")
    spread = 2.0 * np.sqrt(np.diag(covariance))
    theta = identification.theta
    return Entry(
        label=label,
        kind="identification",
        method=identification.method,
        robot=identification.robot,
        names=identification.names,
        value=theta,
        low=theta - spread,
        high=theta + spread,
        covariance=covariance,
        relative_error=identification.relative_error,
        version=identification.version,
        inputs=dict(identification.sources),
        source=source,
        identification=identification,
        notes=tuple(notes),
    )


def at_two_sigma(
    value: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of 95 % intervals moved out to 2σ, each side by itself; NaN and infinity stay."""
    factor = 2.0 / HALF_INTERVAL
    return value - factor * (value - low), value + factor * (high - value)
