"""Parameters that a record does not separate, and the smaller set that it does.

With r_k what is left of the column of parameter k beyond those before it, as a share of its length
in all rows weighted by 1/λ, k is not separated from those if

    10 r_k ‖τ_k‖ < 1,    ‖τ_k‖² = Σ_j τ_jᵀ τ_j / λ_j over the joints j that k acts on     (1)

The standard error of its torque alone, 1/r_k, is then ten times the whole torque in the record,
which the others take back: ia2 = -10⁵ kg m² fits as well as any other value. It is left out, and
those that its column is a combination of hold its part, as among base parameters (Gautier 1991), in
whose order rotor inertias go before those of links. Parameters that are excited weakly, but apart
from the others, have r_k = 1 and stay with wide intervals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, independent_columns, preference
from pivident.foundation.errors import RankDeficientRegressor
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.sentences import listed

#: Kind of the finding that names the parameters left out.
KIND = "inseparable"

#: Smallest singular value of the scaled observation matrix, relative to the largest.
RANK_TOLERANCE = 1e-6

#: Share of a parameter in the weakest direction from which on it is named.
WEAKEST_SHARE = 0.3

#: Standard error of a parameter's torque, in the whole torque, from which on nothing is known.
UNKNOWN = 10.0

#: Remainders above this are never too small, however poor the fit.
SEPARATED = 1e-4

#: Share of a column, in its own length, from which on another one holds a part of it.
HOLDS = 0.03

#: Index of each parameter that is left out, and of those that hold its part.
LeftOut = Mapping[int, Sequence[int]]


def is_separated(gram: np.ndarray, torque: np.ndarray) -> bool:
    """Whether the rank is full and (1) holds for no parameter beyond all others.

    ``gram``: of weighted columns of length one, zero for an empty one, (parameters, parameters);
    ``torque``: ‖τ_k‖, shape (parameters,).
    """
    values, vectors = np.linalg.eigh(gram)
    if values[0] <= RANK_TOLERANCE**2 * values[-1]:
        return False
    return bool(np.all((vectors**2 / values).sum(axis=1) ** -0.5 >= _least(torque)))


def weakest_direction(
    gram: np.ndarray, names: Sequence[str]
) -> tuple[float, tuple[str, ...]] | None:
    """Condition number of the observation matrix, and the parameters in its weakest direction.

    ``gram``: as above. None: it has not full rank.
    """
    values, vectors = np.linalg.eigh(gram)
    if values[0] <= RANK_TOLERANCE**2 * values[-1]:
        return None
    share = np.abs(vectors[:, 0])
    weakest = tuple(names[int(i)] for i in np.argsort(-share) if share[i] > WEAKEST_SHARE)
    return float(np.sqrt(values[-1] / values[0])), weakest


def left_out(gram: np.ndarray, torque: np.ndarray, order: Sequence[int]) -> LeftOut:
    """What to leave out; arguments as above, ``order``: what is to be kept first."""
    if is_separated(gram, torque):
        return {}
    values, vectors = np.linalg.eigh(gram)
    root = np.sqrt(np.clip(values, 0.0, None))[:, None] * vectors.T  # its Gram matrix is the same
    least = np.maximum(_least(torque), 10.0 * RANK_TOLERANCE)
    kept, basis = independent_columns(root, list(order), least)
    while len(kept) == len(gram):  # each by itself is just separated from those before it
        least = 2.0 * least
        kept, basis = independent_columns(root, list(order), least)
    out = sorted(set(order) - set(kept))
    parts = np.abs(np.linalg.solve(basis.T @ root[:, kept], basis.T @ root[:, out])).T
    return {
        k: [kept[i] for i in np.argsort(-part)[:4] if part[i] > max(HOLDS, 0.3 * part.max())]
        for k, part in zip(out, parts, strict=True)
    }


def _least(torque: np.ndarray) -> np.ndarray:
    """Remainder from which on each parameter is separated."""
    return np.minimum(1.0 / np.maximum(UNKNOWN * torque, 1e-300), SEPARATED)


def preferred(base: BaseParameters, selection: Sequence[int]) -> list[int]:
    """Indices within a selection of base parameters, those to be kept first."""
    rank = {i: k for k, i in enumerate(preference(base.robot, base.standard))}
    return sorted(range(len(selection)), key=lambda k: rank[int(base.kept[selection[k]])])


def separated(
    base: BaseParameters, selection: Sequence[int], error: RankDeficientRegressor
) -> tuple[tuple[str, ...], Finding]:
    """Names of what a method's rows separate of a selection, and the sentence about the others.

    Raises:
        RankDeficientRegressor: the error itself, if it is not about these columns.
    """
    names = [base.names[k] for k in selection]
    if error.evidence is None or len(error.evidence[1]) != len(names):
        raise error
    out = left_out(*error.evidence, preferred(base, selection))
    if not 0 < len(out) < len(names):
        raise error
    return tuple(n for k, n in enumerate(names) if k not in out), sentence(out, names)


def refusal(gram: np.ndarray, torque: np.ndarray, names: Sequence[str]) -> RankDeficientRegressor:
    """The error that names groups of parameters, with the evidence; arguments as above."""
    out = left_out(gram, torque, range(len(names)))
    groups = [[names[i] for i in (k, *holders)] for k, holders in out.items()]
    return RankDeficientRegressor(len(names) - len(out), len(names), groups, (gram, torque))


def sentence(out: LeftOut, names: Sequence[str], step: str = "") -> Finding:
    """One line about all that is left out; ``step``: what would separate it."""
    parts = []
    for k, holders in out.items():
        held = listed([names[i] for i in holders])
        part = f"{held} hold{'s' * (len(holders) == 1)} its part"
        parts.append(f"{names[k]} ({part if held else 'no effect in this motion'})")
    text = f"The motion does not separate all parameters; left out: {', '.join(parts)}."
    step = step or (
        "The other parameters are as good as with it; `pivident excite` designs a motion that "
        "separates more, if there is one."
    )
    return Finding("warning", "motion", KIND, text, ", ".join(names[k] for k in out), step)
