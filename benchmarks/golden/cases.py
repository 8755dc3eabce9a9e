"""What is run: the commands as they are called today, and the cases made of them."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from golden.planar_logs import write_ampere_logs, write_fleet, write_periods

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

#: A command or option that has got another name is changed here, and nowhere else.
COMMANDS: dict[str, str] = {
    "audit": "audit {file} --out {out}",
    "check": "check {file} --json",
    "compare": "compare {results} --out {out}",
    "consistent": "consistent {result} --out {out}",
    "demo": "demo --out {out}",
    "excite": "excite {subject} --duration 4 --rate 100 --seconds {seconds} {more} --out {out}",
    "export": "export {result} --to {format} --out {out}",
    "fleet": "fleet {folder} --workers 1 --out {out}",
    "fit-simulator": "fit-simulator {file} --to {format} --out {out}",
    "flexibility": "flexibility {file} --out {out}",
    "friction": "friction {file} --out {out}",
    "gains": "gains {file} --out {out} --in-log-units --least-squares",
    "identify": "identify {file} --method {methods} --folds {folds} --out {out}",
    "init": "init {logs} --robot {robot} --out {out} --yes",
    "laws": "laws {file} --blocks 5 --depth 2",
    "paper": "paper --quick --workers 1 --out {out}",
    "payload": "payload {file} --method {method} --out {out}",
    "predict": "predict {result} {log} --csv {out}.csv --html {out}.html",
    "robots": "robots {robot}",
    "study": "study {scenario} --runs {runs} --workers 1 --out {out}",
    "symbolic": "symbolic {robot} --out {out}",
    "symbolic counts": "symbolic {robot}",
}

#: Where a word of a step goes.
BRACES = re.compile(r"{([a-z]+)}")

#: Formats of `export`, and how their files end.
FORMATS = {
    "urdf": "urdf",
    "mjcf": "xml",
    "sdf": "sdf",
    "c": "c",
    "numpy": "py",
    "json": "json",
    "latex": "tex",
}


@dataclass(frozen=True)
class Step:
    """One call of the program.

    Attributes:
        label: of its output.
        command: key of `COMMANDS`.
        words: what the braces of the command stand for; a list fills several words.
        counted: whether the clock counts (`counted_clock`), for searches that end by the clock.
    """

    label: str
    command: str
    words: Mapping[str, str | list[str]] = field(default_factory=dict)
    counted: bool = False

    def arguments(self) -> list[str]:
        """The command line after the program's name."""
        made: list[str] = []
        for word in COMMANDS[self.command].split():
            whole = BRACES.fullmatch(word)
            value = self.words[whole[1]] if whole else BRACES.sub(self._word, word)
            made += [value] if isinstance(value, str) else value
        return made

    def _word(self, braces: re.Match[str]) -> str:
        return str(self.words[braces[1]])


@dataclass(frozen=True)
class Case:
    """Steps in one folder.

    Attributes:
        steps: one after the other.
        prepare: fills the folder, given it and the folder of the public records.
    """

    steps: tuple[Step, ...]
    prepare: Callable[[Path, Path], None] = lambda folder, data: None


def _identify(file: str, methods: str, folds: int, out: str = "results") -> Step:
    words = {"file": file, "methods": methods, "folds": str(folds), "out": out}
    return Step(f"identify_{out}", "identify", words)


def _on(file: str, *commands: str) -> tuple[Step, ...]:
    """Commands that take an experiment file and write into a folder of their own name."""
    return tuple(Step(name, name, {"file": file, "out": name}) for name in commands)


def _exports(result: str) -> tuple[Step, ...]:
    """One export in each format."""
    return tuple(
        Step(f"export_{to}", "export", {"result": result, "format": to, "out": f"model_{to}.{end}"})
        for to, end in FORMATS.items()
    )


def _example(name: str) -> Callable[[Path, Path], None]:
    """The TOML files of an example."""

    def prepare(folder: Path, data: Path) -> None:
        for path in sorted((EXAMPLES / name).glob("*.toml")):
            shutil.copyfile(path, folder / path.name)

    return prepare


def _script(folder: Path, example: str, code: str) -> None:
    """Lines of Python in the folder, with an example's scripts to import."""
    path = f"import sys; sys.path.insert(0, {str(EXAMPLES / example)!r}); "
    subprocess.run([sys.executable, "-c", path + code], cwd=folder, check=True)


def _fine(folder: Path, data: Path) -> None:
    """The record of the simulated TX40, with the noise of seed 0."""
    _example("simulated_tx40")(folder, data)
    line = "import identify_simulated_tx40 as example; from pathlib import Path; "
    _script(folder, "simulated_tx40", line + "example.write_record(Path('record.npz'), 0)")


def _coarse(folder: Path, data: Path) -> None:
    """The same record with positions rounded to 3600 counts per revolution."""
    _fine(folder, data)
    with np.load(folder / "record.npz") as file:
        signals = dict(file)
    count = 2 * np.pi / 3600
    np.savez(folder / "record.npz", **signals | {"q": count * np.round(signals["q"] / count)})


