"""Spectra of a residual over a joint's angles, and properties of the ripple lines in them.

Spectra of a joint's residual over all its angles: orders, lag, most significant order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.foundation.distributions import chi_square
from pivident.robot.description import Robot
from pivident.studies.friction.order_spectrum import (
    HIGHEST_FREQUENCY,
    MIN_SHARE,
    OrderSpectrum,
    order_grid,
    order_spectrum,
)
from pivident.studies.friction.ripple_lines import (
    DISTINGUISHABLE,
    Angle,
    NamedFinding,
    NamedOrder,
    RippleLine,
    named_bases,
    relate,
)
from pivident.studies.friction.ripple_series import (
    ResidualSeries,
    Wave,
    WaveFit,
    delayed,
    fit_waves,
    settled_rows,
    white_rows,
    whitened,
)

#: Default for the largest number of cycles per motor revolution.
PER_MOTOR_REVOLUTION = 16.0
#: An order belongs to a revolution if it is this close, as a share of the record's resolution: a
#: lag, or an amplitude that changes along the record, shifts a line by as much.
RESOLVED = 0.15
#: A line this close to a stronger one belongs to it [independent orders].
BESIDE = 12.0
#: Trial lags of the torque behind the positions [samples]; the best one is refined.
LAGS = (0.0, 1.0, -1.0, 2.0)
#: Trials that each further lag adds: its spectrum is similar to that without lag.
LAG_TRIALS = 0.5
#: Neighbourhood of a line in which its lag is refined, as a share of its order.
NEAR = 0.03


@dataclass(frozen=True, eq=False)
class _Modulation:
    """A line's wave times a varying factor, fitted beside it."""

    vector: np.ndarray
    covariance: np.ndarray
    p_value: float


def measured_line(
    robot: Robot,
    joint: int,
    series: Sequence[ResidualSeries],
    angle: Angle,
    fit: WaveFit,
    n: int,
    left: OrderSpectrum,
    named: Sequence[NamedOrder],
    chosen: tuple[float, float],
    unit: str,
    lag: float,
) -> RippleLine:
    """All properties of line ``n``, its standard errors scaled to the floor at its order."""
    wave, (a, b) = fit.waves[n], fit.coefficients[n]
    near = int(np.argmin(np.abs(left.orders - wave.order)))
    excess = max(float(left.floor[near]), 1.0)
    order_std = float(fit.order_std[n]) * math.sqrt(excess)
    used = [s.used[:, joint] for s in series]
    phases = np.concatenate(
        [wave.order * wave.angle(s)[v] for s, v in zip(series, used, strict=True)]
    )
    torque = a * np.cos(phases) + b * np.sin(phases)
    error = np.concatenate([s.error[v, joint] for s, v in zip(series, used, strict=True)])
    speed = np.concatenate(
        [np.abs(s.dq @ angle.coefficients)[v] for s, v in zip(series, used, strict=True)]
    )
    frequency = wave.order * speed / (2.0 * math.pi)
    loads = [s.load[:, joint] for s in series]
    mean = float(np.mean(np.concatenate([x[v] for x, v in zip(loads, used, strict=True)])))
    by_load = _modulation(
        series, joint, fit, wave, [x / max(mean, 1e-300) - 1.0 for x in loads], excess
    )
    signs = [np.sign(s.dq @ angle.coefficients) for s in series]
    tilt = float(np.mean(np.concatenate([x[v] for x, v in zip(signs, used, strict=True)])))
    by_direction = _modulation(series, joint, fit, wave, [x - tilt for x in signs], excess)
    size = max(math.hypot(a, b), 1e-300)
    along = np.array([a, b]) / size**2
    ends = [np.array([a, b]) + (sign - tilt) * by_direction.vector for sign in (1.0, -1.0)]
    f50 = series[0].f50[joint]
    return RippleLine(
        joint=robot.joints[joint].name,
        index=joint,
        angle=angle,
        order=wave.order,
        order_std=order_std,
        lag=lag,
        cosine=float(a),
        sine=float(b),
        covariance=fit.covariance[n] * excess,
        unit=unit,
        p_value=chosen[0],
        beside_time=chosen[1],
        frequencies=(float(np.quantile(frequency, 0.05)), float(np.quantile(frequency, 0.95))),
        share=float(np.var(torque) / max(np.var(error), 1e-300)),
        relation=relate(
            wave.order,
            max(order_std, 0.5 * RESOLVED * left.resolution(near)),
            angle,
            robot.joints[joint].kind == "revolute",
            named,
        ),
        beside=None,
        load_slope=float(along @ by_load.vector),
        load_slope_std=float(np.sqrt(along @ by_load.covariance @ along)),
        load_p=by_load.p_value,
        forward=float(np.linalg.norm(ends[0])),
        backward=float(np.linalg.norm(ends[1])),
        direction_p=by_direction.p_value,
        smoothed=float(np.mean(frequency > f50)) if np.isfinite(f50) else 0.0,
    )


