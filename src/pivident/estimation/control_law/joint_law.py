"""The control law of one joint: gains, lag, gravity model, standard errors and warnings.

Its columns and its differentiator are chosen in ``law_equations``, its gravity model in
``law_gravity``. Here they become a law: gains with standard errors from a sandwich, which holds for
a residual that is correlated and of changing variance, but not below those of a white residual.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.control_law.law_equations import (
    Channel,
    Column,
    Equations,
    Term,
    best_equations,
    column_of,
    system_of,
)
from pivident.estimation.control_law.law_gravity import (
    PLACE_TEXTS,
    GravityColumns,
    GravityFit,
    JointGravity,
    best_gravity,
)
from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.covariance.windows import windows_of
from pivident.estimation.normal_equations import JointSums
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.numbers import (
    column,
    format_significant,
    lines_of,
    plus_minus,
    with_spread,
)
from pivident.loop.simulation.control_loop import IdentifiedLaw


@dataclass(frozen=True, eq=False)
class JointLaw:
    """The law of one joint."""

    name: str  # name of the joint
    terms: tuple[Term, ...]  # terms in use
    gains: np.ndarray  # their gains, shape (terms,)
    std: np.ndarray  # robust standard errors of the gains
    derivative_time: float  # lag T of the differentiator [s]
    derivative_time_std: float  # its standard error [s]
    averaged: bool  # whether two-sample means are differenced
    rms: float  # rms of what the law does not explain [u]
    relative_error: float  # that over the rms of u
    f_tests: dict[str, float]  # F statistic of every extra term when it was tried last
    samples: int  # samples used; saturated ones are left out
    saturated: int  # samples left out
    #: The gravity model that it adds; None: it does not compensate gravity.
    gravity: JointGravity | None = None

    def gain(self, term: Term) -> float:
        """Gain of a term, zero where it is not used."""
        return float(self.gains[self.terms.index(term)]) if term in self.terms else 0.0

    @property
    def cascade(self) -> tuple[float, float, float, float]:
        """The law as a cascade kv (kp e - v̂): kp [1/s] and kv, each with its standard error.

        The standard error of the ratio is that of independent gains, an upper bound where they are
        positively correlated.
        """
        kp, kv = self.gain("kp"), self.gain("kd")
        std = dict(zip(self.terms, self.std, strict=True))
        ratio = kp / kv
        relative = np.hypot(std["kp"] / kp, std["kd"] / kv)
        return ratio, abs(ratio) * float(relative), kv, float(std["kd"])

    def to_values(self) -> dict[str, Any]:
        """The law as plain values, for the file of a result."""
        return {
            "joint": self.name,
            "terms": self.terms,
            "gains": self.gains,
            "std": self.std,
            "differentiator": differentiator_values(
                self.averaged, self.derivative_time, self.derivative_time_std
            ),
            "relative_error": self.relative_error,
            "saturated": self.saturated,
            "f_tests": self.f_tests,
            "gravity": None if self.gravity is None else self.gravity.to_values(),
        }


def differentiator_values(averaged: bool, time: float = 0.0, std: float = 0.0) -> dict[str, Any]:
    """How a law differentiates the position, as plain values; ``time`` is its lag T [s]."""
    kind = "two_sample_means" if averaged else "lag" if time else "backward_difference"
    return {"kind": kind, "time": time, "std": std}


def joint_law(
    name: str,
    channels: Sequence[Channel],
    wanted: Sequence[Term] | None,
    recordings: Sequence[Recording],
    weights: GravityColumns | None,
    drive_gain: float,
) -> tuple[JointLaw, np.ndarray]:
    """The law of one joint, and what it makes of the output of the first recording."""
    error = np.concatenate([(c.q_ref - c.q)[c.use] for c in channels])
    if not error.size or np.ptp(error) == 0.0:
        raise IdentificationError(
            f"joint {name!r} has no control error to identify a law from: its reference equals "
            "the position. Was the position logged as its own reference?"
        )
    equations, columns, tests = best_equations(channels, wanted=wanted)
    fit = None
    if weights is not None:
        fit = best_gravity(channels, recordings, weights, (equations, columns))
    if fit is not None and weights is not None:
        law, model = _finished(name, fit.channels, fit.equations, fit.columns, fit.tests)
        law = _with_gravity(law, fit, weights, drive_gain)
        if law.gravity is not None and law.gravity.is_significant:
            return law, model
    return _finished(name, channels, equations, columns, tests)


def _with_gravity(
    law: JointLaw, fit: GravityFit, weights: GravityColumns, drive_gain: float
) -> JointLaw:
    """The law with its gravity model's share of the gains in the unit of the parameters."""
    model = [k for k, c in enumerate(fit.columns) if isinstance(c, int)]
    rest = [k for k, c in enumerate(fit.columns) if not isinstance(c, int)]
    gravity = JointGravity(
        fit.place,
        tuple(weights.parameters[c] for c in fit.columns if isinstance(c, int)),
        law.gains[model] * drive_gain,
        law.std[model] * abs(drive_gain),
        fit.statistic,
        fit.taken,
    )
    return replace(law, gains=law.gains[rest], std=law.std[rest], gravity=gravity)


