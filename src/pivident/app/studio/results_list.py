"""Runs and their results, the verdict first, and what may be done next."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any
from urllib.parse import quote

from pivident.app.studio.fixes import joints_to_change, repair_words, says_the_same
from pivident.app.studio.gate import before_use, line_to_go_to
from pivident.app.studio.offers import best_result, offered
from pivident.app.studio.projects import EXPERIMENT, TEST_LOGS, Project
from pivident.app.studio.rows import Row
from pivident.app.studio.run_folder import read_object
from pivident.app.studio.steps import EXPORTED, STEPS
from pivident.estimation.methods import METHODS
from pivident.foundation.text.numbers import bytes_in_words, time_in_words
from pivident.foundation.text.repair import Place
from pivident.models.export.formats import FORMATS

#: A finding as commands print it, and how many answer the question of a test.
FINDING, MAX_ANSWERS = re.compile(r"^  (?:ok|note|warning|error) +(\S.*)$", re.MULTILINE), 2

#: Less than this is not worth a word [s].
SHORT = 3.0

#: Where the experiment file says what statements of a verdict are about.
LINES: dict[str, Place] = {
    "torque scale": ("recording", 0, "units", "tau"),
    "law": ("controller", "type"),
}


def result_context(
    project: Project,
    runs: list[dict[str, Any]],
    address: str,
    content: dict[str, Any],
    named: Mapping[str, float],
    rows: Sequence[Row],
) -> dict[str, Any]:
    """What the section of results shows.

    Args:
        project: whose.
        runs: its runs, the last one first.
        address: of the project's page.
        content: what the experiment file says now.
        named: files that it names, and when they came [s since 1970].
        rows: its lines.
    """
    outdated = {run["results"]: _outdated(project, run, content, named) for run in runs}
    latest = next((run["id"] for run in runs if run["step"] == "identify"), "")
    passed = {run["results"]: run["in_spite_of"] for run in runs}
    shown = [
        _shown(project, run, address, rows)
        | {
            "outdated": outdated.get(_source(run)) or outdated[run["results"]],
            "again": run["id"] == latest and bool(outdated[run["results"]]),
            "in_spite_of": [*passed.get(_source(run), []), *run["in_spite_of"]],
        }
        for run in runs
    ]
    return {
        "runs": _below_verdicts(shown),
        "newest": next((r["id"] for r in shown if r["offered"] or r["held_back"]), ""),
        "comparable": [r for r in shown if r["step"] == "identify" and r["state"] == "done"],
    }


def _below_verdicts(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Identifications with what followed from each: the result that it is about, or the last one.

    So the verdict stays above what is done with it. Runs before any identification stay alone.
    """
    top: list[dict[str, Any]] = []
    owners: dict[str, dict[str, Any]] = {}
    last: dict[str, Any] | None = None
    for run in reversed(runs):  # the first one first
        run["follow_ups"] = []
        owner = None if run["step"] == "identify" else owners.get(_source(run), last)
        last = run if run["step"] == "identify" else last
        (top if owner is None else owner["follow_ups"]).insert(0, run)
        if run["results"]:
            owners[run["results"]] = owner or run
    return top


def _source(run: dict[str, Any]) -> str:
    """The identification that a run follows from, ``results/001-identify``; empty for others."""
    return "/".join(str(run["arguments"].get("result", "")).split("/")[:2])


def _outdated(
    project: Project, run: dict[str, Any], content: dict[str, Any], named: Mapping[str, float]
) -> str:
    """What an identification was made from and is something else by now; empty if nothing."""
    folder = project.folder / run["results"]
    if run["step"] != "identify" or not (folder / EXPERIMENT).is_file():
        return ""  # no result, or one that was brought from elsewhere
    if not says_the_same(content, folder):
        return "The experiment file has changed since."
    later = (name for name, time in named.items() if time > _seconds(run["created"]))
    return next((f"{name} has changed since." for name in later), "")


def _shown(
    project: Project, run: dict[str, Any], address: str, rows: Sequence[Row]
) -> dict[str, Any]:
    """A run as the page shows it."""
    step, progress = STEPS.get(run["step"]), run.get("progress") or {}
    folder = project.folder / (run["results"] or "none")
    verdict = read_object(folder / "verdict.json")
    repairs = repair_words(project, folder, verdict)
    if verdict.get("repairs") and verdict.get("summary"):
        verdict["summary"]["next_step"] = ""  # repairs are buttons, which need no command
    statements = verdict.get("statements", [])
    against = [s for s in statements if s["severity"] in ("error", "warning")]
    left = progress.get("left_s")
    place = f"{address}/{quote(run['results'])}"
    files = [
        {
            "path": file["path"],
            "size": bytes_in_words(file["bytes"]),
            "address": f"{place}/{quote(file['path'])}?download",
        }
        for file in run["files"]
    ]
    return {
        **run,
        "title": step.title if step else run["step"],
        "words": _words(run) or (step.words if step else ""),
        "best": verdict.get("name", ""),
        "best_results": best_result(run["results"], run["methods"], verdict),
        "downloads": [file for file in files if file["path"].startswith(EXPORTED)],
        "created": clock(_seconds(run["created"])) if run["created"] else "",
        "took": time_in_words(seconds_taken(run))
        if run.get("started") and run.get("ended")
        else "",
        "stage": progress.get("stage", ""),
        "number": progress.get("number", 0),
        "of": progress.get("of", 0),
        "left": f"about {time_in_words(left)} left" if left and left > SHORT else "",
        "line": progress.get("line", "") or "starting",
        "kept": progress.get("kept", []),
        "repairs": repairs,
        "laws": joints_to_change(project.text, folder) if run["step"] == "laws" else [],
        "verdict": verdict if verdict.get("headline") else None,
        "answers": _answers(project, run),
        "against": [s | line_to_go_to(LINES.get(s["topic"], ()), rows) for s in against],
        "for": [s for s in statements if s not in against],
        "pages": [
            {"title": page["title"], "address": f"{place}/{quote(page['path'])}"}
            for page in run["pages"]
        ],
        "files": files,
        **_offers(project, [*offered(project.folder, run), *_always(run, verdict)]),
    }


