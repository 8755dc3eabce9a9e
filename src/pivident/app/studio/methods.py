"""Methods as somebody chooses them: in groups, each in a few words and with about its time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pivident.app.studio.projects import Content
from pivident.app.studio.results_list import seconds_taken
from pivident.estimation.methods import METHODS

#: Offered with the methods that people need.
CONSISTENT = {"pc-piv": "the physically consistent parameters nearest to those of piv"}

#: What is chosen where the experiment file says nothing.
DEFAULT = ("ls", "iv-full-rate", "piv")


def method_context(
    content: Content, check: dict[str, Any], runs: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """What the section of methods shows.

    Args:
        content: of the experiment file.
        check: content of ``check.json``; empty before there is one.
        runs: of the project, the last one first.
    """
    chosen = content.methods or list(DEFAULT)
    plan = check.get("plan") or {}
    groups: dict[str, dict[str, str]] = {"": {}}
    for name, method in METHODS.usable().items():
        groups.setdefault(method.group, {})[name] = method.summary
    groups[""] |= CONSISTENT
    offered = {name for methods in groups.values() for name in methods}
    groups[""] |= {name: "named in the experiment file" for name in chosen if name not in offered}
    listed = [
        {
            "title": title,
            "folded": bool(title) and not set(methods) & set(chosen),
            "methods": [
                {
                    "name": name,
                    "words": words,
                    "chosen": name in chosen,
                    "seconds": _seconds_of(plan, name) if plan else "",
                }
                for name, words in methods.items()
            ],
        }
        for title, methods in groups.items()
    ]
    return {
        "groups": listed if content.has_recording else [],
        "seconds": _common_time(plan) if plan else "",
        "factor": _slowness(plan, runs) if plan else 1.0,
    }


def _seconds_of(plan: dict[str, Any], name: str) -> float:
    """What a method adds to the expected time [s]; a consistent one, that of its free estimate."""
    return float(plan["seconds_of"].get(name.removeprefix("pc-"), 0.0))


def _common_time(plan: dict[str, Any]) -> float:
    """What an identification takes beside its methods [s]."""
    return float(plan["seconds"]) - sum(_seconds_of(plan, name) for name in plan["methods"])


def _slowness(plan: dict[str, Any], runs: Sequence[dict[str, Any]]) -> float:
    """How many times as long as expected the last identification took; 1 before there is one."""
    for run in runs:
        if run["step"] == "identify" and run["state"] == "done" and run["started"]:
            methods = sum(_seconds_of(plan, name) for name in run["methods"])
            return seconds_taken(run) / (_common_time(plan) + methods)
    return 1.0
