"""The load on a link with its covariance, the arm without load, and the residuals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.document.document import Accounted, Document, Part
from pivident.foundation.document.table import Table
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.numbers import percent, plus_minus
from pivident.robot.description import INERTIAL
from pivident.studies.payload.arm_and_load import KnownParts
from pivident.studies.payload.joint_masses import IMPROBABLE, NOTABLE, JointMasses
from pivident.studies.payload.load_estimate import LoadEstimate
from pivident.studies.payload.load_quantities import determined, load_quantities, load_sentences
from pivident.studies.payload.possible_load import PossibleLoad, possible_load

#: Version of the layout of ``payload.json``.
SCHEMA = 1

#: Change of a friction parameter, in standard errors, above which it is named.
FRICTION_NAMED = 3.0


@dataclass(frozen=True, eq=False)
class PayloadIdentification(Accounted):
    """An identified load with the quantities to assess it.

    Attributes:
        load: mass, centre of mass and inertia, in the requested frame.
        link: name of the link that carries it.
        joint: name of the joint that moves the link.
        method: name of the method.
        arm: the arm identified without load.
        arm_change: for each of its parameters, the difference between the common estimate and the
            first one over the standard error of that difference, shape (arm,).
        friction_names: friction parameters that may change with the load.
        friction_change: their change ΔF, shape (friction,).
        friction_std: its standard errors, likewise.
        joints: names of the joints.
        relative_errors: ‖τ - Φθ‖/‖τ‖ of each joint on the loaded recordings, shape (joints,).
        rms_errors: rms of τ - Φθ of each joint on them [N m or N], shape (joints,).
        recordings: names of the loaded recordings.
        converged: whether the iteration converged.
        iterations: number of estimates.
        known: known parts of the load.
        masses: mass by the equations of each joint; None where none is determined,
            or the record without load is not there.
        scale: what the scale of the mass rests on, a sentence.
        warnings: reservations.
        sources: SHA-256 of the loaded recordings' files by name.
        version: version of pivident.
    """

    load: LoadEstimate
    link: str
    joint: str
    method: str
    arm: Identification
    arm_change: np.ndarray
    friction_names: tuple[str, ...]
    friction_change: np.ndarray
    friction_std: np.ndarray
    joints: tuple[str, ...]
    relative_errors: np.ndarray
    rms_errors: np.ndarray
    recordings: tuple[str, ...]
    converged: bool
    iterations: int
    known: KnownParts
    masses: JointMasses | None
    scale: str
    warnings: tuple[Finding, ...]
    sources: dict[str, str]
    version: str

    @cached_property
    def possible(self) -> PossibleLoad | None:
        """The nearest physically possible load; None without a positive mass."""
        return possible_load(self.load) if self.load.mass > 0 else None

    def account(self) -> Document:
        """Determined quantities, what speaks for and against them, all values."""
        quantities = load_quantities(self.load)
        blocks: list[str | Table] = [
            f"Load on link {self.link!r} by {self.method}, {self.iterations} estimates.\n"
            f"Frame: {self.load.frame}.",
            determined(quantities),
            *load_sentences(self.load, self.possible),
            *self._sentences(),
        ]
        title = f"{self.arm.robot.name}: load on link {self.link}"
        return Document(
            title, [Part("Load", blocks)], self.warnings, self._stored(quantities), quantities
        )

    def _sentences(self) -> Iterator[str]:
        """Scale and mass by joints, errors, what differs between the records."""
        errors = ", ".join(
            f"{name} {100 * e:.1f} % ({100 * fit.relative_error:.1f})"
            for name, e, fit in zip(self.joints, self.relative_errors, self.arm.joints, strict=True)
        )
        worst = int(np.argmax(np.abs(self.arm_change)))
        yield self.scale
        yield from self._mass_sentences()
        yield f"Torque error with the load (and without): {errors}."
        yield (
            "The arm in both records: largest difference "
            f"{abs(self.arm_change[worst]):.1f} standard errors ({self.arm.names[worst]})."
        )
        if changed := self._friction_sentence():
            yield changed

    def _mass_sentences(self) -> list[str]:
        """The mass by each joint, where two or more determine one."""
        masses = self.masses
        if masses is None or len(masses.joints) < 2 or masses.disagree:
            return []
        agree = "agree on the mass"
        if masses.p_value < IMPROBABLE:
            agree = f"agree on the mass to within {percent(100 * NOTABLE)}, not to within noise"
        return [
            f"The joints {agree} (p = {masses.p_value:.2g}). By their own equations: "
            f"{masses.listed}."
        ]

    def _friction_sentence(self) -> str:
        """Friction parameters that change significantly with the load."""
        units = dict(zip(self.arm.names, self.arm.units, strict=True))
        named = [
            f"{name} {plus_minus(change, 2 * std, sign=True)} {units[name]}"
            for name, change, std in zip(
                self.friction_names, self.friction_change, self.friction_std, strict=True
            )
            if abs(change) > FRICTION_NAMED * std
        ]
        return f"Friction that differs with the load: {', '.join(named)}." if named else ""

    def _stored(self, quantities: Table) -> dict[str, Any]:
        """The content of ``payload.json``."""
        load, nearest, masses = self.load, self.possible, self.masses
        keys = "was_possible", "distance", "p_value", "values", "intervals", "not_found"
        changes = zip(self.friction_names, self.friction_change, self.friction_std, strict=True)
        arm = zip(self.arm.names, self.arm_change, strict=True)
        return {
            "schema": SCHEMA,
            "robot": self.arm.robot.name,
            "link": self.link,
            "joint": self.joint,
            "frame": load.frame,
            "method": self.method,
            "converged": self.converged,
            "iterations": self.iterations,
            "load": [
                {"name": name, "value": value, "std": std, "interval": (low, high), "unit": unit}
                for name, value, std, low, high, unit in map(dict.values, quantities.rows())
            ],
            "parameters": INERTIAL,
            "values": load.values,
            "covariance": load.covariance,
            "rank": load.rank,
            "undetermined": load.undetermined.T,
            "possible": None if nearest is None else {key: getattr(nearest, key) for key in keys},
            "known": self.known,
            "scale": self.scale,
            "masses": None if masses is None else masses.stored(),
            "friction": [{"name": name, "change": x, "std": std} for name, x, std in changes],
            "arm": [{"name": name, "change_over_std": x} for name, x in arm],
            "relative_errors": dict(zip(self.joints, self.relative_errors, strict=True)),
            "rms_errors": dict(zip(self.joints, self.rms_errors, strict=True)),
            "recordings": self.recordings,
            "warnings": self.warnings,
            "sources": {"without_load": self.arm.sources, "with_load": self.sources},
            "version": self.version,
        }