def _finished(
    name: str,
    channels: Sequence[Channel],
    equations: Equations,
    chosen: tuple[Column, ...],
    tests: dict[str, float],
) -> tuple[JointLaw, np.ndarray]:
    """Gains with robust standard errors; the lag's column is the derivative of the fit by T.

    Of a law with a gravity model, gains and standard errors are those of all of its columns.
    """
    time, averaged = equations.time, equations.averaged
    gains = equations.fit(chosen)[0]
    phi, u = system_of(channels, chosen, time, averaged)
    residual = u - phi @ gains
    rss = float(residual @ residual)
    columns = phi
    if time > 0.0:
        step = 1e-4 * time
        ahead = system_of(channels, chosen, time + step, averaged)[0] @ gains
        behind = system_of(channels, chosen, time - step, averaged)[0] @ gains
        columns = np.column_stack([phi, (ahead - behind) / (2.0 * step)])
    std = np.sqrt(_variances(columns, residual))
    saturated = sum(c.saturated for c in channels)
    model = sum(
        (g * column_of(channels[0], c, time, averaged) for g, c in zip(gains, chosen, strict=True)),
        np.zeros(channels[0].u.size),
    )
    law = JointLaw(
        name=name,
        terms=tuple(c for c in chosen if not isinstance(c, int)),
        gains=gains,
        std=std[: len(chosen)],
        derivative_time=time,
        derivative_time_std=float(std[-1]) if time > 0.0 else 0.0,
        averaged=averaged,
        rms=float(np.sqrt(rss / u.size)),
        relative_error=float(np.sqrt(rss / np.sum(u**2))),
        f_tests=tests,
        samples=u.size,
        saturated=saturated,
    )
    return law, model


def _variances(columns: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Variances of the linear fit with these columns: the sandwich's, or those of a white residual.

    The larger one is taken for each gain. A motion that begins or stops hard determines a gain
    within a few windows, and a jackknife over windows then does not know how uncertain it is.
    """
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    scaled = columns / scale
    (windows,) = windows_of([residual.size])
    sums = JointSums.empty("", np.arange(scale.size), windows.count)
    sums.add(scaled.T, None, residual, None, list(windows.shares(slice(0, residual.size))))
    robust = sandwich([sums], np.zeros(scale.size), np.ones(1))
    freedom = max(residual.size - scale.size, 1)
    white = np.linalg.pinv(scaled.T @ scaled, hermitian=True) * (residual @ residual) / freedom
    return np.maximum(np.diag(robust), np.diag(white)) / scale**2


def diagnostics_of(law: JointLaw) -> Iterator[str]:
    """What has to be said about a law."""
    if law.relative_error > 0.1:
        yield (
            f"The law found for joint {law.name!r} leaves {100 * law.relative_error:.2g} % of its "
            "output unexplained; take its gains as nominal."
        )
    yield from [
        f"{term} of joint {law.name!r} is {plus_minus(gain, 2 * std)}: this record hardly "
        "determines it."
        for term, gain, std in zip(law.terms, law.gains, law.std, strict=True)
        if std > 0.5 * abs(gain)
    ]


def controller_table(found: IdentifiedLaw) -> str:
    """An identified control law: gains with intervals, differentiator, fit, for each joint.

    Where laws compensate gravity, their gravity models come as a second table.
    """
    names = list(dict.fromkeys(term for law in found.joints for term in law.terms))
    columns = [column("joint", [law.name for law in found.joints], "<")]
    for term in names:
        spreads = [
            with_spread(law.gain(term), 2.0 * law.std[law.terms.index(term)])
            if term in law.terms
            else ("", "")
            for law in found.joints
        ]
        columns += [
            column(term, [value for value, _ in spreads], "."),
            column("±2σ", [spread for _, spread in spreads], "."),
        ]
    speeds = [
        differentiator_text(law.averaged, law.derivative_time, law.derivative_time_std)
        for law in found.joints
    ]
    columns.append(column("speed", speeds, "<"))
    errors = [format_significant(100.0 * law.relative_error, 2) for law in found.joints]
    columns += [
        column("error %", errors, "."),
        column("saturated", [str(law.saturated) for law in found.joints], ">"),
    ]
    head = f"Control law of {', '.join(found.recordings)}, output per rad or m, rad/s or m/s, …"
    parts = [head, lines_of(columns), *_gravity_tables(found)]
    return "\n\n".join([*parts, *(f"Warning: {t}" for t in found.warnings)])


def _gravity_tables(found: IdentifiedLaw) -> list[str]:
    """What each joint's law takes for the robot's weight; nothing where none compensates it."""
    rows = [
        (law.name, PLACE_TEXTS[own.place], p.name, *with_spread(value, 2.0 * std), p.unit)
        for law in found.joints
        if (own := law.gravity) is not None
        for p, value, std in zip(own.parameters, own.values, own.std, strict=True)
    ]
    if not rows:
        return []
    titles = ("law of", "gravity at", "parameter", "value", "±2σ", "unit")
    columns = [
        column(title, list(cells), side)
        for title, side, cells in zip(titles, "<<<..<", zip(*rows, strict=True), strict=True)
    ]
    title = "Gravity that the law compensates, as its own model of the robot has it"
    return [title, lines_of(columns)]


def differentiator_text(averaged: bool, time: float = 0.0, std: float = 0.0) -> str:
    """How a law differentiates the position.

    ``time``: lag T [s].
    """
    if averaged:
        return "two-sample means"
    if time == 0.0:
        return "backward difference"
    value, spread = with_spread(1e3 * time, 2e3 * std)
    return f"lag {value} ± {spread} ms"
