"""The additions of ``examples/plugin``, installed: each works like a built-in one."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from copy import copy
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import pivident
from tests.conftest import REPOSITORY
from tests.forked_python import ForkedPython
from tests.planar_log import EXPERIMENT, HEADER, planar_log, write_experiment

PLUGIN = REPOSITORY / "examples" / "plugin"
PROJECT = tomllib.loads((PLUGIN / "pyproject.toml").read_text("utf-8"))["project"]

#: A second distribution, whose entries cannot be imported.
BROKEN = {
    f"pivident.{group}": "lost"
    for group in ("methods", "friction", "readers", "formats", "findings", "commands")
}


def install(target: Path) -> None:
    """As pip does; where its builder is missing, by hand what a wheel of it holds."""
    if find_spec("hatchling") is not None:
        source = shutil.copytree(PLUGIN, target.parent / "plugin")
        options = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
        pip = [sys.executable, "-m", "pip", "install", *options, "--target", str(target)]
        subprocess.run([*pip, str(source)], check=True, capture_output=True)
        return
    shutil.copytree(PLUGIN / "pivident_example", target / "pivident_example")
    declare(target, PROJECT["name"], PROJECT["entry-points"])


def declare(target: Path, name: str, groups: dict[str, dict[str, str]]) -> None:
    """Write what an installed distribution says about itself."""
    folder = target / f"{name.replace('-', '_')}-0.1.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1.0\n")
    lines = []
    for group, entries in groups.items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in entries.items())]
    (folder / "entry_points.txt").write_text("\n".join([*lines, ""]))


class Installation:
    """pivident with what is installed in a folder, and a folder to work in."""

    def __init__(self, target: Path, folder: Path) -> None:
        self.target, self.folder = target, folder
        paths = [str(target), str(Path(pivident.__file__).parents[1])]
        environment = {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "100"}
        self._processes = ForkedPython(os.environ | environment)

    def working_in(self, folder: Path) -> Installation:
        """The same in another folder to work in."""
        other = copy(self)
        other.folder = folder
        return other

    def python(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        return self._processes.run(*map(str, arguments), cwd=self.folder)

    def run(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        return self.python("-m", "pivident", *arguments)

    def close(self) -> None:
        self._processes.close()


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """The example alone, and a log that only its reader reads."""
    target, folder = tmp_path_factory.mktemp("target"), tmp_path_factory.mktemp("work")
    install(target)
    names = HEADER.split(",")
    lines = (
        " ".join(f"{name}={value:.9g}" for name, value in zip(names, row, strict=True))
        for row in planar_log().tolist()
    )
    write_experiment(folder, EXPERIMENT.replace("log.csv", "log.pairs"))
    (folder / "log.pairs").write_text("\n".join(lines), encoding="utf-8")
    installation = Installation(target, folder)
    yield installation
    installation.close()


@pytest.fixture(scope="module")
def broken(plugin, tmp_path_factory):
    """The same with a distribution beside it that is broken."""
    target = tmp_path_factory.mktemp("broken")
    shutil.copytree(plugin.target, target, dirs_exist_ok=True)
    declare(target, "broken-one", {g: {n: "not_there:thing"} for g, n in BROKEN.items()})
    installation = Installation(target, plugin.folder)
    yield installation
    installation.close()


@pytest.fixture(scope="module")
def result(plugin):
    """The log identified, which the example's reader reads."""
    done = plugin.run("identify", "experiment.toml", "--folds", 0, "--out", "results")
    assert done.returncode == 0, done.stderr
    return plugin.folder / "results"


def test_its_entry_points_are_the_parts_of_the_package():
    for group, entries in PROJECT["entry-points"].items():
        assert re.fullmatch(r"pivident\.[a-z]+", group)
        for place in entries.values():
            module, _, name = place.partition(":")
            text = (PLUGIN / module.replace(".", "/")).with_suffix(".py").read_text("utf-8")
            assert re.search(rf"^(?:{name} = |def {name}\(|class {name}\b)", text, re.MULTILINE)
    assert "(plugin)" in (REPOSITORY / "examples" / "README.md").read_text("utf-8")


