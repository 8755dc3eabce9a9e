"""One way from every result to a frame."""

import csv
import io
import sys
from importlib import import_module

import numpy as np
import pytest

import pivident as pv
from pivident.experiment.check.audit_file import audit_file
from pivident.experiment.experiment import load_experiment
from pivident.foundation.document.table import Table, TableError
from pivident.foundation.extras import MissingExtra
from pivident.judgement.validation.residuals.residual_tests import residual_tests
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.profile_intervals import ProfileIntervals
from pivident.studies.tables.chosen import TABLES, table, table_names
from tests.planar_log import write_experiment
from tests.synthetic_identification import synthetic_identification

pd = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def result():
    return synthetic_identification(seed=4)


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    write_experiment(folder)
    (path,) = folder.glob("*.toml")
    return load_experiment(path).problem()


@pytest.fixture(scope="module")
def things(result, problem):
    intervals = ProfileIntervals(
        ("m1",), ("kg",), np.ones(1), np.zeros(1), np.array([np.inf]), 0.95
    )
    return [
        result,
        problem,
        problem.robot,
        problem.recordings[0],
        residual_tests(result),
        pv.verdict(result),
        pv.compare([result, synthetic_identification("IDIM-LS", seed=5)]),
        make_consistent(result),
        intervals,
    ]


def test_every_table_there_is_has_a_function_and_a_class():
    for name, (module, prefix, names) in TABLES.items():
        home, _, cls = name.rpartition(".")
        assert isinstance(getattr(import_module(home), cls), type), name
        for one in names:
            assert callable(getattr(import_module(module), f"{prefix}_{one}"))


def test_both_libraries_get_the_same_numbers(things):
    seen = set()
    for thing in things:
        for name in table_names(thing):
            made = table(thing, name)
            assert made.name == name and len(made) > 0
            polars, pandas = made.to_polars(), made.to_pandas()
            assert list(pandas.columns) == polars.columns == list(made.columns)
            assert len(pandas) == polars.height == len(made)
            for column in polars.columns:
                if polars[column].dtype.is_numeric():
                    np.testing.assert_array_equal(polars[column].to_numpy(), pandas[column])
            assert set(made.meanings) <= set(made.columns) | {"x_m"}
            rows = list(csv.reader(io.StringIO(made.to_csv())))
            assert rows[0] == list(made.columns) and len(rows) == len(made) + 1
            assert name in repr(made) and str(made)
            seen.add((type(thing).__name__, name))
    assert len(seen) == 22


def test_parameters_have_intervals_and_units(result):
    frame = table(result).to_polars()
    np.testing.assert_array_equal(frame["value"], result.theta)
    np.testing.assert_allclose(frame["high"] - frame["low"], 4.0 * result.std)
    assert frame["unit"].to_list() == list(result.units)
    assert frame["joint"].to_list()[0] == "shoulder"


def test_covariance_is_laid_out_pair_by_pair(result):
    frame = table(result, "covariance").to_polars()
    n = len(result.names)
    matrix = frame["covariance"].to_numpy().reshape(n, n)
    np.testing.assert_array_equal(matrix, result.covariance)
    assert frame.row(1)[:2] == (result.names[0], result.names[1])
    np.testing.assert_allclose(frame["correlation"].to_numpy().reshape(n, n), np.eye(n), atol=1e-12)


def test_signals_keep_their_joints_and_times(problem):
    frame = table(problem, "signals").to_pandas()
    recording = problem.recordings[0]
    elbow = frame[frame.joint == "elbow"]
    np.testing.assert_array_equal(elbow.q, recording.q[:, 1])
    np.testing.assert_array_equal(elbow.t_s, recording.t)
    assert set(frame.position_unit) == {"rad"} and set(frame.torque_unit) == {"N m"}


def test_signals_of_a_file_are_refused(result, tmp_path):
    result.save(tmp_path)
    with pytest.raises(TableError, match="no signals"):
        table(pv.load_identification(tmp_path), "signals")


def test_an_audit_has_its_findings(problem, tmp_path):
    write_experiment(tmp_path)
    (audit, *_) = audit_file(next(tmp_path.glob("*.toml")))
    frame = table(audit).to_polars()
    assert frame.height == len(audit.findings) > 0
    assert {"severity", "value", "unit", "message", "next_step"} <= set(frame.columns)


def test_unknown_tables_and_things_are_named(result):
    with pytest.raises(TableError, match="covariance"):
        table(result, "covarianse")
    with pytest.raises(TableError, match="no table of a int"):
        table(3)
    with pytest.raises(KeyError, match="value"):
        table(result)["values"]
    with pytest.raises(TableError, match="same length"):
        Table("a", {"x": [1], "y": [1, 2]})


def test_without_pandas_the_way_to_it_is_named(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtra, match=r"pip install 'pivident\[pandas\]'"):
        table(result).to_pandas()


def test_sheets_get_no_formula_and_no_nan(tmp_path):
    made = Table("a", {"x": ("=1+1", "b"), "y": np.array([np.nan, 1.5])})
    text = made.to_csv(tmp_path / "a.csv")
    assert text == "x,y\n'=1+1,\nb,1.5\n"
    assert (tmp_path / "a.csv").read_text() == text


def test_empty_tables_keep_their_columns():
    made = Table.of_rows("a", [], empty=("x", "y"))
    assert len(made) == 0 and made.to_polars().columns == ["x", "y"]
    assert made._repr_html_() and str(made)
