"""Joint-side friction columns of whole signals; ``friction_kernels`` has them for one instant.

The codes are those of ``pivident.robot.friction``; ``shape`` is γ and then the term's constants,
such as v_s and δ of a Stribeck term.

Friction with a state (Dahl, LuGre, Maxwell slip) needs the path so far. Between two samples the
state is advanced by the exact solution over the travel, with the kernels of the simulator, so that
a column hardly depends on the sampling rate. Where the speed changes its sign between two samples,
the travel is split at the turning point of a motion of constant acceleration. The path starts
relaxed, z = 0.

Friction that changes with the temperature T of its joint: (T - T₀) Σ β s(dq) over some terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.dynamics.friction_kernels import (
    VALUE,
    level_and_slope,
    state_after_way,
    travel_to_reversal,
    values_at_states,
)
from pivident.dynamics.parameters import Parameter
from pivident.foundation.compiled import kernel, read_only
from pivident.foundation.errors import UnusableValue
from pivident.foundation.text.plain_values import Name
from pivident.robot.friction_column import SIGNS, evaluated
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms.presliding import PRESLIDING, PRESLIDING_RATE

_PRESLIDING, _RATE = int(PRESLIDING), int(PRESLIDING_RATE)


@kernel
def _along(column, distance, excess, speed, exponent, period, q, dq, out):
    kind = _PRESLIDING if column == _RATE else column
    shape = (1.0 / distance, excess, 1.0 / speed if excess > 0.0 else 0.0, exponent)
    z, before, resting = 0.0, 1.0, 1.0 + excess
    for k in range(q.size):
        level, _ = level_and_slope(excess, shape[2], exponent, dq[k])
        if k > 0:
            start, travel = dq[k - 1], q[k] - q[k - 1]
            if start * dq[k] < 0.0:
                ahead = travel_to_reversal(start, dq[k], period)
                if (travel - ahead) * dq[k] > 0.0:
                    z = state_after_way(kind, z, start, before, 0.0, resting, ahead, *shape)
                    start, travel, before = 0.0, travel - ahead, resting
            z = state_after_way(kind, z, start, before, dq[k], level, travel, *shape)
        before = level
        out[k] = dq[k] - abs(dq[k]) * z / level if column == _RATE else z


def sampling_period(q: np.ndarray, dq: np.ndarray) -> float:
    """The period that positions and speeds agree on, Σ Δq v / Σ v² with v the mean speed [s]."""
    mean = 0.5 * (dq[1:] + dq[:-1])
    square = float(mean @ mean)
    return max(float(np.diff(q) @ mean) / square, 0.0) if square > 0.0 else 0.0


def memory_column(
    column: int, shape: tuple[float, ...], q: np.ndarray, dq: np.ndarray
) -> np.ndarray:
    """Column of a term with memory along a path at a constant rate, shape (samples,).

    It is z, or d dz/dt = dq - |dq| z/g for the rate; ``shape`` is γ (not used), d, ρ, v_s, δ.
    """
    q, dq = (read_only(np.ascontiguousarray(x, dtype=float)) for x in (q, dq))
    out = np.empty(q.shape)
    _, distance, excess, speed, exponent = shape
    period = sampling_period(q, dq)
    _along(column, distance, excess, speed, exponent, period, q, dq, out)
    return out


#: Names in expressions for arrays.
_FUNCTIONS = {
    "abs": np.abs,
    "power": np.power,
    "exp": np.exp,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "max": np.maximum,
    "min": np.minimum,
    "sign": np.sign,
    "atan": np.arctan,
    "tanh": np.tanh,
    "pi": np.pi,
}


def friction_column(
    term: FrictionTerm,
    dq: np.ndarray,
    q: np.ndarray | None = None,
    load: np.ndarray | None = None,
    simulated: bool = False,
) -> np.ndarray:
    """Column of one friction term, same shape as ``dq``.

    Terms of position need q, those with memory q along one path (samples,), those of load the
    torque that the joint carries [N m or N]. ``simulated`` replaces the hard sign.
    """
    column, sign, shape = term.encoded(simulated)
    if q is None and (term.depends_on_position or term.has_memory or term.column.of_motion):
        raise UnusableValue(f"the term {term.column.name.upper()} needs the positions q")
    if term.has_memory:
        path = np.asarray(q)
        if path.shape != dq.shape or dq.ndim != 1:
            raise UnusableValue(
                "terms with memory need q and dq along one path, each of shape (samples,), not "
                f"{path.shape} and {dq.shape}"
            )
        return memory_column(column, shape, path, dq)
    if load is None and term.depends_on_load:
        name = term.column.name.upper()
        raise UnusableValue(f"the term {name} needs the torque that the joint carries")
    if not term.column.expression:
        return column_values(term, VALUE, q, dq, load)
    quantities = {"dq": dq, "q": q, "load": load, "s": smoothed_sign(sign, shape[0], dq)}
    value = term.column.evaluate(term.values, {**_FUNCTIONS, **quantities})
    return np.asarray(value) if np.shape(value) == dq.shape else np.full(dq.shape, float(value))


def column_values(
    term: FrictionTerm,
    which: int,
    q: np.ndarray | None,
    dq: np.ndarray,
    load: np.ndarray | None = None,
) -> np.ndarray:
    """Value or a slope (``which``) of a term whose function has an address, of the shape of dq."""
    column, sign, shape = term.encoded()
    given = np.broadcast_arrays(*(0.0 if x is None else x for x in (dq, load, q)))
    out = np.empty(np.shape(dq))
    flat = [np.ascontiguousarray(x, dtype=float).ravel() for x in given]
    values_at_states(column, which, sign, shape[0], *flat, out.reshape(-1))
    return out


def expression_value(expression: str, quantities: Mapping[str, Any]) -> Any:
    """The expression of a column at arrays of its quantities and values of its constants."""
    return evaluated(expression, {**_FUNCTIONS, **quantities})


def smoothed_sign(sign: int, gamma: float, dq: np.ndarray) -> np.ndarray:
    """sign(dq), (2/π) atan(γ dq) or tanh(γ dq)."""
    return expression_value(SIGNS[sign], {"gamma": gamma, "dq": dq})


@dataclass(frozen=True)
class FrictionWarming:
    """How the friction of one joint changes with its temperature.

    Attributes:
        joint: name of the joint.
        reference: temperature T₀ that its friction parameters belong to [°C or K].
        parameters: names of those that change.
        per_kelvin: β of each, in its unit per K.
        std: their standard errors.
    """

    joint: Name
    reference: float
    parameters: tuple[Name, ...]
    per_kelvin: tuple[float, ...]
    std: tuple[float, ...]

    def torque(
        self, parameters: Sequence[Parameter], dq: np.ndarray, temperature: np.ndarray
    ) -> np.ndarray:
        """What is added to the friction at T₀ [N m or N], shape (samples,).

        Args:
            parameters: of the model, these among them.
            dq: speed of the joint, shape (samples,) [rad/s or m/s].
            temperature: of the joint, likewise, in the unit of the reference.
        """
        terms = {p.name: p.friction for p in parameters if p.friction is not None}
        pairs = zip(self.parameters, self.per_kelvin, strict=True)
        change = sum(beta * friction_column(terms[name], dq) for name, beta in pairs)
        return np.asarray((temperature - self.reference) * change)