def _answers(project: Project, run: dict[str, Any]) -> list[str]:
    """What a comparison has found, or a test on another log, in sentences."""
    if run["step"] == "predict":
        return FINDING.findall(run["output"])[:MAX_ANSWERS]
    if run["step"] != "compare" or not run["results"]:
        return []
    found = read_object(project.folder / run["results"] / "comparison.json").get("findings", [])
    return [str(sentence) for sentence in found] if isinstance(found, list) else []


def _always(run: dict[str, Any], verdict: dict[str, Any]) -> list[dict[str, Any]]:
    """What can be done with every identification."""
    if run["step"] != "identify" or not run["results"] or not verdict.get("name"):
        return []
    best = best_result(run["results"], run["methods"], verdict)
    return [
        {
            "step": "predict",
            "arguments": {"result": best},
            "words": "Test on another log",
            "reason": "Same columns, other motion: how well are its torques predicted?",
        },
        {
            "step": "export",
            "arguments": {"result": best, "free": True},
            "words": "Export the estimate",
            "reason": "As it is; simulators refuse parameters that no machine can have.",
        },
        {"step": "friction", "arguments": {}, "words": "Show friction", "reason": ""},
        {"step": "laws", "arguments": {}, "words": "Choose friction laws", "reason": ""},
    ]


def _words(run: dict[str, Any]) -> str:
    """What was asked: methods and corrections, or a format, and the results that it is about."""
    given, identified = run["arguments"], run["step"] == "identify"
    of = [given["result"]] if "result" in given else given.get("results", [])
    words = [
        "; ".join(map(_method, run["methods"])) if identified else "",
        f"corrected with the estimate: {', '.join(given['free'])}"
        if identified and given.get("free")
        else "",
        _exported(given) if run["step"] == "export" else "",
        str(given.get("log", "")).removeprefix(f"{TEST_LOGS}/"),
        f"of {', '.join(str(one).removeprefix('results/') for one in of)}" if of else "",
    ]
    return " · ".join(filter(None, words))


def _exported(given: Mapping[str, Any]) -> str:
    """What an export is of, and its format."""
    to = str(given.get("to", ""))
    title = FORMATS[to].title if to in FORMATS else to
    return f"{title} with the {'estimate' if given.get('free') else 'consistent set'}"


def _offers(project: Project, offers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What may be done next, and apart from it what the verdict holds back, with the reason."""
    gates = [before_use(project.folder, o["step"], o["arguments"]) for o in offers]
    pairs = [(_offer(o), gate.reason) for o, gate in zip(offers, gates, strict=True)]
    return {
        "offered": [offer for offer, reason in pairs if not reason],
        "held_back": [offer for offer, reason in pairs if reason],
        "held_back_by": list(dict.fromkeys(reason for _, reason in pairs if reason)),
    }


def _offer(offer: dict[str, Any]) -> dict[str, Any]:
    """A next step with the fields that somebody may fill in."""
    given = offer["arguments"]
    fields = [
        {
            "name": argument.name,
            "label": argument.label,
            "kind": argument.kind,
            "choices": list(argument.choices),
            "default": argument.default,
        }
        for argument in STEPS[offer["step"]].arguments
        if argument.name not in given and argument.is_needed
    ]
    return {**offer, "fields": fields}


def clock(seconds: float) -> str:
    """A time since 1970 [s] as the reader's clock shows it."""
    return datetime.fromtimestamp(seconds).astimezone().strftime("%Y-%m-%d %H:%M")


def _method(name: str) -> str:
    """A method as it is chosen, and as the verdict and reports call it."""
    method = METHODS.get(name.removeprefix("pc-"))
    return f"{name}: {method.label}" if method else name


def seconds_taken(run: dict[str, Any]) -> float:
    """How long a run took that has ended [s]."""
    return _seconds(run["ended"]) - _seconds(run["started"])


def _seconds(stamp: str) -> float:
    """A time of the account of a run [s since 1970]."""
    return datetime.fromisoformat(stamp).timestamp()
