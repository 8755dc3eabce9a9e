"""Without the optional libraries the core works, and what needs one of them names its extra."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pivident.app.cli.friction import run_friction
from pivident.data.logs.bags.decompression import unpacked
from pivident.data.logs.tables.read_csv import read_csv_forgiving
from pivident.data.logs.tables.tables import read_table
from pivident.foundation.document.plot import library_text
from pivident.foundation.document.table import Table
from pivident.foundation.errors import PividentError
from pivident.foundation.extras import MissingExtra, require
from pivident.robot.gallery import load_robot
from pivident.studies.many.batch.results_folder import ResultsFolder
from tests.planar_log import write_experiment

PROJECT = Path(__file__).parents[2] / "pyproject.toml"

#: Extra by library, as it is imported.
OPTIONAL = {
    "sympy": "symbolic",
    "matplotlib": "figures",
    "polars": "tables",
    "pandas": "pandas",
    "plotly": "report",
    "control": "linear",
    "pyarrow": "parquet",
    "h5py": "matlab",
    "lz4": "bags",
    "coal": "collision",
    "mujoco": "mujoco",
    "dask": "cluster",
    "distributed": "cluster",
    "rerun": "rerun",
    "starlette": "studio",
    "uvicorn": "studio",
}

BLOCKED = f"import sys; sys.modules.update(dict.fromkeys({list(OPTIONAL)}))\n"


@pytest.fixture
def without(monkeypatch):
    def block(library):
        for name in {library, *(m for m in sys.modules if m.startswith(f"{library}."))}:
            monkeypatch.setitem(sys.modules, name, None)

    return block


def python(code: str, folder: Path) -> str:
    found = subprocess.run(
        [sys.executable, "-c", BLOCKED + code], cwd=folder, capture_output=True, text=True
    )
    assert found.returncode == 0, found.stderr
    return found.stdout


def test_every_extra_is_declared_and_all_has_them():
    extras = tomllib.loads(PROJECT.read_text())["project"]["optional-dependencies"]
    for library, extra in OPTIONAL.items():
        assert any(line.startswith(library) for line in extras[extra]), library
        assert extra in extras["all"][0]
    assert set(extras) - {"all"} == set(OPTIONAL.values())


def test_no_extra_is_a_requirement_of_the_core():
    core = tomllib.loads(PROJECT.read_text())["project"]["dependencies"]
    assert core and not [line for line in core if line.startswith(tuple(OPTIONAL))]


def test_the_core_identifies_without_any_and_says_what_the_report_needs(tmp_path):
    write_experiment(tmp_path)
    code = (
        "import pivident; from pivident.app.cli import main; main(['--help']); "
        "sys.exit(main(['identify', 'experiment.toml', '--out', 'out']))"
    )
    assert "identify" in python(code, tmp_path)
    found = {path.name for path in (tmp_path / "out").rglob("*")}
    assert {"identification.json", "verdict.json"} <= found and "report.html" not in found


def test_an_audit_without_plotly_prints_and_writes_its_findings(tmp_path):
    write_experiment(tmp_path)
    code = "from pivident.app.cli import main; main(['audit', 'experiment.toml', '--out', 'out'])"
    assert " ok\n\nFindings: out/audit.json" in python(code, tmp_path)
    assert json.loads((tmp_path / "out/audit.json").read_text())["audits"]
    assert not (tmp_path / "out/audit.html").exists()


def sympy_door(folder):
    from pivident.dynamics.grouping.expression_graph import symbol
    from pivident.dynamics.grouping.expressions import sympy_expressions

    assert sympy_expressions  # it gives expressions their form in SymPy
    symbol("x").to_sympy()


def matplotlib_door(folder):
    from pivident.studies.figures.paper_style import new_figure

    new_figure(1)


def polars_door(folder):
    Table("t", {"x": np.zeros(2)}).to_polars()


def pandas_door(folder):
    Table("t", {"x": np.zeros(2)}).to_pandas()


def control_door(folder):
    from pivident.linear.conversion import from_control

    from_control(None)


def plotly_door(folder):
    library_text()


def pyarrow_door(folder):
    (folder / "log.parquet").write_bytes(b"PAR1\x00\x01\x02\x03PAR1")
    read_table(folder / "log.parquet")


def h5py_door(folder):
    (folder / "log.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n")
    read_table(folder / "log.mat")


def lz4_door(folder):
    unpacked(folder / "log.bag", "lz4", b"\x04", 10, 0)


def coal_door(folder):
    from pivident.studies.collision.meshes import load_mesh

    load_mesh(folder / "link.stl", (1.0, 1.0, 1.0))


def dask_door(folder):
    from pivident.studies.many.batch.cluster import DaskCluster

    with DaskCluster(workers=1)():
        pass


def mujoco_door(folder):
    (folder / "arm.xml").write_text("<mujoco/>")
    load_robot(folder / "arm.xml")


def rerun_door(folder):
    from pivident.studies.prediction.rerun_recording import write_rerun

    write_rerun([], folder / "motion.rrd")


def studio_door(folder):
    from pivident.app.studio.serve import serve

    serve(folder, at_once=0)  # what is missing is said first


DOORS = {
    "sympy": sympy_door,
    "matplotlib": matplotlib_door,
    "polars": polars_door,
    "pandas": pandas_door,
    "plotly": plotly_door,
    "control": control_door,
    "pyarrow": pyarrow_door,
    "h5py": h5py_door,
    "lz4": lz4_door,
    "coal": coal_door,
    "mujoco": mujoco_door,
    "starlette": studio_door,
    "uvicorn": studio_door,
    "rerun": rerun_door,
    "dask": dask_door,
    "distributed": dask_door,
}


@pytest.mark.parametrize("library", OPTIONAL)
def test_what_needs_a_library_names_its_extra(library, without, tmp_path):
    without(library)
    with pytest.raises(MissingExtra) as found:
        DOORS[library](tmp_path)
    error = found.value
    assert isinstance(error, PividentError) and isinstance(error, ImportError)
    assert (error.library, error.extra) == (library, OPTIONAL[library])
    assert str(error).endswith(f"run pip install 'pivident[{OPTIONAL[library]}]'")


def test_work_of_many_runs_asks_for_tables_before_it_begins(tmp_path, without):
    without("polars")
    with (
        pytest.raises(MissingExtra, match=r"pivident\[tables\]"),
        ResultsFolder(tmp_path).taken({}),
    ):
        pass
    assert not list(tmp_path.iterdir())
    with pytest.raises(MissingExtra, match=r"pivident\[tables\]"):
        run_friction(tmp_path / "none.toml", None, None, None)


def test_an_installed_library_that_is_broken_is_not_called_missing(tmp_path, monkeypatch):
    (tmp_path / "half_installed.py").write_text("import nothing_of_that_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="nothing_of_that_name") as found:
        require("half_installed", extra="all", purpose="this test")
    assert not isinstance(found.value, MissingExtra)


def test_text_tables_need_none_of_them(tmp_path, without):
    without("polars")
    file = tmp_path / "log.csv"
    file.write_text("t,q,word\n0,1.5,a\n1,x,b\n")
    assert read_table(file, ["t"])["t"].tolist() == [0.0, 1.0]
    assert list(read_csv_forgiving(file)) == ["t", "q"]
