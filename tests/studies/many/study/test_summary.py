"""Summaries of estimates whose distribution is known."""

import json
import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from statsmodels.stats.proportion import proportion_confint

from pivident.studies.many.study.account import render_page
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.bound import efficiency_bounds
from pivident.studies.many.study.run import Store
from pivident.studies.many.study.summary import (
    NOMINAL_COVERAGE,
    clustered_interval,
    geometric_mean,
    record_means,
    summarise,
    summary_text,
    wilson_interval,
)
from tests.studies.many.study.small import small

RUNS = 400


@pytest.fixture(scope="module")
def bench():
    """The arm without the parameters that are zero: relative errors are of the others."""
    all_values = Bench(small()).truth
    return Bench(small(truth={"parameters": [k for k, v in all_values.items() if v != 0.0]}))


@pytest.fixture(scope="module")
def rows(bench):
    """Normal estimates with twice the bound's deviation; "ls" says so, the other says half."""
    rng = np.random.default_rng(1)
    sigma = 2.0 * efficiency_bounds(bench).equation
    made = []
    for run in range(RUNS):
        theta = bench.expected + sigma * rng.standard_normal(sigma.size)
        common = {"run": run, "record": run, "start": 0, "converged": run > 3, "iterations": 2}
        for method, factor in (("ls", 1.0), ("iv-full-rate", 0.5)):
            if method == "ls" and run >= RUNS - 5:
                failure = {"error": "SimulationDiverged", "message": "too fast"}
                made.append({"run": run, "record": run, "start": 0, "method": method} | failure)
                continue
            made.append(
                common
                | {
                    "method": method,
                    "theta": theta.tolist(),
                    "std": (factor * sigma).tolist(),
                    "robust_std": sigma.tolist(),
                    "formula_std": sigma.tolist(),
                    "seconds": 0.5,
                    "d_tau": 1.0,
                    "d_q": None if run == 7 else 2.0,
                    "d_beta": 3.0,
                }
            )
    return pl.DataFrame(made, schema=Store(Path()).schema())


@pytest.fixture(scope="module")
def summary(bench, rows):
    return summarise(bench, rows)


def test_true_intervals_cover_as_they_should(summary):
    true = summary.methods["ls"]
    assert true.coverage == pytest.approx(NOMINAL_COVERAGE, abs=0.01)
    low, high = true.coverage_interval
    assert low < NOMINAL_COVERAGE < high and high - low < 0.02
    narrow = summary.methods["iv-full-rate"]
    assert narrow.coverage == pytest.approx(math.erf(1 / math.sqrt(2)), abs=0.03)
    assert narrow.robust_coverage == pytest.approx(NOMINAL_COVERAGE, abs=0.01)


def test_spread_bias_and_efficiency_are_those_of_the_distribution(summary):
    true, narrow = summary.methods["ls"], summary.methods["iv-full-rate"]
    assert true.predicted_over_empirical == pytest.approx(1.0, abs=0.03)
    assert narrow.predicted_over_empirical == pytest.approx(0.5, abs=0.02)
    assert true.efficiency == pytest.approx(0.25, abs=0.02)
    assert true.variance_ratio["iv-full-rate"] == pytest.approx(1.0, abs=0.02)
    assert true.largest_bias[0] < 0.25
    for p in true.parameters:
        assert abs(p.bias) < 4 * p.bias_std
        assert p.bias_std == pytest.approx(p.spread / math.sqrt(p.runs), rel=1e-9)
        assert p.median_relative_error == pytest.approx(0.6745 * p.spread / abs(p.truth), rel=0.2)
        assert p.sensor_bound < p.bound < p.spread


def test_failures_are_counted(summary):
    true = summary.methods["ls"]
    assert (true.runs, true.failed, true.not_converged) == (RUNS - 5, 5, 4)
    assert true.errors == {"SimulationDiverged": 5}
    assert true.messages == {"SimulationDiverged": "too fast"}
    assert true.simulations_diverged == 1
    text = summary_text(summary)
    assert "5 run(s) ended with SimulationDiverged: too fast" in text