def _modulation(
    series: Sequence[ResidualSeries],
    joint: int,
    fit: WaveFit,
    wave: Wave,
    factors: Sequence[np.ndarray],
    excess: float,
) -> _Modulation:
    """Wald test of two further columns: does the line change with a factor of mean zero?

    ``excess`` is the floor over that of white noise.
    """
    columns, right = [], []
    for s, factor, left in zip(series, factors, fit.left, strict=True):
        phase = wave.order * wave.angle(s)
        plain = np.column_stack([np.cos(phase), np.sin(phase)])
        stack = np.hstack([plain, factor[:, None] * plain])
        used = settled_rows(s.used[:, joint], fit.noise.order)
        columns.append(whitened(fit.filter, stack)[used])
        right.append(whitened(fit.filter, left - fit.noise.mean)[used])
    matrix, values = np.vstack(columns), np.concatenate(right)
    spread = np.linalg.pinv(matrix.T @ matrix)
    solution = spread @ (matrix.T @ values)
    covariance = spread[2:, 2:] * excess
    wald = float(solution[2:] @ np.linalg.pinv(covariance) @ solution[2:])
    return _Modulation(solution[2:], covariance, float(chi_square.sf(wald, 2)))


def marked_beside(
    line: RippleLine,
    stronger: Sequence[RippleLine],
    angles: Sequence[Angle],
    spectra: Sequence[OrderSpectrum],
) -> RippleLine:
    """The line, with the order of the stronger one next to it if there is one."""
    alike = [other for other in stronger if other.angle.name == line.angle.name]
    if not alike:
        return line
    spectrum = next(s for a, s in zip(angles, spectra, strict=True) if a.name == line.angle.name)
    near = int(np.argmin(np.abs(spectrum.orders - line.order)))
    other = min(alike, key=lambda one: abs(one.order - line.order))
    if abs(other.order - line.order) > BESIDE * spectrum.resolution(near):
        return line
    return replace(line, beside=other.beside or other.order, relation=None)


def visibility_notes(
    series: Sequence[ResidualSeries],
    joint: int,
    angle: Angle,
    spectrum: OrderSpectrum,
    top: float,
    cycles: float,
    unit: str,
) -> list[str]:
    """Range and limits of the search over an angle."""
    if not spectrum.searched.any():
        return [
            f"no order of {angle.name} can be searched: the record covers fewer than {cycles:g} "
            f"cycles of any order below {top:.4g}; move the joint further"
        ]
    where = np.flatnonzero(spectrum.searched)
    low, high = spectrum.orders[where[0]], spectrum.orders[where[-1]]
    visible = np.nanmedian(spectrum.smallest_visible())
    rate = series[0].rate
    bound = 0.5 * HIGHEST_FREQUENCY * rate
    notes = [
        f"orders {low:.4g} to {high:.4g} of {angle.name} searched, median detection limit "
        f"{visible:.2g} {unit}; lower orders have fewer than {cycles:g} cycles in the record"
    ]
    speed = np.concatenate([np.abs(s.dq @ angle.coefficients)[s.used[:, joint]] for s in series])
    typical = float(np.median(speed))
    gears = [(name, gear) for name, gear in angle.motors if gear != 1.0]
    for name, gear in gears:
        shown = 2.0 * math.pi * bound / max(typical, 1e-300) / gear
        if shown < PER_MOTOR_REVOLUTION:
            notes.append(
                f"at {rate:g} Hz and median speed, more than {shown:.2g} cycles per revolution of "
                f"the {name} exceed {bound:.4g} Hz and are visible in slower rows only"
            )
    f50 = series[0].f50[joint]
    if np.isfinite(f50):
        limit = 2.0 * math.pi * f50 / max(typical, 1e-300)
        if limit < high:
            notes.append(
                f"the position smoother cuts off at {f50:.3g} Hz, order {limit:.3g} at median "
                "speed: above it the amplitude is that of the logged torque alone"
            )
    return notes


