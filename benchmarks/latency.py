"""Processor time of every command on ordinary logs, beside what importing numba alone takes.

    PIVIDENT_DATA=FOLDER python benchmarks/latency.py [--repeats 10] [--logs planar] [--commands …]

Each log is drafted by `init` and identified once, which fills all caches. Then the commands and
`python -c "import numba, scipy.linalg"` take turns, each in a process of its own; the table gives
medians of processor time (children included) over that of the import in the same turns, with the
modules that a command loads. A ratio holds on any machine, where seconds do not.

The last row of a log is the studio's check after an edit: seconds of the wall (of the processor)
from the change of the file to what is found, in a process that has been waiting.

Logs: ``planar`` (2,000 rows of two simulated joints), ``ur10`` (the public bag, 3,441 rows of six
axes), ``tx40`` (the public record) and ``seven`` (20,000 rows of seven simulated axes).
"""

from __future__ import annotations

import argparse
import gzip
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

IMPORT = ("-c", "import numba, scipy.linalg")

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

#: Largest ratio asked on the UR10 bag.
GOALS = {
    "--help": 0.6, "compare": 1.7, "predict": 2.5, "export": 3.0, "check": 3.5, "init": 4.0,
    "identify": 6.0,
}  # fmt: skip

#: Exit codes that are an answer: done, a method did not converge, something is to be decided.
ANSWERS = (0, 3, 4)


#: Description of an arm of seven axes among the public records.
PANDA = "public/r11_panda_30hz_bag/panda.urdf"


@dataclass(frozen=True)
class Files:
    """A log and a description, and the log that is predicted."""

    logs: tuple[Path, ...]
    robot: str  # a file, or a name of the gallery
    unseen: Path

    def commands(self) -> dict[str, tuple[str, ...]]:
        """The commands in the order of a user's work, by name."""
        result, other = "experiment-results/piv", "experiment-results/ls"
        logs = tuple(map(str, self.logs))
        return {
            "--help": ("--help",),
            "init": ("init", *logs, "--robot", self.robot, "--yes", "--force",
                     "--out", "draft.toml"),
            "check": ("check", "experiment.toml"),
            "identify": ("identify", "experiment.toml"),
            "predict": ("predict", result, str(self.unseen)),
            "export": ("export", result, "--to", "urdf", "--out", "model.urdf"),
            "compare": ("compare", other, result),
        }  # fmt: skip


def run(words: tuple[str, ...], folder: Path) -> float:
    """Processor time of one process, its children included [s]."""
    before = os.times()
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False
    )
    after = os.times()
    if done.returncode not in ANSWERS:
        raise SystemExit(f"{' '.join(words)}\n{done.stdout}\n{done.stderr}")
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )


