"""The six logs: where they are, how their experiments come about, and where faults go.

A log of a public case gets the experiment file of `pivident init --yes`, one of an example that of
the example. Either way the log is then read once and becomes plain columns in the units of its own
file; everything else in the experiment file stays as it was. Speeds get a column where they were
logged, also where `init` does not name them.
"""

from __future__ import annotations

import gzip
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident import load_experiment
from pivident.data.logs.channel_places import locate
from pivident.data.logs.read_log import file_paths, read_channels, stamp_channels
from pivident.data.recording.public_records import public_facts
from pivident.experiment.experiment import Experiment

from .plain_log import PlainLog

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Source:
    """One log.

    Attributes:
        folder: its files in the data folder, or its example.
        robot: the robot's file, from there.
        files: the log's files for `pivident init`; empty: the log is that of an example.
        speeds: key of the file with logged speeds beside those of `init`; empty: speeds, if any,
            are in the file of the positions.
        joint: index of the joint whose columns are spoilt.
        pair: indices of the joints that are exchanged; the first has its torque scaled.
        flange: the link of a URDF that is made heavier; empty: the last link with a mass.
    """

    folder: str
    robot: str
    files: tuple[str, ...] = ()
    speeds: str = ""
    joint: int = 2
    pair: tuple[int, int] = (1, 2)
    flange: str = ""


LOGS = {
    "r04": Source(
        "public/r04_ur10_bag", "ur10.urdf", ("ur10_exciting_trajectory.db3",), flange="wrist_3_link"
    ),
    "r11": Source(
        "public/r11_panda_30hz_bag",
        "panda.urdf",
        ("panda_exciting_trajectory.db3",),
        joint=3,
        pair=(1, 3),
        flange="panda_link7",
    ),
    "TIAGo": Source(
        "tiago",
        "tiago_48_hey5.urdf",
        ("tiago_position.csv", "tiago_velocity.csv", "tiago_effort.csv"),
        speeds="tiago_velocity.csv",
        pair=(2, 4),
        flange="arm_7_link",
    ),
    "TX40": Source("staubli_tx40", "src/pivident/robot/gallery/staubli_tx40.toml"),
    "EMPS": Source("emps", "src/pivident/robot/gallery/emps.toml", joint=0, pair=(0, 0)),
    "KR300": Source("kuka_kr300", "examples/kuka_kr300/kuka_kr300_axes_1_3.toml"),
}  # fmt: skip


def original_experiment(source: Source, data: Path, folder: Path) -> Path:
    """The experiment as a user has it, in a new folder; its file."""
    if not source.files:
        shutil.copytree(ROOT / "examples" / source.folder, folder)
        return folder / "experiment.toml"
    folder.mkdir(parents=True)
    for path in sorted((data / source.folder).iterdir()):
        if path.suffix == ".gz":
            (folder / path.stem).write_bytes(gzip.decompress(path.read_bytes()))
        elif path.is_file():
            shutil.copyfile(path, folder / path.name)
    command = [sys.executable, "-m", "pivident", "init", *source.files]
    subprocess.run(
        [*command, "--robot", source.robot, "--yes"], cwd=folder, check=True, capture_output=True
    )
    return folder / "experiment.toml"


def plain_log(source: Source, path: Path) -> PlainLog:
    """The log of an experiment as plain columns."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    experiment = load_experiment(path)
    robot_file = path.parent / source.robot if source.files else ROOT / source.robot
    stated = tables["robot"] if isinstance(tables["robot"], dict) else {}
    tables["robot"] = {**stated, "model": robot_file.name}
    entries = tables["recording"] if isinstance(tables["recording"], list) else [
        tables["recording"]
    ]  # fmt: skip
    plain, runs = [], []
    for number, entry in enumerate(entries, 1):
        described = _described(entry, experiment, source)
        runs.append(_channels(described, path.parent, experiment))
        plain.append(_of_table(described, runs[-1], experiment.robot.joint_names, number))
    tables["recording"] = plain
    text = robot_file.read_text(encoding="utf-8")
    side = plain[0].get("side", "joint")
    of_motor = (side if isinstance(side, str) else side.get("q", "joint")) == "motor"
    ratios = np.diag(experiment.robot.transmission.reduction)
    gear = ratios if of_motor else np.ones(len(ratios))
    return PlainLog(tables, runs, experiment.robot.joint_names, text, gear)


def _described(entry: Mapping[str, Any], experiment: Experiment, source: Source) -> dict[str, Any]:
    """A table of a recording that names files and columns, those of logged speeds among them."""
    if "dataset" in entry:
        run = entry.get("run", "all")
        files, facts = public_facts(entry["dataset"], run, experiment.robot)
        name = facts.get("name", f"{entry['dataset']}_{run}")
        own = {key: value for key, value in entry.items() if key not in ("dataset", "run")}
        return {**facts, "name": name, "files": files, **own}
    described = {**entry, "columns": dict(entry["columns"])}
    speeds = [name.replace("position", "velocity") for name in entry["columns"]["q"]]
    if source.speeds:
        described["files"] = {**entry["files"], "dq": source.speeds}
    described["columns"].setdefault("dq", speeds)
    units = entry["units"]["q"]
    listed = [f"{unit}/s" for unit in units] if isinstance(units, list) else f"{units}/s"
    described["units"] = {"dq": listed, **entry["units"]}
    return described


def _channels(
    described: Mapping[str, Any], folder: Path, experiment: Experiment
) -> dict[str, np.ndarray]:
    """The channels as they are in their files, time stamps first."""
    files, columns, joints = described["files"], described["columns"], experiment.robot.joint_names
    files = files if isinstance(files, Mapping) else {"log": files}
    paths = file_paths({key: folder / path for key, path in files.items()})
    specs = {key: spec for key, spec in columns.items() if key not in ("t", "inputs")}
    specs |= {f"inputs.{key}": spec for key, spec in columns.get("inputs", {}).items()}
    places = {key: locate(key, spec, paths) for key, spec in specs.items()}
    places |= stamp_channels(columns.get("t"), places, paths)
    read, clocked, faults = read_channels(places, paths, len(joints), None, joints)
    if faults:
        raise faults[0]
    if "t" in read:
        t = read.pop("t")
    elif "q" in clocked:
        t = clocked["q"].t
    else:
        t = np.arange(len(read["q"])) / described["rate"]
    order = [key for key in ("q", "dq", "tau") if key in read]
    names = [*order, *(key for key in read if key not in order)]
    t = np.round(np.asarray(t, float), 6)  # 1.8 s, where 1.79999995 was logged
    return {"t": t} | {key.replace(".", "_"): np.asarray(read[key], float) for key in names}


def _of_table(
    described: Mapping[str, Any],
    run: Mapping[str, np.ndarray],
    joints: tuple[str, ...],
    number: int,
) -> dict[str, Any]:
    """The table of the recording for its plain columns."""
    columns: dict[str, Any] = {"t": "t"}
    for channel in (key for key in run if key != "t"):
        named = [f"{channel}_{joint}" for joint in joints]
        kind, _, name = channel.partition("_")
        if kind == "inputs":
            columns.setdefault("inputs", {})[name] = named
        else:
            columns[channel] = named
    own = {key: value for key, value in described.items() if key not in ("rate", "samples_axis")}
    units = {"t": "s", **described["units"]}
    return {**own, "files": f"log_{number}.csv", "columns": columns, "units": units}