def _ur10e(folder: Path, data: Path) -> None:
    """30 s of the arm of the size of a UR10e."""
    line = "import simulate_log; from pathlib import Path; simulate_log.write(Path(), 30.0)"
    _script(folder, "ur10e_like", line)


def _leg(folder: Path, data: Path) -> None:
    """The log of positions of a leg that MuJoCo has simulated, and its description."""
    line = "import simulate_log; from pathlib import Path; simulate_log.main(Path())"
    _script(folder, "suspended_leg", line)


def _tiago(folder: Path, data: Path) -> None:
    """The TIAGo's log and URDF."""
    for path in sorted((data / "tiago").glob("*.gz")):
        shutil.copyfile(path, folder / path.name)


_PLANAR = """robot = "planar_2r"

[recording]
{empty}
[controller]
type = "pd"
kp = [500, 500]
kd = [15, 12]
{gain}
{more}
"""

_LOG = """files = "{name}.csv"
columns = {{t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["i1", "i2"]}}
units = {{q = "deg", q_ref = "deg", tau = {unit}}}
"""

_KNOWN = '[{unit = "A", gain = 12}, {unit = "A", gain = 5}]'

_FLEET = """robot = "planar_2r"

[recording]
columns = {q = "q", q_ref = "r", tau = "tau"}
rate = 500

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[fleet]
pattern = "{robot}/{day}.npz"
method = "ls"
temperature = "celsius"
"""


def _planar(folder: Path, data: Path) -> None:
    """Logs in amperes without and with a load, and the files for payload, gains and fleet."""
    write_ampere_logs(folder)
    empty, loaded = (_LOG.format(name=n, unit=_KNOWN) for n in ("empty", "loaded"))
    gain = "drive_gain = [12, 5]\n"
    texts = {
        "arm": _PLANAR.format(empty=empty, gain=gain, more=""),
        "payload": _PLANAR.format(empty=empty, gain=gain, more="[[payload.recording]]\n" + loaded),
        "gains": _PLANAR.format(
            empty=_LOG.format(name="empty", unit='"A"'),
            gain="",
            more="[[gains.recording]]\n"
            + _LOG.format(name="loaded", unit='"A"')
            + "\n[gains.payload]\nmass = 1.2\ncenter_of_mass = [0.35, 0, 0]\n",
        ),
    }
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    write_fleet(folder / "logs")
    (folder / "logs" / "fleet.toml").write_text(_FLEET, encoding="utf-8")


#: All methods; the frequency domain needs whole periods.
_METHODS = (
    "ols,ls,tls,irls,ridge,map,ml-ls,set-membership,adaline,hopfield,ekf,ukf,cdkf,particle,"
    "iv,iv-full-rate,piv,didim,piv-as-printed,cloe,clie,ml,oloe"
)

#: The same methods with other options than those that they have by default.
_OPTIONS = """[identify]
tolerance = 0.01
max_iterations = 30
mask = "auto"
bandpass = {cutoff = 30, order = 3, bandwidth = 25, median = 3}
random_walk = {order = 3, passes = 2, f50_max = 60}
noise = {p_max = 60, criterion = "bic"}

[identify.ols]
signals = "algebraic"
algebraic = {window = 20, degree = 3, decimation = [5]}

[identify.ls]
bandpass = {cutoff = 20, decimation = [4, 5], convention = "scipy", edge = [40, 60], align = true}

[identify.tls]
signals = "random_walk"

[identify.irls]
loss = "bisquare"
tolerance = 1e-3

[identify.ridge]
penalty = 0.02

[identify.map]
spread = 0.5
deviation = {fc1 = 0.5}

[identify.set-membership]
bound = [3.0, 1.5]

[identify.adaline]
rate = 0.5
epochs = 40

[identify.hopfield]
reach = 3.0
time = 50.0

[identify.ekf]
start = "initial"
spread = 0.3
drift = 1e-4
passes = 2

[identify.ukf]
alpha = 0.5
beta = 1.0
kappa = 1.0
square_root = false

[identify.cdkf]
step = 1.5
encoder_noise = [1e-5, 2e-5]
torque_noise = 0.1

[identify.particle]
particles = 60
discount = 0.97
seed = 3

[identify.iv]
instruments = "halves"

[identify.piv]
prefilter = "controller"
covariance = "sandwich"
start = "initial"
noise = {ar_order = 6, ma_order = 2}

[identify.didim]
max_iterations = 12

[identify.piv-as-printed]
noise = {p_max = 40}

[identify.cloe]
free = ["kp"]
bounds = {fc1 = [0, 20]}
loss = "huber"

[identify.ml]
prefilter = "none"
undetermined = "hold"

[identify.oloe]
segment = 1.0
bandwidth = 30
"""

_PERIODS = """
[identify]
methods = ["frequency"]
frequency = {period = 2.0, transient = 1}
"""


def _methods(folder: Path, data: Path) -> None:
    """The planar arm's log with options for all methods, and one of whole periods."""
    write_ampere_logs(folder)
    write_periods(folder)
    experiments = (
        ("arm", "empty", ""),
        ("options", "empty", _OPTIONS),
        ("periods", "periods", _PERIODS),
    )
    for name, log, more in experiments:
        text = _PLANAR.format(
            empty=_LOG.format(name=log, unit=_KNOWN), gain="drive_gain = [12, 5]\n", more=more
        )
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")


