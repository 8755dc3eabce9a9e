"""Recordings against one another: the same run twice, held-out motion that is fitted as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.recording.recording import Recording
from pivident.text.finding import Finding, FindingKind, Topic
from pivident.text.repair import Edit, Place, Repair

#: What this check looks at.
RECORDINGS = Topic("recordings")

SAME_RUN = FindingKind(RECORDINGS, "same run")
RATES = FindingKind(RECORDINGS, "rates")

#: What tables of recordings are for, by the table's first key.
PURPOSE = {"validation": "judged on", "payload": "with the load", "gains": "with the payload"}


def check_recordings(recordings: Sequence[tuple[Place, Recording]]) -> list[Finding]:
    """Runs that appear twice, and runs of different rates."""
    findings: list[Finding] = []
    for k, (place, second) in enumerate(recordings):
        for other, first in recordings[:k]:
            if not _same_motion(first, second):
                continue
            here, there = _table(place), _table(other)
            purpose = PURPOSE.get(str(place[0]))
            step = "It counts twice, and all intervals come out too narrow; remove one of them."
            if place[0] == "validation" != other[0]:
                step = (
                    "Fitted motion cannot validate the estimate; name another file, or "
                    "another part of this one."
                )
            elif purpose is not None and place[0] != other[0]:
                step = f"The record {purpose} must be another run; name its file."
            findings.append(
                SAME_RUN.finding(
                    "error",
                    f"{here} is the same motion as {there} ({', '.join(_files(second))}).",
                    second.name,
                    step,
                    place=(*place, "files"),
                    repairs=[Repair((Edit(place),), "Remove this run.")],
                )
            )
            break
    rates = {recording.rate for _, recording in recordings}
    if len(rates) > 1 and max(rates) > 1.5 * min(rates):
        listed = ", ".join(f"{r.name} {r.rate:.5g} Hz" for _, r in recordings)
        findings.append(
            RATES.finding(
                "warning",
                f"The recordings have different rates: {listed}.",
                next_step="This is allowed; check that all come from the same loop.",
                place=(*recordings[-1][0], "rate"),
            )
        )
    return findings


def _same_motion(first: Recording, second: Recording) -> bool:
    """Whether two recordings share samples: parts of one file that overlap, or copies of it."""
    if first.joint_names != second.joint_names:
        return False
    if _files(first) == _files(second) and {s.sha256 for s in first.sources} == {
        s.sha256 for s in second.sources
    }:
        start = max(first.start_time, second.start_time)
        stop = min(first.start_time + first.duration, second.start_time + second.duration)
        return stop > start
    shorter = min(first.samples, second.samples)
    return np.allclose(first.q[:shorter], second.q[:shorter], rtol=0.0, atol=1e-12)


def _files(recording: Recording) -> list[str]:
    return [source.name for source in recording.sources] or [recording.name]


def _table(place: Place) -> str:
    names = ".".join(str(p) for p in place if not isinstance(p, int))
    number = next((p for p in place if isinstance(p, int)), 0)
    return f"[[{names}]] {number + 1}"
