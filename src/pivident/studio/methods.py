"""Methods as somebody chooses them: in groups, each in a few words and with about its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pivident.studio.results_list import seconds_taken
from pivident.studio.studio import Content


@dataclass(frozen=True)
class MethodGroup:
    """Methods that belong together.

    Attributes:
        title: heading.
        methods: what each is, by its name.
        folded: whether the page shows them only when asked.
    """

    title: str
    methods: dict[str, str]
    folded: bool = True


#: All methods; docs/reference/methods.md says more.
GROUPS = (
    MethodGroup(
        "",
        {
            "ls": "least squares: fast, and biased by the feedback loop",
            "iv-full-rate": "instrumental variables: no bias, intervals too wide",
            "piv": "prefiltered instrumental variables: no bias, correct intervals",
            "iv": "instrumental variables on filtered, decimated signals",
            "pc-piv": "the physically consistent parameters nearest to those of piv",
        },
        folded=False,
    ),
    MethodGroup(
        "Methods that fit a simulation",
        {
            "ml": "positions and torques by their noise; needs law and reference",
            "cloe": "positions of the simulated closed loop",
            "clie": "torques of the simulated closed loop",
            "oloe": "positions of the robot driven by the recorded torques",
            "didim": "for coarse encoders with a known law and reference",
        },
    ),
    MethodGroup(
        "Regressions",
        {
            "ols": "least squares without weights",
            "wls": "the same as ls",
            "tls": "total least squares",
            "irls": "robust against spikes and lost samples",
            "ridge": "shrinks what the motion hardly determines",
            "map": "with a normal prior from the description",
            "ml-ls": "with the covariance between the joints",
            "set-membership": "guaranteed intervals for bounded errors",
            "adaline": "step by step, for comparison",
            "hopfield": "step by step, for comparison",
            "frequency": "on the lines of a periodic motion",
            "piv-as-printed": "piv exactly as the paper prints it",
        },
    ),
    MethodGroup(
        "Filters",
        {
            "ekf": "extended Kalman filter",
            "ukf": "unscented Kalman filter",
            "cdkf": "central difference Kalman filter",
            "particle": "particle filter, slow",
        },
    ),
)

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
    known = {name for group in GROUPS for name in group.methods}
    others = {name: "named in the experiment file" for name in chosen if name not in known}
    groups = [
        {
            "title": group.title,
            "folded": group.folded and not set(group.methods) & set(chosen),
            "methods": [
                {
                    "name": name,
                    "words": words,
                    "chosen": name in chosen,
                    "seconds": _seconds_of(plan, name) if plan else "",
                }
                for name, words in {**group.methods, **({} if group.folded else others)}.items()
            ],
        }
        for group in GROUPS
    ]
    return {
        "groups": groups if content.has_recording else [],
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
