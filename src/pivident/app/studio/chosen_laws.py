"""Friction laws that ``pivident laws`` has chosen, written into the experiment file."""

from __future__ import annotations

from pathlib import Path

from pivident.experiment.edited_file import Edits, edited
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.foundation.text.toml import parse_toml, value_text

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
