"""Tests on the instruments of one identification: relevant, needed, and not contradicted?

Relevance: how much of each column of the observation matrix do the instruments explain?

Each column φ_i is regressed on all instruments (first stage). Shea's partial R² asks how much of
what φ_i adds to the other columns its instruments explain; F compares with none at all, and
below 10 instruments are called weak (Staiger and Stock 1997). F is the effective one of Montiel
Olea and Pflueger (2013), over windows of time, since a first stage's residual is as correlated as
any. A column that is its own instrument, such as an offset's, is partialled out. Cragg and
Donald's is the smallest eigenvalue of the concentration matrix,

    min eig (Φᵀ P_Z Φ / k)  in the metric of  V = Φᵀ(I - P_Z)Φ/(n - k),

the F of the direction of the parameters that the instruments explain worst.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.estimation.identification import Identification
from pivident.judgement.validation.moment_sums import (
    ExtraInstruments,
    MomentSums,
    kept_equations,
    moment_sums,
)
from pivident.judgement.validation.overidentification import (
    DurbinWuHausmanTest,
    OveridentificationTest,
    exogeneity_test,
    overidentification_test,
)
from pivident.judgement.validation.residuals.windowed_statistic import (
    directions_of,
    windowed_statistic,
)

#: First-stage F below which instruments are weak.
WEAK = 10.0

#: Share of a column that instruments leave unexplained, below which they hold the column itself.
OWN_INSTRUMENT = 1e-11


@dataclass(frozen=True, eq=False)
class RelevanceTest:
    """First stages of all parameters, and the worst of all directions.

    A column that is its own instrument has a partial R² of one and an infinite F.
    """

    names: tuple[str, ...]  # names of the parameters
    partial_r2: np.ndarray  # Shea's, shape (parameters,)
    first_stage_f: np.ndarray  # effective F, shape (parameters,)
    degrees: np.ndarray  # its effective degrees of freedom, shape (parameters, 2)
    #: Probability of a larger F with irrelevant instruments, shape (parameters,).
    p_values: np.ndarray
    white_f: np.ndarray  # F of the textbook, for white residuals, shape (parameters,)
    condition: float  # condition number of ZᵀΦ with columns of unit length
    cragg_donald: float  # smallest F of any combination of the parameters
    instruments: int  # number of instruments
    rows: int  # number of rows

    @property
    def statistic(self) -> float:
        """Smallest first-stage F."""
        return float(self.first_stage_f.min())

    @property
    def p_value(self) -> float:
        """Its probability with irrelevant instruments."""
        return float(self.p_values[int(np.argmin(self.first_stage_f))])

    @property
    def practical_size(self) -> float:
        """Smallest partial R²; the parameter's variance is as many times larger as 1/R²."""
        return float(self.partial_r2.min())

    @property
    def weak(self) -> tuple[str, ...]:
        """Parameters whose instruments are weak: first-stage F below ten."""
        return tuple(n for n, f in zip(self.names, self.first_stage_f, strict=True) if f < WEAK)

    def __str__(self) -> str:
        k, r = int(np.argmin(self.first_stage_f)), int(np.argmin(self.partial_r2))
        if self.weak:
            verdict = f"instruments are weak for {', '.join(self.weak)}"
        elif self.cragg_donald < WEAK:
            verdict = "instruments are weak for a combination of parameters"
        else:
            verdict = "the instruments are strong"
        return (
            f"Relevance: {verdict}. Smallest first-stage F {self.first_stage_f[k]:.3g} "
            f"({self.names[k]}, weak below {WEAK:g}), smallest partial R² "
            f"{self.partial_r2[r]:.4g} ({self.names[r]}), Cragg-Donald {self.cragg_donald:.3g}, "
            f"condition of ZᵀΦ {self.condition:.3g}."
        )


def relevance_test(sums: MomentSums, names: Sequence[str]) -> RelevanceTest:
    """Relevance of Z on weighted equations."""
    sums, _ = sums.scaled()
    ff, zf, zz = sums.block("phi", "phi"), sums.block("z", "phi"), sums.block("z", "z")
    singular = np.linalg.svd(zf, compute_uv=False)
    stage = np.linalg.lstsq(zz, zf, rcond=1e-14)[0]
    explained = zf.T @ stage
    left = np.maximum(np.diag(ff - explained), 0.0)
    own = left < OWN_INSTRUMENT * np.diag(ff)
    freedom = max(sums.rows - sums.size, 1)
    excluded = _excluded(zz, own)
    statistic, degrees, p_values = _first_stages(sums, stage, excluded)
    partial = excluded.T @ zf
    beyond = np.sum((directions_of(excluded.T @ zz @ excluded).T @ partial) ** 2, axis=0)
    white = beyond / excluded.shape[1] / np.maximum(left / freedom, 1e-300)
    # with unit columns both inverses are of moderate size
    r2 = np.diag(np.linalg.inv(ff)) / np.maximum(np.diag(np.linalg.pinv(explained)), 1e-300)
    return RelevanceTest(
        tuple(names),
        np.where(own, 1.0, np.clip(r2, 0.0, 1.0)),
        np.where(own, np.inf, statistic),
        degrees,
        np.where(own, 0.0, p_values),
        np.where(own, np.inf, white),
        float(singular[0] / max(singular[-1], 1e-300)),
        _cragg_donald(ff, explained, own, freedom),
        sums.size,
        sums.rows,
    )


