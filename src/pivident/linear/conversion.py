"""Linear models from scipy.signal and python-control, with exactly known parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pivident.foundation.errors import IdentificationError
from pivident.foundation.extras import require
from pivident.linear.estimate import LinearEstimate
from pivident.linear.model import Fit, Hold, Structure


def from_scipy(system: Any, dt: float | None = None, *, hold: Hold = "zoh") -> LinearEstimate:
    """A model with one input from ``scipy.signal.lti`` or ``dlti``.

    Args:
        system: TransferFunction, ZerosPolesGain or StateSpace, with one input and output.
        dt: sampling period [s] of the signals, needed for a continuous-time system; a
            discrete-time one has its own.
        hold: behaviour of the input between samples (continuous time).

    Returns:
        A model whose covariance is zero.

    Raises:
        IdentificationError: several inputs or outputs, an improper system, or a sampling
            period that is missing or not that of the system.
    """
    transfer = system.to_tf()
    numerator = np.asarray(transfer.num, dtype=float)
    if numerator.ndim != 1:
        raise IdentificationError(
            f"the system has {numerator.shape[0]} outputs",
            advice="convert one input and output at a time",
        )
    period = _period(transfer.dt, dt)
    return known_model([numerator], [transfer.den], period, transfer.dt is None, hold)


def from_control(system: Any, dt: float | None = None, *, hold: Hold = "zoh") -> LinearEstimate:
    """A model from python-control, with one output and one or more inputs.

    Args:
        system: ``control.TransferFunction``, or ``control.StateSpace`` with one input.
        dt: sampling period [s] of the signals, needed for a continuous-time system; a
            discrete-time one has its own.
        hold: behaviour of the inputs between samples (continuous time).

    Returns:
        A model whose covariance is zero.

    Raises:
        IdentificationError: several outputs, an improper system, or a sampling period that is
            missing or not that of the system.
        MissingExtra: python-control is not installed.
    """
    transfer = require("control", extra="linear", purpose="a system of python-control").tf(system)
    if transfer.noutputs != 1:
        raise IdentificationError(
            f"the system has {transfer.noutputs} outputs", advice="convert one output at a time"
        )
    continuous = transfer.isctime()
    own = None if continuous else transfer.dt
    # python-control says True for a discrete-time system of unspecified period
    period = _period(dt if own is True else own, dt)
    return known_model(transfer.num[0], transfer.den[0], period, continuous, hold)


def known_model(
    numerators: Sequence[np.ndarray],
    denominators: Sequence[np.ndarray],
    dt: float,
    continuous: bool,
    hold: Hold = "zoh",
) -> LinearEstimate:
    """A model of given polynomials in p or z, highest power first, with zero covariance."""
    above, below = [], []
    for b, a in zip(numerators, denominators, strict=True):
        b, a = (np.trim_zeros(np.asarray(part, dtype=float), "f") for part in (b, a))
        b = b if b.size else np.zeros(1)
        if a.size == 0 or b.size > a.size:
            raise IdentificationError(
                f"the numerator has degree {b.size - 1}, the denominator {a.size - 1}",
                advice="only proper systems can be simulated from samples",
            )
        b, a = b / a[0], a / a[0]
        above.append(b if continuous else np.r_[np.zeros(a.size - b.size), b])
        below.append(a)
    common = all(np.array_equal(a, below[0]) for a in below)
    groups = below[:1] if common else below
    structure = Structure(
        numerator_orders=tuple(b.size - 1 for b in above),
        denominator_orders=tuple(a.size - 1 for a in groups),
        delays=(0,) * len(above),
        hold=hold,
    )
    theta = structure.joined(groups, above)
    return LinearEstimate(
        method="Given",
        numerators=tuple(above),
        denominators=tuple(below),
        dt=dt,
        continuous=continuous,
        delays=structure.delays,
        hold=hold,
        common=common,
        names=structure.names,
        theta=theta,
        covariance=np.zeros((theta.size, theta.size)),
        noise=None,
        residual_variance=0.0,
        fit=Fit(r2=math.nan, yic=math.nan, aic=math.nan, bic=math.nan, samples=0),
        iterations=0,
    )


def _period(own: float | None, given: float | None) -> float:
    """The sampling period of a system, from itself or as given."""
    if own is None and given is None:
        raise IdentificationError(
            "a continuous-time system has no sampling period",
            advice="give dt, that of the signals [s]",
        )
    if own is not None and given is not None and not math.isclose(own, given, rel_tol=1e-9):
        raise IdentificationError(
            f"the system has a sampling period of {own:.6g} s, but dt is {given:.6g} s",
            advice="resample the system, or leave dt out",
        )
    return float(given if own is None else own)  # type: ignore[arg-type]