def loaded(words: tuple[str, ...], folder: Path) -> tuple[int, int]:
    """How many modules a process has loaded at its end: all, and those of pivident."""
    done = subprocess.run(
        [sys.executable, "-X", "importtime", *words],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = [line for line in done.stderr.splitlines() if line.startswith("import time:")]
    names = [line.rpartition("|")[2].strip() for line in lines[1:]]
    return len(names), sum(name.split(".")[0] == "pivident" for name in names)


def measure(name: str, files: Files, chosen: list[str], repeats: int, folder: Path) -> bool:
    """Print the rows of one log; whether all goals hold."""
    commands = files.commands()
    program = ("-m", "pivident")
    init = commands["init"]
    run((*program, *init[:-1], "experiment.toml"), folder)
    for command in ("identify", "predict", "export"):
        run((*program, *commands[command]), folder)
    taken = [key for key in commands if not chosen or key in chosen]
    seconds: dict[str, list[float]] = {key: [] for key in ("import", *taken)}
    for _ in range(repeats):
        seconds["import"].append(run(IMPORT, folder))
        for key in taken:
            seconds[key].append(run((*program, *commands[key]), folder))
    base = float(np.median(seconds["import"]))
    holds = True
    for key in taken:
        ratio = float(np.median(seconds[key])) / base
        modules, own = loaded((*program, *commands[key]), folder)
        goal = GOALS[key] if name == "ur10" or key == "--help" else np.nan
        holds &= not ratio > goal
        asked = "" if np.isnan(goal) else f"{goal:g}"
        low, high = (np.quantile(seconds[key], level) / base for level in (0.25, 0.75))
        print(
            f"| {name} | {key} | {np.median(seconds[key]):.2f} | {ratio:.2f} "
            f"({low:.2f}–{high:.2f}) | {asked} | {modules} | {own} |",
            flush=True,
        )
    if not chosen or "studio" in chosen:
        wall, own = studio_check(folder, repeats)
        print(f"| {name} | studio's check | {wall:.2f} s ({own:.2f}) | | | | |", flush=True)
    print(f"| {name} | import numba, scipy.linalg | {base:.2f} | 1 | | | |", flush=True)
    return holds


def timed_look(experiment: Path, folder: Path, say: Callable[[str], None]) -> None:
    """The studio's check; its last line is the processor time [s]."""
    from pivident.app.studio.looks import look

    begin = time.process_time()
    look(experiment, folder, say)
    say(f"{time.process_time() - begin:.3f}")


def studio_check(folder: Path, repeats: int) -> tuple[float, float]:
    """A check of the studio after an edit: seconds of the wall and of the processor, medians."""
    from pivident.app.studio.tasks import Tasks

    tasks, experiment = Tasks(), folder / "experiment.toml"
    text, rows = experiment.read_text("utf-8"), []
    for number in range(repeats + 1):  # the first one reads the signals, which an edit leaves
        experiment.write_text(f"{text}\n# {number}\n", encoding="utf-8")
        begin = time.perf_counter()
        tasks.start("look", timed_look, experiment, folder / "looks" / str(number))
        while tasks.state("look")["state"] == "running":
            time.sleep(0.002)
        rows.append((time.perf_counter() - begin, float(tasks.state("look")["line"])))
    tasks.close()
    experiment.write_text(text, encoding="utf-8")
    wall, own = np.median(rows[1:], axis=0)
    return float(wall), float(own)


def simulated(name: str, rows: int, folder: Path) -> Files:
    """A described arm under feedback, with friction: a log, and another motion."""
    from pivident.dynamics.forward import mass_matrix
    from pivident.dynamics.parameters import nominal_values, standard_parameters
    from pivident.loop.simulation.control_loop import Loop
    from pivident.loop.simulation.controllers import PD
    from pivident.loop.simulation.simulated_record import simulate
    from pivident.robot.gallery import load_robot

    described = load_robot(name)
    # a URDF has no rotors, a loop of these gains would be unstable without them
    robot = replace(described, rotor_inertia=np.maximum(described.rotor_inertia, 0.3))
    standard = standard_parameters(robot)
    postures = np.random.default_rng(1).uniform(-1.5, 1.5, (50, robot.size))
    matrices = mass_matrix(robot, standard, nominal_values(robot, standard), postures)
    inertia, bandwidth = np.einsum("njj->j", matrices) / len(postures), 2.0 * np.pi * 5.0
    loop = Loop(PD(inertia * bandwidth**2, inertia * 2.0 * bandwidth))
    logs = []
    for index, stem in enumerate(("log", "unseen")):
        made = simulate(
            robot, loop, rate=1000.0, duration=rows / 1000.0, encoder=1e-5, torque=0.1, seed=index
        )
        record = made.recording
        columns = {"t": record.t}
        for kind, values in (("q", record.q), ("tau", record.tau)):
            columns |= {f"{kind}_{j}": values[:, k] for k, j in enumerate(record.joint_names)}
        table = np.column_stack(list(columns.values()))
        logs.append(folder / f"{stem}.csv")
        np.savetxt(logs[-1], table, delimiter=",", header=",".join(columns), comments="")
    return Files((logs[0],), name, logs[1])


def public(name: str, folder: Path) -> Files:
    """Files of a public record, copied beside the work."""
    data = Path(os.environ["PIVIDENT_DATA"])
    if name == "ur10":
        source = data / "public" / "r04_ur10_bag"
        names = ("ur10_exciting_trajectory.db3", "ur10.urdf")
        log, robot = (Path(shutil.copy(source / file, folder)) for file in names)
        return Files((log,), str(robot), log)
    source = data / "staubli_tx40"
    logs = (folder / "pos_read_data.csv", folder / "curr_data.csv")
    for log in logs:
        log.write_bytes(gzip.decompress((source / f"{log.name}.gz").read_bytes()))
    robot = Path(shutil.copy(source / "tx40_mdh_modified.urdf", folder))
    return Files(logs, str(robot), folder / "experiment.toml")


def files_of(name: str, folder: Path) -> Files:
    """Files of a log by its name, simulated or copied beside the work."""
    if name == "planar":
        return simulated("planar_2r", 2000, folder)
    if name == "seven":
        return simulated(str(Path(os.environ["PIVIDENT_DATA"]) / PANDA), 20_000, folder)
    return public(name, folder)


def main() -> int:
    """Print the table; 1 where a goal is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--logs", nargs="+", default=["planar", "ur10", "tx40", "seven"])
    parser.add_argument("--commands", nargs="+", default=[])
    arguments = parser.parse_args()
    os.environ["COLUMNS"] = "100"
    # pip writes bytecode as it installs; a checkout has it after its first run, where it may
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    holds = True
    print("| log | command | s | over the import (quartiles) | asked | modules | of pivident |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for name in arguments.logs:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            files = files_of(name, folder)
            holds &= measure(name, files, arguments.commands, arguments.repeats, folder)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
