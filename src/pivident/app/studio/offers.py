"""What a run suggests to do next: from its verdict, its files and the experiment file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pivident.app.studio.projects import EXPERIMENT, RESULTS
from pivident.app.studio.run_folder import read_object, result_folders
from pivident.foundation.text.sentences import listed
from pivident.foundation.text.toml import parse_toml

Offer = dict[str, Any]

#: Most parameters that a designed motion names.
MAX_NAMED = 12

#: Causes of model error that the verdict names and `identify` corrects.
CORRECTED = (
    "delay", "geometry", "gear ratio", "torque gain", "zero position", "position scale", "encoder",
)  # fmt: skip


def offered(project: Path, run: Mapping[str, Any]) -> list[Offer]:
    """What can be done after a run, the most useful first.

    Args:
        project: folder of the project.
        run: an entry of `Runs.listed`.

    Returns:
        For each: ``step`` and ``arguments`` as `Runs.add` takes them, ``words`` for a button, and
        the ``reason`` in a sentence. Empty where the run has no results.
    """
    name = str(run.get("results", ""))
    folder = project / name
    if not name or not folder.is_dir():
        return []
    after = {
        "identify": _after_identification,
        "consistent": _after_consistent,
        "friction": _after_friction,
    }.get(str(run.get("step")))
    if after is None:
        return []
    found: dict[str, Offer] = {}
    for offer in after(project, folder, name):
        found.setdefault(f"{offer['step']} {offer['arguments']}", offer)
    return list(found.values())


def _offer(step: str, words: str, reason: str, **arguments: Any) -> Offer:
    return {"step": step, "arguments": arguments, "words": words, "reason": reason}


def _after_identification(project: Path, folder: Path, name: str) -> Iterator[Offer]:
    """First what the verdict asks for, then what uses the result."""
    verdict = read_object(folder / "verdict.json")
    statements = [s for s in verdict.get("statements", []) if isinstance(s, dict)]
    methods = _methods(folder, verdict)
    best = best_result(name, methods, verdict)
    simulation = (verdict.get("uses") or {}).get("simulation") or {}
    has_consistent = (project / best / "consistent.json").is_file()
    yield from _better_estimates(project, statements, methods)
    if simulation.get("answer") == "care" and not has_consistent:
        yield _consistent(name, simulation)
    friction, uneven = (
        _is_said(statements, "model", kind, ("warning", "error"))
        for kind in ("friction", "uneven friction")
    )
    if friction:
        yield _offer("laws", "Choose friction laws", friction)
    if friction or uneven:
        yield _offer("friction", "Show friction", friction or uneven)
    if motion := _wanted_motion(verdict, statements, name):
        yield motion
    if has_consistent:
        yield from _exports(best)
    elif simulation.get("answer") == "yes":
        yield from _exports(best, "The estimate is one that a machine can have.")
    elif simulation.get("answer") == "no":
        yield _consistent(name, simulation, accept_far=True)
    elif not simulation and verdict.get("severity") != "error":
        yield _consistent(name, simulation)
    yield from _of_tables(project)
    others = _other_results(project, folder)
    if others:
        yield _offer(
            "compare",
            "Compare with the result before",
            f"Shows whether parameters differ significantly from those of {others[-1]}.",
            results=[f"{RESULTS}/{others[-1]}", name],
        )
    if len(methods) > 1:
        text = f"Shows where {listed(methods)} differ significantly."
        yield _offer("compare", "Compare the methods", text, results=[name])


def _consistent(name: str, simulation: Mapping[str, Any], **arguments: Any) -> Offer:
    """The consistent set, as the verdict on simulation asks for it."""
    reason = f"For simulation: {simulation['why']}." if simulation.get("why") else ""
    reason = reason or "Simulators need parameters that a real machine can have."
    return _offer("consistent", "Make the consistent set", reason, result=name, **arguments)


def best_result(name: str, methods: Sequence[str], verdict: Mapping[str, Any]) -> str:
    """The result of the method that a verdict takes, in a folder of one or of several."""
    return f"{name}/{verdict['name']}" if len(methods) > 1 and "name" in verdict else name


def _better_estimates(
    project: Path, statements: list[dict[str, Any]], methods: list[str]
) -> Iterator[Offer]:
    """Identifications that answer a reservation."""
    if reason := _is_said(statements, "feedback", "no instruments"):
        more = ["iv-full-rate", "piv"] if "controller" in _tables(project) else ["iv-full-rate"]
        wanted = list(dict.fromkeys([*methods, *more]))
        yield _offer("identify", f"Identify with {listed(more)} too", reason, method=wanted)
    if reason := _is_said(statements, "prediction", "nothing held out"):
        yield _offer("identify", "Identify with held-out motion", reason, method=methods, folds=5)
    causes = [
        str(s["kind"])
        for s in statements
        if s.get("topic") == "model" and s.get("severity") == "warning" and s["kind"] in CORRECTED
    ]
    if causes:
        free = [cause.replace(" ", "-") for cause in dict.fromkeys(causes)]
        reason = _is_said(statements, "model", causes[0])
        text = f"Correct {listed(causes)} with the estimate"
        yield _offer("identify", text, reason, method=methods, free=free)


def _wanted_motion(
    verdict: Mapping[str, Any], statements: list[dict[str, Any]], name: str
) -> Offer | None:
    """The motion that would determine what is open."""
    names = [str(one) for one in verdict.get("open", [])]
    reason = _is_said(statements, "motion", "wanted")
    if not names and not reason:
        return None
    reason = reason or f"Another motion would determine {listed(names, 6)}."
    if len(names) <= MAX_NAMED and names and not any("," in one for one in names):
        return _offer("excite", "Design the next motion", reason, result=name, parameters=names)
    return _offer("excite", "Design the next motion", reason, result=name)


def _after_consistent(project: Path, folder: Path, name: str) -> Iterator[Offer]:
    if (folder / "consistent.json").is_file():
        yield from _exports(name)


def _after_friction(project: Path, folder: Path, name: str) -> Iterator[Offer]:
    text = "Shows which law predicts motion best that was not fitted."
    yield _offer("laws", "Choose friction laws", text)


def _exports(result: str, reason: str = "A machine can have it.") -> Iterator[Offer]:
    """Files of the consistent set."""
    for to, title in (("urdf", "URDF"), ("mjcf", "MuJoCo"), ("c", "C")):
        words = f"Export the consistent set for {title}"
        yield _offer("export", words, reason, result=result, to=to)


def _methods(folder: Path, verdict: Mapping[str, Any]) -> list[str]:
    """Short names of the methods of a folder."""
    several = [p.parent.name for p in sorted(folder.glob("*/identification.json"))]
    return several or ([str(verdict["name"])] if "name" in verdict else [])


def _is_said(
    statements: list[dict[str, Any]], topic: str, kind: str, severities: tuple[str, ...] = ()
) -> str:
    """The first statement of a kind, with its next step; empty where there is none."""
    for said in statements:
        if (said.get("topic"), said.get("kind")) == (topic, kind):
            if not severities or said.get("severity") in severities:
                return str(said.get("message", ""))
    return ""


def _tables(project: Path) -> dict[str, Any]:
    """Tables of the experiment file; none where it cannot be read."""
    try:
        return parse_toml((project / EXPERIMENT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _of_tables(project: Path) -> Iterator[Offer]:
    """What tables of the experiment file describe beside the identification."""
    tables = _tables(project)
    if "payload" in tables:
        reason = "The experiment file describes records with a load."
        yield _offer("payload", "Identify the payload", reason)
    if "gains" in tables:
        reason = "The experiment file says what is known of the drives."
        yield _offer("gains", "Find drive gains", reason)


def _other_results(project: Path, folder: Path) -> list[str]:
    """Earlier identifications, the last one last."""
    number = int(folder.name.partition("-")[0])
    return [
        name
        for run, names in sorted(result_folders(project).items(), key=lambda one: int(one[0]))
        for name in names
        if int(run) < number and name.endswith("-identify")
    ]
