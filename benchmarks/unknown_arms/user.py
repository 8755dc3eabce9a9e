"""What a new user does with a record: four commands, and between them only what the user can know.

    pivident init RUNS --robot ARM.urdf     then the data sheet is written into the file
    pivident check                          whose advice about the cut-off is followed
    pivident identify -m ls,iv-full-rate,piv

A method that gives no result beside the others is tried by itself.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

#: A friction law with the sharp sign.
HARD_SIGN = ("viscous", {"term": "coulomb", "smoothing": "sign"}, "offset")

METHODS = ("ls", "iv-full-rate", "piv")

#: Longest time of one command [s].
PATIENCE = 900.0


@dataclass(frozen=True)
class Command:
    """A command that ran.

    Attributes:
        arguments: what was typed after ``pivident``.
        code: its exit code; -1 where it took too long.
        seconds: how long it took [s].
        output: what it printed.
        errors: what it printed as errors and progress.
    """

    arguments: tuple[str, ...]
    code: int
    seconds: float
    output: str
    errors: str

    @property
    def complaint(self) -> str:
        """The first line that says what is wrong, empty where nothing is."""
        lines = [x.strip() for x in (self.output + "\n" + self.errors).splitlines()]
        starts = ("error", "Error", "Traceback", "to do")
        found = [x for x in lines if x.startswith(starts) or ": error: " in x]
        return found[0] if found and self.code else ""


@dataclass(frozen=True)
class Session:
    """What a user got.

    Attributes:
        commands: all that ran, in order.
        reached: seconds by method that gave a result [s].
        missed: first line of the error by method that gave none.
    """

    commands: tuple[Command, ...]
    reached: dict[str, float]
    missed: dict[str, str]


def use(
    folder: Path, arm: str, runs: Sequence[str], *, edit: bool = True, hard_sign: bool = False
) -> Session:
    """Run the commands on a record.

    Args:
        folder: with the logs, the URDF and the data sheet; results are written into it.
        arm: name of the arm.
        runs: the runs that are identified from; ``held_out`` validates.
        edit: whether the data sheet is written into the file that `init` made.
        hard_sign: whether dry friction gets a sharp sign, as the machines have it and as no user
            knows.
    """
    logs = [f"{run}.csv" for run in runs]
    file = folder / "experiment.toml"
    commands = [pivident(folder, "init", *logs, "--robot", f"{arm}.urdf", "--yes", "--force")]
    if not file.exists():
        return _finish(folder, commands, {}, dict.fromkeys(METHODS, commands[0].complaint))
    written = file.read_text(encoding="utf-8")
    (folder / "experiment_of_init.toml").write_text(written, encoding="utf-8")
    tables = tomllib.loads(written)
    if edit:
        sheet = json.loads((folder / "data_sheet.json").read_text())
        tables = with_data_sheet(tables, sheet)
        if hard_sign:
            tables["robot"]["friction"] = list(HARD_SIGN)
        if (folder / "held_out.csv").exists() and "held_out" not in runs:
            tables["validation"] = {"recording": [{**_first(tables), "files": "held_out.csv"}]}
        _write(file, tables)
    commands.append(pivident(folder, "check", "experiment.toml"))
    advice = re.search(r"Set bandpass = \{cutoff = ([\d.]+)\}", commands[-1].output)
    if edit and advice:
        tables.setdefault("identify", {})["bandpass"] = {"cutoff": float(advice[1])}
        _write(file, tables)
    together = pivident(folder, "identify", "experiment.toml", "-m", ",".join(METHODS))
    commands.append(together)
    results = folder / "experiment-results"
    reached = {
        method: together.seconds / len(METHODS)
        for method in METHODS
        if (results / method / "identification.json").exists()
    }
    missed = {}
    for method in METHODS:
        if method in reached:
            continue
        alone = pivident(
            folder,
            "identify",
            "experiment.toml",
            "-m",
            method,
            "--out",
            f"experiment-results/alone-{method}",
        )
        commands.append(alone)
        if alone.code == 0:
            reached[method] = alone.seconds
        else:
            missed[method] = alone.complaint or f"exit code {alone.code}"
    return _finish(folder, commands, reached, missed)


def pivident(folder: Path, *arguments: str) -> Command:
    """Run one command in a folder."""
    source = str(Path(__file__).parents[2] / "src")
    environment = {**os.environ, "PYTHONPATH": source, "COLUMNS": "400", "NO_COLOR": "1"}
    begin = time.perf_counter()
    try:
        run = subprocess.run(
            [sys.executable, "-m", "pivident", *arguments],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        code, output, errors = run.returncode, run.stdout, run.stderr
    except subprocess.TimeoutExpired:
        code, output, errors = -1, "", f"error: no end within {PATIENCE:.0f} s"
    return Command(arguments, code, time.perf_counter() - begin, output, errors)


def with_data_sheet(tables: dict[str, Any], sheet: dict[str, Any]) -> dict[str, Any]:
    """The tables of an experiment file with what the data sheet says.

    Args:
        tables: of the file that `init` wrote.
        sheet: the data sheet.
    """
    recordings = tables["recording"]
    for own in recordings if isinstance(recordings, list) else [recordings]:
        own["control_rate"] = sheet["control_rate_hz"]
        if "torque_constant_nm_per_a" in sheet:
            pairs = zip(sheet["torque_constant_nm_per_a"], sheet["gear_ratio"], strict=True)
            own["units"]["tau"] = [{"unit": "A", "gain": k * n} for k, n in pairs]
        if "ball_screw" in sheet:
            _name_all_axes(own)
    if "ball_screw" in sheet:
        screw = sheet["ball_screw"]
        robot = tables["robot"]
        robot.pop("frozen", None)
        robot["joints"] = ["J1", "J2", "J3", "J4"]
        robot["couplings"] = [
            {
                "motor": screw["motor"],
                "joint": screw["turns_with"],
                "ratio": screw["lead_m_per_rad"],
            }
        ]
    return tables


def _name_all_axes(own: dict[str, Any]) -> None:
    """Columns and units of the SCARA's four axes, as its trace names them."""
    axes = [f"J{i}" for i in range(1, 5)]
    lengths = {"J3": ("mm", "N")}
    units = [lengths.get(axis, ("deg", "Nm")) for axis in axes]
    pairs = list(zip(axes, units, strict=True))
    own["columns"] |= {
        "q": [f"{axis}.PosFbk [{unit}]" for axis, (unit, _) in pairs],
        "q_ref": [f"{axis}.PosCmd [{unit}]" for axis, (unit, _) in pairs],
        "tau": [f"{axis}.TrqFbk [{force}]" for axis, (_, force) in pairs],
    }
    positions = [unit for unit, _ in units]
    forces = ["N" if force == "N" else "N m" for _, force in units]
    own["units"] |= {"q": positions, "q_ref": positions, "tau": forces}


def _first(tables: dict[str, Any]) -> dict[str, Any]:
    recordings = tables["recording"]
    first = recordings[0] if isinstance(recordings, list) else recordings
    return {key: value for key, value in first.items() if key not in ("name", "part")}


def _write(file: Path, tables: dict[str, Any]) -> None:
    from pivident.foundation.text.toml import toml_lines

    file.write_text("\n".join([*toml_lines(tables), ""]), encoding="utf-8")


def _finish(
    folder: Path, commands: list[Command], reached: dict[str, float], missed: dict[str, str]
) -> Session:
    session = Session(tuple(commands), reached, missed)
    (folder / "session.json").write_text(json.dumps(asdict(session), indent=1))
    return session
