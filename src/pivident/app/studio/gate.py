"""What is held back because it would be wrong; whoever goes on all the same is not stopped.

A run is held back by errors of the check, the use of a result by a verdict that rejects this use.
What was said against it stays with the result: on its card, in its ``run.json``, in its exports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pivident.app.studio.run_folder import ACCOUNT, read_object
from pivident.app.studio.step_arguments import StepError, result_folder
from pivident.judgement.diagnostics.verdict_file import VERDICT_FILE, rejected_uses

#: Formats for simulators, which need parameters that a machine can have.
SIMULATED = ("urdf", "mjcf", "sdf")

#: Longest way from a derived result to its identification.
MAX_STEPS = 5


@dataclass(frozen=True)
class Gate:
    """Whether something is held back.

    Attributes:
        reason: why, a sentence; empty where nothing is held back.
        against: sentences that a result remembers which is made all the same; none where nobody
            can go on.
    """

    reason: str = ""
    against: tuple[str, ...] = ()


def before_run(has_recording: bool, look: Mapping[str, str], check: Mapping[str, Any]) -> Gate:
    """What holds an identification back.

    Args:
        has_recording: whether the experiment file describes a log.
        look: state of the look at it.
        check: content of its ``check.json``; empty before there is one.
    """
    if not has_recording:
        return Gate("A robot and a log are needed first.")
    if look["findings"] == "failed":
        return Gate(f"The check has failed: {look['error']}")
    if look["findings"] != "ready":
        return Gate("The check has not finished yet.")
    if check.get("error"):
        return Gate("The experiment file cannot be read; see Checks.")
    if check.get("refused"):
        return Gate("First fix what is marked × under Checks: it would stop a run.")
    errors = [r["message"] for r in check.get("remarks", ()) if r["severity"] == "error"]
    if not errors:
        return Gate()
    return Gate("What is marked × under Checks would mislead a run.", tuple(errors))


def before_use(project: Path, step: str, arguments: Mapping[str, Any]) -> Gate:
    """What holds the use of a result back: a verdict that rejects it.

    Args:
        project: folder of the project.
        step: what the result is used for.
        arguments: of the step; one that cannot be carried out is refused elsewhere.
    """
    if step not in ("consistent", "export"):
        return Gate()
    try:
        rejected = rejected_uses(_judged(project, str(arguments.get("result"))))
    except StepError:
        return Gate()
    if step == "export" and arguments.get("to") not in (None, *SIMULATED):
        rejected.pop("simulation", None)
    return Gate(next(iter(rejected.values()), ""), tuple(rejected.values()))


def _judged(project: Path, result: str) -> Path:
    """Folder of the identification that a result follows from."""
    folder = project / result_folder(project, result)
    for _ in range(MAX_STEPS):
        folder = folder if folder.is_dir() else folder.parent
        arguments = read_object(folder / ACCOUNT).get("arguments")
        if (folder / VERDICT_FILE).is_file() or not isinstance(arguments, dict):
            break
        if not isinstance(made_from := arguments.get("result"), str):
            break
        folder = project / result_folder(project, made_from)
    return folder