def test_figures_of_merit_are_medians_and_those_of_the_mean(summary):
    true = summary.methods["ls"]
    assert (true.merit.d_tau, true.merit.d_q, true.merit.d_beta) == (1.0, 2.0, 3.0)
    assert true.merit_of_mean.d_beta < 1.0
    assert 0.0 < true.merit_of_mean.d_tau < 0.1


def test_json_has_methods_and_parameters_by_name(summary):
    plain = json.loads(summary.to_json())
    method = plain["methods"]["ls"]
    for key in ("coverage", "median_relative_error", "efficiency", "runs"):
        assert isinstance(method[key], (int, float))
        assert all(isinstance(p[key], (int, float)) for p in method["parameters"].values())
    assert set(method["parameters"]) == {p.name for p in summary.methods["ls"].parameters}
    assert plain["runs"] == RUNS


def test_one_run_has_no_spread_but_a_summary(bench, rows):
    alone = summarise(bench, rows.filter(pl.col("run") == 0))
    plain = json.loads(alone.to_json())
    assert plain["methods"]["ls"]["efficiency"] is None
    assert "–" in summary_text(alone)
    assert "<table" in render_page(alone, bench, rows.filter(pl.col("run") == 0))


def test_no_estimate_at_all_has_a_summary(bench, rows):
    failed = rows.filter((pl.col("run") == RUNS - 1) & (pl.col("method") == "ls"))
    alone = summarise(bench, failed)
    assert alone.methods["ls"].failed == 1 and alone.methods["ls"].runs == 0
    assert alone.methods["iv-full-rate"].merit_of_mean is None
    assert "SimulationDiverged" in render_page(alone, bench, failed)


def test_the_page_needs_nothing_else_and_names_everything(summary, bench, rows):
    page = render_page(summary, bench, rows)
    for word in (*bench.estimated, "iv-full-rate", "Wilson", summary.hash, "noise.torque = 0.05"):
        assert word in page, word
    assert "src=" not in page.partition("<script>")[0]
    assert page.count('<div class="plot"') == 6


@pytest.mark.parametrize(("hits", "count"), [(0, 20), (19, 20), (40, 40), (380, 400)])
def test_wilson_interval_against_statsmodels(hits, count):
    expected = proportion_confint(hits, count, method="wilson")
    assert wilson_interval(hits / count, count) == pytest.approx(expected, abs=1e-12)


def test_runs_of_one_record_are_one_case():
    shares, records = np.array([1.0, 1.0, 0.0, 0.5]), np.array([3, 3, 5, 5])
    assert record_means(shares, records).tolist() == [1.0, 0.25]
    once = clustered_interval(np.array([0.9, 1.0, 0.95]), np.arange(3))
    thrice = clustered_interval(np.repeat([0.9, 1.0, 0.95], 3), np.repeat(np.arange(3), 3))
    assert thrice == pytest.approx(once)
    assert clustered_interval(np.ones(40), np.arange(40)) == wilson_interval(1.0, 40)


def test_the_clustered_interval_covers_shares_that_depend_on_each_other():
    """All parameters of a run share its noise: the interval is right all the same."""
    rng = np.random.default_rng(6)
    inside = 0
    for _ in range(400):
        luck = rng.beta(9.0, 1.0, 60)
        low, high = clustered_interval(rng.binomial(10, luck) / 10, np.arange(60))
        inside += low < 0.9 < high
    assert inside / 400 == pytest.approx(0.95, abs=0.035)


def test_geometric_means_leave_out_what_is_not_there():
    assert geometric_mean([2.0, 8.0, math.nan, 0.0, math.inf]) == pytest.approx(4.0)
    assert math.isnan(geometric_mean([]))