def named_findings(
    robot: Robot,
    joint: int,
    angle: Angle,
    spectrum: OrderSpectrum,
    named: Sequence[NamedOrder],
    cycles: float,
) -> Iterator[NamedFinding]:
    """Test of each named order by itself, without a search over orders."""
    revolute = robot.joints[joint].kind == "revolute"
    visible = spectrum.smallest_visible() if spectrum.orders.size else np.empty(0)
    for wanted in named:
        for _, order in named_bases(wanted, angle, revolute):
            unseen = ""
            if not spectrum.orders.size or order > spectrum.orders[-1]:
                unseen = "too fast for the sampling on nearly all rows, or above the search"
            else:
                k = int(np.argmin(np.abs(spectrum.orders - order)))
                if not spectrum.searched[k]:
                    unseen = (
                        "too fast for the sampling on nearly all rows"
                        if spectrum.share[k] < MIN_SHARE
                        else f"fewer than {cycles:g} cycles visited"
                    )
            if unseen:
                yield NamedFinding(wanted, order, math.nan, math.nan, math.nan, unseen)
                continue
            yield NamedFinding(
                wanted, order, float(spectrum.amplitude[k]), float(visible[k]),
                spectrum.single(k), "",
            )  # fmt: skip


def highest_order(
    robot: Robot, series: Sequence[ResidualSeries], joint: int, angle: Angle, highest: float | None
) -> float:
    """Largest order to try: requested or the gear's, and at most what the sampling resolves."""
    steps = np.concatenate([np.abs(s.dq @ angle.coefficients)[s.used[:, joint]] for s in series])
    if not steps.size or not np.any(steps > 0):
        return 0.0
    slow = max(float(np.quantile(steps, MIN_SHARE)), 1e-3 * float(steps.max()))
    shown = HIGHEST_FREQUENCY * math.pi * series[0].rate / slow
    if highest is not None:
        return min(highest, shown)
    # a coupled motor has an angle of its own, but its gear sits on the joint
    largest = float(np.abs(robot.transmission.reduction[:, joint]).max())
    return shown if largest == 1.0 else min((PER_MOTOR_REVOLUTION + 0.5) * largest, shown)


def visited_grid(
    series: Sequence[ResidualSeries], joint: int, angle: Angle, highest: float
) -> np.ndarray:
    """Orders of an angle, from one cycle over the visited positions on."""
    visited = np.concatenate([(s.q @ angle.coefficients)[s.used[:, joint]] for s in series])
    return order_grid(visited, highest) if visited.size else np.empty(0)


def best_lag(
    series: Sequence[ResidualSeries],
    joint: int,
    angles: Sequence[Angle],
    grids: Sequence[np.ndarray],
    cycles: float,
    alpha: float,
) -> float:
    """Delay of the torque relative to the positions, estimated from the strongest line [s].

    A torque logged 4 ms late lags 40 degrees at 30 Hz and 140 degrees at 100 Hz, so the line over
    positions of the same instant is smeared. A lag is used only if it is clearly likelier.
    """
    fit = fit_waves(series, joint, [])
    rate = series[0].rate
    found = []
    for samples in LAGS:
        moved = [delayed(s, samples / rate) for s in series]
        spectra = joint_spectra(moved, joint, angles, grids, fit, cycles, len(LAGS))
        best = most_significant(spectra)
        if best is not None:
            which, k, chance = best
            found.append((spectra[which].significance(k), samples, which, k, chance))
    if not found:
        return 0.0
    none = next((significance for significance, samples, *_ in found if samples == 0), 0.0)
    significance, samples, which, k, chance = max(found)
    if chance > alpha or significance < none + DISTINGUISHABLE:
        return 0.0
    near = grids[which][np.abs(grids[which] - grids[which][k]) < NEAR * grids[which][k]]
    finer = []
    for tried in samples + np.linspace(-1.0, 1.0, 17):
        moved = [delayed(s, tried / rate) for s in series]
        rows = white_rows(moved, joint, angles[which].coefficients, fit)
        finer.append((float(order_spectrum(rows, near, 0.0).gain.max()), tried))
    return float(max(finer)[1]) / rate


def joint_spectra(
    series: Sequence[ResidualSeries],
    joint: int,
    angles: Sequence[Angle],
    grids: Sequence[np.ndarray],
    fit: WaveFit,
    cycles: float,
    lags: int,
) -> tuple[OrderSpectrum, ...]:
    """Spectrum over each angle; the trials of all angles and lags count in each."""
    found = [
        order_spectrum(white_rows(series, joint, angle.coefficients, fit), grid, cycles)
        for angle, grid in zip(angles, grids, strict=True)
    ]
    trials = (1.0 + LAG_TRIALS * (lags - 1)) * sum(spectrum.trials for spectrum in found)
    return tuple(replace(spectrum, trials=trials) for spectrum in found)


def most_significant(spectra: Sequence[OrderSpectrum]) -> tuple[int, int, float] | None:
    """Angle, index and false-alarm probability of the most significant order; None without any."""
    candidates = [
        (s.significance(k), a, k) for a, s in enumerate(spectra) if (k := s.best()) is not None
    ]
    if not candidates:
        return None
    _, which, k = max(candidates)
    return which, k, spectra[which].false_alarm(k)