def test_contributing_shows_the_code_of_the_example():
    text = (REPOSITORY / "CONTRIBUTING.md").read_text("utf-8")
    section = text.partition("## Additions\n")[2].partition("\n## ")[0]
    files = [path.read_text("utf-8") for path in PLUGIN.rglob("*.py")]
    files.append((PLUGIN / "pyproject.toml").read_text("utf-8"))
    shown = re.findall(r"```(?:python|toml)\n(.*?)```", section, flags=re.DOTALL)
    assert len(shown) == 1 + len(PROJECT["entry-points"])
    for excerpt in shown:
        assert sum(excerpt in file for file in files) == 1, excerpt


def test_the_reader_reads_what_the_table_holds(plugin, result, tmp_path):
    """The same estimate, to the last bit, as from the same numbers as CSV."""
    own = plugin.working_in(tmp_path)
    write_experiment(tmp_path)
    done = own.run("identify", "experiment.toml", "--folds", 0, "--out", "results")
    assert done.returncode == 0, done.stderr
    tables = [(f / "parameters.csv").read_text("utf-8") for f in (result, tmp_path / "results")]
    assert tables[0] == tables[1]


@pytest.mark.parametrize(
    "command",
    [
        ["check", "experiment.toml"],
        ["audit", "log.pairs", "--robot", "planar_2r"],
        ["init", "log.pairs", "--robot", "planar_2r", "--yes", "--out", "first.toml"],
    ],
    ids=lambda command: command[0],
)
def test_commands_take_logs_of_the_reader(plugin, command):
    done = plugin.run(*command)
    assert done.returncode in (0, 4), done.stderr  # 4: findings about the log
    assert "log.pairs" in done.stdout + (plugin.folder / "experiment.toml").read_text()
    assert "warning: 'lost'" not in done.stderr


def test_the_studio_takes_logs_of_the_reader(plugin):
    code = (
        "from pivident.data.logs.tables.tables import is_log; "
        "from pivident.app.studio.projects import Projects; "
        "from pivident.app.studio.uploads import target; from pathlib import Path; "
        "print(is_log('LOG.PAIRS'), target(Projects(Path('studio')).create('p'), 'a.pairs').name)"
    )
    done = plugin.python("-c", code)
    assert done.stdout == "True a.pairs\n", done.stderr


def test_a_bad_cell_is_named(plugin, tmp_path):
    (tmp_path / "log.pairs").write_text("time=0 q1=1\ntime=1 q1=x\n")
    own = plugin.working_in(tmp_path)
    done = own.run("audit", "log.pairs", "--robot", "planar_2r")
    assert done.returncode == 1 and "log.pairs, line 2" in done.stderr


def test_the_format_is_written_and_loaded_back(plugin, result):
    done = plugin.run("export", result, "--to", "values", "--out", "values.csv")
    assert done.returncode == 0, done.stderr
    assert "Loaded back: torques of 200 random states by the values of the table" in done.stdout
    head, *rows = (plugin.folder / "values.csv").read_text("utf-8").splitlines()
    assert head == "name,value,unit" and len(rows) > 20
    assert '"values"' in plugin.run("export", result, "--to", "x", "--out", "x").stderr


def test_the_command_is_listed_and_runs(plugin):
    shown = plugin.run("--help").stdout
    panel = shown.partition("Additions")[2].partition("╭")[0]
    assert "lengths  Report how the standard errors fall with the length of the record." in panel
    done = plugin.run("lengths", "experiment.toml", "--parts", 2)
    assert done.returncode == 0, done.stderr
    errors = re.findall(r"^ +[\d.]+ s: median standard error (\S+) %$", done.stdout, re.MULTILINE)
    assert len(errors) == 2 and float(errors[0]) > float(errors[1]) > 0.0
    assert "lengths" in plugin.run("completion", "bash").stdout


