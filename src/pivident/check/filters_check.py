"""Filters that the recordings' rates do not allow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pivident.check.remark import Remark
from pivident.estimation.methods import Bandpass, Method
from pivident.recording.recording import Recording


def check_filters(methods: Mapping[str, Method], recordings: Iterable[Recording]) -> list[Remark]:
    """Cut-off frequencies of position filters beyond half the rate of a recording."""
    slowest = min(recordings, key=lambda r: r.rate, default=None)
    if slowest is None:
        return []
    remarks = []
    for name, method in methods.items():
        signals = getattr(method, "signals", None)
        if not isinstance(signals, Bandpass) or signals.cutoff < slowest.rate / 2:
            continue
        step = (
            f"Set bandpass = {{cutoff = {slowest.rate / 10:g}}} or so, above the band of the "
            "motion; or check the unit of the time stamps."
        )
        if slowest.slowed:
            step = f"{slowest.slowed[0].upper()}{slowest.slowed[1:]}."
        remarks.append(
            Remark(
                "error",
                "methods",
                "cutoff",
                f"The position filter of {name!r} has a cutoff of {signals.cutoff:g} Hz, but at "
                f"{slowest.rate:g} Hz {slowest.name} holds nothing above {slowest.rate / 2:g} Hz.",
                slowest.name,
                step,
                place=("identify", "bandpass", "cutoff"),
                refused=True,
            )
        )
    return remarks
