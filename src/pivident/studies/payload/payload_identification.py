"""The load on a link with its covariance, the arm without load, and the residuals.

Quantities of a load with their intervals, and sentences about those that are not determined.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.document.document import Accounted, Document, Part
from pivident.foundation.document.table import Column, Table, Values
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.numbers import percent, plus_minus
from pivident.robot.description import INERTIAL
from pivident.studies.payload.arm_and_load import KnownParts
from pivident.studies.payload.joint_masses import IMPROBABLE, NOTABLE, JointMasses
from pivident.studies.payload.load_estimate import TWO_SIDED_95, LoadEstimate
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
        agree = (
            f"agree on the mass to within {percent(100 * NOTABLE)}, not to within noise"
            if masses.p_value < IMPROBABLE
            else "agree on the mass"
        )
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


#: Difference between an interval and value ± 1.96 σ that is shown, as a share of the half width.
ASYMMETRIC = 0.05

#: Quantities in words: mass, centre of mass, inertia about it, ten parameters at the origin.
LABELS = {
    "mass": "mass",
    **{f"c{axis}": f"centre of mass {axis}" for axis in "xyz"},
    **{f"j{name}": f"inertia about it {name}" for name in INERTIAL[:6]},
    **{name: f"{name} at the origin" for name in INERTIAL},
}

#: Their units.
UNITS = ("kg", *["m"] * 3, *["kg m²"] * 12, *["kg m"] * 3, "kg")


def load_quantities(load: LoadEstimate) -> Table:
    """All quantities with standard errors and intervals of 95 %, each in the unit of its row.

    The value of a quantity that is not determined is NaN and its standard error infinite; intervals
    of the centre of mass are Fieller's.
    """
    values = np.array([load.mass, *load.center_of_mass, *load.inertia, *load.values])
    std = np.array([load.mass_std, *load.center_of_mass_std, *load.inertia_std, *load.std])
    half, known = TWO_SIDED_95 * std, np.isfinite(std)
    lower, upper = np.where(known, values - half, -np.inf), np.where(known, values + half, np.inf)
    lower[1:4], upper[1:4] = load.fieller_interval().T
    shown = np.where(known, values, np.nan)
    columns: dict[str, Values] = {"name": tuple(LABELS), "value": shown, "std": std}
    return Table("load", columns | {"lower": lower, "upper": upper, "unit": UNITS})


def is_asymmetric(quantities: Table) -> np.ndarray:
    """Whether each interval differs from value ± 1.96 σ, shape (quantities,)."""
    value, std, lower, upper = (np.array(quantities[k]) for k in ("value", "std", "lower", "upper"))
    half = TWO_SIDED_95 * std
    with np.errstate(invalid="ignore"):
        ends = np.abs([lower - (value - half), upper - (value + half)])
        return np.isfinite(std) & ~(ends <= ASYMMETRIC * half).all(axis=0)


def determined(quantities: Table) -> Table:
    """The quantities that are determined; Fieller's interval where it is not symmetric."""
    skew, std = is_asymmetric(quantities), np.array(quantities["std"])
    rows = [k for k in np.flatnonzero(np.isfinite(std)) if k < len(LABELS) - 1]  # m is the mass
    columns = {
        "quantity": Column([tuple(LABELS.values())[k] for k in rows]),
        "value": Column(
            np.array(quantities["value"])[rows], spread=2 * std[rows], spread_title="±2σ"
        ),
        "unit": Column([UNITS[k] for k in rows]),
    }
    if skew[rows].any():
        ends = zip(quantities["lower"], quantities["upper"], skew, strict=True)
        texts = [
            "" if not own else f"{a:.3g} to {b:.3g}" if np.isfinite([a, b]).all() else "unbounded"
            for a, b, own in ends
        ]
        columns["interval"] = Column([texts[k] for k in rows], "95 % interval")
    return Table("determined", columns, title="Determined quantities of the load")


def load_sentences(load: LoadEstimate, nearest: PossibleLoad | None) -> list[str]:
    """Undetermined parameters, and whether a body can have these parameters."""
    if not load.mass > 0:
        return []
    sentences = []
    std = load_quantities(load)["std"]
    lost = [label for label, x in zip(LABELS.values(), std, strict=True) if not np.isfinite(x)]
    if lost:
        sentences.append(
            f"The torques of these records determine {load.rank} of 10 combinations of the load's "
            f"parameters. Not determined: {', '.join(lost)}."
        )
    if nearest is None:
        return [
            *sentences,
            "The solver did not find the nearest real body, so it is unknown whether a body can "
            "have these parameters, and over which range.",
        ]
    if not nearest.was_possible:
        sentences.append(_impossible(nearest))
    if ranges := _bounded(load, nearest):
        sentences.append(f"Not determined by torque, but bounded for real bodies (95 %): {ranges}.")
    if nearest.not_found:
        sentences.append(
            f"The solver did not find the range over real bodies of "
            f"{', '.join(nearest.not_found)}; whether they are bounded is unknown."
        )
    return sentences


def _impossible(nearest: PossibleLoad) -> str:
    mass = nearest.values[9]
    verdict = (
        "this can be noise; the intervals hold"
        if nearest.p_value > 0.01
        else "noise is an unlikely cause: check the records, the frame and the known parts"
    )
    return (
        "No real body has exactly these parameters. The nearest one is "
        f"{nearest.distance:.2g} standard errors away ({mass:.4g} kg): {verdict}."
    )


def _bounded(load: LoadEstimate, nearest: PossibleLoad) -> str:
    """Ranges over real bodies of parameters that no torque determines; empty without any."""
    rows = zip(INERTIAL, UNITS[10:], load.determined, nearest.intervals, strict=True)
    return "; ".join(
        f"{LABELS[name]} {low:.2g} to {high:.2g} {unit}"
        for name, unit, known, (low, high) in rows
        if not known and np.isfinite([low, high]).all()
    )
