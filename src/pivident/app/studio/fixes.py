"""What a remark of the check asks for as edits of the experiment file, ready to be applied.

A remark carries its repairs as data; here they become the buttons beside it. Those that the file
contradicts are left out, and a remark that leaves open what is right has none.

Repairs that a verdict has tried, applied to the experiment file as ``pivident apply`` does.
Friction laws that ``pivident laws`` has chosen, written into it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pivident.app.studio.projects import EXPERIMENT, Changed, Project
from pivident.experiment.edited_file import Edits, edited, edits_for, with_repair
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.foundation.text.repair import Repair
from pivident.foundation.text.toml import parse_toml, value_text
from pivident.judgement.diagnostics.stored_verdict import repairs_of


@dataclass(frozen=True)
class Fix:
    """One way to do what a remark asks for.

    Attributes:
        words: what is done, a sentence.
        edits: place and new value as TOML, in their order; None: removed.
    """

    words: str
    edits: Edits


def fixes(remark: Mapping[str, Any], text: str) -> tuple[Fix, ...]:
    """Ways to do what a remark asks for, the most likely first; empty where none is definite.

    Each has been tried on the text.

    Args:
        remark: an entry of ``check.json``, with ``joints``, the names of the robot's joints.
        text: the experiment file that was checked.
    """
    ways: list[Fix] = []
    for content in remark.get("repairs", ()):
        try:
            fix = Fix(*edits_for(Repair.of_json(content), text, tuple(remark.get("joints", ()))))
            works = edited(text, fix.edits) != text
        except (PividentError, ValueError):
            continue
        if works and all(fix.edits != other.edits for other in ways):
            ways.append(fix)
    return tuple(ways)


def says_the_same(content: Mapping[str, Any], results: Path) -> bool:
    """Whether an experiment file says what it said when a result was made, comments apart."""
    try:
        return bool(parse_toml((results / EXPERIMENT).read_text(encoding="utf-8")) == content)
    except (OSError, ValueError):
        return False


def repair_words(project: Project, results: Path, verdict: Mapping[str, Any]) -> dict[int, str]:
    """What each repair of a verdict would do and has done when it was tried, by its number.

    Without those that the file contradicts; none where the file says something else by now.

    Args:
        project: whose.
        results: folder of the verdict.
        verdict: its content.
    """
    if not verdict.get("repairs"):
        return {}
    items = (verdict.get("summary") or {}).get("items", ())
    effects = [item["effect"] for item in items if item["effect"]]
    words = {}
    for number, effect in enumerate(effects, start=1):
        try:
            done = repaired_text(project, results, number)[1]
        except (PividentError, ValueError):
            continue
        words[number] = f"{done.rstrip('.')} · tried: {effect}"
    return words


def repaired_text(project: Project, results: Path, number: int) -> tuple[str, str]:
    """The experiment file with a repair of a verdict, and what was done, a sentence.

    Args:
        project: whose.
        results: folder of the verdict.
        number: of the repair in it, from 1.

    Raises:
        Changed: the experiment file is no longer the one that the verdict is about.
        PividentError: there is no such repair, or it contradicts the file.
    """
    if not says_the_same(parse_toml(project.text), results):
        raise Changed(
            f"{EXPERIMENT} has changed since the verdict in {results.name}",
            advice="identify it again",
        )
    repairs = repairs_of(results)
    if not 0 < number <= len(repairs):
        raise Changed(f"the verdict in {results.name} has no repair {number}", advice="reload")
    joints = load_experiment(project.experiment).robot.joint_names
    return with_repair(project.text, repairs[number - 1][0], joints)


#: File of the chosen laws, and where they belong in an experiment file.
LAWS, PLACE = "laws.toml", ("robot", "joint_friction")


def joints_to_change(text: str, results: Path) -> list[str]:
    """Joints whose chosen laws an experiment file does not have yet.

    Args:
        text: the experiment file.
        results: folder of the run that has chosen.
    """
    try:
        joints = [str(place[-1]) for place, _ in _edits(results)]
        return joints if with_laws(text, results) != text else []
    except (PividentError, OSError, ValueError):
        return []


def with_laws(text: str, results: Path) -> str:
    """An experiment file with the laws that a run has chosen.

    Args:
        text: the experiment file.
        results: folder of the run.

    Raises:
        ExperimentError: it has chosen none, or the file contradicts them.
    """
    return edited(text, _edits(results))


def _edits(results: Path) -> Edits:
    """The laws as edits."""
    path = results / LAWS
    if not path.is_file():
        raise ExperimentError(f"{results.name} has chosen no laws", advice="reload the page")
    laws = parse_toml(path.read_text(encoding="utf-8"))["robot"]["joint_friction"]
    return tuple(((*PLACE, joint), value_text(law)) for joint, law in laws.items())