@pytest.mark.parametrize(
    ("command", "group"),
    [
        (["--help"], "pivident.commands"),
        (["lengths", "experiment.toml", "--parts", "1", "--method", "ls"], "pivident.readers"),
        (["robots"], "pivident.commands"),
        (["audit", "experiment.toml"], "pivident.findings"),
    ],
)
def test_what_is_broken_is_named_in_one_line_and_stops_nothing(broken, command, group):
    done = broken.run(*command)
    assert done.returncode in (0, 4), done.stderr  # 4: findings about the log
    named = [line for line in done.stderr.splitlines() if "broken-one" in line]
    assert len(named) == len(set(named))
    (line,) = (line for line in named if group in line)
    assert line.startswith("warning: 'lost' of the distribution broken-one (entry points ")
    assert "not_there" in line and line.endswith("pip uninstall broken-one")
    assert "Traceback" not in done.stderr and "ExtensionWarning" not in done.stderr


def test_a_broken_format_is_named_where_it_is_asked_for(broken, result):
    done = broken.run("export", result, "--to", "lost", "--out", "lost.txt")
    assert done.returncode == 1 and "broken-one" in done.stderr
    assert broken.run("export", result, "--to", "values", "--out", "again.csv").returncode == 0


def test_the_method_is_one_of_all(plugin, result, tmp_path):
    """Options of its file, studio form, manual, stored result and folds follow from the class."""
    text = EXPERIMENT.replace("log.csv", "log.pairs").replace(
        'methods = ["ls"]', 'methods = ["ls", "least-absolute"]\nleast-absolute = {passes = 12}'
    )
    (plugin.folder / "absolute.toml").write_text(text, encoding="utf-8")
    done = plugin.run("identify", "absolute.toml", "--out", "absolute")
    assert done.returncode == 0, done.stderr
    assert "IDIM-LAD" in done.stdout
    code = (
        "import json, sys; from pivident import load_identification; "
        "from pivident.estimation.methods import METHODS; "
        "from pivident.experiment.identify_table import METHOD_ENTRIES; "
        "from pivident.experiment.manual import rows_of; "
        "from pivident.app.studio.view import method_context; "
        "from pivident.app.studio.studio import Content; "
        "found = load_identification('absolute/least-absolute'); "
        "text = 'recording = {files = \\'log.csv\\'}'; "
        "groups = method_context(Content(text), {}, [])['groups']; "
        "offered = {m['name']: m['words'] for g in groups for m in g['methods']}; "
        "rows = list(rows_of(METHOD_ENTRIES['least-absolute'])); "
        "kind = type(found.method_used).__name__; words = offered['least-absolute']; "
        "print(json.dumps([found.method, found.options['passes'], kind, words, rows[2]]))"
    )
    method, passes, kind, words, row = json.loads(plugin.python("-c", code).stdout)
    assert (method, passes, kind) == ("IDIM-LAD", 12, "LeastAbsolute")
    assert words == "least absolute deviations"
    assert row == "| `passes` | number | `30` | – | how often the rows are weighted anew |"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("least-absolute = {passes = 0}", "passes"),
        ("least-absolute = {penalty = 2.0}", "the method 'least-absolute' has no penalty"),
    ],
)
def test_wrong_options_of_the_method_are_refused(plugin, line, answer):
    text = EXPERIMENT.replace("log.csv", "log.pairs").replace('methods = ["ls"]', line)
    (plugin.folder / "wrong.toml").write_text(text, encoding="utf-8")
    done = plugin.run("identify", "wrong.toml")
    assert done.returncode == 1 and answer in done.stderr


def test_a_broken_method_is_named_and_stops_no_other(broken):
    done = broken.run("identify", "experiment.toml", "--folds", 0, "--out", "beside-broken")
    assert done.returncode == 0, done.stderr
    assert "'lost' of the distribution broken-one" in done.stderr
    done = broken.run("identify", "experiment.toml", "-m", "lost")
    assert done.returncode == 1 and "pip uninstall broken-one" in done.stderr


