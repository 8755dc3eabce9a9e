"""Commands with their files in one text: logs of all presets, flags of ``init``, channels by file.

    $ init a.csv --robot planar_2r --rate 500 --yes
    @ a.csv
    t,q_1,q_2,tau_1,tau_2
    …

Each command runs in the folder of its files, which are the only ones that it may write.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import shlex
import shutil
import tempfile
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np

from fuzzing.mutations import NUMBERS, TEXTS, spoilt_text

#: The commands that are run; others ask, serve or draw.
COMMANDS = ("init", "predict", "gains", "check", "audit", "payload")

#: Values of the flags of ``init``, right ones first.
FLAGS = {
    "--rate": ("500", "499", "125", "100000", "1e-3"),
    "--joints": ("1", "2", "shoulder", "shoulder,elbow", "1,2", "elbow,elbow", "3", ","),
    "--gravity": ("-y", "none", "0,0,-9.81", "+z", "0,0,0", "1,2", "-9.81", "nan,0,0"),
    "--body": ("forearm 1.5 kg", "forearm 1.5 kg at 0.1,0,0", "forearm", "x 1 kg", "forearm -1 kg",
               "forearm 1.5 g", "forearm nan kg", "forearm 1 kg at 0,0"),
    "--columns": ("t,q1,q2,tau1,tau2", "t,q1..q2,-,-", "t,q1..q9", "q1", "t,t,t,t,t", "q1..q99999"),
    "--robot": ("planar_2r", "emps", "staubli_tx40", "arm.urdf", "no_robot", "a.csv"),
}  # fmt: skip

CHUNKS = (
    "$ init a.csv --yes\n", "$ predict result.json a.csv\n", "$ gains e.toml\n", "\n@ b.csv\n",
    " --rate ", " --body ", " --joints ", " --gravity ", "q=", "tau=", " b.csv", ",temperature_1",
    "nan", "inf", "1e999", ",", ";", "\t", '"', "\0",
)  # fmt: skip

GAINS = """robot = "planar_2r"

[recording]
files = "a.csv"
columns = {t = "t", q = ["q_1", "q_2"], tau = ["i_1", "i_2"]}
units = {tau = "A"}

[gains]
sensors = ["s_1", "s_2"]
temperature = ["temp_1", "temp_2"]
trusted = {1 = 2.0}
reference_temperature = 30.0
friction_drift = true

[identify]
methods = ["ls"]
temperature = ["temp_1", "temp_2"]
reference_temperature = 28.0
"""

URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><mass value="8"/><inertia ixx="0.2" iyy="0.2" izz="0.2" ixy="0"
 ixz="0" iyz="0"/></inertial></link><link name="forearm"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="5" effort="90"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="forearm"/>
<origin xyz="0.5 0 0"/><axis xyz="0 0 1"/><limit lower="0" upper="0"/></joint></robot>
"""


#: What a word in the name of a column makes it hold; other columns hold positions.
HOLDS = {"tau": 3, "effort": 3, "torque": 3, "cur": 3, "i_": 3, "s_": 3, "qd": 1, "vel": 1, "dq": 1}


@cache
def planar_motion(samples: int) -> np.ndarray:
    """Positions, speeds, accelerations and torques of the planar arm, (4, samples, 2)."""
    from pivident.dynamics.parameters import nominal_values, standard_parameters
    from pivident.dynamics.regressor import Regressor
    from pivident.robot.gallery import load_robot

    robot, t = load_robot("planar_2r"), np.arange(samples)[:, None] / 500.0
    rates, mixed = np.array([[9.0, 14.0], [23.0, 31.0]]), []
    for derivative in range(3):
        phase = [t * w + derivative * np.pi / 2.0 for w in rates]
        mixed.append(
            sum(0.4 * w**derivative * np.sin(p) for w, p in zip(rates, phase, strict=True))
        )
    standard = standard_parameters(robot)
    torque = Regressor.build(robot, standard).torque(*mixed, nominal_values(robot, standard))
    return np.array([*mixed, torque])


def clock(rng: random.Random) -> tuple[float, float, float, float]:
    """Period, unit and start of time stamps, and a factor of all other columns."""
    period = rng.choice((0.002, 0.002, 0.002, 0.002, 0.01, 2.0))
    return (
        period,
        rng.choice((1.0, 1.0, 1.0, 1e3, 1e9)),
        rng.choice((0.0, 0.0, 1.7e9)),
        rng.choice((1.0, 1.0, 57.3)),
    )


