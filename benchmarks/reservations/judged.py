"""One record by the user's way: estimates and verdict; whether that names what was planted."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import pivident as pv
from pivident.foundation.text.plain_values import plain
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.trials import Trial
from pivident.judgement.diagnostics.verdict import Verdict, verdict

from .records import Made, Wanted, make

#: Methods that `pivident init` writes into a file.
METHODS = ("ls", "iv-full-rate", "piv")

#: Severities of a reservation.
RESERVATIONS = ("error", "warning")

#: Kinds of findings and edits of repairs that name a cause under another word.
SAID_AS = {
    "lost samples": {"lost"},
    "jitter": {"hidden jitter"},
    "delay": {"late", "early", "drive delay", "delay"},
    "torque gain": {"gain"},
}

#: Edits that set a cause right: class and channel or key.
UNDONE_BY = {
    "delay": ("Edit",),
    "torque gain": ("Multiplied", "Gain"),
    "gear ratio": ("Multiplied", "Gain"),
    "zero position": ("Shifted",),
    "geometry": ("Shifted",),
}


def judge(record: Wanted) -> dict[str, Any]:
    """Everything that is kept of a record, as plain values."""
    begin = time.perf_counter()
    made = make(record)
    kept: dict[str, Any] = {
        "family": record.family,
        "fault": record.fault,
        "seed": record.seed,
        "size": made.size,
        "unit": made.unit,
        "expected": [list(cause) for cause in made.expected],
    }
    simulated = time.perf_counter()
    try:
        found = {name: pv.identify(made.problem, name) for name in METHODS}
    except pv.PividentError as error:
        return kept | {"refused": str(error)}
    said = verdict(diagnose(made.problem, found))
    kept |= parameters(made, found["piv"])
    kept |= statements(said)
    kept["seconds"] = [simulated - begin, time.perf_counter() - simulated]
    return plain(kept)


def parameters(made: Made, piv: pv.Identification) -> dict[str, Any]:
    """Errors of PIV over the σ that it shows, as far as the truth is known."""
    own = [
        (name, min((value - truth[name] for truth in made.truths if name in truth), key=abs), std)
        for name, value, std in zip(piv.names, piv.theta, piv.std, strict=True)
        if any(name in truth for truth in made.truths)
    ]
    names, errors, std = (list(x) for x in zip(*own, strict=True))
    return {"names": names, "error": errors, "std": std, "z": list(np.divide(errors, std))}


def statements(said: Verdict) -> dict[str, Any]:
    """What a verdict says."""
    keys = ("severity", "topic", "kind", "subject", "message")
    return {
        "recommended": said.name,
        "severity": said.severity,
        "headline": said.headline,
        "findings": [{key: getattr(one, key) for key in keys} for one in said.statements],
        "uses": {use.name: use.answer for use in said.uses},
        "repairs": [repair(trial) for trial in said.repairs],
        "tried": [repair(trial) for trial in said.trials if not trial.wins],
    }


def repair(trial: Trial) -> dict[str, Any]:
    """A repair that was tried."""
    edits = [] if trial.repair is None else trial.repair.as_json()["edits"]
    return {"cause": trial.cause, "outcome": trial.outcome, "effect": trial.effect, "edits": edits}


def reservations(kept: Mapping[str, Any]) -> list[dict[str, str]]:
    """Findings that are reservations, in the order of the verdict."""
    return [one for one in kept["findings"] if one["severity"] in RESERVATIONS]


def names_fault(kept: Mapping[str, Any]) -> bool:
    """Whether the first repair or, without one, the first reservation names what was planted."""
    expected: Sequence[Sequence[str | None]] = kept["expected"]
    if kept["repairs"]:
        first = kept["repairs"][0]
        return any(_undoes(edit, *cause) for edit in first["edits"] for cause in expected)
    said = reservations(kept)
    return bool(said) and any(_names(said[0], *cause) for cause in expected)


def _names(finding: Mapping[str, str], kind: str | None, joint: str | None) -> bool:
    words = f"{finding['subject']} {finding['message']}"
    if joint is not None and joint not in words:
        return False
    kinds = {kind, *SAID_AS.get(str(kind), ())}
    alike = finding["topic"] == "model" and str(kind) in words  # "cannot tell it from …"
    return finding["kind"] in kinds or finding["topic"] in kinds or alike


def _undoes(edit: Mapping[str, Any], kind: str | None, joint: str | None) -> bool:
    if edit["edit"] not in UNDONE_BY.get(str(kind), ()):
        return False
    entries = [own[0] for key in ("factors", "gains", "offsets") for own in edit.get(key) or ()]
    if joint is None:
        return "delay" in [str(part) for part in edit.get("place") or ()]
    return joint in entries