def test_the_friction_term_is_a_term_of_robot_files(plugin):
    """Its compiled functions are those of its declaration, and its parameter is estimated."""
    pytest.importorskip("sympy")
    term = PROJECT["entry-points"]["pivident.friction"]["drag"]
    done = plugin.python("-m", "pivident.dynamics.generate_friction", term)
    compiled = PLUGIN / "pivident_example" / "drag_compiled.py"
    assert done.stdout == compiled.read_text("utf-8")
    text = EXPERIMENT.replace("log.csv", "log.pairs").replace(
        'robot = "planar_2r"',
        'robot = {model = "planar_2r", friction = ["viscous", "coulomb", "offset", "drag"]}',
    )
    (plugin.folder / "drag.toml").write_text(text, encoding="utf-8")
    done = plugin.run("identify", "drag.toml", "--folds", 0, "--out", "drag")
    assert done.returncode == 0, done.stderr
    rows = (plugin.folder / "drag" / "parameters.csv").read_text("utf-8").splitlines()[1:]
    estimates = {row.split(",")[0]: [float(x) for x in row.split(",")[1:3]] for row in rows}
    for name in ("cd1", "cd2"):  # of which the simulated arm has none
        value, std = estimates[name]
        assert abs(value) < 5.0 * max(std, 0.05)


def test_a_friction_term_that_is_broken_stops_no_other(broken):
    done = broken.run("check", "experiment.toml")
    assert done.returncode in (0, 4), done.stderr


@pytest.fixture(scope="module")
def resting(plugin, tmp_path_factory):
    """An experiment whose arm rests for the last three seconds of the record."""
    folder = tmp_path_factory.mktemp("resting")
    rows = planar_log()
    period = rows[1, 0] - rows[0, 0]
    rest = np.repeat(rows[-1:], round(3.0 / period), axis=0)
    rest[:, 0] += period * np.arange(1, len(rest) + 1)
    rest[:, 5:] += 1e-3 * np.random.default_rng(1).standard_normal((len(rest), 2))
    rows = np.vstack([rows, rest])
    options = {"fmt": "%.9g", "delimiter": ",", "header": HEADER, "comments": ""}
    np.savetxt(folder / "log.csv", rows, **options)
    (folder / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    return plugin.working_in(folder)


def test_the_finding_is_said_by_check_and_audit_and_its_repair_sets_it_right(resting):
    """Its place is a line of the file, its repair a button of the studio, and data in JSON."""
    said = "The arm rests for the last 3"
    assert said in resting.run("check", "experiment.toml").stdout
    done = resting.run("audit", "experiment.toml", "--out", "audit")
    assert said in done.stdout
    assert "Rest at the end" in (resting.folder / "audit" / "audit.html").read_text("utf-8")
    (audit,) = json.loads((resting.folder / "audit" / "audit.json").read_text("utf-8"))["audits"]
    (finding,) = (f for f in audit["findings"] if f["kind"] == "quiet end")
    (edit,) = finding["repairs"][0]["edits"]
    assert edit["place"] == ["recording", "part"]
    code = (
        "import json; from pathlib import Path; "
        "from pivident.experiment.check.experiment_check import check_experiment; "
        "from pivident.experiment.edited_file import edited; "
        "from pivident.app.studio.fixes import fixes; file = Path('experiment.toml'); "
        "look = lambda: [r.as_json() for r in check_experiment(file).remarks "
        "if r.kind == 'quiet end']; "
        "(remark,) = look(); (fix,) = fixes(remark, file.read_text()); "
        "file.write_text(edited(file.read_text(), fix.edits)); "
        "print(json.dumps([remark['place'], fix.words, look()]))"
    )
    place, words, left = json.loads(resting.python("-c", code).stdout)
    assert place == ["recording", 0, "part"] and words.startswith("Write part = [")
    assert left == []
