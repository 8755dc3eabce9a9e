"""Torques that keep a value for a while though their joint moves, in words."""

from __future__ import annotations

import numpy as np

from pivident.data.logs.bad_samples import frozen_samples
from pivident.data.logs.clocks.timestamps import runs_of
from pivident.data.logs.log import Log
from pivident.data.recording.checks import TOLERATED_CLIPPING
from pivident.foundation.text.finding import (
    Finding,
    FindingKind,
    Quantity,
    Severity,
    Topic,
    at_sample,
)
from pivident.judgement.audit.spoilt_checks import COMPARISONS

#: What the checks of single channels look at.
CHANNELS = Topic("channels", "Channels")

FROZEN = FindingKind(
    CHANNELS, "frozen", ("recording", "part"), reservation=True, spoils=COMPARISONS
)


def check_frozen(
    log: Log, name: str, x: np.ndarray, q: np.ndarray, place: np.ndarray
) -> list[Finding]:
    """What there is to say about a channel; ``place``: numbers of its samples in the log."""
    if not np.isfinite(q).all():
        return []
    frozen = frozen_samples(x, q)
    if not frozen.any():
        return []
    parts = runs_of(frozen)
    first, stop = parts[np.argmax(parts[:, 1] - parts[:, 0])].tolist()
    begin, end = int(place[first]), int(place[stop - 1])
    share = float(frozen.mean())
    severity: Severity = "error" if share > TOLERATED_CLIPPING else "warning"
    others = f", the longest of {len(parts)} such stretches" if len(parts) > 1 else ""
    text = (
        f"{name} is exactly {x[first]:.6g} (unit of the log) from sample {begin} to {end}"
        f"{_times(log, begin, end)} while its joint moves{others}. Elsewhere it never stays the "
        "same for so long."
    )
    step = "Use a part without it (part = [start, stop] in s), or log the motion again."
    evidence = {
        "share": Quantity(100 * share, "%", bound=100 * TOLERATED_CLIPPING),
        **at_sample(begin, log.time_of(begin)),
    }
    return [FROZEN.finding(severity, text, name, step, evidence)]


def _times(log: Log, begin: int, end: int) -> str:
    """The same in seconds, where the log has a clock."""
    start, stop = log.time_of(begin), log.time_of(end)
    if start is None or stop is None:
        return ""
    return f" ({start:.4g} to {stop:.4g} s)"
