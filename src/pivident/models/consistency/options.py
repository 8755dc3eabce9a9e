"""Options for consistent estimates: prior, reference, margin, bounds of the links, and names.

Names of physically consistent estimates: ``pc-piv`` is ``piv`` made consistent.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

from pivident.estimation.methods import METHODS

if TYPE_CHECKING:
    from pivident.estimation.identification import Identification
    from pivident.models.consistency.consistent_model import ConsistentModel
    from pivident.models.consistency.constraints import Bounds
    from pivident.robot.description import Robot

#: Prefix of the method whose estimate is made consistent.
PREFIX = "pc-"
#: Name of each consistent estimate, and the method of the free one.
CONSISTENT_METHODS = {f"{PREFIX}{free}": free for free in METHODS}


@dataclass(frozen=True, eq=False)
class ConsistencyOptions:
    """How estimates are made consistent, see `pivident.make_consistent`."""

    # rule that selects among equally near sets of bodies
    prior: Literal["entropic", "euclidean", "none"] = "entropic"
    bounds: Bounds | None = None  # bounds of the links, or None
    # diameter of the steel ball that bounds every link from below [m]; None: the default
    margin: float | None = None
    reference: Robot | None = None  # robot with the nominal bodies; None: the identified one's own
    accept_far: bool = False  # whether parameters far from the estimate are accepted

    def to_values(self) -> dict[str, Any]:
        """The options as plain values, ready for JSON."""
        bounds = {} if self.bounds is None else asdict(self.bounds)
        return {
            "prior": self.prior,
            "margin": self.margin,
            "reference": None if self.reference is None else self.reference.name,
            "accept_far": self.accept_far,
            "bounds": {key: value for key, value in bounds.items() if value},
        }

    def make_consistent(self, identification: Identification) -> ConsistentModel:
        """Make an estimate consistent with these options."""
        from pivident.models.consistency.consistent_model import MIN_BALL, make_consistent

        return make_consistent(
            identification,
            prior=self.prior,
            bounds=self.bounds,
            margin=MIN_BALL if self.margin is None else self.margin,
            reference=self.reference,
            accept_far=self.accept_far,
        )


def free_methods(names: Iterable[str]) -> list[str]:
    """The methods to run, each once: ``ls, piv, pc-piv`` needs ``ls`` and ``piv``."""
    return list(dict.fromkeys(CONSISTENT_METHODS.get(name, name) for name in names))


def made_consistent(names: Iterable[str]) -> tuple[str, ...]:
    """Methods whose consistent estimate is requested, without the prefix."""
    return tuple(CONSISTENT_METHODS[name] for name in names if name in CONSISTENT_METHODS)


def consistent_label(method: str) -> str:
    """Name of the consistent estimate in tables: ``PC-IDIM-PIV``."""
    return f"PC-{method}"