def columns(
    names: list[str], rng: random.Random, samples: int, time: tuple[float, ...],
    separator: str = ",",
) -> str:  # fmt: skip
    """A table of a motion of the planar arm, in columns of any name, some of them worthless."""
    noise, cells = np.random.default_rng(rng.randrange(2**31)), []
    period, unit, start, scale = time
    for name in names:
        if any(word in name for word in ("time", "stamp")) or name == "t":
            x = (np.arange(samples) * period + start) * unit
        elif "temp" in name:
            x = 25.0 + 5.0 * np.arange(samples) / samples
        else:
            kind = next((k for word, k in HOLDS.items() if word in name), 0)
            x = planar_motion(samples)[kind, :, sum(map(ord, name)) % 2]
            x = scale * x + 1e-5 * noise.standard_normal(samples)
        if rng.random() < 0.04:
            x = rng.choice((np.full(samples, 1.0), np.repeat(x[::7], 7)[:samples], x[::-1]))
        cells.append([f"{v:.12g}" for v in x])
    rows = (separator.join(row) for row in zip(*cells, strict=True))
    return "\n".join([separator.join(names), *rows]) + "\n"


def preset_names(rng: random.Random) -> list[str]:
    """Columns as the logger of a preset calls them, of a few joints, some of them missing."""
    from pivident.data.logs.recognition.presets import presets

    preset = rng.choice(presets())
    phrases = [" ".join(p) for p in (*preset.columns, *preset.channels)]
    joints = rng.choice((1, 2, 2, 2, 6))
    style = rng.choice(("_{}", "_{}", "[{}]", ".{}", "/{}"))
    names = [rng.choice(("t", "time", "timestamp", "stamp"))]
    for phrase in dict.fromkeys(phrases):
        if rng.random() < 0.9:
            joined = phrase.replace(" ", rng.choice(("_", "_", ".", " ")))
            names += [joined + style.format(j) for j in range(rng.choice((0, 1)), joints)]
    if rng.random() < 0.4:
        word = rng.choice(("temperature", "temp", "motor_temperature", "joint_temperatures"))
        names += [word + style.format(j) for j in range(joints)]
    return names


def flags(rng: random.Random) -> str:
    """A few flags of ``init``, mostly with values that mean something."""
    chosen = []
    for flag, values in FLAGS.items():
        if flag == "--robot" or rng.random() < 0.2:
            first = flag == "--robot" and rng.random() < 0.7
            value = values[0] if first else rng.choice((*values, rng.choice(TEXTS + NUMBERS)))
            chosen.append(f"{flag}={value}" if value.startswith("-") else f"{flag} {value!r}")
    return " ".join(chosen)


#: What describes a log in two files.
PAIR = """robot = "planar_2r"

[recording]
files = {q = "a.csv", tau = "b.csv"}
columns = {t = {file = "q", columns = "t"}, q = ["q_1", "q_2"], tau = ["tau_1", "tau_2"]}

[identify]
methods = ["ls"]
"""


