"""What later commands read back from the verdict of a folder of results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pivident.estimation.stored_identification import json_of_file
from pivident.foundation.codec import decode
from pivident.foundation.errors import IdentificationFileError, PividentError, UnusableValue
from pivident.foundation.text.repair import Repair
from pivident.judgement.validation.held_out.held_out_errors import HeldOutErrors

#: The verdict's name in a folder of results.
VERDICT_FILE = "verdict.json"

#: The file of a result.
RESULT = "identification.json"

#: Uses whose rejection is said wherever a result goes.
REJECTED = {"torque": "torque prediction", "simulation": "simulation"}


def repairs_of(folder: Path) -> list[tuple[Repair, str]]:
    """Repairs that the verdict of a folder recommends, in order, each with what was wrong.

    Raises:
        IdentificationFileError: the folder has no verdict, or one of an earlier version.
    """
    stored: Any = json_of_file(folder / VERDICT_FILE).get("repairs")
    try:
        return [(Repair.of_json(one["repair"]), str(one["cause"])) for one in stored]
    except (TypeError, KeyError, ValueError):
        raise IdentificationFileError(
            str(folder / VERDICT_FILE), "holds no repairs that can be read", advice="identify again"
        ) from None


def stored_experiment(folder: Path) -> str:
    """SHA-256 of the experiment file that the verdict of a folder is about; empty without one."""
    return str(_content(folder).get("experiment", ""))


def rejected_uses(folder: Path) -> dict[str, str]:
    """Uses for which the verdict on a result rejects it, each with a sentence that says why.

    Args:
        folder: of the result; the verdict stands in it, or in the folder above.
    """
    stored = (_content(folder) or _content(folder.parent)).get("uses")
    judged: dict[str, Any] = stored if isinstance(stored, dict) else {}
    return {
        name: f"The verdict rejects it for {words}: {judged[name].get('why', '')}."
        for name, words in REJECTED.items()
        if isinstance(judged.get(name), dict) and judged[name].get("answer") == "no"
    }


def said_against(folder: Path) -> tuple[str, ...]:
    """What a file that is made of a result has to say: rejected uses, and checks that were passed.

    Args:
        folder: of the result; the verdict stands in it, or in the folder above.
    """
    stored = (_content(folder) or _content(folder.parent)).get("in_spite_of")
    passed = [str(said) for said in stored] if isinstance(stored, list) else []
    passed = [f"Identified in spite of this: {said}" for said in passed]
    return (*passed, *rejected_uses(folder).values())


def recommended_method(folder: Path) -> str:
    """Short name of the method that the verdict of a folder recommends; empty without one."""
    name = _content(folder).get("name")
    return name if isinstance(name, str) and name == Path(name).name else ""


def result_of(path: Path) -> Path:
    """A file of a result; of a folder its identification, or the one that its verdict recommends.

    Raises:
        IdentificationFileError: the folder has neither.
    """
    if not path.is_dir():
        return path
    name = "" if (path / RESULT).is_file() else recommended_method(path)
    if (path / name / RESULT).is_file():
        return path / name / RESULT
    there = sorted(p.parent.name for p in path.glob(f"*/{RESULT}"))
    advice = f"name one of {', '.join(there)}" if there else "name the folder of a result"
    raise IdentificationFileError(
        str(path), f"holds no {RESULT} and no {VERDICT_FILE} that recommends one", advice=advice
    )


def held_out_errors(folder: Path, method: str) -> HeldOutErrors | None:
    """Held-out errors of a result in a folder, by its verdict or that of the folder above.

    None where there is no verdict with errors of this method.
    """
    for place in (folder, folder.parent):
        stored = _content(place).get("held_out")
        for name, values in stored.items() if isinstance(stored, dict) else ():
            if place == folder or name == folder.name:
                try:
                    found = decode(HeldOutErrors, values)
                except UnusableValue:
                    continue
                if found.method == method:
                    return found
    return None


def _content(folder: Path) -> dict[str, Any]:
    """The verdict of a folder as plain values, empty where there is none."""
    try:
        return json_of_file(folder / VERDICT_FILE)
    except PividentError:
        return {}
