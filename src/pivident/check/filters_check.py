"""Filters that recordings are too slow or too short for, and rates that one channel sets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pivident.estimation.kinematics import MIN_RUN, settled_recipe
from pivident.estimation.method import Method
from pivident.estimation.signal_recipes import Bandpass, RandomWalk
from pivident.experiment.identify_table import median_finding
from pivident.recording.recording import Recording
from pivident.signals.bandpass import EDGE
from pivident.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.text.sentences import capital

#: What this check looks at.
METHODS = Topic("methods")

CUTOFF = FindingKind(METHODS, "cutoff", ("identify", "bandpass", "cutoff"), stops=True)
TOO_SHORT = FindingKind(METHODS, "too short", ("recording", "part"), stops=True)
SLOWED = FindingKind(Topic("timing"), "slowed", ("recording", "rate"))


def check_filters(methods: Mapping[str, Method], recordings: Iterable[Recording]) -> list[Finding]:
    """Filters that a recording is too slow or too short for."""
    recordings = list(recordings)
    findings = [_slowed(r) for r in recordings if r.slowed]
    if (median := median_finding(methods)) is not None:
        findings.append(median)
    findings += [f for recording in recordings for f in _too_short(recording, methods)]
    slowest = min(recordings, key=lambda r: r.rate, default=None)
    if slowest is None:
        return findings
    for name, method in methods.items():
        signals = method.signals
        if not isinstance(signals, Bandpass) or signals.cutoff is None:
            continue
        highest = float(signals.cutoffs(slowest.joints).max())
        if highest < slowest.rate / 2:
            continue
        step = (
            "Leave cutoff out, and it is chosen from the record; or check the unit of the time "
            "stamps."
        )
        if slowest.slowed:
            step = f"{capital(slowest.slowed)}."
        findings.append(
            CUTOFF.finding(
                "error",
                f"The position filter of {name!r} has a cutoff of {highest:g} Hz, but at "
                f"{slowest.rate:g} Hz {slowest.name} holds nothing above {slowest.rate / 2:g} Hz.",
                slowest.name,
                step,
            )
        )
    return findings


def _too_short(recording: Recording, methods: Mapping[str, Method]) -> list[Finding]:
    """A recording of which the filters leave too little between its ends."""
    needed = {}
    for name, method in methods.items():
        signals = settled_recipe(method.signals, [recording])
        ends = (EDGE, EDGE) if isinstance(signals, RandomWalk) else signals.ends(recording.rate)
        needed[name] = sum(ends) + MIN_RUN
    name = max(needed, key=needed.__getitem__, default="")
    if not needed or recording.samples >= needed[name]:
        return []
    seconds = needed[name] / recording.rate
    text = (
        f"{recording.name} is too short for {name!r}: {recording.samples} samples, of which its "
        f"filters drop {needed[name] - MIN_RUN} at the ends; {needed[name]} are needed, "
        f"{seconds:.3g} s at {recording.rate:g} Hz."
    )
    step = "Take a longer part, or log for longer."
    return [TOO_SHORT.finding("error", text, recording.name, step)]


def _slowed(recording: Recording) -> Finding:
    """A recording that has lost samples of its positions to a slower channel."""
    return SLOWED.finding(
        "warning",
        f"{recording.name} is used at {recording.rate:g} Hz, slower than its positions were "
        "logged.",
        recording.name,
        f"{capital(recording.slowed)}.",
        {"rate": Quantity(recording.rate, "Hz")},
    )