def _excluded(zz: np.ndarray, own: np.ndarray) -> np.ndarray:
    """T: Z T are the instruments proper, freed of columns that are their own instruments.

    ``own``: columns that are their own instruments, shape (parameters,). Result: T, shape
    (parameters, instruments proper); all of them where every column is its own.
    """
    everything = np.eye(len(zz))
    if not own.any() or own.all():
        return everything
    proper = everything[:, ~own]
    proper[own] = -np.linalg.solve(zz[np.ix_(own, own)], zz[np.ix_(own, ~own)])
    return proper


def _first_stages(
    sums: MomentSums, stage: np.ndarray, excluded: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Effective F of each column, its degrees of freedom and its probability."""
    moments = excluded.T @ sums.block("z", "phi")
    basis = directions_of(excluded.T @ sums.block("z", "z") @ excluded)
    residuals = sums.window("z", "phi") - sums.window("z", "z") @ stage
    nothing = np.zeros_like(sums.shares)  # they sum to zero already
    outcomes = [
        windowed_statistic(moments[:, i], residuals[:, :, i] @ excluded, nothing, basis, True)
        for i in range(sums.size)
    ]
    return (
        np.array([o.statistic if o.statistic > 0 else np.inf for o in outcomes]),
        np.array([o.degrees for o in outcomes]),
        np.array([o.p_value for o in outcomes]),
    )


def _cragg_donald(ff: np.ndarray, explained: np.ndarray, own: np.ndarray, freedom: int) -> float:
    """Smallest eigenvalue; columns that are their own instruments are partialled out."""
    if own.all():
        return float("inf")
    noisy = ~own
    known = explained[np.ix_(noisy, noisy)]
    if own.any():
        cross = explained[np.ix_(own, noisy)]
        known = known - cross.T @ np.linalg.solve(explained[np.ix_(own, own)], cross)
    noise = (ff - explained)[np.ix_(noisy, noisy)]
    values, vectors = np.linalg.eigh(known)
    if values[0] <= 0.0:
        return 0.0
    # the noise may lack directions, what is explained may not
    inverse_root = vectors / np.sqrt(values)
    worst = float(np.linalg.eigvalsh(inverse_root.T @ noise @ inverse_root)[-1])
    return freedom / int(noisy.sum()) / max(worst, 1e-300)


@dataclass(frozen=True, eq=False)
class InstrumentTests:
    """What is known about the instruments of a result."""

    relevance: RelevanceTest  # whether they explain the regressors
    #: Whether least squares on the same equations differs significantly.
    exogeneity: DurbinWuHausmanTest
    overidentification: OveridentificationTest  # whether further instruments contradict them

    def __str__(self) -> str:
        return "\n".join(
            str(test) for test in (self.relevance, self.exogeneity, self.overidentification)
        )


def instrument_tests(
    identification: Identification, extra: ExtraInstruments | Literal["auto"] = "auto"
) -> InstrumentTests:
    """All tests, from one pass over the equations that were solved last."""
    chosen = further_kind(identification) if extra == "auto" else extra
    sums = moment_sums(identification, chosen)
    names = [identification.names[k] for k in identification.restrictions.freedom.free]
    return InstrumentTests(
        relevance_test(sums, names),
        exogeneity_test(sums, names),
        overidentification_test(sums, names),
    )


def further_kind(identification: Identification) -> ExtraInstruments:
    """Which further instruments a result can have."""
    records = kept_equations(identification).records
    used = identification.instruments
    if used is not None and used.further and records[0].full_rate:
        return "other"
    if used is not None and used.kind != "loop":
        return "delayed"
    recorded = all(r.full_rate and r.kinematics.recording.q_ref is not None for r in records)
    virtual = identification.loop is not None and identification.loop.reference == "smoothed"
    return "reference" if recorded and not virtual else "delayed"
