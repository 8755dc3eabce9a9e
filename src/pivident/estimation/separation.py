"""Parameters that a record does not separate, and the smaller set that it does.

With φ_k the column of parameter k in all rows of a record, each weighted by 1/λ, and r_k what is
left of it beyond the columns before it, as a share of its length, k is not separated from those if

    r_k ‖τ_k‖ < 1,    ‖τ_k‖² = Σ_j τ_jᵀ τ_j / λ_j over the joints j that k acts on        (1)

The standard error of its torque alone, 1/r_k, is then larger than the whole torque in the record,
which the others take back: ia2 = -10⁵ kg m² fits as well as any other value. Such a column is left
out, and those that it is a combination of hold its part, as among base parameters (Gautier 1991).
The order is that of the base parameters, so the rotor inertia goes, not the link's. A parameter
that is excited weakly, but apart from the others, has r_k = 1 and stays with its wide interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, independent_columns, preference
from pivident.errors import RankDeficientRegressor
from pivident.text.finding import Finding
from pivident.text.lists import listed

if TYPE_CHECKING:
    from pivident.estimation.identification import Identification
    from pivident.estimation.problem import Problem

#: Kind of the finding that names the parameters left out.
KIND = "inseparable"

#: Smallest singular value of the scaled observation matrix, relative to the largest.
RANK_TOLERANCE = 1e-6

#: Remainders above this are never too small, however poor the fit.
SEPARATED = 1e-3

#: Share of a column, in its own length, from which on another one holds a part of it.
HOLDS = 0.03


@dataclass(frozen=True)
class LeftOut:
    """A parameter that is left out: its index, and those of the parameters that hold its part."""

    index: int
    holders: tuple[int, ...]


def is_separated(gram: np.ndarray, torque: np.ndarray) -> bool:
    """Whether (1) holds for no parameter beyond all others, and the rank is full.

    ``gram``: of weighted columns of length one, zero for an empty one, (parameters, parameters);
    ``torque``: ‖τ_k‖, shape (parameters,).
    """
    values, vectors = np.linalg.eigh(gram)
    if values[0] <= RANK_TOLERANCE**2 * values[-1]:
        return False
    remainder = 1.0 / np.sqrt((vectors**2 / values).sum(axis=1))
    return not bool(np.any(remainder < _least(torque)))


def left_out(gram: np.ndarray, torque: np.ndarray, order: Sequence[int]) -> list[LeftOut]:
    """What to leave out; arguments as above, ``order``: what is to be kept first."""
    if is_separated(gram, torque):
        return []
    values, vectors = np.linalg.eigh(gram)
    root = np.sqrt(np.clip(values, 0.0, None))[:, None] * vectors.T  # its Gram matrix is the same
    least = np.maximum(_least(torque), 10.0 * RANK_TOLERANCE)
    kept, basis = independent_columns(root, list(order), least)
    while len(kept) == len(gram):  # each by itself is just separated from those before it
        least = 2.0 * least
        kept, basis = independent_columns(root, list(order), least)
    out = sorted(set(order) - set(kept))
    parts = np.linalg.solve(basis.T @ root[:, kept], basis.T @ root[:, out])
    made = []
    for k, part in zip(out, np.abs(parts).T, strict=True):
        largest = [i for i in np.argsort(-part) if part[i] > max(HOLDS, 0.3 * part.max())][:4]
        made.append(LeftOut(k, tuple(kept[i] for i in largest)))
    return made


def _least(torque: np.ndarray) -> np.ndarray:
    """Remainder from which on each parameter is separated."""
    return np.minimum(1.0 / np.maximum(torque, 1e-300), SEPARATED)


def preferred(base: BaseParameters, selection: Sequence[int]) -> list[int]:
    """Indices within a selection of base parameters, those to be kept first."""
    rank = {i: k for k, i in enumerate(preference(base.robot, base.standard))}
    heads = [rank[int(base.kept[k])] for k in selection]
    return sorted(range(len(heads)), key=heads.__getitem__)


def separated(problem: Problem, error: RankDeficientRegressor) -> tuple[Problem, Finding]:
    """The problem without what a method's rows do not separate, and the sentence about it.

    Raises:
        RankDeficientRegressor: the error itself, where it is not about the problem's own columns,
            or nothing would be left.
    """
    if error.gram is None or len(error.gram) != len(problem.names):
        raise error
    out = left_out(error.gram, error.torque, preferred(problem.base, problem.selection))
    gone = {own.index for own in out}
    names = tuple(name for k, name in enumerate(problem.names) if k not in gone)
    if not gone or not names:
        raise error
    return replace(problem, parameters=names), sentence(out, problem.names)


def narrowed(problem: Problem, found: Identification) -> Problem:
    """The problem of the parameters that a result has, which says why others were left out."""
    if found.names == problem.names:
        return problem
    why = [w for w in found.warnings if w.kind == KIND and w not in problem.findings]
    return replace(problem, parameters=found.names, findings=(*problem.findings, *why))


def sentence(out: Sequence[LeftOut], names: Sequence[str], step: str = "") -> Finding:
    """One line about all that is left out; ``step``: what would separate it."""
    parts = []
    for own in out:
        held = listed([names[k] for k in own.holders])
        verb = "holds" if len(own.holders) == 1 else "hold"
        parts.append(f"{names[own.index]} ({held} {verb} its part)" if held else _alone(own, names))
    subject = ", ".join(names[own.index] for own in out)
    text = f"The motion does not separate all parameters; left out: {', '.join(parts)}."
    step = step or (
        "The other parameters are as good as with it; `pivident excite` designs a motion that "
        "separates more, if there is one."
    )
    return Finding("warning", "motion", KIND, text, subject, step)


def _alone(own: LeftOut, names: Sequence[str]) -> str:
    return f"{names[own.index]} (no effect in this motion)"