def _payload(method: str) -> Step:
    words = {"file": "payload.toml", "method": method, "out": f"payload_{method}"}
    return Step(f"payload_{method}", "payload", words)


def _predict(result: str, log: str, out: str) -> Step:
    return Step(out, "predict", {"result": result, "log": log, "out": out})


def _simulator(to: str) -> Step:
    return Step(to, "fit-simulator", {"file": "leg.toml", "format": to, "out": to})


def _excite(out: str, subject: str, seconds: int, *more: str) -> Step:
    """A search of so many seconds by the counted clock."""
    words = {"subject": subject, "seconds": str(seconds), "more": list(more), "out": out}
    return Step(out, "excite", words, counted=True)


_ALL = "ls,iv,iv-full-rate,piv"
_TIAGO = [f"tiago_{kind}.csv.gz" for kind in ("position", "velocity", "effort")]

CASES: dict[str, Case] = {
    "emps": Case(
        (
            *_on("experiment.toml", "check", "audit", "friction"),
            _identify("experiment.toml", _ALL, 3),
            _identify("friction.toml", "ls", 2, "law"),
            Step("compare", "compare", {"results": ["results", "law"], "out": "compare"}),
            *_exports("results/piv"),
        ),
        _example("emps"),
    ),
    "kr300": Case(
        (
            *_on("experiment.toml", "check", "audit", "flexibility"),
            _identify("experiment.toml", _ALL, 2),
            _identify("friction.toml", "ls", 2, "law"),
        ),
        _example("kuka_kr300"),
    ),
    "tx40": Case(
        (
            *_on("experiment.toml", "check"),
            _identify("experiment.toml", _ALL, 2),
            _identify("friction.toml", "ls", 2, "law"),
            *_exports("law"),
        ),
        _example("staubli_tx40"),
    ),
    "tiago": Case(
        (
            Step(
                "init",
                "init",
                {"logs": _TIAGO, "robot": "tiago_48_hey5.urdf.gz", "out": "experiment.toml"},
            ),
            _identify("experiment.toml", "ls", 2),
        ),
        _tiago,
    ),
    "fine": Case((_identify("experiment.toml", _ALL, 2),), _fine),
    "coarse": Case((_identify("experiment.toml", "ls,piv,didim", 0),), _coarse),
    "ur10e": Case(
        (
            Step(
                "init",
                "init",
                {"logs": ["rtde_log.csv"], "robot": "ur10e_like.urdf", "out": "experiment.toml"},
            ),
            _identify("experiment.toml", "ls", 2),
        ),
        _ur10e,
    ),
    "planar": Case(
        (
            *_on("arm.toml", "check", "audit"),
            _identify("arm.toml", "ols,iv-full-rate,piv,didim,pc-ls", 3),
            Step("consistent", "consistent", {"result": "results/piv", "out": "consistent"}),
            Step("laws", "laws", {"file": "arm.toml"}),
            *map(_payload, ("ls", "piv")),
            _predict("results/piv", "loaded.csv", "predict_piv"),
            _predict("consistent/consistent.json", "arm.toml", "predict_consistent"),
            _predict("planar_2r", "arm.toml", "predict_nominal"),
            Step("gains", "gains", {"file": "gains.toml", "out": "found_gains.toml"}),
            Step("fleet", "fleet", {"folder": "logs", "out": "fleet"}),
            *_exports("results/piv"),
            _excite("next_motion", "results/piv", 4),
        ),
        _planar,
    ),
    "methods": Case(
        (
            _identify("arm.toml", _METHODS, 2),
            _identify("options.toml", _METHODS, 0, "options"),
            _identify("periods.toml", "frequency,ls", 0, "periods"),
        ),
        _methods,
    ),
    "leg": Case(tuple(map(_simulator, ("mjcf", "isaac"))), _leg),
    "excite": Case(
        (
            _excite("splines", "planar_2r", 6),
            _excite("fourier", "planar_2r", 6, "--motion", "fourier", "--criterion", "d"),
            _excite("postures", "planar_2r", 6, "--motion", "postures", "--for", "fc1,fc2"),
            _excite("goal", "planar_2r", 20, "--to", "20%", "--for", "zz2,ia2", "--start=0.3,-0.4"),
        )
    ),
    "demo": Case((Step("demo", "demo", {"out": "demo"}),)),
    "paper": Case((Step("paper", "paper", {"out": "paper"}),)),
    "symbolic": Case(
        (
            Step("robot", "robots", {"robot": "staubli_tx40"}),
            Step("planar", "symbolic", {"robot": "planar_2r", "out": "planar"}),
            Step("tx40", "symbolic counts", {"robot": "staubli_tx40"}),
        )
    ),
    "study": Case(
        tuple(
            Step(name, "study", {"scenario": name, "runs": str(runs), "out": name})
            for name, runs in (("fine", 2), ("coarse", 1))
        )
    ),
}
