"""What the records of one arm show together."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .judge import WIDTH, Judged
from .user import METHODS, Session

Rows = Sequence[tuple[int, Session, Sequence[Judged]]]


def record_lines(seed: int, session: Session, judged: Sequence[Judged]) -> list[str]:
    """What became of one record: commands, errors, figures by method."""
    lines = [f"\nseed {seed}"]
    for command in session.commands:
        words = " ".join(command.arguments)
        end = f"  {command.complaint}" if command.complaint else ""
        lines.append(f"  pivident {words}: exit {command.code}, {command.seconds:.0f} s{end}")
    for method, error in session.missed.items():
        lines.append(f"  {method}: not reached: {error}")
    for own in judged:
        z, za = own.z, own.z_attainable
        worst = int(np.nanargmax(np.abs(z)))
        lines.append(
            f"  {own.method:13s} coverage {_share(z)} of the truth, {_share(za)} of the attainable;"
            f" rms z {_rms(z):.1f}, {_rms(za):.1f}; worst {own.names[worst]} z = {z[worst]:+.1f};"
            f" held-out {own.held_out:.2f} %; {own.instruments}"
            f"{'' if own.converged else '; NOT CONVERGED'}"
        )
    return lines


def summary_lines(arm: str, rows: Rows) -> list[str]:
    """One table of all records: a line for each method.

    The bias of a method is the mean error over the records, in units of the mean standard error of
    least squares, rms over the parameters; what chance leaves of it is 1/√records where standard
    errors are right.
    """
    count = len(rows)
    lines = [
        f"\n{arm}, {count} records. Coverage of 95 % intervals in %: all parameters | bodies and "
        "rotors | friction and offsets.",
        f"{'method':13s} {'reached':>8s} {'truth':>16s} {'attainable':>16s} {'|e/θ| %':>8s} "
        f"{'held-out %':>10s} {'bias':>6s} {'over ls':>8s} {'s':>5s}",
    ]
    scale = _mean_std(rows, "ls")
    reference = _bias(rows, "ls", scale)
    for method in METHODS:
        own = [j for _, _, judged in rows for j in judged if j.method == method]
        if not own:
            lines.append(f"{method:13s} {f'0/{count}':>8s}")
            continue
        kinds = (None, False, True)
        truth = " | ".join(_coverage(own, "z", kind) for kind in kinds)
        attainable = " | ".join(_coverage(own, "z_attainable", kind) for kind in kinds)
        relative = np.concatenate([_relative(j) for j in own])
        bias = _bias(rows, method, scale)
        lines.append(
            f"{method:13s} {f'{len(own)}/{count}':>8s} {truth:>16s} {attainable:>16s} "
            f"{100 * np.nanmedian(relative):8.2f} {np.median([j.held_out for j in own]):10.2f} "
            f"{bias:6.2f} {bias / reference:8.2f} {np.median([j.seconds for j in own]):5.0f}"
        )
    errors: dict[str, list[int]] = {}
    for seed, session, _ in rows:
        for method, error in session.missed.items():
            errors.setdefault(f"{method}: {error}", []).append(seed)
    lines += [f"  seeds {', '.join(map(str, seeds))}: {text}" for text, seeds in errors.items()]
    return lines


def write_table(path: Path, rows: Rows) -> None:
    """Every parameter of every result as a row of a CSV file."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["seed", "method", "name", "estimate", "std", "truth", "attainable"])
        for seed, _, judged in rows:
            for j in judged:
                columns = (j.names, j.estimate, j.std, j.truth, j.attainable)
                writer.writerows(
                    [seed, j.method, name, *map(repr, map(float, values))]
                    for name, *values in zip(*columns, strict=True)
                )


def _relative(judged: Judged) -> np.ndarray:
    """|estimate - truth|/|truth| where the truth is not zero."""
    truth = np.where(judged.truth == 0.0, np.nan, judged.truth)
    return np.abs(judged.estimate / truth - 1.0)


def _mean_std(rows: Rows, method: str) -> dict[str, float]:
    """Mean standard error of each parameter by one method."""
    found: dict[str, list[float]] = {}
    for _, _, judged in rows:
        for j in judged:
            if j.method == method:
                for name, std in zip(j.names, j.std, strict=True):
                    found.setdefault(name, []).append(float(std))
    return {name: float(np.mean(values)) for name, values in found.items()}


def _bias(rows: Rows, method: str, scale: dict[str, float]) -> float:
    """Mean distance from what is attainable over the records, rms over the parameters."""
    found: dict[str, list[float]] = {}
    for _, _, judged in rows:
        for j in judged:
            if j.method == method:
                for name, off in zip(j.names, j.estimate - j.attainable, strict=True):
                    if name in scale:
                        found.setdefault(name, []).append(float(off) / scale[name])
    means = [np.mean(values) for values in found.values()]
    return float(np.sqrt(np.mean(np.square(means)))) if means else float("nan")


def _coverage(own: Sequence[Judged], kind: str, friction: bool | None) -> str:
    z = np.concatenate(
        [
            getattr(j, kind)[slice(None) if friction is None else j.is_friction == friction]
            for j in own
        ]
    )
    return _share(z).removesuffix(" %")


def _share(z: np.ndarray) -> str:
    z = z[np.isfinite(z)]
    return f"{100 * np.mean(np.abs(z) < WIDTH):.0f} %" if z.size else "– %"


def _rms(z: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(z**2)))
