"""Figures of the results, as small PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .rows import Row
from .scaling import JointPoint, LengthPoint, exponent
from .stages import StageRow

INK, ACCENT, PALE = "#222222", "#0b6e99", "#c9d6dc"


def _axes(width: float = 6.4, height: float = 3.8):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(width, height), layout="constrained")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    return figure, axes


def _save(figure, folder: Path, name: str) -> Path:
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.png"
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def ratios(rows: Sequence[Row], folder: Path) -> Path:
    """How many times as fast as each peer."""
    shown = [r for r in rows if r.theirs is not None]
    figure, axes = _axes(9.0, 0.5 + 0.42 * len(shown))
    values = [r.ratio for r in shown]
    axes.barh(range(len(shown)), values, color=ACCENT, height=0.6)
    axes.axvline(1.0, color=INK, linewidth=1)
    axes.set_xscale("log")
    axes.set_xlim(min(0.5, 0.8 * min(values)), 2.5 * max(values))
    axes.set_yticks(
        range(len(shown)), [f"{r.work.split(',')[0]}\nbeside {r.peer}" for r in shown], fontsize=7
    )
    axes.invert_yaxis()
    for k, value in enumerate(values):
        axes.text(value * 1.05, k, f"{value:.3g} x", va="center", fontsize=8, color=INK)
    axes.set_xlabel("their time over ours")
    return _save(figure, folder, "ratios")


def samples(points: Sequence[LengthPoint], folder: Path) -> Path:
    """Processor time per sample and iteration, and peak memory, over the length of the record."""
    figure, axes = _axes()
    n = [p.samples for p in points]
    axes.plot(n, [p.microseconds for p in points], "o-", color=ACCENT)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.4 * max(p.microseconds for p in points))
    axes.set_xlabel("samples of six joints")
    axes.set_ylabel("processor time per sample\nand iteration [µs]", color=ACCENT)
    memory = axes.twinx()
    memory.plot(n, [p.peak_mib / 1024 for p in points], "s--", color=INK, markersize=4)
    memory.set_ylabel("peak memory of the process [GiB]", color=INK)
    memory.set_ylim(bottom=0.0)
    memory.spines["top"].set_visible(False)
    return _save(figure, folder, "samples")


def joints(points: Sequence[JointPoint], folder: Path) -> Path:
    """Cost over the number of joints, with the slopes."""
    figure, axes = _axes()
    arms = [p for p in points if p.branches == 1]
    trees = [p for p in points if p.branches > 1]
    for what, label, colour in (
        ("matrix_us", "observation matrix", ACCENT),
        ("simulation_us", "closed-loop simulation", INK),
    ):
        slope = exponent(list(points), what)
        axes.plot(
            [p.joints for p in arms], [getattr(p, what) for p in arms], "o-", color=colour,
            label=f"{label}: joints to the power {slope:.2f}",
        )  # fmt: skip
        axes.plot(
            [p.joints for p in trees],
            [getattr(p, what) for p in trees],
            "D",
            color=colour,
            mfc="none",
        )
    at = np.array([4, 12])
    axes.plot(at, arms[-1].matrix_us * (at / 12) ** 2, ":", color="#999999", label="quadratic")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks([2, 3, 4, 6, 8, 12], ["2", "3", "4", "6", "8", "12"])
    axes.set_yticks([0.1, 0.2, 0.5, 1, 2, 5], ["0.1", "0.2", "0.5", "1", "2", "5"])
    axes.minorticks_off()
    axes.set_xlabel("joints (open diamonds: a tree of 12)")
    axes.set_ylabel("per sample, one thread [µs]")
    axes.legend(frameon=False, fontsize=8)
    return _save(figure, folder, "joints")


def stages(rows: Sequence[StageRow], folder: Path) -> Path:
    """Where the time goes, beside the time that the bound of each stage allows."""
    figure, axes = _axes(7.5, 0.5 + 0.33 * len(rows))
    place = np.arange(len(rows))
    axes.barh(place, [r.ms for r in rows], color=PALE, height=0.7, label="processor time")
    axes.barh(
        place, [r.floor_ms for r in rows], color=ACCENT, height=0.35, label="its bound allows"
    )
    axes.set_yticks(
        place, [f"{r.stage} ({r.bound})" if r.bound else r.stage for r in rows], fontsize=8
    )
    axes.invert_yaxis()
    axes.set_xlabel("ms of one thread in one identification")
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    return _save(figure, folder, "stages")