def grown_command(rng: random.Random) -> bytes:
    """A command with its files."""
    plain, time = ["t", "q_1", "q_2", "tau_1", "tau_2"], clock(rng)
    samples = rng.choice((1500, 600, 600, 300, 30, 3))
    kind = rng.random()
    if kind < 0.6:
        names = preset_names(rng) if rng.random() < 0.7 else plain
        table = columns(names, rng, samples, time, rng.choice(",,,;\t "))
        if rng.random() < 0.1:
            table = table.partition("\n")[2]  # no header
        log, more = "a.csv", ""
        if rng.random() < 0.3 and len(names) > 2:
            half = rng.randrange(1, len(names))
            table, log = columns([names[0], *names[1:half]], rng, samples, time), "a.csv b.csv"
            other = time if rng.random() < 0.7 else clock(rng)
            more = f"@ b.csv\n{columns([names[0], *names[half:]], rng, samples, other)}"
        text = f"$ init {log} {flags(rng)} --yes\n@ a.csv\n{table}{more}@ arm.urdf\n{URDF}"
    elif kind < 0.8:
        pair = rng.choice(
            ("q=a.csv tau=b.csv", "q=a.csv tau=b.csv", "tau=b.csv q=a.csv", "q=a.csv", "a.csv",
             "a.csv b.csv", "q=a.csv tau=a.csv dq=b.csv", "q=a.csv q=b.csv", "t=b.csv q=a.csv")
        )  # fmt: skip
        band = rng.choice(
            ("", "", "--band 10", "--band 0", "--band -1", "--band 1e9", "--band nan")
        )
        given = rng.choice(("result.json", "result.json", "planar_2r", "arm.urdf"))
        described = rng.choice(("--experiment e.toml", "--experiment e.toml", ""))
        first = rng.choice((["t", "q_1", "q_2"], ["t", "q_1", "q_2"], plain, ["q_1", "q_2"]))
        second = rng.choice(
            (["tau_1", "tau_2"], ["tau_1", "tau_2"], ["t", "tau_1", "tau_2"], plain)
        )
        one = columns(first, rng, samples, time)
        two = columns(second, rng, rng.choice((samples, samples, 500)), time)
        text = f"$ predict {given} {pair} {described} {band}\n@ a.csv\n{one}@ b.csv\n{two}"
        text += f"@ arm.urdf\n{URDF}@ e.toml\n{PAIR}"
    else:
        names = ["t", "q_1", "q_2", "i_1", "i_2", "s_1", "s_2", "temp_1", "temp_2"]
        lines = [x for x in GAINS.split("\n") if not x.strip() or rng.random() < 0.95]
        command = rng.choice(("gains", "gains", "gains --in-log-units", "check", "check", "audit"))
        table = columns(names, rng, samples, time)
        text = f"$ {command} e.toml\n@ a.csv\n{table}@ e.toml\n" + "\n".join(lines)
    return text.encode("utf-8", "replace")


@cache
def result_of_pair() -> bytes:
    """A result of a log in two files, which says how they were read."""
    from pivident import load_experiment
    from pivident.estimation.identification_file import to_json
    from pivident.estimation.identify import identify

    rng, time = random.Random(3), (0.002, 1.0, 0.0, 1.0)
    with tempfile.TemporaryDirectory() as folder:
        for name, columns_of in (("a", ["t", "q_1", "q_2"]), ("b", ["tau_1", "tau_2"])):
            Path(folder, f"{name}.csv").write_text(columns(columns_of, rng, 1500, time))
        path = Path(folder, "e.toml")
        path.write_text(PAIR)
        return to_json(identify(load_experiment(path).problem(), "ls")).encode()


@cache
def command_seeds() -> tuple[bytes, ...]:
    """Some commands to begin with."""
    return tuple(grown_command(random.Random(seed)) for seed in range(12))


def spoilt_command(data: bytes, rng: random.Random) -> bytes:
    """The command, the head of a file or a file spoilt, or another one grown."""
    if rng.random() < 0.5:
        return grown_command(rng)
    text = data.decode("utf-8", "replace")
    at = rng.choice([k for k in range(len(text)) if text.startswith("@ ", k)] or [0])
    head, tail = (
        (text[:at], text[at:]) if rng.random() < 0.5 else (text[: at + 200], text[at + 200 :])
    )
    if rng.random() < 0.3:
        head, tail = tail, head
        return head.encode() + spoilt_text(tail.encode(), rng, CHUNKS)
    return spoilt_text(head.encode("utf-8", "replace"), rng, CHUNKS) + tail.encode(
        "utf-8", "replace"
    )


def run_command(path: Path) -> object:
    """Write the files of a command into a folder of its own, and run it there.

    An error that pivident raises on purpose is printed by the command; any other one is raised.
    """
    from pivident.app.cli.app import main

    text = path.read_bytes().decode("utf-8", "replace")
    folder = path.parent / "case"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    first, *parts = text.split("\n@ ")
    (folder / "result.json").write_bytes(result_of_pair())
    for part in parts:
        name, _, content = part.partition("\n")
        if name.strip() in ("a.csv", "b.csv", "e.toml", "arm.urdf", "result.json"):
            (folder / name.strip()).write_text(content, encoding="utf-8", newline="")
    try:
        words = shlex.split(first.removeprefix("$").split("\n")[0])
    except ValueError:
        return None
    unsafe = any(
        word.startswith(("/", "~", "--out", "--csv", "--html")) or "../" in word for word in words
    )
    if not words or words[0] not in COMMANDS or unsafe or "\0" in first:
        return None
    quiet = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
    with quiet[0], quiet[1], contextlib.chdir(folder):
        with mock.patch.dict(os.environ, {"PIVIDENT_DEBUG": "1"}):  # errors come through
            return main(words)
